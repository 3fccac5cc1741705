"""Picture sizes, as people type them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from vsd_analytics.site.model import Camera


def parse_size(text: str) -> tuple[int, int]:
    """Return width and height in pixels of `1920x1080`.

    Raises:
        UsageError: E101.
    """
    found = re.fullmatch(r"(\d{2,5})[x×](\d{2,5})", text.strip().lower())
    if found is None or not (int(found[1]) and int(found[2])):
        raise UsageError(f"--size: {text!r} is not a picture size", fix="--size 1920x1080: width x height in pixels")
    return int(found[1]), int(found[2])


def known_size(camera: Camera, size_px: tuple[int, int] | None) -> tuple[int, int]:
    """Return the size of a camera's pictures; UsageError E101 where it is not known."""
    if size_px is None:
        raise UsageError(f"the picture size of {camera.camera_id} is not known", fix="--size 1920x1080")
    return size_px
