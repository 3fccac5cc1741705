"""The one question of the week: the most pressing that earlier weeks and their answers leave (`model/remedies.py`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import timedelta
from typing import Final

from vsd_analytics.report.model.remedies import (
    REST,
    Candidate,
    above_all_hour,
    around_hour,
    remedies,
    rest_of_floor,
    wording,
)
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.model.week_agenda import PastQuestion, PlaceToAsk, Remedy
from vsd_analytics.report.pages.no_data import nothing
from vsd_analytics.report.pages.things_to_know import weakest_camera
from vsd_analytics.site.questions import AskedQuestion
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say

FLOOR: Final = "floor"
"""Place of a question about the whole floor, its data, or the site."""
FACTS: Final = ("where", "check")
"""Remedies that find something out: to do it is no change of the site."""
OWN: Final = "own"
"""The site's own question, `ask` of an area: it is asked whatever can be compared."""
EVENT: Final = timedelta(weeks=4)
"""The same of what happened in a week: a rise, a camera that was down."""
OPEN_MAX: Final = 3
"""Open questions that a page names when it has nothing new to ask."""


def may_ask(report: WeekReport) -> bool:
    """Tell whether a report asks: other days, a week that is only begun, and one whose question is answered do not."""
    return report.week.is_week and not report.is_so_far and not _is_answered(report)


def _is_answered(report: WeekReport) -> bool:
    return report.agenda is not None and any(p.monday == report.week.monday for p in report.agenda.asked)


def choose(report: WeekReport) -> AskedQuestion:
    """Return the one question of the week: the first candidate that earlier weeks and their answers leave."""
    past = report.agenda.asked if report.agenda is not None else ()
    for candidate in candidates(report):
        text = wording(candidate, past, monday=report.week.monday)
        if text is not None:
            return _question(report, candidate, text)
    still_open = list(_still_open(past))
    if not still_open:
        return _question(report, Candidate(place=FLOOR, remedy="idea", text="", is_change=False), say("question.idea"))
    ids = terms.joined(p.question_id for p in still_open[:OPEN_MAX])
    text = say("question.decide", plural=len(still_open), n=len(still_open), week=report.week.number, ids=ids)
    return _question(report, Candidate(place=FLOOR, remedy="decide", text="", is_change=False), text)


def candidates(report: WeekReport) -> Iterator[Candidate]:
    """Yield what this week could ask, most pressing first."""
    week, violation_rate = report.week.number, report.level.violation_rate
    if report.state == "no_data":
        texts = nothing(report)
        yield Candidate(place=FLOOR, remedy=texts.rule.replace("_", "-"), text=texts.question, is_change=False)
        return
    if violation_rate.state == "not_measurable":
        yield Candidate(place=FLOOR, remedy="means", text=say("question.no_means"), is_change=False)
        return
    if violation_rate.value is None and report.state != "too_incomplete":
        yield Candidate(place=FLOOR, remedy="quiet", text=say("question.few"), is_change=False)
        return
    if report.state == "empty":
        distance = fmt.distance(report.rules.distance_m, report.rules.distance_unit)
        yield Candidate(place=FLOOR, remedy="tape", text=say("question.empty", distance=distance), is_change=False)
        return
    yield from _about_cameras(report)
    if report.state == "too_incomplete":
        return
    places = places_to_ask(report)
    watched = {p.area_id for p in places if p.changed_on is not None}
    rises = [
        a for a in report.areas if a.violation_rate.verdict == "clear_rise" and a.area_id is not None and a.is_material
    ]
    if report.state == "normal":
        for area in sorted(rises, key=lambda a: -(a.violation_rate.change or 0.0)):
            if area.area_id not in watched:
                text, again = (say(f"{t}.rose", area=area.name, week=week) for t in ("question", "again"))
                yield Candidate(place=str(area.area_id), remedy="why", text=text, again=again, area_id=area.area_id,
                                is_change=False, forget=EVENT)  # fmt: skip
    free = [p for p in places if p.changed_on is None]
    for k in range(max((len(p.remedies) for p in free), default=0)):
        for place in free:
            if k < len(place.remedies):
                r = place.remedies[k]
                if not place.is_testable and r.key not in (*FACTS, OWN):
                    continue  # a change that no later week can judge is no question worth asking
                yield Candidate(place=place.place, remedy=r.key, text=r.text, again=r.again, area_id=place.area_id,
                                is_change=r.key not in FACTS)  # fmt: skip
    when = around_hour(report)
    text, again = say("question.other_times", when=when), say("again.other_times", when=when)
    yield Candidate(place=FLOOR, remedy="times", text=text, again=again)


def _about_cameras(report: WeekReport) -> Iterator[Candidate]:
    """Yield what to ask of cameras that recorded too little, or missed the busiest place."""
    camera, spot = weakest_camera(report), report.busiest_spot
    row = next((a for a in report.areas if spot is not None and a.area_id == spot.area_id), None)
    is_incomplete = report.state == "too_incomplete"
    owns_spot = row is not None and camera is not None and row.cameras == (camera.camera_id,)
    is_one = camera is not None and (camera.share or 0.0) <= report.coverage.share - 0.1
    if camera is not None and ((is_incomplete and is_one) or (not is_incomplete and owns_spot)):
        name = terms.camera_name(camera.name)
        text, again = say("question.camera", camera=name), say("again.camera", camera=name)
        yield Candidate(place=camera.camera_id, remedy="record", text=text, again=again, is_change=False, forget=EVENT)
    if is_incomplete:
        text, again = say("question.cameras"), say("again.cameras")
        yield Candidate(place=FLOOR, remedy="record", text=text, again=again, is_change=False, forget=EVENT)


def places_to_ask(report: WeekReport) -> tuple[PlaceToAsk, ...]:
    """Return the places that may be asked about; without an agenda, the busiest by its name."""
    if report.agenda is not None:
        return report.agenda.places
    spot = report.busiest_spot
    if spot is None:
        return ()
    if spot.area_id is None:
        return (PlaceToAsk(place=REST, name=spot.name, remedies=rest_of_floor(around_hour(report))),)
    card = next((c for c in (report.spots.cards if report.spots else ()) if c.area_id == spot.area_id), None)
    choices = remedies(spot.name, None, area=None, fixtures=(), when=above_all_hour(report))
    if card is not None and card.question:
        choices = (Remedy(key=choices[0].key, text=card.question, again=choices[0].again, short=card.ask), *choices[1:])
    return (PlaceToAsk(place=spot.area_id, area_id=spot.area_id, name=spot.name, remedies=choices),)


def _still_open(past: Sequence[PastQuestion]) -> Iterator[PastQuestion]:
    """Yield the questions that nobody answered, the latest asking of each, newest first."""
    latest = {(p.place, p.remedy): p for p in past}
    answered = {(p.place, p.remedy) for p in past if p.answer in ("tried", "not-possible")}
    for p in reversed(past):
        key = (p.place, p.remedy)
        if key not in answered and latest[key] is p and p.remedy not in ("decide", "idea"):
            yield p


def _question(report: WeekReport, candidate: Candidate, text: str) -> AskedQuestion:
    """Return a question with its id: the week, the place, the remedy; the floor where the site has several."""
    floors = (report.site.floor_id,) if len(report.site.floors) > 1 else ()
    place = () if candidate.place == FLOOR and floors else (candidate.place,)
    return AskedQuestion(
        monday=report.week.monday,
        floor_id=report.site.floor_id,
        question_id="-".join((f"Q{report.week.number}", *floors, *place, candidate.remedy)),
        place=candidate.place,
        remedy=candidate.remedy,
        text=text,
        area_id=candidate.area_id,
        is_change=candidate.is_change,
    )
