"""A site in place of the one that nobody has described yet, so that files can be looked at without a project."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.intake.first_positions import first_positions
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.site.model import Camera, Floor, Site

CAMERAS_MAX: Final = 1_000
_FLOOR: Final = Floor("floor", "Floor")


def site_of_files(paths: Sequence[Path], options: IngestOptions, *, root: Path) -> Site:
    """Return a site with one floor, in UTC, and a camera for each name that the first records of some files have.

    Args:
        paths: Files, archives or folders.
        options: What the user says about them.
        root: A folder without a project.
    """
    single = _site(root, ["camera"] if options.camera is None else [options.camera])
    names: dict[str, None] = {}
    for path in paths:
        try:
            sample = first_positions(single, Source(path), options)
        except (VsdError, OSError):  # reading the file reports it
            continue
        names |= dict.fromkeys(sample.camera.names)
    return _site(root, list(names)[:CAMERAS_MAX]) if names else single


def _site(root: Path, names: Sequence[str]) -> Site:
    cameras = tuple(Camera(name, name, _FLOOR.floor_id) for name in names)
    return Site("site", "Site", "UTC", root, floors=(_FLOOR,), cameras=cameras)
