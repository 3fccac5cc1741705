"""What came of a logged change, in one sentence: it worked, it moved elsewhere, it rose, or nobody can tell yet.

Which of these may be said is `change_outcome.outcome`.
"""

from __future__ import annotations

from vsd_analytics.figures.week.change_outcome import outcome
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import LedgerLine, Redesign
from vsd_analytics.report.words import terms
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text


def came_of(change: Redesign | None) -> str:
    """Return what became of the time too close in the area of a change; None = nothing is known of it."""
    if change is None:
        return say("came_of.nothing")
    running = change.running
    likely = "" if running is None else between(running)
    match outcome(change):
        case "too_early":
            reason = reason_text(change.reason if running is None else running.reason).rstrip(".")
            return say("came_of.early", reason=reason) if reason else say("came_of.nothing")
        case "works" | "fell" as said:
            return say(f"came_of.{said}", likely=likely, areas=terms.joined(change.compared_with))
        case "moved":
            return say("came_of.moved", share=fmt.percent(min(1.0, change.moved_elsewhere or 0.0)))
        case said:
            return say(f"came_of.{said}", likely=likely)


def ledger_words(line: LedgerLine) -> str:
    """Return what a line of the ledger says after the change itself; empty for a change of the whole site."""
    if line.outcome == "site_wide":
        return ""
    parts = [_in_area(line), _on_floor(line)]
    if line.watched_until is not None:
        parts.append(say("ledger.until", date=fmt.date_short(line.watched_until)))
    return " ".join(part for part in parts if part)


def _in_area(line: LedgerLine) -> str:
    if line.outcome == "alone":
        return say("came_of.alone")
    if line.avoided_min is None or line.avoided_lo is None or line.avoided_hi is None:
        reason = reason_text(line.reason).rstrip(".")
        return say("came_of.early", reason=reason) if reason else say("came_of.nothing")
    low, high = _minutes(line.avoided_lo), _minutes(line.avoided_hi)
    n = fmt.count(_rounded(abs(line.avoided_min)))
    least, most = (fmt.count(_rounded(abs(end))) for end in (line.avoided_lo, line.avoided_hi))
    return say(
        f"ledger.{line.outcome}",
        least=least,
        most=most, n=n, low=low, high=high, usual=fmt.count(_rounded(line.usual_min or 0.0)),
        areas=terms.joined(line.compared_with),
    )  # fmt: skip


def _on_floor(line: LedgerLine) -> str:
    if line.floor_avoided_lo is None or line.floor_avoided_hi is None:
        return ""
    is_clear = line.floor_verdict in ("clear_fall", "clear_rise")
    if line.outcome == "cannot_tell" and not is_clear:  # what nobody can tell of the area has not moved the floor
        return ""
    low, high = _minutes(line.floor_avoided_lo), _minutes(line.floor_avoided_hi)
    return say(f"ledger.floor_{line.floor_verdict or 'cannot_tell'}", low=low, high=high)


def _minutes(avoided: float) -> str:
    """Return an end of a range: 120 fewer, 80 more, no fewer."""
    n = _rounded(abs(avoided))
    if not n:
        return say("ledger.none")
    return say("ledger.fewer" if avoided > 0 else "ledger.more", n=fmt.count(n))


def _rounded(minutes: float) -> float:
    """Return minutes with two digits: a range of hundreds is not known to the minute."""
    return float(f"{minutes:.2g}")


def between(estimate: Estimate) -> str:
    """Return the range of a change of time in words: between 30% less and 50% more, up to 30% less."""
    lo, hi = estimate.change_lo, estimate.change_hi
    if lo is None or hi is None:
        return amount(estimate.change)
    if 0.0 in (lo, hi) and lo < hi:  # a clear change that without one comparison area would not be clear ends there
        return say("came_of.up_to", amount=amount(lo or hi))
    return say("came_of.between", low=amount(lo), high=amount(hi))


def amount(change: float | None) -> str:
    """Return a change of time in words: 14% less, 8% more, as much as before."""
    return say("came_of.same") if round((change or 0.0) * 100) == 0 else fmt.less_more(change)
