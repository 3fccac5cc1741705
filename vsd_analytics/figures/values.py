"""Estimates as values of answers: a number without an interval is given, and the reason says why it has none."""

from __future__ import annotations

from dataclasses import replace

from vsd_analytics.answer import Estimated, Reason, State, Value
from vsd_analytics.figures.slots import NOTHING_OPEN


def measured(estimate: Estimated | None, *, reason: Reason | None = None) -> Value:
    """Return an estimate as a value whose reason says why it has no number or no interval.

    Args:
        estimate: The estimate; None = there is none.
        reason: The reason of what it is part of; None = its own.
    """
    if estimate is None:
        return Value.missing(NOTHING_OPEN)
    value = Value.of(estimate, reason=reason)
    if value.value is None:
        return lack(value.state, value.reason)
    return replace(value, reason=value.reason if value.lo is None else None)


def relative(ratio: Estimated | None, *, reason: Reason) -> Value:
    """Return a ratio of after over before as a relative change: -0.14 is 14 % fewer.

    Args:
        ratio: The ratio with its limits; None = there is none.
        reason: Why there is no ratio, or no interval, where it does not say so itself.
    """
    if ratio is None:
        return Value.missing(reason)
    cell = Value.of(ratio)
    value, lo, hi = (None if n is None else n - 1 for n in (cell.value, cell.lo, cell.hi))
    has_interval = value is not None and (lo is not None or hi is not None)
    return Value(value, lo, hi, cell.state, None if has_interval else cell.reason or reason)


def known(number: float | None, reason: Reason | None, state: State = "not_enough_data") -> Value:
    """Return a number that has no interval, or why it is not known."""
    return lack(state, reason) if number is None else Value(number)


def unknown_count(rate: Estimated, n: int) -> Value | None:
    """Return why a count is unknown: nothing was seen, and its rate has no recorded time; None where it is known."""
    if n or rate.value is not None:
        return None
    value = Value.of(rate)
    return lack(value.state, value.reason)


def lack(state: State, reason: Reason | None) -> Value:
    """Return a value that is not given, as what it comes from is not."""
    return Value.missing(reason or NOTHING_OPEN, "not_enough_data" if state == "ok" else state)


def without(value: Value, reason: Reason | None) -> Value:
    """Return a value, without its number where there is a reason to hold it back."""
    return value if reason is None else Value.missing(reason)
