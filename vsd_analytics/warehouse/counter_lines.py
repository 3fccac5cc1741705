"""The relations `counter_lines` and `counter_quarters`: lines that door counters count, and what these counted."""

from __future__ import annotations

from typing import Final

import numpy as np
import pyarrow as pa

from vsd_analytics.config.door_counts import door_counts
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.count_lines import line_life_ms

QUARTER_MS: Final = 900_000
_LINES: Final = pa.schema(
    [
        ("floor_id", pa.string()),
        ("from_ms", pa.int64()),
        ("to_ms", pa.int64()),
        ("line_id", pa.string()),
        ("line_no", pa.int32()),
    ]
)
_WAYS: Final = ("n_to_left", "n_to_right", "n_both")
_QUARTERS: Final = pa.schema(
    [
        ("line_id", pa.string()),
        ("quarter", pa.int64()),
        ("recorded_s", pa.float64()),
        ("interval_s", pa.float64()),
        *((name, pa.int64()) for name in _WAYS),
    ]
)


def counter_lines(site: Site) -> pa.Table:
    """Return the relation `counter_lines`: a line each that a door counter counts, and its life (UTC milliseconds)."""
    lines = [(number, line) for number, line in enumerate(site.lines) if line.is_by_counter]
    rows = [(line.floor_id, *line_life_ms(site, line), line.line_id, number) for number, line in lines]
    return pa.Table.from_pylist([dict(zip(_LINES.names, row, strict=True)) for row in rows], schema=_LINES)


def counter_quarters(site: Site, quarters: pa.ChunkedArray) -> pa.Table:
    """Return the relation `counter_quarters`: a row each for a line that a counter counts and a UTC quarter-hour.

    The sum of an interval is spread evenly over its time, in whole people: up to t of T seconds floor(n t / T) of n
    people have passed. Sums of whole intervals, such as hours, stay exact.

    Args:
        site: The project.
        quarters: UTC quarter-hours since 1970 of the range, in order.

    Returns:
        Columns line_id, quarter; recorded_s, the seconds that intervals cover; interval_s, the longest of these
        intervals; n_to_left, n_to_right and n_both, each null where the counter says nothing of it.

    Raises:
        StoreError: E302, stored counts are damaged.
    """
    lines = [line.line_id for line in site.lines if line.is_by_counter] if len(quarters) else []
    tables = [_of_line(line_id, door_counts(site, line_id), quarters) for line_id in lines]
    return pa.concat_tables([_QUARTERS.empty_table(), *tables])


def _of_line(line_id: str, counts: pa.Table, quarters: pa.ChunkedArray) -> pa.Table:
    """Return the rows of one line."""
    first, last = quarters[0].as_py(), quarters[-1].as_py()
    begins_ms, stops_ms = (counts[name].cast(pa.int64()).to_numpy() for name in ("from_ts", "to_ts"))
    is_near = (stops_ms > first * QUARTER_MS) & (begins_ms < (last + 1) * QUARTER_MS)
    from_ms, to_ms = begins_ms[is_near], stops_ms[is_near]
    people = np.stack([counts[way].to_numpy().astype(np.float64)[is_near] for way in _WAYS], axis=1)  # null becomes NaN
    n_rows = last - first + 1
    recorded_ms, longest_ms, sums = np.zeros(n_rows), np.zeros(n_rows), np.zeros((n_rows, 3))
    for step in range(4):  # an interval lies within a local hour, and so reaches into four quarter-hours at most
        quarter = from_ms // QUARTER_MS + step
        begin_ms, end_ms = np.maximum(from_ms, quarter * QUARTER_MS), np.minimum(to_ms, (quarter + 1) * QUARTER_MS)
        is_inside = (end_ms > begin_ms) & (quarter >= first) & (quarter <= last)
        row, length_ms = (quarter - first)[is_inside], (to_ms - from_ms)[is_inside]
        n, start_ms = people[is_inside], from_ms[is_inside]
        at_end, at_begin = (
            np.floor(n * ((ms[is_inside] - start_ms) / length_ms)[:, None]) for ms in (end_ms, begin_ms)
        )
        np.add.at(sums, row, at_end - at_begin)
        np.add.at(recorded_ms, row, (end_ms - begin_ms)[is_inside])
        np.maximum.at(longest_ms, row, length_ms)
    is_counted = recorded_ms > 0
    seconds = (recorded_ms[is_counted] / 1000, longest_ms[is_counted] / 1000)
    ways = (pa.array(way, from_pandas=True).cast(pa.int64()) for way in sums[is_counted].T)
    number = np.arange(first, last + 1)[is_counted]
    return pa.table([pa.repeat(line_id, len(number)), number, *seconds, *ways], schema=_QUARTERS)
