"""The page of `vsd calibrate --draw`."""
