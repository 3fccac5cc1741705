"""Fills the agenda of a week: what may be asked where, from shapes and fixtures, and what earlier reports asked."""

from __future__ import annotations

from datetime import date, timedelta
from typing import Final

import shapely
from shapely.geometry.base import BaseGeometry

from vsd_analytics.config.asked_questions import read_asked
from vsd_analytics.config.change_log import read_answers, read_log
from vsd_analytics.figures.change_weeks import REFERENCE_WEEKS
from vsd_analytics.figures.comparison_areas import areas_that_serve
from vsd_analytics.figures.hotspots import FloorHotspots
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.week.areas import busiest_area
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.density import floor_fixtures
from vsd_analytics.figures.week.model_estimate import same_fields
from vsd_analytics.figures.week.model_sections import SpotCard
from vsd_analytics.figures.week.results import AreaRow
from vsd_analytics.figures.week.spots import place_shape
from vsd_analytics.report.model import remedies as rules
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.model.week_agenda import Agenda, PastQuestion, PlaceToAsk
from vsd_analytics.site.model import Fixture

WATCHED: Final = timedelta(days=28)
"""So long after a logged change nothing else is asked about its area: two changes at once cannot be separated."""
MEMORY: Final = timedelta(weeks=52)
"""Questions of earlier years are forgotten."""
BUSIEST_WEEKS: Final = 8
"""Weeks before in which the same busiest area is no news."""
OWN: Final = timedelta(weeks=26)
"""An answer so near to a week answers its own question; ids of questions come again each year."""


def agenda(report: WeekReport, data: WeekData, hotspots: FloorHotspots | None) -> Agenda:
    """Return what this week may ask, and what earlier weeks asked.

    Args:
        report: The report with its areas and numbered spots.
        data: The week.
        hotspots: The hotspots its cards were made from; None = there are none.
    """
    return Agenda(
        places=_places(report, data, hotspots), asked=past_questions(data), busiest_before=_busiest_before(data)
    )


def changed_on(data: WeekData) -> dict[str, date]:
    """Return the local day of the last logged change of each area in the four weeks up to the end of this one."""
    end = data.midnight(data.monday + WEEK)
    recent = [e for e in read_log(data.site) if e.area_id is not None and end - WATCHED <= e.at < end]
    return {str(e.area_id): e.at.astimezone(data.site.zone).date() for e in recent}


def fixtures_to_ask(data: WeekData) -> tuple[Fixture, ...]:
    """Return the fixtures a question may name: one that was moved in the last four weeks is watched where it is."""
    recent = data.midnight(data.monday + WEEK) - WATCHED
    return tuple(f for f in floor_fixtures(data) if f.valid_from is None or f.valid_from <= recent)


def past_questions(data: WeekData) -> tuple[PastQuestion, ...]:
    """Return the questions of earlier weeks with their last answers; what came after this week is not known to it.

    The week's own question is among them once it is answered, whenever that was: then the page asks nothing.
    """
    site, end = data.site, data.midnight(data.monday + WEEK)
    asked = [
        a
        for a in read_asked(site)
        if a.floor_id == data.floor.floor_id and data.monday - MEMORY <= a.monday <= data.monday
    ]
    answers = read_answers(site) if asked else ()
    known = {a.question: a for a in answers if end - MEMORY <= a.at < end}
    own = {a.question: a for a in answers if end - OWN <= a.at < end + OWN}
    changes = {(e.question, e.at): number for number, e in enumerate(read_log(site), 1) if e.question is not None}
    questions = []
    for one in asked:
        answer = (own if one.monday == data.monday else known).get(one.question_id)
        if answer is None and one.monday == data.monday:
            continue
        questions.append(
            same_fields(
                PastQuestion,
                one,
                number=one.monday.isocalendar().week,
                answer=None if answer is None else answer.kind,
                answered_at=None if answer is None else answer.at.astimezone(site.zone),
                answer_text="" if answer is None else answer.text,
                by=None if answer is None else answer.by,
                change=None if answer is None else changes.get((one.question_id, answer.at)),
            )
        )
    return tuple(questions)


def _places(report: WeekReport, data: WeekData, hotspots: FloorHotspots | None) -> tuple[PlaceToAsk, ...]:
    """Return the material areas, the rest of the floor last: most time beyond its crowd first, then most violations."""
    cards = {c.area_id: c for c in reversed(report.spots.cards)} if report.spots is not None else {}
    spots = {} if hotspots is None else {s.number: place_shape(s.place) for s in hotspots.spots}
    is_tested = report.spots is not None and report.spots.kind == "tested"
    shapes = {area_id: spots.get(c.number) for area_id, c in cards.items()} if is_tested else {}
    changed = changed_on(data)
    rows = [a for a in report.areas if a.is_material and a.violation_rate.value]
    beyond = {area_id: c.excess_min_per_week or 0.0 for area_id, c in cards.items()}
    rows.sort(
        key=lambda a: (
            a.area_id is None and a.area_id not in cards,
            -beyond.get(a.area_id, 0.0),
            -(a.violation_rate.value or 0.0),
        )
    )
    return tuple(_place(row, cards.get(row.area_id), shapes.get(row.area_id), report, data, changed) for row in rows)


def _place(
    row: AreaRow,
    card: SpotCard | None,
    shape: BaseGeometry | None,
    report: WeekReport,
    data: WeekData,
    changed: dict[str, date],
) -> PlaceToAsk:
    area = next((a for a in data.areas if a.area_id == row.area_id), None)
    evidence = None if card is None else card.evidence
    usual = None if card is None else card.usual
    when = rules.above_all(usual) if usual is not None else rules.above_all_hour(report)
    if area is None:
        remedies = rules.rest_of_floor(rules.around_hour(report))
    else:
        remedies = rules.remedies(
            area.name,
            shapely.Polygon(area.polygon) if shape is None else shape,
            area=area,
            fixtures=fixtures_to_ask(data),
            when=when,
            is_unsure=evidence is not None and evidence.sureness == "low",
        )
    return PlaceToAsk(
        place=row.area_id or rules.REST,
        area_id=row.area_id,
        name=row.name,
        remedies=remedies,
        is_testable=area is None or bool(areas_that_serve(data, area, _weeks_before(data))[0]),
        changed_on=changed.get(row.area_id or ""),
    )


def _weeks_before(data: WeekData) -> tuple[date, date]:
    """Return the days that a change made after this week would be compared with, as far as they are loaded."""
    return max(data.warehouse.first, data.sunday - REFERENCE_WEEKS * WEEK + timedelta(days=1)), data.sunday


def _busiest_before(data: WeekData) -> tuple[str, ...]:
    """Return the busiest area of each week before, the latest first; weeks in which it had few are left out."""
    busiest = []
    for k in range(1, BUSIEST_WEEKS + 1):
        inside = data.week(data.monday - k * WEEK)
        sums = {a.area_id: float(data.area(a.area_id).n[:, inside].sum()) for a in data.areas}
        best = busiest_area(data, {k: n for k, n in sums.items() if n}, total=float(data.whole.n[:, inside].sum()))
        if best is not None and not data.mask.hides(round(sums[best])):
            busiest.append(best)
    return tuple(busiest)
