"""One logged change, one story: its verdict, its effect, who took people up, and when a change not clear yet will be.

Every output says these sentences: the three things to know, the log, the answers to earlier questions, the mail, the
planner and `vsd compare`. `vsd_analytics.figures.change_outcome` says which verdict it is. The effect is that on the
time too close in the area, of the verdict that may be read every week, with the person-minutes of a week that it makes.
"""

from __future__ import annotations

from datetime import date
from typing import Final

from vsd_analytics.answer import Reason
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import Foreseen, JudgedChange, LoggedChangeResult, ReceivingArea
from vsd_analytics.stats.placebos import MIN_AREAS
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

NEAR_MAX: Final = 3
"""Areas that cannot be compared with, which a sentence names at most."""


def came_of(change: JudgedChange | None, *, day: date | None = None) -> str:
    """Return what became of the time too close in the area of a change: verdict, effect, receivers, what is to come.

    Args:
        change: The change; None = nothing is known of it.
        day: Last day of what the output shows; None = what is to come lies ahead.
    """
    if change is None:
        return say("came_of.nothing")
    match change.outcome:
        case "site_wide":
            return ""
        case "too_early" | "alone" as outcome:
            if change.foreseen is not None and change.foreseen.reason is not None:
                return _untestable(change.foreseen)
            reason = reason_text(change.reason if change.running is None else change.running.reason).rstrip(".")
            early = say("came_of.early", reason=reason) if reason else say("came_of.nothing")
            return " ".join(
                part for part in (say("came_of.alone") if outcome == "alone" else early, ahead(change, day)) if part
            )
        case "works":
            return say("came_of.works", story=story(change))
        case "cannot_tell":
            sentence = say("came_of.cannot_tell", likely=_possible(change.running), usual=_usual(change))
            return " ".join(part for part in (sentence, ahead(change, day)) if part)
        case _:
            return terms.capital(story(change)) + "."


def story(change: JudgedChange) -> str:
    """Return the effect of a change that has one, beside which areas, and who took people up; without a full stop."""
    running = change.running
    if running is None:
        raise AssertionError("a change with an effect has a running verdict")
    why = reason_text(change.not_yet).rstrip(".")
    outcome = "works" if change.outcome == "fell" and not why else change.outcome
    return say(
        f"came_of.story_{outcome}",
        why=terms.capital(why),
        effect=_effect(change, running),
        areas=terms.joined(change.compared_with),
        share=fmt.percent(min(1.0, change.moved_elsewhere or 0.0)),
        receivers=received(change),
        likely=fmt.likely_signed(running),
    )


def received(change: JudgedChange) -> str:
    """Return which areas took people up, each with its range; else that none did, or where people went is not known."""
    if not change.receivers:
        is_left = change.people is not None and (change.people.change_hi or 0.0) < 0
        return say("came_of.went_unknown" if is_left else "came_of.nobody_took_up")
    areas = [say("came_of.took_up_area", area=r.area_name, likely=_more(r)) for r in change.receivers]
    return say("came_of.took_up", areas=terms.joined(areas))


def ahead(change: JudgedChange, day: date | None) -> str:
    """Return by which week a change will be clear, or what would tell where none will; empty where nothing is known.

    Args:
        change: A change that is not clear yet.
        day: Last day of what the output shows.
    """
    foreseen = change.foreseen
    if foreseen is None:
        return ""
    if foreseen.reason is not None:
        return _untestable(foreseen)
    size, power = fmt.percent(abs(foreseen.change)), fmt.percent(foreseen.power)
    way = "fall" if foreseen.change < 0 else "rise"
    if foreseen.clear_by is None:
        few = "few_" if foreseen.n_areas < MIN_AREAS else ""
        n = foreseen.n_areas
        return say(f"foreseen.never_{few}{way}", plural=n, n=n, size=size, power=power, weeks=foreseen.weeks_max)
    is_over = day is not None and foreseen.clear_by <= day
    week = foreseen.clear_by.isocalendar().week
    return say(f"foreseen.{'was' if is_over else 'will_be'}_{way}", size=size, power=power, week=week)


def result_words(line: LoggedChangeResult, *, day: date | None = None, is_told: bool = False) -> str:
    """Return what a line of the log says after the change itself; empty for a change of the whole site.

    Args:
        line: The change.
        day: Last day of the page.
        is_told: The page tells the whole story above: here verdict and effect are enough.
    """
    if line.outcome == "site_wide":
        return ""
    parts = [_brief(line) if is_told else came_of(line, day=day), on_floor(line)]
    if line.watched_until is not None and line.foreseen is None:
        parts.append(say("logged_changes.until", date=fmt.date_short(line.watched_until)))
    return " ".join(part for part in parts if part)


def _brief(change: JudgedChange) -> str:
    """Return the verdict and the effect of a change that has one, without what it rests on."""
    assert change.running is not None
    effect = _effect(change, change.running)
    if change.outcome == "works":
        return say("came_of.brief_works", effect=effect)
    return terms.capital(say("came_of.brief", effect=effect))


def on_floor(change: JudgedChange) -> str:
    """Return what became of the whole floor, from whatever cause; empty where that adds nothing."""
    net = change.net
    if net is None or net.change_lo is None or net.change_hi is None:
        return ""
    way = "less" if net.change_hi < 0 else "more" if net.change_lo > 0 else "either"
    if change.outcome == "cannot_tell" and way == "either":  # what nobody can tell of the area has not moved the floor
        return ""
    return say(f"logged_changes.floor_{way}", likely=fmt.likely_signed(net))


def is_none(estimate: Estimate) -> bool:
    """Tell whether a change is a fall to none at all."""
    return estimate.change is not None and estimate.change <= -1


def _effect(change: JudgedChange, running: Estimate) -> str:
    """Return an effect in words: 84% less time too close there, about 170 of 200 person-minutes a week (likely ...)."""
    usual, avoided = change.usual_min, change.avoided_min
    minutes, likely = "", fmt.likely_signed(running)
    way = "none" if is_none(running) else "less" if (running.change or 0.0) < 0 else "more"
    if usual is not None and avoided is not None:
        minutes = say(f"came_of.minutes_{way}", n=_minutes(avoided), usual=_minutes(usual))
    if way == "none" and running.change_hi is not None:
        likely = say("came_of.none", most=fmt.percent(1 + running.change_hi))
    size = fmt.percent(abs(running.change or 0.0))
    return say(f"came_of.effect_{way}", size=size, minutes=minutes, likely=likely)


def _possible(running: Estimate | None) -> str:
    """Return the range of a change of time in words: between 30% less and 50% more."""
    if running is None or running.change_lo is None or running.change_hi is None:
        return say("came_of.any")
    low, high = (say("came_of.same") if round(end * 100) == 0 else fmt.less_more(end) for end in _ends(running))
    return say("came_of.between", low=low, high=high)


def _ends(running: Estimate) -> tuple[float, float]:
    return running.change_lo or 0.0, running.change_hi or 0.0


def _usual(change: JudgedChange) -> str:
    return "" if change.usual_min is None else say("came_of.usual", usual=_minutes(change.usual_min))


def _minutes(minutes: float) -> str:
    """Write minutes with two digits: a range of hundreds is not known to the minute."""
    return fmt.count(float(f"{abs(minutes):.2g}"))


def _more(area: ReceivingArea) -> str:
    low = fmt.signed(area.change if area.change_lo is None else area.change_lo)
    if area.change_hi is None:
        return say("came_of.took_up_from", low=low)
    return say("came_of.took_up_range", low=low, high=fmt.signed(area.change_hi))


def _untestable(foreseen: Foreseen) -> str:
    """Return why no week will tell, and what would: an area to compare with, or days with and without the change."""
    why = reason_text(foreseen.reason).rstrip(".")
    near = [_left_out(reason) for reason in foreseen.left_out[:NEAR_MAX]]
    is_alone = foreseen.reason is not None and foreseen.reason.code == "logged_change.no_comparison"
    if is_alone and near:
        why = say("foreseen.no_area", areas="; ".join(near))
    return say("foreseen.untestable_area" if is_alone else "foreseen.untestable_weeks", why=why)


def _left_out(reason: Reason) -> str:
    """Write why an area is not compared with, after its name."""
    area, why = (reason.values[name] for name in ("area", "why"))
    return say("foreseen.left_out", area=str(area), why=reason_text(why) if isinstance(why, Reason) else str(why))
