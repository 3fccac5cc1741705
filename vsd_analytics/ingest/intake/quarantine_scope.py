"""Which records in quarantine are of a camera and time, so that a purge and an export reach them as well.

A record is left out only when it is known to be of another camera or time. A record that cannot be read is in scope,
because a later replay may still read it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime

import msgspec

from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.formats.tables import Tables
from vsd_analytics.ingest.intake.quarantine_reader import Rereader, how_read
from vsd_analytics.site.model import Site
from vsd_analytics.store.erasures import RecordScope
from vsd_analytics.store.quarantine import FOLDER, QuarantineEntry, entries, files

_TABLES = ("table", "positions", "pairs")

_Place = tuple[str | None, int | None]
"""Our camera id and UTC milliseconds of a record; None = not known."""


class _Head(msgspec.Struct, frozen=True):
    """Camera and time of a frame message, whatever else is wrong with it."""

    camera: str
    ts: datetime


_head = msgspec.json.Decoder(_Head)


@dataclass(frozen=True, slots=True)
class QuarantinedLines:
    """Lines of the quarantine in scope.

    Attributes:
        lines: The lines as they are in the files.
        n_doubtful: Lines in scope because their camera or time cannot be read.
    """

    lines: Sequence[bytes] = ()
    n_doubtful: int = 0


def quarantined_in_scope(site: Site, which: RecordScope) -> QuarantinedLines:
    """Return the entries of the quarantine that are, or may be, of a camera and time; the caller holds its lock.

    Lines are read again as a replay reads them, but only their camera and time. A time without an offset is read by
    the clock its camera has now. An entry of unknown time is in scope when it came after the first instant. A count of
    records that were not stored is no record.

    Args:
        site: The project.
        which: Camera (or all) and time.
    """
    known: dict[str | None, str | None] = {which.camera_id: which.camera_id}  # vsd.toml may not know it any more
    known |= {name: c.camera_id for c in site.cameras for name in (c.camera_id, *c.engine_ids)}
    reread = Rereader(site)
    is_in_scope: dict[bytes, bool] = {}
    for path in files(site.root / FOLDER):
        read = list(entries(path))
        places = dict(_places(reread, [entry for _, entry in read]))
        for number, (line, entry) in enumerate(read):
            if entry is not None and entry.n_not_kept:
                continue
            at_ms = None if entry is None or entry.at is None else entry.at.timestamp() * 1000
            may_be_of_it = at_ms is None or at_ms >= which.first_ms
            each = [(known.get(camera), ms) for camera, ms in places.get(number, [(None, None)])]
            of_it = [place for place in each if _is_of(place, which, may_be_of_it)]
            if of_it:
                is_in_scope[line] = not any(_is_known(p, which) for p in of_it)
    return QuarantinedLines(tuple(is_in_scope), sum(is_in_scope.values()))


def _is_of(place: _Place, which: RecordScope, is_when_unknown: bool) -> bool:
    camera_id, ms = place
    is_then = is_when_unknown if ms is None else which.first_ms <= ms < which.after_ms
    return is_then and (which.camera_id is None or camera_id in (None, which.camera_id))


def _is_known(place: _Place, which: RecordScope) -> bool:
    camera_id, ms = place
    return ms is not None and (which.camera_id is None or camera_id is not None)


def _places(reread: Rereader, read: Sequence[QuarantineEntry | None]) -> Iterator[tuple[int, list[_Place]]]:
    """Yield number and places of the entries that can be read; the camera is the source's own name."""
    groups: dict[str, list[int]] = {}
    for i, entry in enumerate(read):
        if entry is not None and (entry.row is not None or (entry.is_whole and entry.format is not None)):
            groups.setdefault(how_read(entry), []).append(i)
    for numbers in groups.values():
        group = [_bare(e) for i in numbers if (e := read[i]) is not None]
        places: dict[int, list[_Place]] = {}
        try:
            reading = reread.reading(group[0])
            reader = Tables(is_only_where=True) if group[0].row is None and group[0].format in _TABLES else None
            for batch in reread.batches(group, reading, reader=reader):
                for rows in reread.on_clocks(batch).tables.values():
                    for at, camera, ms in zip(*(rows[c].to_pylist() for c in ("line", "camera", "ts_ms")), strict=True):
                        places.setdefault(numbers[at], []).append((camera, ms))
        except VsdError:
            continue
        yield from places.items()


def _bare(entry: QuarantineEntry) -> QuarantineEntry:
    """Return an entry whose frame message holds camera and time alone, so that nothing else spoils its reading."""
    if entry.row is not None or entry.format != "frames":
        return entry
    try:
        head = _head.decode(entry.text)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return entry
    message = msgspec.json.encode({"v": 1, "camera": head.camera, "ts": head.ts})
    return msgspec.structs.replace(entry, text=message.decode())
