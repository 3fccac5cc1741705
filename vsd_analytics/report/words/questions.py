"""What to ask about the room: which remedies fit a place, and which question of them this week asks.

A rule table over a place's shape, its name, and the fixtures around it gives the remedies, first what fits best (brief,
4.3); `ask` of the area in `vsd.toml` comes before all. Questions are about the room, never about people.

A question is asked once, and once more in other words while nobody answers. Then another remedy or place is next. What
is not possible is never asked again; what was put off is asked again after four weeks; a place that was just changed is
watched instead.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vsd_analytics.figures.week.model_sections import UsualHours
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.model.week_agenda import PastQuestion, PlaceToAsk, Remedy
from vsd_analytics.report.words import terms
from vsd_analytics.report.words.no_data import nothing
from vsd_analytics.report.words.things_to_know import weakest_camera
from vsd_analytics.site.model import Area, Fixture
from vsd_analytics.site.questions import AskedQuestion
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import days

REST: Final = "rest"
"""Place of a question about the rest of the floor."""
FLOOR: Final = "floor"
"""Place of a question about the whole floor, its data, or the site."""
PUT_OFF: Final = timedelta(days=28)
"""What was put off is asked again after so long."""
FORGET: Final = timedelta(weeks=26)
"""What nobody answered may be asked again after so long."""
EVENT: Final = timedelta(weeks=4)
"""The same of what happened in a week: a rise, a camera that was down."""
OPEN_MAX: Final = 3
"""Open questions that a page names when it has nothing new to ask."""
NEAR_M: Final = 2.0
"""Fixtures this near to a spot belong to it."""
LONG: Final = 2.5
"""A spot at least this many times as long as wide is shaped like a queue."""
END_M: Final = 1.5
"""Two shelves whose ends are this near to a spot make it the end of an aisle."""

# Words in an area's name -> the key of the question to ask about it; the last fits every name.
BY_NAME: Final = (
    (("queue", "checkout", "till", "counter", "desk", "coda", "fila", "cassa", "casse", "banco", "sportell"), "queue"),
    (("entrance", "door", "exit", "lobby", "foyer", "ingresso", "entrata", "porta", "uscita", "atrio"), "entrance"),
    (("aisle", "corridor", "passage", "corsia", "corridoio", "passaggio"), "one_way"),
    (("",), "spread"),
)


FACTS: Final = ("where", "check")
"""Remedies that find something out: to do it is no change of the site."""
SLUGS: Final = {"queue": "wait", "one_way": "one-way", "entrance": "clear"}
"""How a remedy is called in the id of its question, where its key would say nothing."""


def by_name(name: str) -> str:
    """Return the key of the question an area's name suggests."""
    return next(key for words, key in BY_NAME if any(w in name.casefold() for w in words))


def remedies(
    name: str,
    shape: BaseGeometry | None,
    *,
    area: Area | None,
    fixtures: Sequence[Fixture],
    when: str = "",
    is_unsure: bool = False,
) -> tuple[Remedy, ...]:
    """Return what may be asked about a place, first what fits best.

    Args:
        name: What the place is called.
        shape: Its floor, metres; None = unknown, then only its name decides.
        area: The area of `vsd.toml` it lies in.
        fixtures: Those of its floor.
        when: Set behind the question, such as ", above all on Saturday around 13:00"; empty for nothing.
        is_unsure: The place itself is in doubt: ask to check it first, and propose nothing that costs much.
    """
    near = [] if shape is None else [f for f in fixtures if Polygon(f.polygon).distance(shape) <= NEAR_M]
    movable = sorted((f for f in near if f.is_movable), key=lambda f: Polygon(f.polygon).distance(shape))
    named = by_name(name)
    is_queue = shape is not None and is_long(shape) and any(f.kind == "till" for f in near)
    own = [_own(area.ask)] if area is not None and area.ask else []
    if is_unsure:
        return (_asked("check", name, when), *own, *(_asked(key, name, when) for key in ("spread", "fewer")))
    found = ["queue"] if is_queue or named == "queue" else []
    found += [f"move-{f.fixture_id}" for f in movable]
    if shape is not None and is_aisle_end(shape, near) and found[:1] != ["queue"]:
        found.append("one_way")  # a queue beside shelves stays a queue
    found += [named, "spread", "fewer"]
    names = {f"move-{f.fixture_id}": f.name for f in movable}
    return (*own, *(_asked(key, name, when, names.get(key, "")) for key in dict.fromkeys(found)))


def rest_of_floor(when: str) -> tuple[Remedy, ...]:
    """Return what may be asked about the floor outside all areas."""
    text, again = say("question.rest", when=when), say("again.rest", when=when)
    return (Remedy(key="where", text=text, again=again, short=text),)


def _asked(key: str, name: str, when: str, fixture: str = "") -> Remedy:
    rule = "movable" if fixture else key
    texts = [
        say(f"{t}.{rule}", area=name, fixture=fixture, when=w) for t, w in (("ask", when), ("again", ""), ("ask", ""))
    ]
    return Remedy(key=SLUGS.get(key, key), text=texts[0], again=texts[1], short=texts[2])


def _own(text: str) -> Remedy:
    return Remedy(key="own", text=text, again=text, short=text)


def is_long(shape: BaseGeometry) -> bool:
    """Tell whether the smallest rectangle around a shape, turned as need be, is at least 2.5 times as long as wide."""
    short, long = _sides(shape)
    return long >= LONG * short > 0


def is_aisle_end(shape: BaseGeometry, fixtures: Sequence[Fixture]) -> bool:
    """Tell whether two long shelves end near a shape that is not between them for most of their length."""
    ends = []
    for fixture in fixtures:
        polygon = Polygon(fixture.polygon)
        short, long = _sides(polygon)
        is_beside = shape.buffer(END_M).intersection(polygon).area < 0.5 * polygon.area
        if fixture.kind == "shelf" and long >= LONG * short and polygon.distance(shape) <= END_M and is_beside:
            ends.append(fixture)
    return len(ends) >= 2


def _sides(shape: BaseGeometry) -> tuple[float, float]:
    box = shape.minimum_rotated_rectangle
    if not isinstance(box, Polygon):
        return 0.0, 0.0
    x, y = box.exterior.coords.xy
    a, b = ((x[i + 1] - x[i]) ** 2 + (y[i + 1] - y[i]) ** 2 for i in (0, 1))
    return min(a, b) ** 0.5, max(a, b) ** 0.5


# which question -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A question that a week could ask.

    Attributes:
        place: Id of an area or camera, `REST` or `FLOOR`.
        remedy: What it proposes.
        text: Its words.
        again: Other words for the same; empty = none.
        area_id: Area it is about; None = none.
        is_change: To try it is to change the site.
        forget: It may be asked again after so long.
    """

    place: str
    remedy: str
    text: str
    again: str = ""
    area_id: str | None = None
    is_change: bool = True
    forget: timedelta = FORGET


def may_ask(report: WeekReport) -> bool:
    """Tell whether a report has a question of the week: other days and a week that is only begun have none."""
    return report.week.is_week and not report.is_so_far


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


def wording(candidate: Candidate, past: Sequence[PastQuestion], *, monday: date) -> str | None:
    """Return the words in which a week may ask a question; None when it may not.

    Args:
        candidate: The question.
        past: What earlier weeks asked, oldest first.
        monday: First day of the week that asks.
    """
    same = [p for p in past if (p.place, p.remedy) == (candidate.place, candidate.remedy)]
    if not same:
        return candidate.text
    other = candidate.again or candidate.text
    answered = max((p for p in same if p.answer is not None), key=lambda p: (p.answered_at, p.monday), default=None)
    since = same
    if answered is not None and answered.answered_at is not None:
        if answered.answer != "later" or monday - answered.answered_at.date() < PUT_OFF:
            return None
        since = [p for p in same if p.monday > answered.monday and p.monday > answered.answered_at.date()]
        if not since:
            return say("question.put_off", week=answered.number, question=other)
    if monday - since[-1].monday >= candidate.forget:
        return say("question.before", week=since[-1].number, question=other)
    recent = [p for p in since if monday - p.monday < candidate.forget]
    return say("question.open", week=recent[0].number, question=other) if len(recent) == 1 else None


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
    made = remedies(spot.name, None, area=None, fixtures=(), when=above_all_hour(report))
    if card is not None and card.question:
        made = (Remedy(key=made[0].key, text=card.question, again=made[0].again, short=card.ask), *made[1:])
    return (PlaceToAsk(place=spot.area_id, area_id=spot.area_id, name=spot.name, remedies=made),)


def around_hour(report: WeekReport) -> str:
    """Return when the floor is busiest: "on Saturday around 13:00"."""
    busiest = report.busiest_hour
    if busiest is None:
        return say("question.busy")
    return say("question.when", day=fmt.weekday(busiest.start.date()), clock=fmt.clock(busiest.start))


def above_all_hour(report: WeekReport) -> str:
    """Return the same as the end of a question."""
    return say("question.above_all", when=around_hour(report))


def above_all(usual: UsualHours) -> str:
    """Return the usual hours of a spot as the end of a question."""
    first, last = fmt.hour_label(usual.first_hour), fmt.hour_label(usual.last_hour + 1)
    when = say("question.when_usual", first=first, last=last)
    if usual.weekday is not None:
        when = say("question.when_usual_day", day=days()[usual.weekday], first=first, last=last)
    return say("question.above_all", when=when)


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
