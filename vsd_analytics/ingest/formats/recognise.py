"""Which adapter reads a source: the one the user named, or the first that recognises it."""

from __future__ import annotations

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.formats.adapters import adapter, formats
from vsd_analytics.ingest.formats.no_table import not_recognised
from vsd_analytics.ingest.reading.adapter import Adapter, IngestOptions, Source, empty, not_a_file


def find_adapter(source: Source, options: IngestOptions) -> Adapter:
    """Return the adapter the user named, or the first that recognises the source.

    Raises:
        InputError: E201 no such file, E202 empty file, E204 no format recognises it, E205 damaged from its first line.
    """
    where = Where(source.name)
    if not source.path.exists():
        raise InputError(
            f"there is no file {source.name}",
            code="E201",
            where=where,
            why="that path is neither a file nor a folder",
            fix="check the path and the spelling",
        )
    if not (source.path.is_file() or source.path.is_dir()):
        raise not_a_file(source)
    if source.size_bytes == 0:
        raise empty(source)
    if options.format is not None:
        return adapter(options.format)
    if options.columns is not None:
        return adapter("table")
    if options.persons is not None:
        return adapter("json")
    for name in formats():
        candidate = adapter(name)
        if candidate.detects(source):
            return candidate
    if source.path.is_file() and not source.head(1):
        raise empty(source)
    if options.map and source.path.is_file():
        return adapter("table")
    raise not_recognised(source, formats())
