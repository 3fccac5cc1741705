"""The cards of the numbered spots in words: rate, change, since when, when, how sure, what to ask."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date

from markupsafe import Markup

from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import Evidence, SpotCard, UsualHours
from vsd_analytics.report.draw import small_maps
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import days
from vsd_analytics.wording.reasons import reason_text

N_DOTS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """One card, ready to print.

    Attributes:
        number: As on the map.
        name: Of the spot.
        value, unit: Its figure.
        change: What became of it, in words.
        direction: good, bad or same; colours that.
        notes: Further lines: excess.
        when: When it is busy.
        dots: For each of three dots, whether it is full.
        sure: high, medium or low, in words.
        reason: Why.
        ask: What to ask about the room.
        picture: The surroundings of the spot, with its bands; empty for none.
    """

    number: int
    name: str
    value: str
    unit: str
    change: str
    direction: str
    notes: tuple[str, ...]
    when: str
    dots: tuple[bool, ...]
    sure: str
    reason: str
    ask: str
    picture: Markup


@dataclass(frozen=True, slots=True, kw_only=True)
class Cards:
    """The cards and the lines above them.

    Attributes:
        title: What the spots are.
        sub: How they were chosen.
        cards: At most three.
        watching: Places that are watched after a change, one sentence each.
        more: That the planner shows more spots; empty where it does not.
        has_pictures: True when a card has one of a camera.
    """

    title: str
    sub: str
    cards: tuple[Card, ...]
    watching: tuple[str, ...]
    more: str
    has_pictures: bool


def cards(report: WeekReport, *, question: str = "") -> Cards | None:
    """Return the cards of the week; None where no spot is numbered.

    Args:
        report: The report.
        question: The question of the week, which the page asks at its top: its card does not repeat it.
    """
    spots = report.spots
    if spots is None or not spots.cards:
        return None
    n = len(spots.cards)
    number = {2: say("spots.two"), 3: say("spots.three")}.get(n, str(n))
    if spots.kind == "tested":
        title = say("spots.tested", plural=n, n=number)
        first, last = (fmt.date_short(d) if d is not None else "" for d in (spots.first, spots.last))
        sub = say("spots.sub_tested", plural=n, first=first, last=last)
    else:
        title = say("spots.busiest_recorded" if report.silent_cameras else "spots.busiest", plural=n, n=number)
        why = reason_text(spots.reason).rstrip(".")
        sub = say("spots.sub_busiest", reason=why) if why else say("spots.sub_busiest_plain")
    spot_cards = tuple(
        _card(replace(c, ask="") if c.ask and c.ask.rstrip("?") in question else c, report) for c in spots.cards
    )
    return Cards(
        title=title,
        sub=sub,
        cards=spot_cards,
        watching=tuple(dict.fromkeys(watched(s.name, s.changed_on) for s in spots.watching)),
        more=say("spots.more", plural=spots.n_more, n=spots.n_more) if spots.n_more else "",
        has_pictures=any(p.camera_name is not None for p in report.spot_pictures),
    )


def watched(name: str, changed_on: date | None) -> str:
    """Return the sentence of a place that is watched after a change."""
    return say("spots.watching", name=name, date="" if changed_on is None else fmt.date_short(changed_on))


def _card(card: SpotCard, report: WeekReport) -> Card:
    value, unit, notes = _figures(card, report)
    change, direction = _change(card.violation_rate, report) if card.ratio is None else _since(card)
    evidence = card.evidence
    level = {"high": 3, "medium": 2, "low": 1}.get(evidence.sureness if evidence is not None else "", 0)
    return Card(
        number=card.number,
        name=card.name,
        value=value,
        unit=unit,
        change=change,
        direction=direction,
        notes=notes,
        when=_when(card.usual),
        dots=tuple(i < level for i in range(N_DOTS)),
        sure=say(f"spots.{evidence.sureness}") if evidence is not None else "",
        reason=_reason(evidence, report) if evidence is not None else "",
        ask=card.ask,
        picture=spot_scene(report, card.number),
    )


def _figures(card: SpotCard, report: WeekReport) -> tuple[str, str, tuple[str, ...]]:
    violation_rate = card.violation_rate
    if card.ratio is None:
        return fmt.number(violation_rate.value if violation_rate is not None else None), say("spots.rate_unit"), ()
    if card.ratio.value is None:
        return fmt.MISSING, reason_text(card.ratio.reason), ()
    unit, notes = say("spots.ratio_unit"), []
    if card.ratio.lo is not None and card.ratio.hi is not None:
        unit = say("spots.ratio_unit_range", low=fmt.number(card.ratio.lo), high=fmt.number(card.ratio.hi))
    if card.excess_min_per_week is not None:
        is_little = round(card.excess_min_per_week) == 0
        notes.append(say("spots.excess_little" if is_little else "spots.excess", n=fmt.count(card.excess_min_per_week)))
    here = card.here
    if here is not None and report.previous is not None:
        value, before = (fmt.number(float(f"{v or 0.0:.2g}")) for v in (here.value, here.previous))
        around = fmt.distance(report.rules.distance_m / 2, report.rules.distance_unit)
        notes.append(say("spots.here", distance=around, rate=value, before=before, week=report.previous.number))
    return fmt.number(card.ratio.value), unit, tuple(notes)


def _since(card: SpotCard) -> tuple[str, str]:
    if card.is_new is None:
        return "", "same"
    if card.is_new:
        return say("spots.new"), "bad"
    if card.since is None:
        return "", "same"
    key = "spots.since_first" if card.is_since_first else "spots.since"
    return say(key, week=card.since.isocalendar().week, date=fmt.date_short(card.since)), "same"


def _change(violation_rate: Estimate | None, report: WeekReport) -> tuple[str, str]:
    """Return the change of an area in words, and its direction; empty where nothing is compared."""
    if report.state != "normal" or report.previous is None or violation_rate is None:
        return "", "same"
    if violation_rate.verdict in ("clear_fall", "clear_rise") and violation_rate.change is not None:
        words = say("spots.change", change=fmt.fewer_more(violation_rate.change), week=report.previous.number)
        return words, terms.direction(violation_rate.verdict)
    key = "no_change" if violation_rate.verdict in ("about_same", "cannot_tell") else "little"
    return say(f"spots.cap_{key}", week=report.previous.number), "same"


def _when(usual: UsualHours | None) -> str:
    if usual is None:
        return say("spots.when_unknown")
    if usual.last_hour - usual.first_hour >= 11:
        return say("spots.when_all_day")
    first, last = fmt.hour_label(usual.first_hour), fmt.hour_label(usual.last_hour + 1)
    if usual.weekday is None:
        return say("spots.when_hours", first=first, last=last)
    return say("spots.when_day", first=first, last=last, day=days()[usual.weekday])


def _reason(evidence: Evidence, report: WeekReport) -> str:
    parts = [
        say("spots.reason_days", plural=evidence.days_open, n=evidence.days_present, open=evidence.days_open),
        say("spots.reason_hours", share=fmt.percent(evidence.recorded_share)),
    ]
    if evidence.is_camera_down:
        camera = terms.camera_name(evidence.camera_name or "")
        parts = [say("spots.reason_down", camera=camera, hours=fmt.hours(evidence.lost_h))]
    elif evidence.error_m is None:
        parts.append(say("spots.reason_no_error"))
    else:
        parts.append(say("spots.reason_error", error=fmt.distance(evidence.error_m, report.rules.distance_unit)))
    return terms.sentence(", ".join(parts))


def spot_scene(report: WeekReport, number: int) -> Markup:
    """Draw the surroundings of a numbered spot; empty without a picture of it.

    Args:
        report: The report.
        number: Number of the spot.
    """
    picture = next((p for p in report.spot_pictures if p.number == number), None)
    floor = next((m for m in report.maps if m.kind != "picture"), None)
    if picture is None or floor is None:
        return Markup("")
    if picture.camera_name is None:
        label = say("spots.floor_label", floor=floor.title, number=number)
    else:
        label = say("spots.picture_label", camera=terms.camera_name(picture.camera_name), number=number)
    return small_maps.scene(picture, floor, rules=report.rules, name=f"spot{number}", label=label)
