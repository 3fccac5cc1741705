"""Round lengths for the scale bar of a map."""

from __future__ import annotations

import math
from typing import Final

M_PER_FT: Final = 0.3048


def nice_length_m(width_m: float, *, unit: str) -> float:
    """Return a length that is round in the unit in which the page writes distances, m or ft; see `nice_metres`."""
    return nice_metres(width_m) if unit == "m" else nice_metres(width_m / M_PER_FT) * M_PER_FT


def nice_metres(width_m: float) -> float:
    """Return a round length of a twentieth to a quarter of a map's width: 1, 5, 10, 50, ... metres.

    There is no bar of 2 m, which could be taken for the legal distance of a site that has another.
    """
    exponent = math.floor(math.log10(max(width_m, 1e-3) / 4))
    for factor in (5, 1):
        if factor * 10.0**exponent <= width_m / 4:
            return factor * 10.0**exponent
    return 10.0**exponent
