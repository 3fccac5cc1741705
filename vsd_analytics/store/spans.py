"""Which hours of a spool are folded together: few reads for many small segments, and bounded memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.store.segments import about, read_segment

FAR_DAYS = 7
"""Days further apart are folded apart: a span lists the parts of all days between its first and its last."""
SPAN_ROWS = 500_000
"""Rows folded at once: whole days of quiet sites, single hours of busy ones."""


@dataclass(frozen=True, slots=True)
class FoldSpan:
    """UTC hours that are folded together, and for each of their days the segments that hold records of it."""

    by_day: Mapping[int, Sequence[Path]]
    first_hour: int
    last_hour: int

    @property
    def segments(self) -> list[Path]:
        """Every segment once, in the order of days."""
        return list(dict.fromkeys(path for paths in self.by_day.values() for path in paths))

    def overlapping(self, files: Iterable[Path]) -> list[Path]:
        """Return the files with instants between those of the segments: no others can hold one of their keys."""
        files = list(files)
        if not files:
            return []
        ends = [ends_ms(path) for path in self.segments]
        known = [end for end in ends if end is not None]
        if not known or len(known) < len(ends):
            return files
        first, last = min(known)[0], max(end for _, end in known)
        return [
            path for path in files if (end_ms := ends_ms(path)) is None or (end_ms[0] <= last and end_ms[1] >= first)
        ]


def spans_of(segments: Sequence[Path], *, stored_days: set[int]) -> Iterator[FoldSpan]:
    """Yield the days of a spool in order, in spans of at most SPAN_ROWS rows, so that memory is bounded.

    New days are folded together. A day that the store has records of is a span of its own, because those records are
    read too. Of a day with more rows the single hours are spans.
    """
    segments_hours = [(path, *_hours_and_rows(path)) for path in segments]
    n_rows_of = {path: n_rows for path, _, n_rows in segments_hours}
    together: dict[int, list[Path]] = {}
    for day in sorted({h // 24 for _, hours, _ in segments_hours for h in hours}):
        hours_of_day = range(day * 24, day * 24 + 24)
        inside = [(path, hours) for path, hours, _ in segments_hours if not hours.isdisjoint(hours_of_day)]
        paths = [path for path, _ in inside]
        joined = {*paths, *(path for of_day in together.values() for path in of_day)}
        first, last = min(together, default=day), max(together, default=day)
        is_new = day - last <= FAR_DAYS and stored_days.isdisjoint(range(first, day + 1))
        if together and not (is_new and sum(n_rows_of[path] for path in joined) <= SPAN_ROWS):
            yield _of_days(together)
            together = {}
        if sum(n_rows_of[path] for path in paths) <= SPAN_ROWS:
            together[day] = paths
            continue
        for hour in hours_of_day:
            if of_hour := [path for path, hours in inside if hour in hours]:
                yield FoldSpan({day: of_hour}, hour, hour)
    if together:
        yield _of_days(together)


def _of_days(by_day: Mapping[int, Sequence[Path]]) -> FoldSpan:
    return FoldSpan(by_day, min(by_day) * 24, max(by_day) * 24 + 23)


def hours_in(segment: Path) -> frozenset[int]:
    """Return the UTC hour numbers a segment has rows of; not a range, because instants may be years apart."""
    return _hours_and_rows(segment)[0]


def ends_ms(path: Path) -> tuple[int, int] | None:
    """Return first and last instant of a part or a segment by what it notes, UTC milliseconds; None where unknown."""
    try:
        footer = about(path)
    except (pa.ArrowException, ValueError, OSError):
        return None  # whoever reads it says what is wrong
    return None if footer.first_ms is None or footer.last_ms is None else (footer.first_ms, footer.last_ms)


def _hours_and_rows(segment: Path) -> tuple[frozenset[int], int]:
    """Return the UTC hour numbers a segment has rows of, and the number of its rows."""
    footer = about(segment)
    if footer.first_ms is not None and footer.last_ms is not None:
        hours = {footer.first_ms // HOUR_MS, footer.last_ms // HOUR_MS}
        if len(hours) == 1:  # most segments: their instants need not be read
            return frozenset(hours), footer.n_rows
    instants = read_segment(segment, columns=["ts"])["ts"].cast(pa.int64()).to_numpy()
    return frozenset(np.unique(instants // HOUR_MS).tolist()), footer.n_rows
