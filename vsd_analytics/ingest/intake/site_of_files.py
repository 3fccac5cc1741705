"""The first positions of a file, and a site in place of the one that nobody has described yet: to look at files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.checks.sample import SAMPLE_ROWS, Sample, sample_of
from vsd_analytics.ingest.formats.recognise import find_adapter
from vsd_analytics.ingest.intake.pipeline import options_for
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch, Source
from vsd_analytics.ingest.reading.limits import within_bounds
from vsd_analytics.ingest.reading.raw import n_rows
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


def first_positions(site: Site, source: Source, options: IngestOptions) -> Sample:
    """Return the records from which the card of a source is made.

    Raises:
        InputError: The source cannot be read.
    """
    options = options_for(site, source, options)
    reader = find_adapter(source, options)
    head: list[RawBatch] = []
    for batch in within_bounds(source, reader.read(source, options)):
        head.append(batch)
        if sum(n_rows(b.tables.values()) for b in head) >= SAMPLE_ROWS:
            break
    return sample_of(head, is_whole=False)


def _site(root: Path, names: Sequence[str]) -> Site:
    cameras = tuple(Camera(name, name, _FLOOR.floor_id) for name in names)
    return Site("site", "Site", "UTC", root, floors=(_FLOOR,), cameras=cameras)
