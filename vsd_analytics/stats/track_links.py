"""Links between tracks that end and tracks that begin, by time and walking speed, less those that chance gives.

Where no camera looks, nobody can be followed. A track that begins where and when a walker would come out again may be
the same person's, or anybody's. Each end is given at most one start, those first that fit a usual walker best. The same
with time running backwards, starts *before* the end, can only be chance; what time running forwards has more is people.
No pair is said to be one person.

Sources: correction for chance: Abbott, J. Econ. Entomol. 18 (1925); walking speeds: Weidmann, Transporttechnik der
Fussgänger (1993).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.next_area import MIN_LEAVING
from vsd_analytics.stats.quantiles import t_quantile

SLOWEST_M_PER_S: Final = 0.6
FASTEST_M_PER_S: Final = 2.2
"""Walking speeds of nearly everybody, along the straight line (Weidmann: 1.34 on average, standard deviation 0.26)."""
USUAL_M_PER_S: Final = 1.34
SLACK_S: Final = 2.0
"""A record of either track may be missing, and clocks of two cameras may differ."""
FARTHEST_M: Final = 30.0
"""Nobody is sought farther away: too many others fit there."""
SAME_CAMERA_M: Final = 1.5
"""Shorter gaps within one camera's view are tracks that were cut, which shares of flow already count as lost."""

IN_WAVES: Final = "flow.waves"
MAX_CHANCE: Final = 0.8
"""Share of ends with a start that fits by chance, above which too few are left to tell people from chance."""

WAVE_S: Final = 30.0
"""People within so many seconds of each other may be of one wave: out of one lift, or of one lecture that ended."""
AROUND_S: Final = 300.0
"""How many people there are at that time of the day is known from so many seconds around."""
MAX_COMPANY: Final = 1.5
"""Others of one wave on average, at both places, from which one cause may send people to both: couples are fewer."""

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class TrackEnds:
    """One end of some tracks, one element each.

    Attributes:
        at_s: When, seconds from any instant.
        x_m, y_m: Where.
        area: Area left last, or entered first; any integers.
        camera: Camera number.
        day: Day, 0 to n_days - 1.
    """

    at_s: Array
    x_m: Array
    y_m: Array
    area: Ints
    camera: Ints
    day: Ints


@dataclass(frozen=True, slots=True, eq=False)
class LinkCounts:
    """Ends by day and area, and those of them that were given a start.

    Attributes:
        ends: Ends, shape (n_areas, n_days).
        forward: Those given a later start, shape (n_areas, n_areas, n_days): from, to, day.
        backward: Those given an earlier start, same shape.
        company_of_ends, company_of_starts: How many others a person of the area comes with, beyond chance, shape
            (n_areas,).
    """

    ends: Array
    forward: Array
    backward: Array
    company_of_ends: Array
    company_of_starts: Array


@dataclass(frozen=True, slots=True)
class LinkedShare:
    """Share of those who leave one area that is estimated to enter another one over floor where nobody is followed.

    Attributes:
        value: Links more than chance gives / people who leave, 0 to 1; None when unknown.
        lo, hi: Limits of its interval; None without one.
        n_links: Ends that were given a later start.
        n_chance: Ends that were given an earlier start.
        n: People who leave.
        reason: Why there is no value or no interval.
    """

    value: float | None
    lo: float | None
    hi: float | None
    n_links: int
    n_chance: int
    n: int
    reason: Reason | None

    @property
    def possible(self) -> float:
        """The share that the links more than chance gives come to, also where they may have another cause."""
        return self.value if self.value is not None else max(0, self.n_links - self.n_chance) / max(1, self.n)


def link_counts(ends: TrackEnds, starts: TrackEnds, *, n_areas: int, n_days: int) -> LinkCounts:
    """Return how many ends are given a later start that a walker could reach, and how many an earlier one.

    A pair fits where distance / FASTEST_M_PER_S - SLACK_S / 2 <= time between <= distance / SLOWEST_M_PER_S + SLACK_S,
    at most `FARTHEST_M` apart. Pairs are taken in the order of how far the time is from distance / USUAL_M_PER_S; each
    end and each start is used once. A start that goes on where a track of the same camera was cut is none.

    Args:
        ends: Where tracks end that left an area.
        starts: Where tracks begin that enter an area.
        n_areas: How many areas there are.
        n_days: How many days there are.
    """
    reach_s = FARTHEST_M / SLOWEST_M_PER_S + SLACK_S
    end, start = _near_in_time(ends, starts, reach_s)
    between_s = starts.at_s[start] - ends.at_s[end]
    away_m = np.hypot(starts.x_m[start] - ends.x_m[end], starts.y_m[start] - ends.y_m[end])
    is_same = starts.camera[start] == ends.camera[end]
    is_cut = is_same & (away_m < SAME_CAMERA_M) & (between_s > 0) & (between_s <= SLACK_S)
    goes_on = np.zeros(len(starts.at_s), dtype=np.bool_)
    goes_on[start[is_cut]] = True
    takes_s = np.abs(between_s)
    fits = (
        (takes_s > 0)
        & (away_m <= FARTHEST_M)
        & (takes_s >= away_m / FASTEST_M_PER_S - SLACK_S / 2)
        & (takes_s <= away_m / SLOWEST_M_PER_S + SLACK_S)
        & (~is_same | (away_m >= SAME_CAMERA_M))
        & ~goes_on[start]
    )
    misfit = np.abs(takes_s - away_m / USUAL_M_PER_S)
    links = []
    for way in (between_s > 0, between_s < 0):
        chosen = np.flatnonzero(fits & way)
        chosen = chosen[np.argsort(misfit[chosen], kind="stable")]
        given = chosen[_one_to_one(end[chosen], start[chosen])]
        counts = np.zeros((n_areas, n_areas, n_days))
        np.add.at(counts, (ends.area[end[given]], starts.area[start[given]], ends.day[end[given]]), 1.0)
        links.append(counts)
    every = np.zeros((n_areas, n_days))
    np.add.at(every, (ends.area, ends.day), 1.0)
    return LinkCounts(
        ends=every,
        forward=links[0],
        backward=links[1],
        company_of_ends=_company(ends, n_areas),
        company_of_starts=_company(starts, n_areas),
    )


def linked_share(
    counts: LinkCounts,
    origin: int,
    to: int,
    left: npt.ArrayLike,
    *,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> LinkedShare:
    """Return the share of those who leave one area that is linked to another one.

    With f_b, g_b the shares of ends given a later, and an earlier start that enters b, f and g their sums: an end is a
    person's who went on, p, or is given a start by chance, so f = p + (1 - p) g, p = (f - g) / (1 - g), and
    p_b = f_b - (1 - p) g_b; times ends / people who leave. Limits: jackknife over days, t quantile of D - 1 degrees of
    freedom; never narrower than Poisson counts. The upper one also holds the case that no start is given by chance: in
    a crowd, starts given by chance are lacking for those who went on.

    Unknown where people leave the area and enter the other one in waves (`MAX_COMPANY`): times alone cannot tell people
    who walk from one cause, such as the end of a lecture, that sends others to the second place.

    Args:
        counts: Of all ends.
        origin: The area that people leave.
        to: The area that they enter.
        left: People who leave it by day, shape (n_days,).
        confidence: Confidence level.
        min_days: Days with people who leave that an interval needs.
    """
    leaving = np.asarray(left, dtype=np.float64)
    ahead, behind = counts.forward[origin], counts.backward[origin]
    n, used = int(leaving.sum()), np.flatnonzero(leaving)
    totals = int(ahead[to].sum()), int(behind[to].sum()), n

    def share(is_used: Array) -> float:
        ends, people = float(counts.ends[origin] @ is_used), float(leaving @ is_used)
        if not ends or not people:
            return 0.0
        f, g = (v @ is_used / ends for v in (ahead, behind))
        goes_on = max(0.0, (float(f.sum()) - float(g.sum())) / max(1 - float(g.sum()), 1 - MAX_CHANCE))
        return float(f[to] - (1 - min(goes_on, 1.0)) * g[to]) * ends / people

    if n < MIN_LEAVING:
        return LinkedShare(None, None, None, *totals, Reason("flow.few", least=MIN_LEAVING, has=n))
    if behind.sum() > MAX_CHANCE * counts.ends[origin].sum():
        return LinkedShare(None, None, None, *totals, Reason("flow.crowd"))
    if min(counts.company_of_ends[origin], counts.company_of_starts[to]) >= MAX_COMPANY:
        return LinkedShare(None, None, None, *totals, Reason(IN_WAVES))
    every = np.ones(len(leaving))
    value, n_days = share(every), len(used)
    shown = min(max(value, 0.0), 1.0)
    if n_days < min_days:
        return LinkedShare(shown, None, None, *totals, Reason("flow.days", least=min_days, has=n_days))
    without = np.array([share(every - (np.arange(len(leaving)) == d)) for d in used])
    variance = (n_days - 1) / n_days * float(((without - without.mean()) ** 2).sum())
    least = float(ahead[to].sum() + behind[to].sum()) / n**2
    half = t_quantile(n_days - 1, confidence=confidence) * math.sqrt(max(variance, least))
    most = max(shown, float(ahead[to].sum()) / n)
    return LinkedShare(shown, min(max(0.0, value - half), shown), min(1.0, most + half), *totals, None)


def _company(track_ends: TrackEnds, n_areas: int) -> Array:
    """Return how many others come within `WAVE_S` of a person, by area, less those of an even stream around them.

    The stream is that of `AROUND_S` before and after, without the wave itself.
    """
    company = np.zeros(n_areas)
    for area in range(n_areas):
        at_s = np.sort(track_ends.at_s[track_ends.area == area])
        if not len(at_s):
            continue
        near, around = (
            np.searchsorted(at_s, at_s + s, side="right") - np.searchsorted(at_s, at_s - s) - 1.0
            for s in (WAVE_S, AROUND_S)
        )
        company[area] = (near - (around - near) * WAVE_S / (AROUND_S - WAVE_S)).mean()
    return company


def _near_in_time(ends: TrackEnds, starts: TrackEnds, reach_s: float) -> tuple[Ints, Ints]:
    """Return the pairs of an end and a start that are at most so far apart in time."""
    order = np.argsort(starts.at_s, kind="stable")
    begins = starts.at_s[order]
    first, last = (np.searchsorted(begins, ends.at_s + s) for s in (-reach_s, reach_s))
    n = last - first
    end = np.repeat(np.arange(len(n)), n)
    if not len(end):
        return end, end
    return end, order[np.repeat(first - np.concatenate(([0], n.cumsum()[:-1])), n) + np.arange(n.sum())]


def _one_to_one(end: Ints, start: Ints) -> Ints:
    """Return which pairs, in this order, use an end and a start that none before has used."""
    used_ends, used_starts, given = set[int](), set[int](), []
    for k, (e, s) in enumerate(zip(end.tolist(), start.tolist(), strict=True)):
        if e not in used_ends and s not in used_starts:
            used_ends.add(e)
            used_starts.add(s)
            given.append(k)
    return np.array(given, dtype=np.int64)
