"""Checks of the machine and the project behind `vsd doctor`."""
