"""Where a profile, written or to be written, finds the camera of a source in its name."""

from __future__ import annotations

from dataclasses import replace

from vsd_analytics.config.camera_in_name import CameraName, camera_named
from vsd_analytics.errors import InputError, VsdError
from vsd_analytics.ingest.formats.recognise import find_adapter
from vsd_analytics.ingest.formats.tables import is_divided
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.named_camera import camera_of
from vsd_analytics.site.model import ReadingRule, Site


def with_named_camera(site: Site, source: Source, profile: ReadingRule | None, options: IngestOptions) -> IngestOptions:
    """Return options with the camera that the source's name says, where its profile reads it from there.

    The files of a folder or archive whose own name says none are looked at one by one later.

    Raises:
        InputError: E213, the name says no camera of the site, or several.
    """
    if profile is None or profile.camera_from_name is None or options.camera is not None:
        return options
    if not source.path.exists():  # reading it reports that
        return options
    known = ids_by_name(site)
    try:
        camera = camera_of(source, profile.camera_from_name, known, rule_id=profile.rule_id)
    except InputError:
        if not is_divided(source):
            raise
        return replace(options, camera_from_name=profile.camera_from_name)
    return replace(options, camera=camera)


def name_to_save(site: Site, source: Source, options: IngestOptions) -> CameraName | None:
    """Return the camera in a file's name that a new profile should read; None where it is known otherwise.

    Args:
        site: The site.
        source: The file.
        options: What the user says, completed from vsd.toml.
    """
    named = camera_named(source.file_name, ids_by_name(site)) if options.camera is None else None
    return None if named is None or _says_camera(source, options) else named


def _says_camera(source: Source, options: IngestOptions) -> bool:
    """Return whether the first records of a source name their cameras."""
    try:
        batch = next(iter(find_adapter(source, options).read(source, options)))
    except (VsdError, OSError, StopIteration):  # a table without a column of cameras is refused on a site of several
        return False
    return not any(table["camera"].null_count for table in batch.tables.values())


def ids_by_name(site: Site) -> dict[str, str]:
    """Return the ids of the site's cameras by all their names."""
    return {name: c.camera_id for c in site.cameras for name in (c.camera_id, *c.engine_ids)}
