"""The fair comparison of floors: which of them really differ in the share of time that people spend too close.

Made from `close_by_crowding` of the JSON files of the ten weeks on the page: observed over expected at the same
crowding (`stats.standard_ratio`), against how floors usually differ (`stats.funnel`), pulled towards their mean
(`stats.shrinkage`). Missing is not zero: a week in which some camera recorded too little is left out, and a floor that
lost more than half of its weeks so is shown, but never said to differ.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import Any, Final, Literal

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.close_by_crowding import EDGES
from vsd_analytics.figures.week.results import CloseByCrowding
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.site_index.floor_weeks import FloorKey, FloorWeeks
from vsd_analytics.site_index.read_reports import IndexedReport
from vsd_analytics.stats.funnel import Funnel, funnel
from vsd_analytics.stats.quantiles import t_quantile, z_quantile
from vsd_analytics.stats.shrinkage import Pulled, pull_limited
from vsd_analytics.stats.standard_ratio import SiteTime, StandardRatio, known_shares, standard_ratios
from vsd_analytics.wording.reasons import text_or_none

CONFIDENCE: Final = 0.95
LEAST_KNOWN: Final = 0.8
"""Share of a floor's person-time that must lie in classes of crowding which others know."""
LEAST_WEEKS: Final = 0.5
"""Share of its weeks that a floor must have recorded well enough."""
FloorStatus = Literal["compared", "gaps", "older", "distance", "few", "nobody", "alone", "reason", "absent"]
"""Why a floor is compared or not; "reason": its files say why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedFloor:
    """One floor of the comparison.

    Attributes:
        key: Identifies it.
        name: Name of its site, and of the floor where the site has several.
        status: Whether it is compared, or why not.
        reason: Why its files have no time too close by crowding, with status "reason".
        n_weeks: Weeks used.
        n_left_out: Weeks left out, as some camera recorded too little.
        unrecorded: Share of open camera-hours not recorded in all its weeks; None without any.
        person_h: Person-hours of the weeks used.
        ratio: Time too close over that of a usual floor at the same crowding; None where it cannot be said.
        lo, hi: Its likely range, from its own days and weeks.
        said: What is said of it: the ratio pulled towards the mean of the usual floors; of a floor that differs its
            own, with a wider range. None where it is not compared.
        differs: It really differs.
    """

    key: FloorKey
    name: str
    status: FloorStatus
    reason: Reason | None = None
    n_weeks: int = 0
    n_left_out: int = 0
    unrecorded: float | None = None
    person_h: float = 0.0
    ratio: float | None = None
    lo: float | None = None
    hi: float | None = None
    said: Pulled | None = None
    differs: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteComparison:
    """All floors of the index, compared.

    Attributes:
        floors: By name, never by ratio.
        usual_sd: Usual standard deviation between floors, log scale; None with fewer than four floors compared.
        distance_m: The legal distance of the floors compared.
    """

    floors: tuple[ComparedFloor, ...]
    usual_sd: float | None
    distance_m: float

    @property
    def usual_reach(self) -> float | None:
        """Return how many times a usual floor lies above or below the mean at most; None without `usual_sd`."""
        return None if self.usual_sd is None else math.exp(z_quantile(confidence=CONFIDENCE) * self.usual_sd)

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain values, as `vsd site build --json` prints it."""
        return {
            "distance_m": self.distance_m,
            "usual_sd": _rounded(self.usual_sd),
            "floors": [_plain(f) for f in self.floors],
        }


@dataclass(frozen=True, slots=True, eq=False)
class _FloorTime:
    """A floor and its usable weeks as arrays; `time` is None where there is no ratio."""

    shown: ComparedFloor
    time: SiteTime | None


def compare_sites(floors: Sequence[FloorWeeks], latest: date) -> SiteComparison | None:
    """Return the comparison of all floors over the ten weeks that end with one.

    Args:
        floors: All floors.
        latest: Monday of the last week.

    Returns:
        None with fewer than two floors.
    """
    if len(floors) < 2:
        return None
    reports = {f.key: [r for _, r in f.window(latest) if r is not None] for f in floors}
    rules = Counter(r.rules.distance_m for floor_reports in reports.values() for r in floor_reports)
    distance_m = max(rules, key=lambda d: (rules[d], d), default=DEFAULTS.distance_m)
    names = _names(floors)
    floor_times = [_floor_time(f.key, names[f.key], reports[f.key], distance_m) for f in floors]
    shown, usual_sd = _compared(_without_lonely(floor_times))
    return SiteComparison(
        floors=tuple(sorted(shown, key=lambda f: (f.name.casefold(), f.key))),
        usual_sd=usual_sd,
        distance_m=distance_m,
    )


def _names(floors: Sequence[FloorWeeks]) -> dict[FloorKey, str]:
    n_floors = Counter((f.key.project, f.key.site_id) for f in floors)
    return {f.key: f.site_name if n_floors[f.key[:2]] == 1 else f.full_name for f in floors}


def _floor_time(key: FloorKey, name: str, reports: Sequence[IndexedReport], distance_m: float) -> _FloorTime:
    """Return what the weeks of a floor say, before it is seen beside others."""
    shown = ComparedFloor(key=key, name=name, status="compared", unrecorded=_unrecorded(reports))
    if not reports:
        return _FloorTime(replace(shown, status="absent"), None)
    alike = [r for r in reports if r.rules.distance_m == distance_m]
    if not alike:
        return _FloorTime(replace(shown, status="distance"), None)
    if not any(_is_of_today(r.close_by_crowding) for r in alike) and any(r.state != "no_data" for r in alike):
        return _FloorTime(replace(shown, status="older"), None)
    known = [r for r in alike if r.state == "no_data" or _is_of_today(r.close_by_crowding)]
    whole = [r for r in known if is_whole(r)]
    n_gaps = len(known) - len(whole)
    is_gappy = len(known) > 0 and len(whole) < LEAST_WEEKS * len(known)
    used = [r for r in (known if is_gappy else whole) if (c := r.close_by_crowding) is not None and c.state == "ok"]
    shown = replace(shown, n_weeks=len(used), n_left_out=0 if is_gappy else n_gaps)
    if is_gappy:
        shown = replace(shown, status="gaps", n_left_out=n_gaps)
    elif not used:
        why = next((c.reason for r in reversed(whole) if (c := r.close_by_crowding) is not None), None)
        return _FloorTime(replace(shown, status="reason", reason=why), None)
    time = _time([(r.week.monday, c) for r in used if (c := r.close_by_crowding) is not None])
    if time is None:
        return _FloorTime(shown, None)
    shown = replace(shown, person_h=float(time.person_h.sum()))
    if len(time.close_h) < DEFAULTS.min_days or shown.person_h < DEFAULTS.min_exposure_h:
        return _FloorTime(shown if is_gappy else replace(shown, status="few"), None)
    if not time.close_h.any():
        return _FloorTime(shown if is_gappy else replace(shown, status="nobody"), None)
    return _FloorTime(shown, time)


def _is_of_today(crowding: CloseByCrowding | None) -> bool:
    return crowding is not None and crowding.edges in ((), EDGES)


def is_whole(report: IndexedReport) -> bool:
    """Tell whether each camera of a week recorded so much of its open hours that the floor can be judged."""
    least = report.rules.min_coverage
    shares = [c.share for c in report.coverage.cameras if c.share is not None] or [report.coverage.share]
    return report.state != "no_data" and min(shares) >= least


def _unrecorded(reports: Sequence[IndexedReport]) -> float | None:
    cameras = [c for r in reports for c in r.coverage.cameras]
    scheduled_h = sum(c.scheduled_h for c in cameras)
    if scheduled_h:
        return max(0.0, 1 - sum(c.recorded_h for c in cameras) / scheduled_h)
    return 1 - sum(r.coverage.share for r in reports) / len(reports) if reports else None


def _time(weeks: Sequence[tuple[date, CloseByCrowding]]) -> SiteTime | None:
    """Return the days of all weeks below each other; None without a day."""
    days = [(monday.toordinal(), d) for monday, c in weeks for d in c.days]
    if not days:
        return None
    groups = [g for _, c in weeks for g in c.classes]
    return SiteTime(
        close_h=np.array([d.close_h for _, d in days]),
        person_h=np.array([d.person_h for _, d in days]),
        week=np.array([monday for monday, _ in days], dtype=np.int64),
        classes=np.array([(g.first, g.last) for g in groups], dtype=np.int64).reshape(-1, 2),
        class_close_h=np.array([g.close_h for g in groups]),
    )


def _without_lonely(floor_times: Sequence[_FloorTime]) -> list[_FloorTime]:
    """Return the floors, those as crowded as no others marked "alone": nobody knows what to expect there."""
    left = list(floor_times)
    while True:
        compared = [k for k, f in enumerate(left) if f.shown.status == "compared" and f.time is not None]
        times = [t for k in compared if (t := left[k].time) is not None]
        shares = known_shares(times).tolist() if times else []
        worst = min(zip(shares, compared, strict=True), default=(1.0, -1))
        if worst[0] >= LEAST_KNOWN:
            return left
        left[worst[1]] = _FloorTime(replace(left[worst[1]].shown, status="alone"), None)


def _compared(floor_times: Sequence[_FloorTime]) -> tuple[list[ComparedFloor], float | None]:
    """Return the floors with their ratios, and how floors usually differ."""
    solid = [f for f in floor_times if f.time is not None and f.shown.status == "compared"]
    hollow = [f for f in floor_times if f.time is not None and f.shown.status == "gaps" and _is_known(f.time, solid)]
    plain = [f.shown for f in floor_times if f not in solid and f not in hollow]
    if not solid:
        return plain, None
    ratios = standard_ratios(_times(solid), beside=_times(hollow))
    own = ratios[: len(solid)]
    seen = funnel([math.log(r.ratio) for r in own], [r.variance for r in own], [r.df for r in own])
    middle = 0.0 if seen is None else seen.middle
    shown = [_with_ratio(f.shown, r, middle) for f, r in zip([*solid, *hollow], ratios, strict=True)]
    if seen is None:
        return [*plain, *shown], None
    return [*plain, *_judged(shown[: len(solid)], own, seen), *shown[len(solid) :]], seen.tau


def _is_known(time: SiteTime, solid: Sequence[_FloorTime]) -> bool:
    return float(known_shares([*_times(solid), time])[-1]) >= LEAST_KNOWN


def _times(floors: Sequence[_FloorTime]) -> list[SiteTime]:
    return [f.time for f in floors if f.time is not None]


def _with_ratio(shown: ComparedFloor, standard_ratio: StandardRatio, middle: float) -> ComparedFloor:
    ratio, reach = standard_ratio.ratio / math.exp(middle), _reach(standard_ratio, CONFIDENCE)
    return replace(shown, ratio=ratio, lo=ratio / reach, hi=ratio * reach)


def _reach(standard_ratio: StandardRatio, confidence: float) -> float:
    return math.exp(t_quantile(standard_ratio.df, confidence=confidence) * math.sqrt(standard_ratio.variance))


def _judged(shown: Sequence[ComparedFloor], own: Sequence[StandardRatio], seen: Funnel) -> list[ComparedFloor]:
    """Return the floors with what is said of them: usual ones pulled towards their mean, those that differ as found.

    Those that differ are not of the others' kind, so nothing pulls them. As they were chosen for their ratio, their
    ranges have a confidence of 1 - .05 R / k, R the number named (Benjamini & Yekutieli, Journal of the American
    Statistical Association 100, 2005).
    """
    is_usual = (~seen.differs).tolist()
    usual = [r for r, u in zip(own, is_usual, strict=True) if u]
    logs = [math.log(r.ratio) - seen.middle for r in usual]
    pulled = iter(
        pull_limited(logs, [r.variance for r in usual], [r.df for r in usual], tau=seen.tau, confidence=CONFIDENCE)
    )
    chosen = 1 - (1 - CONFIDENCE) * (len(shown) - len(usual)) / len(shown)
    judged = []
    for floor, standard_ratio, differs in zip(shown, own, seen.differs.tolist(), strict=True):
        ratio, reach = floor.ratio or 1.0, _reach(standard_ratio, chosen)
        estimate = Pulled(ratio, ratio / reach, ratio * reach, 1.0) if differs else next(pulled)
        judged.append(replace(floor, said=estimate, differs=differs))
    return judged


def _plain(floor: ComparedFloor) -> dict[str, Any]:
    estimate = floor.said
    return {
        "project": floor.key.project,
        "site": floor.key.site_id,
        "floor": floor.key.floor_id,
        "name": floor.name,
        "status": floor.status,
        "reason": text_or_none(floor.reason),
        "weeks": floor.n_weeks,
        "weeks_left_out": floor.n_left_out,
        "not_recorded": _rounded(floor.unrecorded),
        "person_hours": _rounded(floor.person_h),
        "ratio": _rounded(floor.ratio),
        "ratio_lo": _rounded(floor.lo),
        "ratio_hi": _rounded(floor.hi),
        "said": None if estimate is None else _rounded(estimate.value),
        "said_lo": None if estimate is None else _rounded(estimate.lo),
        "said_hi": None if estimate is None else _rounded(estimate.hi),
        "differs": floor.differs if floor.status == "compared" else None,
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")
