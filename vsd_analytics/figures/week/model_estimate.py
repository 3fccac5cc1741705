"""What every section of the report is made of: fields that say what they mean, the form of a figure, how to fill it."""
# ruff: noqa: RUF009  (`_f` only wraps dataclasses.field)

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from typing import Any, TypeVar

from vsd_analytics.answer import Reason, State, Verdict
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.stats.before_after import BeforeAfter
from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate
from vsd_analytics.stats.net_effect import NetEffect
from vsd_analytics.stats.running_verdict import RunningVerdict


def described(meaning: str, unit: str | None = None, metric: str | None = None, *, default: Any = MISSING) -> Any:
    """Return a dataclass field that carries its documentation."""
    metadata = {k: v for k, v in (("help", meaning), ("unit", unit), ("metric", metric)) if v is not None}
    return field(metadata=metadata) if default is MISSING else field(default=default, metadata=metadata)


def optional(meaning: str, unit: str | None = None, metric: str | None = None) -> Any:
    """Return such a field that is None unless it is given."""
    return described(meaning, unit, metric, default=None)


_f, _o = described, optional
_Section = TypeVar("_Section")


def same_fields(section: type[_Section], source: object, **others: Any) -> _Section:
    """Return a section of the report whose fields are attributes of the same names; `others` are given or differ."""
    names = [f.name for f in fields(section) if f.name not in others and hasattr(source, f.name)]  # type: ignore[arg-type]
    return section(**{name: getattr(source, name) for name in names}, **others)


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A figure of this week with its interval, last week's value over the same hours, and the change between them."""

    value: float | None = _f("This week's value over all its recorded open hours; None when `state` is not ok.")
    lo: float | None = _o("Lower end of the confidence interval of `value`.")
    hi: float | None = _o("Upper end of the confidence interval of `value`; for 0 the rule-of-three bound.")
    previous: float | None = _o("The week before; None when it is not compared.")
    change: float | None = _o("Relative change over the hours recorded in both weeks: -0.14 is 14 % fewer.", "share")
    change_lo: float | None = _o("Lower end of the interval of `change`.", "share")
    change_hi: float | None = _o("Upper end of the interval of `change`.", "share")
    verdict: Verdict | None = _o("Read from the interval of `change`; None when nothing is compared.")
    hours_compared: float | None = _o("Camera-hours recorded in both weeks that `change` uses.", "h")
    state: State = _f("Whether the value can be given.", default="ok")
    reason: Reason | None = _o("In words, why not.")


def level_estimate(rate: RateEstimate | None, *, mask: Mask) -> Estimate | None:
    """Return a rate as an estimate; None for none. A small count takes the rate with it.

    Args:
        rate: A rate of the analysis room.
        mask: Tells which counts are small.
    """
    if rate is None:
        return None
    if mask.hides(rate.n_events):
        return Estimate(value=None, state="not_enough_data", reason=mask.why)
    if rate.value is None:
        return Estimate(value=None, state=_missing(rate.state), reason=rate.reason)
    return Estimate(value=rate.value, lo=rate.lo, hi=rate.hi, reason=rate.reason if rate.lo is None else None)


def change_estimate(ratio: ChangeEstimate | BeforeAfter | RunningVerdict | NetEffect) -> Estimate:
    """Return a ratio as an estimate that has a change and no level; only the running one has a verdict."""
    verdict = ratio.verdict if isinstance(ratio, RunningVerdict) else None
    if ratio.value is None:
        return Estimate(value=None, verdict=verdict, state=_missing(ratio.state), reason=ratio.reason)
    return Estimate(
        value=None,
        change=ratio.value - 1,
        change_lo=None if ratio.lo is None else ratio.lo - 1,
        change_hi=None if ratio.hi is None else ratio.hi - 1,
        verdict=verdict,
        reason=ratio.reason if ratio.lo is None else None,
    )


def _missing(state: State) -> State:
    return state if state != "ok" else "not_enough_data"
