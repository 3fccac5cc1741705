"""What else happened, by local hour and day: the tables `context` and `context_days`."""

from __future__ import annotations

from datetime import date
from typing import Final, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vsd_analytics.api.table import Table
from vsd_analytics.config.context_series import ContextSeries, context_series
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.dimensions import QUARTER_MS, calendar

_TEXTS: Final = [("name", pa.string()), ("unit", pa.string()), ("place", pa.string())]


def context_table(site: Site, first: date, last: date, *, per: Literal["hour", "day"]) -> Table:
    """Return a row for each series that was added and each local hour, or day, of a range.

    An interval counts in the hour (day) that it lies in wholly; a longer one says nothing about a single hour. `value`
    is the sum of these intervals, or their mean weighted by open time, as the series says. It is null unless they
    cover all open time of the hour (day), or all of an hour (day) without open time: missing is not 0.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        per: The grain.

    Returns:
        Columns name, unit, place; start (local instant) and local_hour for hours; local_date, weekday (1 Monday); value
        in the unit; covered_s, the seconds that intervals cover; open_s, the open time.

    Raises:
        InputError: E110, a line of context.jsonl is wrong.
    """
    found = calendar(site, first, last)
    quarters = found["quarter"].to_numpy()
    starts_ms = found["hour_start_ms"].to_numpy() if per == "hour" else found["local_date"].to_numpy()
    at = np.flatnonzero(np.append(True, starts_ms[1:] != starts_ms[:-1]))
    edges_ms = np.append(quarters[at], quarters[-1] + 1) * QUARTER_MS
    rows = found.take(at)
    columns = [("local_date", pa.date32()), ("weekday", pa.int32())]
    if per == "hour":
        instants = pa.timestamp("us", tz=site.timezone)  # as in the other tables
        columns = [("start", instants), *columns, ("local_hour", pa.int32())]
        rows = rows.append_column(
            "start", rows["hour_start_ms"].cast(pa.timestamp("ms", tz=site.timezone)).cast(instants)
        )
    schema = pa.schema(
        [*_TEXTS, *columns, ("value", pa.float64()), ("covered_s", pa.float64()), ("open_s", pa.float64())]
    )
    opens_ms = np.append(0, np.cumsum(found["is_open"].to_numpy() * QUARTER_MS))
    opening = _Opening(np.append(quarters, quarters[-1] + 1) * QUARTER_MS, opens_ms)
    tables = [schema.empty_table()]
    for series in context_series(site).values():
        value, covered_ms, open_ms = _by_bucket(series, edges_ms, opening)
        texts = [pa.repeat(text, len(rows)) for text in (series.name, series.unit, series.place)]
        numbers = [pa.array(value, from_pandas=True), pa.array(covered_ms / 1000), pa.array(open_ms / 1000)]
        same = [rows[name].combine_chunks() for name, _ in columns]
        tables.append(pa.table([*texts, *same, *numbers], schema=schema))
    return Table(pa.concat_tables(tables), title=f"What else happened, {first} to {last}")


class _Opening:
    """Open time up to an instant: quarter-hours, each open or not."""

    def __init__(self, edges_ms: NDArray[np.int64], opens_ms: NDArray[np.int64]) -> None:
        self._edges_ms = edges_ms
        self._opens_ms = opens_ms

    def between(self, from_ms: NDArray[np.int64], to_ms: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the open milliseconds of each interval."""
        before, after = (np.interp(ends, self._edges_ms, self._opens_ms) for ends in (from_ms, to_ms))
        return np.asarray(after - before, np.float64)


def _by_bucket(
    series: ContextSeries, edges_ms: NDArray[np.int64], opening: _Opening
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the value (NaN = unknown), covered and open milliseconds of each span between two edges."""
    n_buckets = len(edges_ms) - 1
    bucket = np.searchsorted(edges_ms, series.from_ms, side="right") - 1
    is_inside = (bucket >= 0) & (bucket < n_buckets) & (series.to_ms <= edges_ms[np.minimum(bucket + 1, n_buckets)])
    bucket, values = bucket[is_inside], series.values[is_inside]
    from_ms, to_ms = series.from_ms[is_inside], series.to_ms[is_inside]

    def total(of: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.float64]:
        return np.bincount(bucket, weights=of, minlength=n_buckets).astype(np.float64)

    lengths_ms = np.diff(edges_ms).astype(np.float64)
    covered_ms, open_ms = total(to_ms - from_ms), opening.between(edges_ms[:-1], edges_ms[1:])
    has_open = open_ms > 0
    weights = np.where(has_open[bucket], opening.between(from_ms, to_ms), to_ms - from_ms)
    weighed_ms = total(weights)
    is_known = (covered_ms > 0) & (weighed_ms >= np.where(has_open, open_ms, lengths_ms) - 0.5)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = total(values) if series.adds == "sum" else total(values * weights) / weighed_ms
    return np.where(is_known, value, np.nan), covered_ms, open_ms
