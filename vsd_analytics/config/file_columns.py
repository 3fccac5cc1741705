"""Our names for the columns of a user's table, and the units its positions may have; importing it costs nothing."""

from __future__ import annotations

from typing import Final

FILE_NUMBERS: Final = ("x_m", "y_m", "u_px", "v_px", "x_a_m", "y_a_m", "x_b_m", "y_b_m", "distance_m", "distance_sd_m")
FILE_BOX: Final = ("left", "top", "right", "bottom", "width", "height", "center_x", "center_y")
FILE_TEXTS: Final = ("camera_id", "track_id", "track_a", "track_b")
FILE_TAG: Final = "tag"
"""What the engine says somebody is, such as staff. Read only where `map` names it: many columns have such a name."""
FILE_COLUMNS: Final = ("ts", "frame", *FILE_TEXTS, *FILE_NUMBERS, *FILE_BOX)
"""Columns that are read under their own names."""
MAP_COLUMNS: Final = (*FILE_COLUMNS, FILE_TAG)
"""Names of ours that `map` may give."""

PLACES: Final = (
    ("x_m", "y_m"),
    ("u_px", "v_px"),
    ("left", "top", "right", "bottom"),
    ("left", "top", "width", "height"),
    ("center_x", "center_y", "width", "height"),
)
"""Columns that hold a place together: on the floor, then in the picture."""

METRES: Final = {"mm": 0.001, "cm": 0.01, "dm": 0.1, "m": 1.0, "km": 1000.0, "ft": 0.3048, "yd": 0.9144, "in": 0.0254}
"""Metres of one unit that positions and distances of a file may have."""
