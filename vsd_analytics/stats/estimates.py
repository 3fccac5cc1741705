"""What the functions of this package return: a level, a change, and what a change is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vsd_analytics.answer import Reason, State, Verdict
from vsd_analytics.settings import DEFAULTS


@dataclass(frozen=True, slots=True)
class RateEstimate:
    """A rate and what is known about it.

    Attributes:
        value: Violations per open hour (M0) or per person-hour (M7); None when it cannot be given at all. It may be
            given where the interval is not: then `state` is "not_enough_data" and the rate is to be printed grey.
        lo: Lower limit of the interval, in the unit of `value`; None without an interval.
        hi: Upper limit, likewise. After no violation at all: the one-sided upper limit (rule of three).
        n_events: Violations counted in recorded hours; None when unknown.
        exposure_h: Recorded open camera-hours (M0) or person-hours (M7) the violations are divided by.
        n_days: Days with exposure, on any camera.
        df: Degrees of freedom of Student's t; None without an interval or where t was not used.
        log_se: Standard error of ln rate; likewise.
        state: "ok" when the figure has a value and an interval.
        reason: Why not, or what is special.
        is_conservative: The interval is wider than it need be: differences between weekdays are in it, because
            there are not yet four weeks of history, or it reaches to the usual rate with the weekdays a camera missed.
        left_out: Indices of cameras without one recorded hour.
    """

    value: float | None
    lo: float | None
    hi: float | None
    n_events: float | None
    exposure_h: float
    n_days: int
    df: float | None
    log_se: float | None
    state: State
    reason: Reason | None
    is_conservative: bool
    left_out: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class ChangeEstimate:
    """A change from period A (before) to period B (after), over camera-hours recorded in both.

    Attributes:
        value: Ratio of rates B / A (0.86 = 14 % fewer); None when A's rate is 0 or unknown.
        lo: Lower limit of the ratio; None without an interval.
        hi: Upper limit of the ratio; None without an interval, or where none can be given (A without events).
        rate_a: Rate of A over the compared hours, in the unit of the figure compared.
        rate_b: Rate of B, likewise.
        n_a: Violations (or person-hours, for people) of A in the compared hours.
        n_b: The same of B.
        exposure_a_h: Hours (or person-hours) of A that were compared.
        exposure_b_h: The same of B.
        n_days: Pairs of days compared.
        df: Degrees of freedom of Student's t; None where it was not used.
        log_se: Standard error of ln theta; likewise.
        verdict: What the interval allows to say: `verdict_of`.
        state: "ok" unless the verdict is "too_little_data".
        reason: Why not, or what is special.
        is_conservative: The interval is wider than it need be (very few events on one side).
        left_out: Indices of cameras without one hour recorded in both periods.
    """

    value: float | None
    lo: float | None
    hi: float | None
    rate_a: float | None
    rate_b: float | None
    n_a: float | None
    n_b: float | None
    exposure_a_h: float
    exposure_b_h: float
    n_days: int
    df: float | None
    log_se: float | None
    verdict: Verdict
    state: State
    reason: Reason | None
    is_conservative: bool
    left_out: tuple[int, ...] = ()

    @property
    def change(self) -> float | None:
        """Return the relative change, theta - 1: -0.14 is 14 % fewer."""
        return None if self.value is None else self.value - 1

    @property
    def change_lo(self) -> float | None:
        """Return the lower limit of the relative change."""
        return None if self.lo is None else self.lo - 1

    @property
    def change_hi(self) -> float | None:
        """Return the upper limit of the relative change."""
        return None if self.hi is None else self.hi - 1


@dataclass(frozen=True, slots=True)
class ChangeSplit:
    """How a change in how often splits into more people and more risk per person.

    ln theta_violation_rate = ln theta_people + ln theta_risk + rest. The rest is 0 when every camera recorded equally
    long; otherwise it comes from the different weights that the two figures give to cameras.

    Attributes:
        people: Change of people in view per open hour (mean number of people in view).
        encounter_rate: Change of violations per person-hour.
        violation_rate: Change of violations per open hour.
        rest: Ratio left over, theta_violation_rate / (theta_people theta_risk); None when one of them is unknown.
        people_share: Share of the log change that people explain, ln theta_people / ln theta_violation_rate; below 0 or
            above 1 where people and risk moved against each other. None unless how often changed clearly.
    """

    violation_rate: ChangeEstimate
    people: ChangeEstimate
    encounter_rate: ChangeEstimate
    rest: float | None
    people_share: float | None


def no_rate(reason: Reason, state: State = "not_measurable") -> RateEstimate:
    """Return the estimate of a rate that cannot be given."""
    return RateEstimate(None, None, None, None, 0.0, 0, None, None, state, reason, False)


def no_change(reason: Reason, state: State = "not_measurable") -> ChangeEstimate:
    """Return the estimate of a change that cannot be given."""
    return ChangeEstimate(
        value=None, lo=None, hi=None, rate_a=None, rate_b=None, n_a=None, n_b=None, exposure_a_h=0.0, exposure_b_h=0.0,
        n_days=0, df=None, log_se=None, verdict="too_little_data", state=state, reason=reason, is_conservative=False,
    )  # fmt: skip


def verdict_of(lo: float | None, hi: float | None, *, about_same_share: float = DEFAULTS.about_same_share) -> Verdict:
    """Return the verdict an interval of a ratio allows.

    Clear when it excludes 1, however small the change; about the same when it holds 1 and all of it lies within
    1 -+ `about_same_share`; otherwise the data cannot tell.

    Args:
        lo: Lower limit; None = none known, read as 0.
        hi: Upper limit; None = none known, read as infinity. Without either: "too_little_data".
        about_same_share: Changes up to this share do not matter.
    """
    if lo is None and hi is None:
        return "too_little_data"
    low, high = (0.0 if lo is None else lo), (math.inf if hi is None else hi)
    if high < 1:
        return "clear_fall"
    if low > 1:
        return "clear_rise"
    return "about_same" if 1 - about_same_share <= low and high <= 1 + about_same_share else "cannot_tell"
