"""Trying records of the quarantine again, after vsd.toml or the column mapping was corrected.

The order matters: records that are good now are durable in the store before the quarantine file is replaced by the
rest. A crash in between replays them again, and the store recognises them by their keys.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path

import msgspec

from vsd_analytics.errors import DiskError, VsdError
from vsd_analytics.ingest.intake.normalise import Normaliser
from vsd_analytics.ingest.intake.pseudonyms import keys_of
from vsd_analytics.ingest.intake.quarantine_reader import Rereader, how_read
from vsd_analytics.ingest.intake.quarantine_writer import SourceReading, entry_of, matches
from vsd_analytics.ingest.reading.adapter import IngestOptions, Rejected
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store.quarantine import FOLDER, QuarantineEntry, entries, files, locked, rewrite
from vsd_analytics.store.secrets import DayKeys
from vsd_analytics.store.store import FoldResult, Store

_DEFAULTS = IngestOptions()


@dataclass
class ReplayResult:
    """The result of a replay.

    Attributes:
        n_chosen: Entries chosen.
        n_solved: Entries that left quarantine.
        n_records: Records acknowledged, by table.
        n_dropped: Records left out on purpose, by reason.
        n_bad: Entries tried and still bad, by their reason now.
        n_not_replayable: Entries that cannot be tried again, by reason: their file must be ingested again.
        n_not_kept: Records that were only counted, by reason: their file must be ingested again.
        errors: Why some could not be tried, each message once.
        fold: What the store gained by them; empty for a dry run.
        waiting: What it gained from records in the spool, which an earlier run had not folded when it was stopped.
    """

    n_chosen: int = 0
    n_solved: int = 0
    n_records: Counter[TableName] = field(default_factory=Counter)
    n_dropped: Counter[str] = field(default_factory=Counter)
    n_bad: Counter[str] = field(default_factory=Counter)
    n_not_replayable: Counter[str] = field(default_factory=Counter)
    n_not_kept: Counter[str] = field(default_factory=Counter)
    errors: list[VsdError] = field(default_factory=list)
    fold: FoldResult = field(default_factory=FoldResult)
    waiting: FoldResult = field(default_factory=FoldResult)

    @property
    def n_left(self) -> int:
        """Return how many chosen records are still in quarantine, including those only counted."""
        return sum(self.n_bad.values()) + sum(self.n_not_replayable.values()) + sum(self.n_not_kept.values())


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
    offset is read by the clock its camera has now. Good records are stored exactly once, records left out on purpose
    leave the quarantine as well, and bad ones stay with the reason they have now.

    Args:
        site: The site.
        reason: Entries of this reason only.
        source: Entries whose source's name contains this only.
        options: New options of the user (camera, columns, map, period and the like); fields at their defaults are
            taken from the ingest.
        now: The clock that times are compared with; None = the instant at which each entry was quarantined, so that a
            record from the future does not become valid by waiting.
        is_dry_run: Try everything, write nothing.

    Raises:
        UsageError: E101, `options.camera` is no camera of the site.
        StoreError: E302, the store is damaged; what was read stays acknowledged.
        DiskError: The disk refused; what was acknowledged is stored, the rest is still in quarantine.
    """
    folder = site.root / FOLDER
    result = ReplayResult()
    reread = Rereader(site, options)
    if not folder.is_dir():
        return result
    keys = None if is_dry_run else keys_of(site)
    store = Store(site.acknowledged, site_id=site.site_id, ballast_mb=site.settings.ballast_mb)
    attempt = _Attempt(site, reread, keys, now, None if is_dry_run else store, result)
    if not is_dry_run:
        result.waiting = store.fold()
    with locked(folder):
        for path in files(folder):
            left = attempt.on_file(path, reason=reason, source=source)
            if left is not None and not is_dry_run:
                rewrite(path, left)
    if not is_dry_run:
        result.fold = store.fold()
    return result


@dataclass
class _Attempt:
    """One run over the quarantine."""

    site: Site
    reread: Rereader
    keys: DayKeys | None
    now: datetime | None
    store: Store | None
    result: ReplayResult

    def on_file(self, path: Path, *, reason: str | None, source: str | None) -> list[QuarantineEntry | bytes] | None:
        """Try one file's entries; return those that must stay in it, or None when none was tried."""
        lines = list(entries(path))
        chosen = [i for i, (_, e) in enumerate(lines) if e is not None and matches(e, reason=reason, source=source)]
        stay: dict[int, list[QuarantineEntry | bytes]] = {i: [line] for i, (line, _) in enumerate(lines)}
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
                self.result.n_not_replayable[entry.reason] += 1
        for numbers in groups.values():
            group = [e for i in numbers if (e := lines[i][1]) is not None]
            for i, left in zip(numbers, self._on_group(group), strict=True):
                stay[i] = list(left)
        return [e for i in sorted(stay) for e in stay[i]] if groups else None

    def _on_group(self, group: Sequence[QuarantineEntry]) -> list[list[QuarantineEntry]]:
        """Try entries that are read alike; return for each what is left of it."""
        first = group[0]
        assert first.at is not None
        normaliser = Normaliser(self.site, now=self.now or first.at, keys=self.keys)
        if first.is_live:
            normaliser.live_at(self.now or first.at)
        rejects: list[list[Rejected]] = [[] for _ in group]
        try:
            reading = self.reread.reading(first)
            for batch in self.reread.batches(group, reading):
                clean = normaliser.normalise(self.reread.on_clocks(batch))
                self.result.n_dropped.update(clean.n_dropped)
                for bad in clean.rejected:
                    rejects[bad.line].append(bad)
                for name in reversed(TABLES):
                    rows = clean.tables.get(name)
                    if rows is not None and rows.num_rows:
                        if self.store is not None:
                            self.store.append(name, rows, engines=first.engines, import_id=first.import_id)
                        self.result.n_records[name] += rows.num_rows
        except DiskError:
            raise
        except VsdError as error:
            if str(error) not in map(str, self.result.errors):
                self.result.errors.append(error)
            self.result.n_bad.update(e.reason for e in group)
            return [[e] for e in group]
        left = [[_renewed(entry, bad, reading) for bad in bads] for entry, bads in zip(group, rejects, strict=True)]
        self.result.n_solved += sum(not x for x in left)
        self.result.n_bad.update(x[0].reason for x in left if x)
        return left


def _alike(entry: QuarantineEntry) -> str:
    """Return the same text for entries that may be tried together."""
    how = [
        entry.at,
        entry.is_live,
        entry.engines,
        entry.import_id,
        entry.source,
        how_read(entry),
    ]  # its name may say a camera
    return msgspec.json.encode(how).decode()


def _renewed(entry: QuarantineEntry, bad: Rejected, reading: SourceReading | None) -> QuarantineEntry:
    """Return an entry with the reason it has now, and its old source, line and instant."""
    if entry.row is not None:
        return msgspec.structs.replace(entry, reason=bad.reason, detail=bad.detail)
    record = replace(bad, line=entry.line)
    return entry_of(record, source=entry.source, at=entry.at, is_live=entry.is_live, reading=reading)
