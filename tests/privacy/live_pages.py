"""What a reader learns from the live page, who looks at it in every minute and knows how its bands are made."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
from privacy import hidden_counts as hidden
from privacy import person_times
from privacy.hidden_counts import HOURS, N_DAYS, World
from privacy.person_times import Times

from vsd_analytics.figures.now import READ_BEFORE, first_day, now, relations, usual_day
from vsd_analytics.figures.share.now import Band
from vsd_analytics.warehouse.warehouse import open_warehouse

QUARTERS = 4
Interval = tuple[float, float]


def people_told(band: Band) -> Interval:
    """Return the least and greatest number of people behind a band, beside what is usual or in steps."""
    if band.about is not None:
        step = band.below or 0.5
        return max(float(band.below), band.about - step - 0.5), band.about + step + 0.5
    if band.hi is None:
        return 0.0, float(band.below)
    low = float(band.below) if band.lo is None else band.lo
    return {"above": (band.hi, np.inf), "within": (low, band.hi)}.get(band.crowd or "", (0.0, low))


def read_live(known: Times, world: World, week: int) -> None:
    """Add what the pages of every minute of a week tell of the hours of its floor.

    A quarter-hour gives an interval of its person-hours; the sums of these are all that is told of an hour. Days on
    which a camera was down or lost minutes are left out: their people are made up for, so they tell less.
    """
    site = world.site
    [floor] = [f.floor_id for f in site.floors]
    for day in range(N_DAYS):
        if any((week, c, day) in world.lost for c in range(2)) or any(
            k[0] == week and k[2] == day for k in world.cut_h
        ):
            continue
        on = hidden.monday(week) + timedelta(days=day)
        with open_warehouse(site, first_day(on), on, relations=READ_BEFORE) as warehouse:
            usual = usual_day(warehouse, on, floor_id=floor)
        with open_warehouse(site, on, on, relations=relations(site)) as warehouse:
            for hour in range(*HOURS):
                start = datetime(on.year, on.month, on.day, hour, tzinfo=site.zone)
                of_minutes = [now(warehouse, usual, start + timedelta(minutes=m)) for m in range(16, 16 + 60)]
                told = {page.start: people_told(page.people) for page in of_minutes if page.people is not None}
                assert len(told) == QUARTERS
                low, high = (sum(ends) / QUARTERS for ends in zip(*told.values(), strict=True))
                keys = person_times.keys_of(week, days=[day], hour=hour)
                known.rows.append((dict.fromkeys(keys, 1.0), low, min(high, 200.0), f"live {week} {day} {hour}"))
