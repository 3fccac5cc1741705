"""Trying again what is in quarantine, after vsd.toml or the mapping was mended.

Order matters: what became good is in the store, durably, before the quarantine file is replaced by what is left of it.
A crash in between replays again, and the store knows the records by their keys.
"""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import datetime
from pathlib import Path
from typing import IO, Any

import msgspec
import numpy as np

from vsd_analytics.errors import DiskError, InputError, VsdError
from vsd_analytics.ingest.adapter import IngestOptions, RawBatch, Rejected, Source
from vsd_analytics.ingest.instants import local_to_utc, utc_to_local
from vsd_analytics.ingest.normalise import Normaliser
from vsd_analytics.ingest.pipeline import adapter, with_site
from vsd_analytics.ingest.quarantine import Entry, Reading, entries, entry_of, files, locked, matches, rewrite
from vsd_analytics.ingest.raw import rows_table
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.site import Site
from vsd_analytics.store import FoldResult, Store
from vsd_analytics.store.secrets import DayKeys

_DEFAULTS = IngestOptions()
_NO_ROW = (ValueError, TypeError, OverflowError)


@dataclass
class ReplayResult:
    """What became of the entries of the quarantine that were chosen.

    Attributes:
        n_chosen: Entries chosen.
        n_mended: Entries that left quarantine.
        n_records: Records acknowledged, by table.
        n_dropped: Records left out on purpose, by reason.
        n_bad: Entries tried and still bad, by their reason now.
        n_fixed: Entries that cannot be tried again, by reason: their file has to be ingested again.
        n_not_kept: Records that were only counted, by reason: their file has to be ingested again.
        errors: Why some could not be tried, each message once.
        fold: What the store gained; empty for a dry run.
    """

    n_chosen: int = 0
    n_mended: int = 0
    n_records: Counter[TableName] = field(default_factory=Counter)
    n_dropped: Counter[str] = field(default_factory=Counter)
    n_bad: Counter[str] = field(default_factory=Counter)
    n_fixed: Counter[str] = field(default_factory=Counter)
    n_not_kept: Counter[str] = field(default_factory=Counter)
    errors: list[VsdError] = field(default_factory=list)
    fold: FoldResult = field(default_factory=FoldResult)

    @property
    def n_left(self) -> int:
        """Return how many chosen records are still in quarantine, those only counted among them."""
        return sum(self.n_bad.values()) + sum(self.n_fixed.values()) + sum(self.n_not_kept.values())


def replay(
    site: Site,
    *,
    reason: str | None = None,
    source: str | None = None,
    options: IngestOptions = _DEFAULTS,
    now: datetime | None = None,
    is_dry_run: bool = False,
) -> ReplayResult:
    """Try the entries of the quarantine again with the site as it is described now.

    Rows go through the same checks as at their ingest; lines are read again by their format first. A time without an
    offset moves with the clock its camera has now. What is good is stored, exactly once; what is left out on purpose
    leaves as well; what is still bad stays, with the reason it has now.

    Args:
        site: The site.
        reason: Entries of this reason only.
        source: Entries whose source's name contains this only.
        options: What the user says anew (camera, columns, map, period and the like); fields at their defaults are
            taken from the ingest.
        now: Instant times are held against; None = the instant at which each entry was quarantined, so that a record
            from the future does not become right by waiting.
        is_dry_run: Try everything, write nothing.

    Raises:
        UsageError: E101, `options.camera` is no camera of the site.
        StoreError: E302, the store is damaged; what was read stays acknowledged.
        DiskError: The disk refused; what was acknowledged is stored, the rest is still in quarantine.
    """
    folder = site.root / "quarantine"
    result = ReplayResult()
    given = with_site(site, options)
    if not folder.is_dir():
        return result
    keys = DayKeys(site.root / "secrets") if site.settings.pseudonyms and not is_dry_run else None
    store = Store(site.root / "store", site_id=site.site_id, ballast_mb=site.settings.ballast_mb)
    attempt = _Attempt(site, options, given, keys, now, None if is_dry_run else store, result)
    with locked(folder):
        for path in files(folder):
            left = attempt.on_file(path, reason=reason, source=source)
            if left is not None and not is_dry_run:
                rewrite(path, left)
    if not is_dry_run:  # also what an earlier run stored and was cut off before folding
        result.fold = store.fold()
    return result


@dataclass
class _Attempt:
    """One run over the quarantine."""

    site: Site
    said: IngestOptions
    given: IngestOptions
    keys: DayKeys | None
    now: datetime | None
    store: Store | None
    result: ReplayResult

    def on_file(self, path: Path, *, reason: str | None, source: str | None) -> list[Entry | bytes] | None:
        """Try one file's entries; return what has to stay in it, or None when nothing was chosen."""
        lines = list(entries(path))
        chosen = [i for i, (_, e) in enumerate(lines) if e is not None and matches(e, reason=reason, source=source)]
        stay: dict[int, list[Entry | bytes]] = {i: [line] for i, (line, _) in enumerate(lines)}
        groups: dict[str, list[int]] = {}
        for i in chosen:
            entry = lines[i][1]
            assert entry is not None
            if entry.n_not_kept:
                self.result.n_not_kept[entry.reason] += entry.n_not_kept
                continue
            self.result.n_chosen += 1
            if entry.can_be_replayed:
                groups.setdefault(_alike(entry), []).append(i)
            else:
                self.result.n_fixed[entry.reason] += 1
        for numbers in groups.values():
            group = [e for i in numbers if (e := lines[i][1]) is not None]
            for i, left in zip(numbers, self._on_group(group), strict=True):
                stay[i] = list(left)
        return [e for i in sorted(stay) for e in stay[i]] if groups else None

    def _on_group(self, group: Sequence[Entry]) -> list[list[Entry]]:
        """Try entries that are read alike; return for each what is left of it."""
        first = group[0]
        assert first.at is not None
        normaliser = Normaliser(self.site, now=self.now or first.at, keys=self.keys)
        if first.is_live:
            normaliser.live_at(self.now or first.at)
        found: list[list[Rejected]] = [[] for _ in group]
        try:
            reading = self._reading(first)
            for batch in self._batches(group, reading):
                clean = normaliser.normalise(self._on_clocks(batch))
                self.result.n_dropped.update(clean.n_dropped)
                for bad in clean.rejected:
                    found[bad.line].append(bad)
                for name in reversed(TABLES):
                    rows = clean.tables.get(name)
                    if rows is not None and rows.num_rows:
                        if self.store is not None:
                            self.store.append(name, rows, engines=first.engines)
                        self.result.n_records[name] += rows.num_rows
        except DiskError:
            raise
        except VsdError as error:
            if str(error) not in map(str, self.result.errors):
                self.result.errors.append(error)
            self.result.n_bad.update(e.reason for e in group)
            return [[e] for e in group]
        left = [[_renewed(entry, bad, reading) for bad in bads] for entry, bads in zip(group, found, strict=True)]
        self.result.n_mended += sum(not x for x in left)
        self.result.n_bad.update(x[0].reason for x in left if x)
        return left

    def _reading(self, entry: Entry) -> Reading | None:
        """Return how lines like this one are read now: as they were, and as the user says anew."""
        if entry.row is not None or entry.format is None:
            return None
        anew = {f.name: v for f in fields(IngestOptions) if (v := getattr(self.said, f.name)) != _default(f.name)}
        try:
            options = replace(msgspec.convert(entry.options, IngestOptions), **anew)
        except msgspec.ValidationError as error:
            raise InputError("an entry of the quarantine was changed by hand", why=str(error)) from None
        return Reading(options.format or entry.format, options, entry.first_line, entry.engines)

    def _batches(self, group: Sequence[Entry], reading: Reading | None) -> Iterator[RawBatch]:
        """Read the entries again; the column `line` and the rejected carry their numbers in the group."""
        if reading is None:
            for name in TABLES:
                numbers = [i for i, e in enumerate(group) if e.table == name and e.row is not None]
                if numbers:
                    yield self._rows(name, group, numbers)
            return
        lines = _Lines.of(group)
        for batch in adapter(reading.format).read(lines, with_site(self.site, reading.options)):
            tables = {n: lines.renumbered(t) for n, t in batch.tables.items()}
            kept = [replace(r, line=r.line - lines.n_above - 1) for r in batch.rejected if r.line > lines.n_above]
            yield replace(batch, tables=tables, rejected=kept, notes=())

    def _rows(self, name: TableName, group: Sequence[Entry], numbers: Sequence[int]) -> RawBatch:
        default = {} if self.given.camera is None else {"camera": self.given.camera}
        rows = {i: {**default, **(group[i].row or {})} for i in numbers}
        try:
            return RawBatch({name: rows_table(name, list(rows.values()), lines=numbers)})
        except _NO_ROW:
            bad = []
        for i in numbers:
            try:
                rows_table(name, [rows[i]], lines=[i])
            except _NO_ROW as error:
                bad.append(Rejected(i, group[i].reason, f"the entry holds no raw row: {error}"))
                del rows[i]
        return RawBatch({name: rows_table(name, list(rows.values()), lines=list(rows))}, bad)

    def _on_clocks(self, batch: RawBatch) -> RawBatch:
        """Move times without an offset from the zone they were read in to the clock their camera has now."""
        clocks = {name: c.clock for c in self.site.cameras for name in (c.camera_id, *c.engine_ids)}
        return replace(batch, tables={n: _moved(t, clocks) for n, t in batch.tables.items()})


def _moved(rows: Any, clocks: Mapping[str, str]) -> Any:
    import pyarrow as pa

    zones, cameras = rows["zone"].to_pylist(), rows["camera"].to_pylist()
    now = [None if zone is None else clocks.get(camera, zone) for zone, camera in zip(zones, cameras, strict=True)]
    moves = {(was, to) for was, to in zip(zones, now, strict=True) if was is not None and to is not None and was != to}
    if not moves:
        return rows
    ts_ms = np.array(rows["ts_ms"].fill_null(0).to_numpy(), dtype=np.int64)
    for was, to in sorted(moves):
        at = np.array([(was, to) == pair for pair in zip(zones, now, strict=True)])
        ts_ms[at] = local_to_utc(utc_to_local(ts_ms[at], was), to)[0]
    is_null = rows["ts_ms"].is_null().to_numpy()
    moved = rows.set_column(rows.schema.get_field_index("ts_ms"), "ts_ms", pa.array(ts_ms, pa.int64(), mask=is_null))
    return moved.set_column(rows.schema.get_field_index("zone"), "zone", pa.array(now, pa.string()))


def _alike(entry: Entry) -> str:
    """Return the same text for entries that may be tried together."""
    how = [entry.format, entry.options, entry.first_line] if entry.row is None else None
    return msgspec.json.encode([entry.at, entry.is_live, entry.engines, how]).decode()


def _default(name: str) -> Any:
    return getattr(_DEFAULTS, name)


def _renewed(entry: Entry, bad: Rejected, reading: Reading | None) -> Entry:
    """Return an entry with the reason it has now, at its old place and time."""
    if entry.row is not None:
        return msgspec.structs.replace(entry, reason=bad.reason, detail=bad.detail)
    record = replace(bad, line=entry.line)
    return entry_of(record, source=entry.source, at=entry.at, is_live=entry.is_live, reading=reading)


@dataclass(frozen=True, slots=True)
class _Lines(Source):
    """Lines of quarantine as a file of their format.

    Attributes:
        content: The file.
        n_above: Lines above the first entry's.
    """

    content: bytes
    n_above: int

    @staticmethod
    def of(group: Sequence[Entry]) -> _Lines:
        """Return a file of the first line, if there is one, and the lines of entries read alike."""
        above = [group[0].first_line] if group[0].first_line else []
        # a JSON message from a broker may have line breaks, which are blanks to JSON
        lines = [*above, *(e.text.replace("\r\n", " ").replace("\n", " ") for e in group)]
        path = Path(group[0].source.replace("\0", " "))
        return _Lines(path, ("\n".join(lines) + "\n").encode(), len(above))

    @property
    def size_bytes(self) -> int:
        """Return the number of bytes of all lines."""
        return len(self.content)

    def open(self) -> IO[bytes]:
        """Return a stream of the lines."""
        return io.BytesIO(self.content)

    def head(self, n_bytes: int = 65536) -> bytes:
        """Return the first bytes."""
        return self.content[:n_bytes]

    def renumbered(self, table: Any) -> Any:
        """Return raw rows with the number of their entry as `line`, without those of the first line."""
        import pyarrow.compute as pc

        table = table.filter(pc.greater(table["line"], self.n_above))
        at = table.schema.get_field_index("line")
        return table.set_column(at, table.schema.field("line"), pc.subtract(table["line"], self.n_above + 1))
