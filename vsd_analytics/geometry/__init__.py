"""From pictures to the floor and back: homographies, calibration files, views, overlaps, ownership."""
