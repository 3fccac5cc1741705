"""The size of plans and camera pictures, read from their first bytes."""

from __future__ import annotations

import math
import re
from pathlib import Path


def picture_size(path: Path) -> tuple[float, float] | None:
    """Return width and height of a picture without decoding it.

    Args:
        path: PNG, JPG or any other raster picture Pillow knows, in pixels; or SVG, in units of its viewBox
            (of its width and height when it has none).

    Returns:
        (width, height), or None when the file is not a readable picture.
    """
    try:
        return _svg_size(path) if path.suffix.lower() == ".svg" else _raster_size(path)
    except (OSError, ValueError, SyntaxError, LookupError):  # Pillow and ElementTree call damage a SyntaxError
        return None


def _raster_size(path: Path) -> tuple[float, float]:
    import warnings

    from PIL import Image

    try:
        with warnings.catch_warnings(action="ignore"), Image.open(path) as picture:  # nothing is decoded here
            return picture.size
    except Image.DecompressionBombError as error:
        raise ValueError(str(error)) from None


def _svg_size(path: Path) -> tuple[float, float] | None:
    from xml.etree import ElementTree as ET

    with path.open("rb") as f:
        _, root = next(ET.iterparse(f, events=("start",)), (None, None))  # the first element only
    if root is None or root.tag.rpartition("}")[2] != "svg":
        return None
    box = [float(part) for part in re.split(r"[\s,]+", root.get("viewBox", "").strip()) if part]
    width, height = box[2:] if len(box) == 4 else (_length(root.get(side, "")) for side in ("width", "height"))
    return (width, height) if 0 < width < math.inf and 0 < height < math.inf else None


def _length(text: str) -> float:
    match = re.fullmatch(r"\s*([0-9.]+)\s*(px)?\s*", text)
    return float(match[1]) if match else 0.0
