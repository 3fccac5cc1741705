"""Weeks of hours: 168 slots of local weekday and hour, what is usual in each, and how much it varies.

Arrays have one row per week, oldest first, and 168 columns, Monday 00 to Sunday 23. A slot holds what was counted, `n`,
and in how many recorded hours, `x_h`; 0 or NaN hours = not recorded, which is never 0. In the week the clocks go back a
slot has two hours, in the week they go forward one has none, so everything is per recorded hour.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import gammaincinv

from vsd_analytics.answer import Reason, State
from vsd_analytics.settings import DEFAULTS

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

SLOTS: Final = 168
WEEK_AXES: Final = 2  # counts are weeks by slots
MIN_PROFILE_WEEKS: Final = 3  # of the last four (analytics M13, M14)
SPARSE: Final = 5.0  # below it the median of a count is too coarse, and the mean is used
N_PEAKS: Final = 3
"""Hours named: more would not be peaks."""


@dataclass(frozen=True, slots=True, eq=False)
class Weeks:
    """Checked counts.

    Attributes:
        n: What was counted, shape (n_weeks, 168); 0 where nothing was recorded.
        x_h: Recorded hours, same shape; 0 where nothing was recorded.
    """

    n: Floats
    x_h: Floats

    @property
    def rate(self) -> Floats:
        """Return counts per recorded hour; NaN where nothing was recorded."""
        rate: Floats = np.divide(self.n, self.x_h, out=np.full(self.n.shape, np.nan), where=self.x_h > 0)
        return rate

    def latest(self, max_weeks: int) -> Weeks:
        """Return only the last `max_weeks` recorded values of each slot; earlier ones count as not recorded."""
        is_recorded = self.x_h > 0
        number = is_recorded[::-1].cumsum(axis=0)[::-1]
        kept = is_recorded & (number <= max_weeks)
        return Weeks(np.where(kept, self.n, 0.0), np.where(kept, self.x_h, 0.0))

    @property
    def n_recorded(self) -> int:
        """Return how many weeks have a recorded hour."""
        return int((self.x_h > 0).any(axis=1).sum())


@dataclass(frozen=True, slots=True)
class Spread:
    """How the same hour differs from week to week: var = noise mean + dispersion mean^2, pooled over slots.

    Attributes:
        noise: Chance variance per unit of mean for one recorded hour: 1 for counts of independent events.
        dispersion: Variance of the relative change from week to week.
    """

    noise: float
    dispersion: float


@dataclass(frozen=True, slots=True, eq=False)
class SlotRates:
    """A rate for each hour of the week, pulled towards the mean hour as far as chance may have made it.

    Attributes:
        rate: Per unit of exposure, shape (168,); NaN where too few weeks recorded the hour.
        lo, hi: Limits, same shape.
        raw: n / x without the pull, same shape.
        n: Counted, same shape.
        x: Exposure the counts are divided by, same shape.
        n_weeks: Weeks that recorded it, same shape.
        state: "ok" when at least one hour has a rate.
        reason: Why not.
    """

    rate: Floats
    lo: Floats
    hi: Floats
    raw: Floats
    n: Floats
    x: Floats
    n_weeks: Ints
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class PeakHour:
    """One of the highest hours of the week.

    Attributes:
        weekday: 0 Monday to 6 Sunday.
        hour: Local hour, 0 to 23.
        value: Rate, as of `SlotRates`.
        lo, hi: Its interval.
        n: Counted.
        n_weeks: Weeks that recorded it.
    """

    weekday: int
    hour: int
    value: float
    lo: float
    hi: float
    n: float
    n_weeks: int


@dataclass(frozen=True, slots=True)
class PeakHours:
    """The highest hours of the week, and the hours that may be as high as the highest.

    Attributes:
        top: At most three hours, highest first.
        tied: Weekday and hour of all others, `top` among them, whose interval reaches the first one's.
        state: "ok" when there is a first.
        reason: Why not.
    """

    top: tuple[PeakHour, ...]
    tied: tuple[tuple[int, int], ...]
    state: State
    reason: Reason | None


def as_weeks(n: npt.ArrayLike, x_h: npt.ArrayLike) -> Weeks:
    """Check counts and recorded hours of weeks.

    Args:
        n: What was counted, shape (n_weeks, 168); ignored where nothing was recorded.
        x_h: Recorded hours, same shape; 0 or NaN = not recorded.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    counts, hours = np.asarray(n, dtype=np.float64), np.asarray(x_h, dtype=np.float64)
    if counts.ndim != WEEK_AXES or counts.shape[1] != SLOTS or counts.shape != hours.shape:
        raise ValueError(f"n and x_h must both be weeks x {SLOTS}, are {counts.shape} and {hours.shape}")
    hours = np.where(np.isnan(hours) | np.isnan(counts), 0.0, hours)
    counts = np.where(hours > 0, counts, 0.0)
    if not (np.isfinite(counts).all() and np.isfinite(hours).all()) or (counts < 0).any() or (hours < 0).any():
        raise ValueError("counts and hours must be finite and not negative")
    return Weeks(counts, hours)


def recorded_hours(n: npt.ArrayLike, x_h: npt.ArrayLike, open_h: npt.ArrayLike, *, min_share: float) -> Weeks:
    """Return what all cameras counted together, and in how many hours of all of them.

    A camera that is down takes its people with it, not the site's: hours are weighted by the camera's usual part of
    the count in that slot, x = sum_c m_c x_c / sum_c m_c with m_c its mean rate there, so that n / x estimates what all
    would have counted. With all cameras up x is the recorded time.

    Args:
        n: Counts by camera, shape (n_cameras, n_weeks, 168); NaN = not known.
        x_h: Recorded open hours by camera, same shape.
        open_h: Open hours, shape (n_weeks, 168).
        min_share: A camera's slot counts from this share of its open hours on; so does the weighted sum.

    Returns:
        Counts and hours of all cameras; cameras that never recorded are left out.
    """
    counts, hours = np.asarray(n, dtype=np.float64), np.asarray(x_h, dtype=np.float64)
    open_hours = np.asarray(open_h, dtype=np.float64)
    is_used = (hours > 0) & (hours >= min_share * open_hours) & ~np.isnan(counts)
    counts, hours = np.where(is_used, counts, 0.0), np.where(is_used, hours, 0.0)
    seen = hours.sum(axis=(1, 2)) > 0
    counts, hours = counts[seen], hours[seen]
    slot_h = hours.sum(axis=1)
    usual = np.divide(counts.sum(axis=1), slot_h, out=np.zeros(slot_h.shape), where=slot_h > 0)
    # where nobody was ever seen, hours of all cameras weigh the same
    usual = np.where(usual.sum(axis=0) > 0, usual, (slot_h > 0).astype(np.float64))
    total = usual.sum(axis=0)
    share = np.divide(usual, total, out=np.zeros(usual.shape), where=total > 0)
    x = np.einsum("cs,cws->ws", share, hours)
    is_kept = (x > 0) & (x >= min_share * open_hours - 1e-9)
    return Weeks(np.where(is_kept, counts.sum(axis=0), 0.0), np.where(is_kept, x, 0.0))


def usual(weeks: Weeks, *, is_count: bool) -> Floats:
    """Return what is usual in each slot: the median of the weeks' rates; NaN for slots never recorded, shape (168,).

    The median of small counts is too coarse (0 for what happens every third week): where it is under 5, and the numbers
    are counts, the mean of the weeks replaces it.
    """
    rate = weeks.rate
    is_known = (weeks.x_h > 0).any(axis=0)
    middle = np.full(rate.shape[1], np.nan)
    middle[is_known] = np.nanmedian(rate[:, is_known], axis=0)
    if not is_count:
        return middle
    x = weeks.x_h.sum(axis=0)
    mean = np.divide(weeks.n.sum(axis=0), x, out=np.full(x.shape, np.nan), where=x > 0)
    return np.where(middle < SPARSE, mean, middle)


def spread(weeks: Weeks, *, is_count: bool, min_weeks: int = 2) -> Spread:
    """Return how much an hour differs from week to week, pooled over the slots.

    For counts the noise is 1 and dispersion = sum_s (s2 - mean mean(1/x)) / sum_s (mean^2 - s2 / k) over slots with
    k >= `min_weeks` recorded weeks, s2 their variance: sums before the ratio, because the ratio of one slot is mostly
    chance. For measured amounts (people in view) noise and dispersion both come from the slots, by least squares of
    s2 / mean on 1 and mean, neither below 0.

    Args:
        weeks: Counts and hours.
        is_count: The numbers count independent events.
        min_weeks: Recorded weeks a slot needs to take part, at least 2.
    """
    rate = weeks.rate
    k = (weeks.x_h > 0).sum(axis=0)
    chosen = k >= max(min_weeks, 2)
    if not chosen.any():
        return Spread(1.0 if is_count else 0.0, 0.0)
    rate, k = rate[:, chosen], k[chosen]
    mean, s2 = np.nanmean(rate, axis=0), np.nanvar(rate, axis=0, ddof=1)
    hours = np.where(weeks.x_h > 0, weeks.x_h, np.nan)[:, chosen]
    per_hour = np.nanmean(1 / hours, axis=0)
    if is_count:
        top, bottom = float((s2 - mean * per_hour).sum()), float((mean**2 - s2 / k).sum())
        return Spread(1.0, max(top, 0.0) / bottom if bottom > 0 else 0.0)
    is_seen = mean > 0
    if not is_seen.any():
        return Spread(0.0, 0.0)
    design = np.column_stack([per_hour[is_seen], mean[is_seen]])
    from scipy.optimize import nnls  # takes a tenth of a second to import, and only long histories need it

    (noise, dispersion), _ = nnls(design, s2[is_seen] / mean[is_seen])
    return Spread(float(noise), float(dispersion))


def slot_rates(
    n: npt.ArrayLike,
    x: npt.ArrayLike,
    *,
    min_weeks: int = MIN_PROFILE_WEEKS,
    confidence: float = DEFAULTS.confidence,
) -> SlotRates:
    """Return the rate of each hour of the week, shrunk by gamma-Poisson empirical Bayes (M13).

    Prior gamma(a, b) over the hours: a = m^2 / v, b = m / v, m = sum n / sum x, v the variance between hours beyond
    chance. rate = (a + n') / (b + x'), limits from the gamma posterior. Events of one hour share its crowd, so its
    exposure counts for less than it measures: x' = x / (1 + dispersion rate sum x_w^2 / x), n' = n x' / x, with the
    dispersion from week to week. With dispersion 0 it is the plain gamma-Poisson.

    Args:
        n: Counts, shape (n_weeks, 168).
        x: Exposure, same shape: recorded hours, or person-hours; 0 or NaN = not recorded, or nobody there.
        min_weeks: Weeks an hour needs.
        confidence: Level of the limits, hour by hour.

    Returns:
        Rates per unit of exposure.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    weeks = as_weeks(n, x)
    n_weeks = (weeks.x_h > 0).sum(axis=0)
    is_estimated = n_weeks >= min_weeks
    counted, exposure = weeks.n.sum(axis=0), weeks.x_h.sum(axis=0)
    raw = np.divide(counted, exposure, out=np.full(SLOTS, np.nan), where=exposure > 0)
    empty = np.full(SLOTS, np.nan)
    if not is_estimated.any():
        reason = Reason("hours.weeks", least=min_weeks)
        return SlotRates(empty, empty, empty, raw, counted, exposure, n_weeks, "not_enough_data", reason)
    estimated_n, estimated_x = counted[is_estimated], exposure[is_estimated]
    m = float(estimated_n.sum() / estimated_x.sum())
    if m == 0:
        reason = Reason("hours.nothing")
        return SlotRates(empty, empty, empty, raw, counted, exposure, n_weeks, "not_enough_data", reason)
    shared = _exposure_spread(weeks, is_estimated) * (weeks.x_h**2).sum(axis=0)[is_estimated] / estimated_x
    expected = np.full(estimated_x.shape, m)
    for _ in range(2):  # busy hours lose more to what their crowd shares: the second pass knows which are busy
        lost = 1 + shared * expected
        worth_x, worth_n = estimated_x / lost, estimated_n / lost
        between = max(between_hours(worth_n, worth_x, m), 1e-6 * m * m)
        a, b = m * m / between + worth_n, m / between + worth_x
        expected = a / b
    tail = (1 - confidence) / 2
    rate, lo, hi = empty.copy(), empty.copy(), empty.copy()
    rate[is_estimated] = a / b
    lo[is_estimated] = gammaincinv(a, tail) / b
    hi[is_estimated] = gammaincinv(a, 1 - tail) / b
    return SlotRates(rate, lo, hi, raw, counted, exposure, n_weeks, "ok", None)


def peaks(rates: SlotRates) -> PeakHours:
    """Return the highest hours of the week, and the hours that may be as high as the first (M14).

    Args:
        rates: Shrunk rates: a raw rate puts the hour with least data on top.
    """
    if rates.state != "ok":
        return PeakHours((), (), rates.state, rates.reason)
    known = np.flatnonzero(~np.isnan(rates.rate))
    if (total := float(rates.n[known].sum())) < SPARSE:
        return PeakHours((), (), "not_enough_data", Reason("violations.few", least=SPARSE, has=total))
    order = known[np.lexsort((known, -rates.rate[known]))]
    top = tuple(
        PeakHour(
            int(s) // 24, int(s) % 24, float(rates.rate[s]), float(rates.lo[s]), float(rates.hi[s]),
            float(rates.n[s]), int(rates.n_weeks[s]),
        )
        for s in order[:N_PEAKS]
    )  # fmt: skip
    tied = tuple((int(s) // 24, int(s) % 24) for s in order[1:] if rates.hi[s] >= top[0].lo)
    return PeakHours(top, tied, "ok", None)


def between_hours(n: Floats, x: Floats, m: float) -> float:
    """Return the variance of true rates between hours: weighted moments less what chance makes, at least 0.

    Args:
        n: Events of each hour.
        x: Exposure of each hour, above 0.
        m: Mean rate, events per unit of exposure.
    """
    scatter = float((x * (n / x - m) ** 2).sum()) - m * (len(x) - 1)
    weight = float(x.sum() - (x**2).sum() / x.sum())
    return max(scatter / weight, 0.0) if weight > 0 else 0.0


def _exposure_spread(weeks: Weeks, is_estimated: Bools) -> float:
    """Return the dispersion of counts around the slot's own rate, given exposures that differ from week to week.

    E (n - r x)^2 = r x (1 - x / X) + dispersion r^2 x^2 (1 - 2 x / X + sum x^2 / X^2), summed over weeks and slots and
    solved for the dispersion; r = slot's n / X.
    """
    n, x = weeks.n[:, is_estimated], weeks.x_h[:, is_estimated]
    total = x.sum(axis=0)
    r = n.sum(axis=0) / total
    chance = r * x * (1 - x / total)
    shared = r**2 * x**2 * (1 - 2 * x / total + (x**2).sum(axis=0) / total**2)
    return max(0.0, float(((n - r * x) ** 2 - chance).sum()) / max(float(shared.sum()), 1e-12))
