"""Who is together: whether track ids tell it at all, and which share of violations is between groups (M9).

The rules are SQL. Two tracks *walk* together (`sql/marts/pair_days.sql`, `track_groups.sql`) when they were close for
2 s and in 3 records, near for half of these, close for 60 % of the time either was seen, and walked 2 m meanwhile. They
*stand* together in a window of two minutes (`sql/staging/window_company.sql`, `stats/standing_company.py`) when they
stay close to each other and to those around them. Groups are the connected components. docs/statistics.md has what
both find of true groups. They need ids that last: of people whose ids change every 10 s most groups are missed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.quantiles import t_quantile, zero_events_limit

MIN_EVENTS: Final = 5
"""Fewer violations get no interval, as for rates."""
SMALL_COUNT: Final = 30
"""Below it days may agree by luck: an interval is never narrower than a binomial count's."""
MIN_TRACKS: Final = 30
"""Fewer ends of tracks do not tell whether ids are cut."""
LONG_SHARE: Final = 0.5
"""Share of person-time that ids of `together_life_s` and more must have."""


@dataclass(frozen=True, slots=True)
class Accuracy:
    """What the rule found of the true groups of recordings, lowest and highest over the scenes.

    Attributes:
        f1: Harmonic mean of precision and recall: of people who walk over pairs ever closer than 2 m, of people who
            stand over the pairs of each annotated instant.
        time_precision: Share of the violation time called within groups that is; of people who stand, of instants.
        time_recall: Share of the violation time within groups that is called so; likewise.
        scenes: How many recordings, of what.
        weakness: Where it is known to fail.
    """

    f1: tuple[float, float]
    time_precision: tuple[float, float]
    time_recall: tuple[float, float]
    scenes: Reason
    weakness: Reason


KNOWN_ACCURACY: Final = Accuracy(
    f1=(0.76, 0.96),
    time_precision=(0.74, 1.0),
    time_recall=(0.75, 0.99),
    scenes=Reason("groups.scenes"),
    weakness=Reason("groups.weakness"),
)
"""Held by tests on the recordings (tests/realdata). Of shops and queues only the simulator's parties are known."""


@dataclass(frozen=True, slots=True)
class TrackLives:
    """Whether track ids last long enough to tell who moves together.

    Attributes:
        n_tracks: Track ids, one site day each.
        median_life_s: Median of their lives, first to last record; None without tracks.
        long_share: Share of person-time in ids that live at least `together_life_s`; None without tracks.
        cut_share: Share of ids that end where another one begins right then, above what chance gives: ids that were
            cut; None where no end is known.
        state: "ok" where ids last: long_share is at least a half, or they live short because visits are short.
        reason: Why not.
    """

    n_tracks: int
    median_life_s: float | None
    long_share: float | None
    cut_share: float | None
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class ShareEstimate:
    """A share of counted things, and its interval from how days differ.

    Attributes:
        value: The share, 0 to 1; None when nothing was counted.
        lo, hi: Limits of the interval; None without one. After none (or all) of n: the one-sided limit 3 / n away.
        n: Counted things that have the property.
        of: Counted things.
        n_days: Days with any.
        state: "ok" when the share has a value and an interval.
        reason: Why not, or what is special.
    """

    value: float | None
    lo: float | None
    hi: float | None
    n: int
    of: int
    n_days: int
    state: State
    reason: Reason | None


def track_lives(
    life_s: npt.ArrayLike,
    exposure_s: npt.ArrayLike,
    *,
    n_ends: int,
    n_goes_on: int,
    n_came_before: int,
    min_life_s: float = DEFAULTS.together_life_s,
    max_cut_share: float = DEFAULTS.together_cut_share,
) -> TrackLives:
    """Return whether track ids last long enough to tell who moves together.

    They do where at least half of person-time is in ids of `min_life_s` or more. Where ids live shorter, visits may be
    short (a street crossed in 8 s), or ids cut. Where one is cut, another begins right there and right after. By chance
    others begin as often right before an end as right after, so

        cut_share = (n_goes_on - n_came_before) / n_ends.

    An engine that loses people for longer than reach (`facts/track_lives`) between two ids is not seen through.

    Args:
        life_s: Seconds each id lived, shape (n_tracks,).
        exposure_s: Person-seconds of each, same shape.
        n_ends: Ends of tracks at a known place.
        n_goes_on: Other tracks that begin within reach of an end, after it.
        n_came_before: The same before it.
        min_life_s: Life an id needs to be long.
        max_cut_share: Share of ids cut up to which short lives are taken as short visits.
    """
    lives, exposure = np.asarray(life_s, dtype=np.float64), np.asarray(exposure_s, dtype=np.float64)
    if len(lives) == 0 or exposure.sum() <= 0:
        return TrackLives(0, None, None, None, "not_enough_data", Reason("nobody.seen"))
    median, long_share = float(np.median(lives)), float(exposure[lives >= min_life_s].sum() / exposure.sum())
    cut_share = min(1.0, max(0.0, (n_goes_on - n_came_before) / n_ends)) if n_ends else None
    state: State = "ok"
    reason = None
    if long_share < LONG_SHARE:
        short = Reason("ids.short", median=median, share=long_share, least=min_life_s)
        if cut_share is not None and n_ends >= MIN_TRACKS and cut_share > max_cut_share:
            state = "not_measurable"
            reason = Reason("ids.cut", short=short, share=cut_share)
        elif cut_share is None or n_ends < MIN_TRACKS:
            state = "not_enough_data"
            reason = Reason("ids.few_ends", short=short, n=n_ends, least=MIN_TRACKS)
    return TrackLives(len(lives), median, long_share, cut_share, state, reason)


def share_by_days(
    n: npt.ArrayLike,
    totals: npt.ArrayLike,
    *,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> ShareEstimate:
    """Return a share with the interval of the ratio estimator with days as clusters, on the logit scale.

    p = sum_d n_d / sum_d m_d; var(p) = D/(D-1) sum_d (n_d - p m_d)^2 / (sum m)^2 (as for rates: `stats.influence`);
    limits expit(logit p +- t_{D-1} sqrt(var) / (p (1 - p))), so that they stay between 0 and 1.

    Args:
        n: Things with the property by day, shape (n_days,).
        totals: All things m_d, same shape; days without any say nothing.
        confidence: Confidence level.
        min_days: Days an interval needs.

    Raises:
        ValueError: Shapes do not fit, or a count is negative or above what it is a share of.
    """
    part, whole = np.asarray(n, dtype=np.float64), np.asarray(totals, dtype=np.float64)
    if part.shape != whole.shape or part.ndim != 1:
        raise ValueError("every day needs both counts")
    if bool((part < 0).any()) or bool((part > whole).any()):
        raise ValueError("a part lies between 0 and the whole")
    part, whole = part[whole > 0], whole[whole > 0]
    n_part, n_whole, n_days = round(float(part.sum())), round(float(whole.sum())), len(whole)

    def estimate(
        value: float | None, lo: float | None, hi: float | None, state: State, reason: Reason | None
    ) -> ShareEstimate:
        return ShareEstimate(value, lo, hi, n_part, n_whole, n_days, state, reason)

    if n_whole == 0:
        return estimate(None, None, None, "not_enough_data", Reason("violations.none"))
    share = n_part / n_whole
    if n_days < min_days:
        reason = Reason("violations.days", least=min_days, has=n_days)
        return estimate(share, None, None, "not_enough_data", reason)
    if n_whole < MIN_EVENTS:
        reason = Reason("level.events", least=MIN_EVENTS, has=n_whole)
        return estimate(share, None, None, "not_enough_data", reason)
    if n_part in (0, n_whole):
        limit = min(1.0, zero_events_limit(confidence=confidence) / n_whole)
        reason = Reason("violations.none_of" if n_part == 0 else "violations.all_of", n=n_whole)
        lo, hi = (0.0, limit) if n_part == 0 else (1 - limit, 1.0)
        return estimate(share, lo, hi, "ok", reason)
    off = part - share * whole
    var = n_days / (n_days - 1) * float(off @ off) / n_whole**2
    if n_whole < SMALL_COUNT:
        var = max(var, share * (1 - share) / n_whole)
    half = t_quantile(n_days - 1, confidence=confidence)
    return estimate(share, *logit_limits(share, var, half), "ok", None)


def logit_limits(share: float, var: float, half: float) -> tuple[float, float]:
    """Return expit(logit p -+ half sqrt(var) / (p (1 - p))): limits of a share between 0 and 1 with its variance."""
    if not 0 < share < 1:
        return share, share
    off = half * math.sqrt(var) / (share * (1 - share))
    middle = math.log(share / (1 - share))
    return _expit(middle - off), _expit(middle + off)


def _expit(x: float) -> float:
    return 1 / (1 + math.exp(-x)) if x >= 0 else math.exp(x) / (1 + math.exp(x))
