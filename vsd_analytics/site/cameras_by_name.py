"""The camera that somebody means by a name, typed or in a file: its id, its display name, either in other case."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from vsd_analytics.errors import UsageError
from vsd_analytics.site.model import Camera, Site


def camera_called(site: Site, camera_id: str, *, option: str = "vsd calibrate") -> Camera:
    """Return a camera of the site; UsageError E101 when there is none, with the nearest id behind `option`."""
    known = {c.camera_id: c for c in site.cameras}
    if camera_id in known:
        return known[camera_id]
    near = nearest_camera_id(camera_id, site.cameras)
    raise UsageError(
        f"the site has no camera {camera_id!r}",
        why=f"its cameras are: {', '.join(known)}",
        fix=f"{option} {near}" if near else "describe it in vsd.toml with [[camera]]",
    )


def camera_meant(text: str, cameras: Iterable[Camera]) -> Camera | None:
    """Return the one camera whose id, display name or engine id is a text, but for case and " -_".

    None where no camera is, or several are. It is for fixes that are printed: records are never given to a camera on
    this ground, because a display name may change.
    """
    meant = [c for c in cameras if _letters(text) in {_letters(n) for n in (c.camera_id, c.name, *c.engine_ids) if n}]
    return meant[0] if len(meant) == 1 else None


def nearest_camera_id(text: str, cameras: Iterable[Camera]) -> str | None:
    """Return the id of the camera that a text means, else the id or engine id that is spelled most like it, or None."""
    known = tuple(cameras)
    meant = camera_meant(text, known)
    if meant is not None:
        return meant.camera_id
    names = [name for c in known for name in (c.camera_id, *c.engine_ids)]
    return next(iter(difflib.get_close_matches(text, names, n=1)), None)


def _letters(text: str) -> str:
    return "".join(letter for letter in text.casefold() if letter not in " -_")
