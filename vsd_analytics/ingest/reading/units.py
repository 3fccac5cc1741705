"""Units of length: what a column's own name says, and the factor to metres."""

from __future__ import annotations

import re
from typing import Final

from vsd_analytics.ingest.reading.column_hints import unaccented

LENGTHS: Final = ("x_m", "y_m", "x_a_m", "y_a_m", "x_b_m", "y_b_m", "distance_m", "distance_sd_m")
"""Our columns in metres."""

PIXELS: Final = "px"

_FEET: Final = ("foot", "feet", "piedi", "pies", "pieds")
"""Before an axis or a point they are those of a person."""
_POINTS: Final = frozenset({"x", "y", "z", "u", "v", "pos", "position", "point", "location"})
_WORDS: Final = {
    **{unit: unit for unit in ("mm", "cm", "dm", "m", "km", "ft")},
    **{f"{stem}{end}": "m" for stem in ("meter", "metre") for end in ("", "s")},
    **{f"{prefix}{stem}{end}": unit
       for prefix, unit in (("milli", "mm"), ("mili", "mm"), ("centi", "cm"), ("zenti", "cm"), ("deci", "dm"),
                            ("kilo", "km"))
       for stem, ends in (("meter", ("", "s")), ("metre", ("", "s")), ("metr", ("i", "o", "os")))
       for end in ends},
    **dict.fromkeys(_FEET, "ft"),
    **dict.fromkeys(("yd", "yds", "yard", "yards"), "yd"),
    **dict.fromkeys(("inch", "inches", "zoll", "pollici", "pulgadas"), "in"),
    **dict.fromkeys(("px", "pix", "pixel", "pixels"), PIXELS),
}  # fmt: skip
_PART = re.compile(r"[A-Z]?[a-z]+|[A-Z]+|\d+")
_INCHES = re.compile(r"(?:\w+[_ .-])?[xyz][_ .]?[\[(]?in[\])]?", re.IGNORECASE)
_AXIS = re.compile(r"(?:pos|position|foot)?[xyz](mm|cm|dm|km|ft|yd|px)", re.IGNORECASE)


def unit_in_name(name: str) -> str | None:
    """Return the unit that a column name states, such as "mm" for `x_mm`, `X (mm)` or `posMillimeters`.

    Args:
        name: The name as the file gives it.

    Returns:
        A key of `file_columns.METRES`, `PIXELS`, or None. A single "m" counts only behind the name, as in `x_m`, and
        "in" only behind an axis, as in `x_in` or `Y [in]`. Feet before an axis, as in `foot_x`, are a person's.
    """
    if joined := _AXIS.fullmatch(name.strip()):
        return _WORDS[joined[1].lower()]
    if _INCHES.fullmatch(name.strip()):
        return "in"
    parts = [part.lower() for part in _PART.findall(unaccented(name))]
    for i, part in reversed(list(enumerate(parts))):
        is_body = part in _FEET and parts[i + 1 : i + 2] and parts[i + 1] in _POINTS
        if part in _WORDS and not is_body and (part != "m" or (i == len(parts) - 1 and i > 0)):
            return _WORDS[part]
    return None
