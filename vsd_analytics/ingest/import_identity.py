"""What makes two imports the same one: the bytes of the file, and how they are read."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec

from vsd_analytics.ingest.adapter import IngestOptions, Source
from vsd_analytics.site.model import Site
from vsd_analytics.store import durable

_SAYS_NOTHING = frozenset(
    {"is_sure", "is_only_camera", "camera_from_name", "profile", "line_max_bytes", "persons_max", "pairs_max"}
)
"""Options that do not change how a record is read."""


def import_id(site: Site, source: Source, options: IngestOptions, *, kind: str) -> str:
    """Return the id of an import, 16 hexadecimal digits.

    The same file that comes again, also under another name, is the same import. With other options, cameras or clocks
    it is another one, so that the first can be taken back.

    Args:
        site: The site; its cameras and pseudonym days are part of how a file is read.
        source: A file, archive or folder.
        options: The completed options (`pipeline.with_site`).
        kind: Name of the adapter.
    """
    read = {f.name: getattr(options, f.name) for f in dataclasses.fields(options) if f.name not in _SAYS_NOTHING}
    cameras = sorted((c.camera_id, *sorted(c.engine_ids)) for c in site.cameras)
    how = [kind, read, cameras, site.timezone, site.day_starts_min, _content(source.path)]
    if options.camera_from_name is not None:  # an import without it has the id that it always had
        how.append(options.camera_from_name)
    return durable.digest(msgspec.json.encode(how, order="deterministic"))


def _content(path: Path) -> list[list[str]]:
    """Return the names of a folder's files with the hashes of their bytes; a single file has no name."""
    if not path.is_dir():
        return [["", durable.file_digest(path)]]
    files = sorted(p for p in path.rglob("*") if p.is_file())
    return [[str(p.relative_to(path).as_posix().encode("utf-8", "replace")), durable.file_digest(p)] for p in files]
