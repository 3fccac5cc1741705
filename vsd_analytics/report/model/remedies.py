"""What may be asked about a place: the remedies that fit it, and whether earlier weeks leave a question to ask.

A rule table over a place's shape, its name, and the fixtures around it gives the remedies, first what fits best; `ask`
of the area in `vsd.toml` comes before all. Questions are about the room, never about people.

A question is asked once, and once more in other words while nobody answers. Then another remedy or place is next. What
is not possible is never asked again; what was put off is asked again after four weeks; a place that was just changed is
watched instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vsd_analytics.figures.week.model_sections import UsualHours
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.model.week_agenda import PastQuestion, Remedy
from vsd_analytics.site.model import Area, Fixture
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import days

REST: Final = "rest"
"""Place of a question about the rest of the floor."""
PUT_OFF: Final = timedelta(days=28)
"""What was put off is asked again after so long."""
FORGET: Final = timedelta(weeks=26)
"""What nobody answered may be asked again after so long."""
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
    keys = ["queue"] if is_queue or named == "queue" else []
    keys += [f"move-{f.fixture_id}" for f in movable]
    if shape is not None and is_aisle_end(shape, near) and keys[:1] != ["queue"]:
        keys.append("one_way")  # a queue beside shelves stays a queue
    keys += [named, "spread", "fewer"]
    names = {f"move-{f.fixture_id}": f.name for f in movable}
    return (*own, *(_asked(key, name, when, names.get(key, "")) for key in dict.fromkeys(keys)))


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
