"""What makes two imports the same one, and two files alike: their bytes, columns, and how they are read."""

from __future__ import annotations

import contextlib
import dataclasses
import json
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.checks.check_case import SourceWarning
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.site.model import Site
from vsd_analytics.store import durable
from vsd_analytics.store.durable import make_dirs, publish
from vsd_analytics.store.imports import ImportLine, holdings, imports_of, purge_command
from vsd_analytics.store.store import Store

Content = list[list[str]]
"""Name and hash of each file."""

_SAYS_NOTHING = frozenset(
    {
        *("is_sure", "is_only_camera", "camera_from_name", "profile", "line_max_bytes", "persons_max", "pairs_max"),
        "staff_classes",
    }
)
"""Options that do not change how a record is read."""
_CHOOSES_RECORDS = frozenset({"camera", "where", "is_only_camera", "pictures", "clocks", "engine"})
"""Options by which a second import may bring other records of the same file, new cameras, and names."""


def import_id(site: Site, options: IngestOptions, content: Content, *, kind: str) -> str:
    """Return the id of an import, 16 hexadecimal digits.

    The same file that comes again, also under another name, is the same import. With other options, cameras or clocks
    it is another one, so that the first can be taken back.

    Args:
        site: The site; its cameras and pseudonym days are part of how a file is read.
        options: The completed options (`pipeline.with_site`).
        content: `content_of` the file, archive or folder.
        kind: Name of the adapter.
    """
    read = {f.name: getattr(options, f.name) for f in dataclasses.fields(options) if f.name not in _SAYS_NOTHING}
    cameras = sorted((c.camera_id, *sorted(c.engine_ids)) for c in site.cameras)
    how = [kind, read, cameras, site.timezone, site.day_starts_min, content]
    if options.camera_from_name is not None:  # an import without it has the id that it always had
        how.append(options.camera_from_name)
    return _hash(how, options)


def _hash(how: list[object], options: IngestOptions) -> str:
    """Return the hash of how a file is read; without classes of staff the one that it always had."""
    how += [options.staff_classes] if options.staff_classes else []
    return durable.digest(msgspec.json.encode(how, order="deterministic"))


def content_id(content: Content) -> str:
    """Return a hash of a file's bytes, or of the names and bytes of a folder's files, whatever its own name is."""
    return durable.digest(msgspec.json.encode(content))


def reading_id(options: IngestOptions, *, kind: str) -> str:
    """Return a hash of how a file is read: its columns, units and clock, and not which of its records are read.

    Args:
        options: The completed options.
        kind: Name of the adapter.
    """
    left_out = _SAYS_NOTHING | _CHOOSES_RECORDS | {"map", "site_map"}
    read = {f.name: getattr(options, f.name) for f in dataclasses.fields(options) if f.name not in left_out}
    return _hash([kind, read, {**options.site_map, **options.map}, sorted(set(options.clocks.values()))], options)


def import_line(
    source: Source, kind: str, identity: tuple[str, str, str], at: datetime, run: int, landmarks: str
) -> ImportLine:
    """Return the line of the list of imports for a source.

    Args:
        source: The source.
        kind: Name of the adapter.
        identity: `import_id`, `content_id` and `reading_id`.
        at: When it is imported.
        run: Number of the command.
        landmarks: A few of its first records.
    """
    name = source.name.encode("utf-8", "backslashreplace").decode()
    import_id, content, reading = identity
    return ImportLine(
        id=import_id,
        at=at.astimezone(UTC),
        run=run,
        source=name,
        format=kind,
        content=content,
        reading=reading,
        landmarks=landmarks,
    )


def warning_of_earlier_reading(site: Site, source: Source, reading: str) -> SourceWarning | None:
    """Return the warning of a file whose bytes are stored already, read in another way: W230.

    Records at other times would be stored a second time. Records at the same times are second deliveries: their first
    places would stay.

    Args:
        site: The site. Imports that were taken back raise no warning, nor do those without a stored record.
        source: The file that is about to be imported.
        reading: Its `reading_id`.
    """
    earlier = [line for line in imports_of(site.root / "store").values() if line.content and not line.is_taken_back]
    other = [line for line in earlier if line.reading != reading]
    content = content_id(content_of(source.path)) if other else ""
    other = [line for line in other if line.content == content]
    store = Store(site.root / "store", site_id=site.site_id)
    held = holdings(store) if other else {}
    stored: ImportLine | None = next((line for line in reversed(other) if line.id in held), None)
    if stored is None:
        return None
    n_records = sum(held[stored.id].n_records.values())
    return SourceWarning(
        f"the same file is stored already, read in another way: import {stored.id}, {n_records:,} records",
        "with another clock everybody would be stored twice; with another unit or column the first places would stay",
        f"take the first import back with `{purge_command(store, stored.id)}`, and import again",
        is_sure=True,
        code="W230",
    )


def content_of(path: Path) -> Content:
    """Return the names of a folder's files with the hashes of their bytes; a single file has no name."""
    if not path.is_dir():
        return [["", durable.file_digest(path)]]
    files = sorted(p for p in path.rglob("*") if p.is_file())
    return [[str(p.relative_to(path).as_posix().encode("utf-8", "replace")), durable.file_digest(p)] for p in files]


FILE = Path("status") / "shapes.json"
MOST = 1_000


def known_shapes(root: Path) -> list[str]:
    """Return the shapes (`SourceProfile.shape`) imported into a project, the oldest first; [] = unreadable."""
    try:
        shapes = json.loads((root / FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    return [shape for shape in shapes if isinstance(shape, str)] if isinstance(shapes, list) else []


def note_shape(root: Path, shape: str) -> None:
    """Remember a shape; where that cannot be written, its card is shown once more."""
    shapes = [known for known in known_shapes(root) if known != shape]
    with contextlib.suppress(OSError, VsdError):
        make_dirs((root / FILE).parent)
        publish(root / FILE, json.dumps([*shapes, shape][-MOST:]).encode())
