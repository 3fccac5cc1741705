"""A stored day as a stream: the alarms it gave, or would have given with today's rules."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterator, Sequence
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.live.alarms import AlarmEngine, epoch_ms
from vsd_analytics.live.companions import FORGET_MS
from vsd_analytics.live.events import AlarmEvent
from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.site.model import AlarmRule, Site
from vsd_analytics.store.layout import HOUR_MS, hour_of, segment_paths
from vsd_analytics.store.part_files import read_part, with_every_column
from vsd_analytics.store.segments import read_segment
from vsd_analytics.store.spans import ends_ms
from vsd_analytics.store.store import Store

SLICE_MS = 60_000
"""Records are fed a minute at a time, so that memory does not grow with the hour."""

DAY_S = 86_400.0
_TRIES = 5


def lookback_s(rules: Sequence[AlarmRule], *, lateness_s: float) -> float:
    """Return for how long, in seconds, records influence the alarms after them: at most a day.

    It is the longest `for_s` with its cool-down, or the time people are remembered, plus the lateness.
    """
    longest = max((r.for_s + r.cooldown_s for r in rules), default=0.0)
    return min(max(longest, FORGET_MS / 1000) + lateness_s, DAY_S)


def replay(
    site: Site,
    first: date,
    last: date,
    *,
    rules: Sequence[AlarmRule] | None = None,
    now: datetime,
    variants: Sequence[AlarmRule] = (),
    on_time: Callable[[int], None] | None = None,
    on_records: Callable[[int, Collection[str]], None] | None = None,
) -> list[AlarmEvent]:
    """Return the events of all alarms that were open in a range of local days.

    The same records give the same events as when they came live, as far as none came later than `lateness_s`. Records
    are read from `lookback_s` before the range on, so a silence that is older seems to begin there; and beyond the
    range until its alarms have ended, at most a day.

    Args:
        site: The project; records still in the spool are read too.
        first: First local day.
        last: Last local day, inclusive.
        rules: Rules to apply; None = those of the site.
        now: The clock: later records are not read.
        variants: Further rules to try on the same records, with ids of their own; no event of `rules` depends on them.
        on_time: Called with the seconds of stored time done since the last call, for a progress bar.
        on_records: Called for each minute with records: its end in UTC milliseconds, and the ids of their cameras.

    Raises:
        StoreError: E302, a file of the store is damaged.
    """
    start, end = (datetime(d.year, d.month, d.day, tzinfo=site.zone) for d in (first, last + timedelta(days=1)))
    rules = site.alarms if rules is None else rules
    early = start - timedelta(seconds=lookback_s(rules, lateness_s=site.settings.lateness_s))
    stop = min(end + timedelta(days=1), now)
    engine = AlarmEngine(site, rules=[*rules, *variants], start=early)
    events: list[AlarmEvent] = []
    begun: set[str] = set()
    done = early
    for until, tables in stored_minutes(site, early, stop):
        if on_time is not None:
            on_time(round((until - done).total_seconds()))
        done = until
        cameras = {c for rows in tables.values() for c in rows["camera_id"].unique().to_pylist()}
        if on_records is not None and cameras:
            on_records(epoch_ms(until), cameras)
        events += [*engine.feed(tables), *engine.close(min(until, stop))]
        if until >= end:
            begun = begun or {e.alarm for e in events if e.event == "start" and _instant(e.at_ms) < end}
            if not begun.intersection(engine.open_alarms):
                break
    inside = {e.alarm for e in events if e.event == "start" and _instant(e.at_ms) < end}
    over = {e.alarm for e in events if e.event == "end" and _instant(e.at_ms) < start}
    return [e for e in sorted(events, key=lambda e: e.order) if e.alarm in inside - over]


def stored_minutes(
    site: Site, start: datetime, end: datetime, *, cameras: Collection[str] | None = None
) -> Iterator[tuple[datetime, dict[TableName, pa.Table]]]:
    """Yield the stored records of [start, end), minute by minute, in order of time.

    Args:
        site: The project.
        start: First instant.
        end: Instant after the last.
        cameras: Only these; None = all.

    Yields:
        The end of a slice of time, and its rows in `SCHEMAS`; a record that is both in the spool and in a part comes
        twice. Hours without records are one slice.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    first_ms, end_ms = epoch_ms(start), epoch_ms(end)
    for hour in range(hour_of(first_ms), hour_of(end_ms - 1) + 1):
        low, high = max(first_ms, hour * HOUR_MS), min(end_ms, (hour + 1) * HOUR_MS)
        tables = {t: _rows(store, t, hour, cameras) for t in TABLES}
        if not any(rows.num_rows for rows in tables.values()):
            yield _instant(high), tables
            continue
        for at in range(low, high, SLICE_MS):
            until = min(at + SLICE_MS, high)
            yield _instant(until), {t: _between(rows, at, until) for t, rows in tables.items()}


def _rows(store: Store, table: TableName, hour: int, cameras: Collection[str] | None) -> pa.Table:
    """Return one table's stored rows of an hour, by time; try again when a fold removes a file meanwhile."""
    for _ in range(_TRIES - 1):
        with contextlib.suppress(FileNotFoundError):
            return _rows_now(store, table, hour, cameras)
    return _rows_now(store, table, hour, cameras)


def _rows_now(store: Store, table: TableName, hour: int, cameras: Collection[str] | None) -> pa.Table:
    """Return the rows; FileNotFoundError when a fold removes a file meanwhile.

    The spool is read before the parts: then a fold at work makes records come twice, and none is missed.
    """
    try:
        read = [_between(_spooled(p, table), hour * HOUR_MS, (hour + 1) * HOUR_MS) for p in _spool(store, table, hour)]
        read += [read_part(part.path, table) for part in store.parts(table, first_hour=hour, last_hour=hour)]
    except FileNotFoundError:
        raise
    except (pa.ArrowException, OSError):
        store.refuse_damaged()
        raise
    rows = pa.concat_tables([SCHEMAS[table].empty_table(), *read])
    if cameras is not None:
        rows = rows.filter(pc.is_in(rows["camera_id"], pa.array(sorted(cameras), pa.string())))
    return rows.sort_by("ts")


def _spool(store: Store, table: TableName, hour: int) -> list[Path]:
    """Return the spool's files that may hold rows of an hour."""
    segments = []
    for path in segment_paths(store.root, table):
        ends = ends_ms(path)
        if ends is None or ends[0] // HOUR_MS <= hour <= ends[1] // HOUR_MS:
            segments.append(path)
    return segments


def _spooled(path: Path, table: TableName) -> pa.Table:
    return with_every_column(table, read_segment(path)).select(SCHEMAS[table].names).cast(SCHEMAS[table])


def _between(rows: pa.Table, low_ms: int, high_ms: int) -> pa.Table:
    ts_ms = rows["ts"].cast(pa.int64())
    return rows.filter(pc.and_(pc.greater_equal(ts_ms, low_ms), pc.less(ts_ms, high_ms)))


def _instant(ms: int) -> datetime:
    return datetime.fromtimestamp(ms / 1000, tz=UTC)
