"""The timetable: violations by local hour, states, averages, and the busiest hour."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

import numpy as np

from vsd_analytics.figures.close_time import close_time_share_by_hour
from vsd_analytics.figures.share.weeks import timetable_hours
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_estimate import same_fields
from vsd_analytics.figures.week.results import BusiestHour, DayMean, HourCell, HourMean, Timetable


@dataclass(frozen=True, slots=True, kw_only=True)
class WeekTimetable:
    """The hours of a week, ready to print.

    Attributes:
        when: The timetable.
        busiest: The full hour with most violations, of those that may be printed; None without a full hour.
    """

    when: Timetable
    busiest: BusiestHour | None


def timetable(data: WeekData) -> WeekTimetable:
    """Return the hours of the week in which the site opens on any day, with their states and counts.

    A count from 1 to under `mask_below` is held back. Averages are made of what is printed, with the middle of 1 to
    `mask_below` - 1 for such hours, so that they tell nothing more. An hour of few people has no share of time too
    close.
    """
    cells = _cells(data)
    full = [(c, _printed(c, data)) for c in cells if c.state == "full"]
    known = [(c, n) for c, n in full if n is not None]
    by_day = [_mean([n for c, n in known if c.day == day]) for day in data.week_days]
    open_hours = sorted({c.hour for c in cells})
    by_hour = [_mean([n for c, n in known if c.hour == hour]) for hour in open_hours]
    when = Timetable(
        cells=cells,
        day_means=tuple(DayMean(day=d, value=v, hours=n) for d, (v, n) in zip(data.week_days, by_day, strict=True)),
        hour_means=tuple(HourMean(hour=h, value=v, hours=n) for h, (v, n) in zip(open_hours, by_hour, strict=True)),
        busiest_day=busiest_day({(c.day, c.hour): n for c, n in known if not c.fold}),
    )
    return WeekTimetable(when=when, busiest=_busiest(known))


def busiest_day(known: Mapping[tuple[date, int], float]) -> date | None:
    """Return the day with more violations than every other day in the hours that both have; None where no day has.

    Averages of days with other hours do not say it: a Sunday that opens only for its busy hours has a high one.

    Args:
        known: Violations of full hours by local day and hour.
    """
    days = sorted({day for day, _ in known})

    def is_above(day: date, other: date) -> bool:
        both = [hour for d, hour in known if d == day and (other, hour) in known]
        return bool(both) and sum(known[day, h] for h in both) > sum(known[other, h] for h in both)

    busiest = [day for day in days if all(is_above(day, other) for other in days if other != day)]
    return busiest[0] if len(days) > 1 and busiest else None


def _states(data: WeekData) -> dict[int, Mapping[str, Any]]:
    """Return the floor's rows of `hour_states` by start of the hour, in UTC milliseconds."""
    rows = data.warehouse.rows(
        "select hour_start_ms, state, recorded_share, cameras_down from hour_states "
        "where floor_id = $floor and local_date between $first and $last",
        {"floor": data.floor.floor_id, "first": data.monday, "last": data.sunday},
    )
    return {row["hour_start_ms"]: row for row in rows}


def _cells(data: WeekData) -> tuple[HourCell, ...]:
    hours, states = data.hours, _states(data)
    is_known = data.why_no_violations is None
    held = data.hidden.hours
    close_time_share = close_time_share_by_hour(data.this)
    close_time_share[[*data.hidden.untimed]] = np.nan
    cells = []
    for i in timetable_hours(data, data.this):
        recorded = states[int(hours.start_ms[i])]
        state, share = recorded["state"], recorded["recorded_share"]
        is_open = state != "closed"
        if is_open and data.not_over_ms is not None and hours.start_ms[i] >= data.not_over_ms:
            state, share = "not_over", None
        is_counted = is_known and state not in ("no_data", "closed", "not_over")
        n = int(data.whole.n[:, i].sum()) if is_counted and i not in held else None
        cells.append(
            HourCell(
                day=date.fromordinal(int(hours.day[i])),
                hour=int(hours.hour[i]),
                fold=int(hours.fold[i]),
                start=data.local(int(hours.start_ms[i])),
                state=state,
                violations=n,
                is_masked=is_counted and i in held.small,
                is_held_back=is_counted and i in held.others,
                scaled=n / share if n is not None and state == "low_data" else None,
                close_time_share=float(close_time_share[i])
                if n is not None and np.isfinite(close_time_share[i])
                else None,
                share=share if is_open else None,
                cameras_down=recorded["cameras_down"] if state not in ("closed", "not_over") else 0,
            )
        )
    return tuple(cells)


def _printed(cell: HourCell, data: WeekData) -> float | None:
    """Return the count a reader knows of a cell; the middle of the small counts for a masked one."""
    return data.mask.middle if cell.is_masked else cell.violations


def _mean(values: Sequence[float]) -> tuple[float | None, int]:
    return (sum(values) / len(values) if values else None), len(values)


def _busiest(known: Sequence[tuple[HourCell, float]]) -> BusiestHour | None:
    best = max(known, key=lambda item: item[1], default=None)
    if best is None or best[1] == 0:
        return None
    cell, n = best
    mean, _ = _mean([value for _, value in known])
    return same_fields(BusiestHour, cell, ratio_to_mean=None if cell.is_masked or not mean else n / mean)
