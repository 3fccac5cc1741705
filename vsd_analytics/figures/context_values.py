"""What else happened, by local hour and day: the series of `vsd context add` beside the opening hours of the site.

An interval counts in the hour (day) that it lies in wholly; a longer one says nothing about a single hour. The value is
the sum of these intervals, or their mean weighted by open time, as the series says. It is unknown unless they cover all
open time of the hour (day), or all of an hour (day) without open time: missing is not 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Final, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vsd_analytics.config.context_series import SITE, ContextSeries, context_series
from vsd_analytics.site.model import Area, Floor, Site
from vsd_analytics.warehouse.dimensions import QUARTER_MS, calendar

Floats = NDArray[np.float64]
Grain = Literal["hour", "day"]
_TEXTS: Final = [("name", pa.string()), ("unit", pa.string()), ("place", pa.string())]


class _Opening:
    """Open time up to an instant: quarter-hours, each open or not."""

    def __init__(self, edges_ms: NDArray[np.int64], opens_ms: NDArray[np.int64]) -> None:
        self._edges_ms = edges_ms
        self._opens_ms = opens_ms

    def between(self, from_ms: NDArray[np.int64], to_ms: NDArray[np.int64]) -> Floats:
        """Return the open milliseconds of each interval."""
        before, after = (np.interp(ends, self._edges_ms, self._opens_ms) for ends in (from_ms, to_ms))
        return np.asarray(after - before, np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Spans:
    """The local hours or days of a range.

    Attributes:
        rows: The quarter-hours of the calendar at which they start, one a span.
        edges_ms: Their ends, UTC milliseconds, one more than spans.
        opening: Open time.
    """

    rows: pa.Table
    edges_ms: NDArray[np.int64]
    opening: _Opening

    def values(self, series: ContextSeries) -> tuple[Floats, Floats, Floats]:
        """Return the value (NaN = unknown), covered and open milliseconds of a series in each span."""
        edges_ms, n_spans = self.edges_ms, len(self.edges_ms) - 1
        span = np.searchsorted(edges_ms, series.from_ms, side="right") - 1
        is_inside = (span >= 0) & (span < n_spans) & (series.to_ms <= edges_ms[np.minimum(span + 1, n_spans)])
        span, values = span[is_inside], series.values[is_inside]
        from_ms, to_ms = series.from_ms[is_inside], series.to_ms[is_inside]

        def total(each: Floats | NDArray[np.int64]) -> Floats:
            return np.bincount(span, weights=each, minlength=n_spans).astype(np.float64)

        lengths_ms = np.diff(edges_ms).astype(np.float64)
        covered_ms, open_ms = total(to_ms - from_ms), self.opening.between(edges_ms[:-1], edges_ms[1:])
        has_open = open_ms > 0
        weights = np.where(has_open[span], self.opening.between(from_ms, to_ms), to_ms - from_ms)
        weighed_ms = total(weights)
        is_known = (covered_ms > 0) & (weighed_ms >= np.where(has_open, open_ms, lengths_ms) - 0.5)
        with np.errstate(invalid="ignore", divide="ignore"):
            value = total(values) if series.adds == "sum" else total(values * weights) / weighed_ms
        return np.where(is_known, value, np.nan), covered_ms, open_ms


def spans(site: Site, first: date, last: date, *, per: Grain) -> Spans:
    """Return the local hours or days from `first` to `last`."""
    quarters_of_days = calendar(site, first, last)
    quarters = quarters_of_days["quarter"].to_numpy()
    column = "hour_start_ms" if per == "hour" else "local_date"
    starts = quarters_of_days[column].to_numpy()
    at = np.flatnonzero(np.append(True, starts[1:] != starts[:-1]))
    ends_ms = np.append(quarters, quarters[-1] + 1) * QUARTER_MS
    opens_ms = np.append(0, np.cumsum(quarters_of_days["is_open"].to_numpy() * QUARTER_MS))
    edges_ms = np.append(quarters[at], quarters[-1] + 1) * QUARTER_MS
    return Spans(quarters_of_days.take(at), edges_ms, _Opening(ends_ms, opens_ms))


def context_rows(site: Site, first: date, last: date, *, per: Grain) -> pa.Table:
    """Return a row for each series that was added and each local hour, or day, of a range.

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
    asked = spans(site, first, last, per=per)
    rows = asked.rows
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
    tables = [schema.empty_table()]
    for series in context_series(site).values():
        value, covered_ms, open_ms = asked.values(series)
        texts = [pa.repeat(text, len(rows)) for text in (series.name, series.unit, series.place)]
        numbers = [pa.array(value, from_pandas=True), pa.array(covered_ms / 1000), pa.array(open_ms / 1000)]
        same = [rows[name].combine_chunks() for name, _ in columns]
        tables.append(pa.table([*texts, *same, *numbers], schema=schema))
    return pa.concat_tables(tables)


def series_of(site: Site, floor: Floor, areas: Sequence[Area]) -> Iterator[tuple[ContextSeries, Area | None]]:
    """Yield the series that concern a floor, each with its area; None = the whole floor, as of the whole site."""
    by_id = {area.area_id: area for area in areas}
    for series in context_series(site).values():
        if series.place in by_id:
            yield series, by_id[series.place]
        elif series.place in (SITE, floor.floor_id):
            yield series, None
