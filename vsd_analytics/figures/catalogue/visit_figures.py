"""Visits of areas that ask for them: how many an hour (M35), and how long they last (M36)."""

from __future__ import annotations

from typing import Final

from vsd_analytics.figures.catalogue.form import Asked, Row, figure, missing
from vsd_analytics.figures.visits import AreaVisits, visits
from vsd_analytics.figures.week.results import Figure
from vsd_analytics.result import Reason

PER_HOUR: Final = "visits per open hour"
SECONDS: Final = "seconds; share of visits"


@figure("M35")
def visits_per_open_hour(asked: Asked) -> Figure:
    """Return the visits of each area per open hour, by entries that were seen; areas with few visits have no value."""
    found = visits(asked.data.this)
    rows: list[Row] = []
    for of in found:
        shown = not asked.small(of.dwell.n_visits) and of.often.rate is not None
        rows.append(
            {
                "area": of.area.area_id,
                "place": of.area.name,
                "value": of.often.rate if shown else None,
                "lo": of.often.lo if shown else None,
                "hi": of.often.hi if shown else None,
                "recorded_share": of.recorded_share,
                "reason": of.often.reason,
            }
        )
    if all(row["value"] is None for row in rows):
        return missing(PER_HOUR, "not_enough_data", _few(found))
    return Figure(unit=PER_HOUR, rows=tuple(rows), denominator=asked.recorded_h, note=Reason("note.visits"))


@figure("M36")
def dwell_times(asked: Asked) -> Figure:
    """Return how long visits of each area last: median, 90 % quantile, share of long ones, and the mean by two ways."""
    found = visits(asked.data.this)
    rows: list[Row] = []
    for of in found:
        place = {"area": of.area.area_id, "place": of.area.name}
        if asked.small(of.dwell.n_visits) or of.dwell.median.value_s is None:
            rows.append({**place, "what": "median", "value": None, "reason": of.dwell.reason})
            continue
        for what, q in (("median", of.dwell.median), ("90 % leave within", of.dwell.p90)):
            rows.append({**place, "what": what, "value": q.value_s, "lo": q.lo_s, "hi": q.hi_s})
        long, little = of.dwell.long_share, of.dwell.little
        share = {"longer_than_s": of.long_visit_s, "value": long.value, "lo": long.lo, "hi": long.hi}
        rows.append({**place, "what": "share of long visits", "unit": "share", **share, "reason": long.reason})
        for what, mean in (("mean by tracks", little.by_tracks), ("mean by Little's law", little.by_little)):
            rows.append({**place, "what": what, "value": mean.value_s, "lo": mean.lo_s, "hi": mean.hi_s,
                         "agrees": little.agrees, "reason": mean.reason})  # fmt: skip
    if all(row["value"] is None for row in rows):
        return missing(SECONDS, "not_enough_data", _few(found))
    n_visits = sum(of.dwell.n_visits for of in found if not asked.small(of.dwell.n_visits))
    return Figure(unit=SECONDS, rows=tuple(rows), denominator=n_visits, note=Reason("note.visits"))


def _few(found: tuple[AreaVisits, ...]) -> Reason | None:
    """Return why no area has visits to print: the reason of the first."""
    return next((of.dwell.reason or of.often.reason for of in found), None)
