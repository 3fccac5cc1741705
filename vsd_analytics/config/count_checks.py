"""Whether counts of a door counter can be what they are taken for: counters of another door, unit, clock or direction.

Each check compares what a file would add with what its line has, or with other lines. What cannot be by chance is sure:
nothing of the file is stored then. What a strike or a fair could do as well is a warning.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

if TYPE_CHECKING:
    from vsd_analytics.config.door_counts import Counts
    from vsd_analytics.config.interval_rows import Interval

Floats = NDArray[np.float64]

ALIKE_MIN: Final = 12
"""Intervals with SAME_LEAST people and more that are compared: two counters hardly ever agree in one of them."""
ALIKE_SHARE: Final = 0.95
STEPS_MIN, FALLS_SHARE = 30, 0.02
"""A count that goes up and down like people falls in every third step; a total does not within a day."""
SAME_RUN: Final = 24
"""Intervals with one and the same number of at least SAME_LEAST people."""
SAME_LEAST: Final = 5
WEEKS: Final = 8
"""Of the history that a file is compared with."""
DAYS_MIN: Final = 5
"""Days of the history on the weekdays of the file, and people a day, that a comparison needs."""
PEOPLE_MIN: Final = 50
TIMES: Final = 4.0
"""Times as many people as usual: holidays and rain stay below it on most days of a city's streets."""
CLOCK_DAYS, CLOCK_GAIN = 3, 0.25
"""Days a clock is judged by, and by how much more the hours of the days look like the usual ones on another clock."""
HOURS_MIN: Final = 20
"""Hours of the day that a clock needs on both sides: of opening hours alone every shift would do."""
TURNED: Final = -0.5
"""Correlation of who enters less who leaves, by hour, with the usual one, below which the ways are turned round."""


@dataclass(frozen=True, slots=True)
class CountWarning:
    """What looks wrong about the counts of a file.

    Attributes:
        what: What was seen.
        why: Why it matters.
        fix: What settles it.
        is_sure: Almost surely wrong: nothing of the file is stored unless the user says so.
    """

    what: str
    why: str
    fix: str
    is_sure: bool = False


def count_warnings(
    line_id: str,
    new: Mapping[Interval, Counts],
    stored: Mapping[Interval, Counts],
    others: Mapping[str, Mapping[Interval, Counts]],
    *,
    timezone: str,
) -> list[CountWarning]:
    """Return what looks wrong about the counts that a file would add to a line.

    Args:
        line_id: The line.
        new: Counts of the file that are not stored, by interval: to the left, to the right, both ways.
        stored: Counts of the line that are stored.
        others: Counts of the other lines, by id.
        timezone: The site's; days and hours are local.
    """
    table, known = _table(new, timezone), _table(stored, timezone)
    if table.empty:
        return []
    near = _history(table, known)
    sure = [*_totals(table), *_copies(line_id, new, stored, others), *_clock(table, near)]
    return sure or [*_stuck(table), *_people(line_id, table, near), *_ways(table, near)]


def _table(counts: Mapping[Interval, Counts], timezone: str) -> pd.DataFrame:
    """Return counts by time: `n` of all ways, `net` to the left less to the right, local `day` and `hour`."""
    rows = sorted((begin, *ways) for (begin, _), ways in counts.items())
    table = pd.DataFrame(rows, columns=["ts_ms", "left", "right", "both"]).astype(float)
    table["n"] = table[["left", "right", "both"]].sum(axis=1, min_count=1)
    table["net"] = table["left"] - table["right"]
    at = pd.to_datetime(table["ts_ms"], unit="ms", utc=True).dt.tz_convert(timezone)
    table["day"], table["hour"], table["weekday"] = at.dt.date, at.dt.hour, at.dt.day_of_week
    return table.dropna(subset=["n"])


def _totals(table: pd.DataFrame) -> Iterator[CountWarning]:
    for way, column in (("left", "left"), ("right", "right"), ("both", "both")):
        steps = table.groupby("day")[column].diff().dropna().to_numpy()  # many totals begin again at midnight
        steps = steps[steps != 0]
        falls = int((steps < 0).sum())
        if len(steps) >= STEPS_MIN and falls <= FALLS_SHARE * len(steps):
            yield CountWarning(
                f"the numbers of --{way} rise in {len(steps) - falls:,} of {len(steps):,} steps, as totals do",
                "each would count everybody again who came before",
                "export counts of each interval, not the counter's total; if they are counts of intervals: --yes",
                is_sure=True,
            )


def _copies(
    line_id: str,
    new: Mapping[Interval, Counts],
    stored: Mapping[Interval, Counts],
    others: Mapping[str, Mapping[Interval, Counts]],
) -> Iterator[CountWarning]:
    """Yield the line, and the older days of this line, whose numbers the file repeats."""
    counted = {i: ways for i, ways in new.items() if sum(n or 0 for n in ways) >= SAME_LEAST}
    for other_id, other in others.items():
        common = [ways == other[interval] for interval, ways in counted.items() if interval in other]
        if len(common) >= ALIKE_MIN and np.mean(common) >= ALIKE_SHARE:
            yield CountWarning(
                f"{np.mean(common):.0%} of {len(common):,} counts are those of line {other_id!r}",
                "two doors do not let the same people in at the same time",
                f"--line {other_id}, or the file of the counter at {line_id}; if both are right: --yes",
                is_sure=True,
            )
    for days in range(1, 7 * WEEKS + 1):
        shift_ms = days * 86_400_000
        moved = ((ways, stored.get((begin - shift_ms, end - shift_ms))) for (begin, end), ways in counted.items())
        common = [ways == before for ways, before in moved if before is not None]
        if len(common) >= ALIKE_MIN and np.mean(common) >= ALIKE_SHARE:
            yield CountWarning(
                f"{np.mean(common):.0%} of {len(common):,} counts are those of {days} days before",
                "the same people would count twice, on days when others came",
                "the file of these days; if the counter sent the same numbers: --yes",
                is_sure=True,
            )
            return


def _stuck(table: pd.DataFrame) -> Iterator[CountWarning]:
    n = table["n"].to_numpy()
    run = 1 + np.arange(len(n)) - np.maximum.accumulate(np.where(np.diff(n, prepend=np.nan) != 0, np.arange(len(n)), 0))
    run[n < SAME_LEAST] = 0
    if len(run) and run.max() >= SAME_RUN:
        last = int(run.argmax())
        yield CountWarning(
            f"{int(run.max())} intervals in a row have {n[last]:,.0f} people, until {table['day'].iloc[last]}",
            "a counter that hangs repeats its last number",
            "look at the counter; leave the cells of these intervals empty, and add the file with --replace",
        )


def _history(table: pd.DataFrame, known: pd.DataFrame) -> pd.DataFrame:
    """Return the counts of the line around those of the file, on the same weekdays; empty where they are too few."""
    around_ms = WEEKS * 7 * 86_400_000
    begin_ms, end_ms = table["ts_ms"].min() - around_ms, table["ts_ms"].max() + around_ms
    near = known[known["ts_ms"].between(begin_ms, end_ms) & known["weekday"].isin(table["weekday"].unique())]
    return near if near["day"].nunique() >= DAYS_MIN else near.iloc[:0]


def _span(table: pd.DataFrame) -> str:
    first, last = table["day"].min(), table["day"].max()
    return f"{first}" if first == last else f"{first} to {last}"


def _clock(table: pd.DataFrame, near: pd.DataFrame) -> Iterator[CountWarning]:
    usual, now = _hourly(near, "n"), _hourly(table, "n")
    if table["day"].nunique() < CLOCK_DAYS or (~np.isnan(usual) & ~np.isnan(now)).sum() < HOURS_MIN:
        return
    here = _correlation(usual, now)
    shifted = {hours: _correlation(usual, np.roll(now, -hours)) for hours in range(-12, 13) if hours}
    best = max(shifted, key=lambda hours: (shifted[hours], -abs(hours)))
    if abs(best) > 1 and shifted[best] - here >= CLOCK_GAIN:
        yield CountWarning(
            f"{_span(table)}: the day looks as usual if its times are {abs(best)} hours "
            f"{'earlier' if best > 0 else 'later'} (correlation by hour {shifted[best]:.2f}, as read {here:.2f})",
            "a counter on another clock gives people to the wrong hours and days",
            "--zone with the zone of the file's times, such as --zone UTC; if the hours are right: --yes",
            is_sure=True,
        )


def _people(line_id: str, table: pd.DataFrame, near: pd.DataFrame) -> Iterator[CountWarning]:
    usual, now = _hourly(near, "n"), _hourly(table, "n")
    is_both = ~np.isnan(usual) & ~np.isnan(now)
    before, people = float(usual[is_both].sum()), float(now[is_both].sum())
    times = max(people + 1, before + 1) / min(people + 1, before + 1)
    if max(people, before) >= PEOPLE_MIN and times > TIMES:
        more = f"{times:.1f} times {'as many people as' if people > before else 'fewer people than'}"
        yield CountWarning(
            f"{_span(table)}: {more} usual in the same hours: {people:,.0f} a day, {before:,.0f} on these weekdays",
            "another counter, another unit or a covered counter looks so; a fair or a closed street does, too",
            f"compare the file with what you know of {line_id}, and add a corrected one with --replace",
        )


def _ways(table: pd.DataFrame, near: pd.DataFrame) -> Iterator[CountWarning]:
    halves = [_hourly(near[near["day"].isin(days)], "net") for days in np.array_split(near["day"].unique(), 2)]
    is_steady = _correlation(*halves) >= -TURNED
    turned = _correlation(_hourly(near, "net"), _hourly(table, "net"))
    if table["day"].nunique() >= CLOCK_DAYS and is_steady and turned <= TURNED:
        yield CountWarning(
            f"{_span(table)}: people go the other way round, hour by hour (correlation {turned:.2f})",
            "who came in would count as who went out, and people inside would be below none",
            "the column of --left for --right and that of --right for --left, and --replace",
        )


def _hourly(table: pd.DataFrame, column: str) -> Floats:
    """Return the mean sum of each local hour over the days, shape (24,); NaN for an hour that was never counted."""
    by_day = table.groupby(["day", "hour"])[column].sum(min_count=1)
    return by_day.groupby("hour").mean().reindex(range(24)).to_numpy(dtype=np.float64)


def _correlation(a: Floats, b: Floats) -> float:
    """Return the correlation of two days by hour; 0 where fewer than 6 hours are known of both or one does not vary."""
    is_both = ~np.isnan(a) & ~np.isnan(b)
    a, b = a[is_both], b[is_both]
    return float(np.corrcoef(a, b)[0, 1]) if len(a) >= 6 and a.std() > 0 and b.std() > 0 else 0.0
