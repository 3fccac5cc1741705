"""Names of the numbered spots, by area, and the question each card asks, by the rules of `remedies`."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import shapely
from shapely.geometry.base import BaseGeometry

from vsd_analytics.figures.cell_places import CellPlace
from vsd_analytics.figures.hotspots import FloorHotspots
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_sections import Evidence, SpotCard, Spots, UsualHours
from vsd_analytics.figures.week.spots import place_shape
from vsd_analytics.report.model import remedies as rules
from vsd_analytics.report.model.agenda import changed_on, fixtures_to_ask, past_questions
from vsd_analytics.site.model import Area
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say

NEAR_AREA_M: Final = 3.0
"""A hotspot outside all areas is named after one that is at most this far away."""


def with_words(spots: Spots, data: WeekData, hotspots: FloorHotspots) -> Spots:
    """Return the spots with names and questions.

    Args:
        spots: Their figures, numbered in order.
        data: The week.
        hotspots: The hotspots they were made from, in the same order where they are tested ones.
    """
    if spots.kind == "tested":
        places = {s.number: s.place for s in hotspots.spots}  # a card may be left out between two hotspots
        cards = tuple(_tested(data, card, places[card.number]) for card in spots.cards)
    else:
        cards = tuple(_busiest(data, card) for card in spots.cards)
    watching = (
        replace(one, name=place_name(s.place)) for one, s in zip(spots.watching, hotspots.watching, strict=True)
    )
    return replace(spots, cards=cards, watching=tuple(watching))


def place_name(place: CellPlace) -> str:
    """Return what a page calls a place: its area, the area it lies near, or the rest of the floor."""
    near = _near(place)
    return place.area_name or (say("spots.near", area=near) if near else say("spots.on_the_rest"))


def _near(place: CellPlace) -> str | None:
    return place.nearest_name if (place.nearest_m or 0.0) <= NEAR_AREA_M else None


def _tested(data: WeekData, card: SpotCard, place: CellPlace) -> SpotCard:
    about = place.area_name or _near(place) or say("spots.this", number=card.number)
    area = next((a for a in data.areas if a.area_id == place.area_id), None)
    ask, question = _asked(data, about, place_shape(place), area, card.evidence, card.usual)
    return replace(card, name=place_name(place), ask=ask, question=question)


def _busiest(data: WeekData, card: SpotCard) -> SpotCard:
    area = next(a for a in data.areas if a.area_id == card.area_id)
    ask, question = _asked(data, card.name, shapely.Polygon(area.polygon), area, card.evidence, card.usual)
    return replace(card, ask=ask, question=question)


def _asked(
    data: WeekData,
    name: str,
    shape: BaseGeometry,
    area: Area | None,
    evidence: Evidence | None,
    usual: UsualHours | None,
) -> tuple[str, str]:
    """Return what to ask on the card, and the same with its hours; what was asked often enough is not asked again."""
    if evidence is not None and evidence.is_camera_down:
        return say("ask.camera", camera=terms.camera_name(evidence.camera_name or "")), ""
    day = changed_on(data).get(area.area_id) if area is not None else None
    if day is not None:
        return say("ask.watched", date=fmt.date_short(day)), ""
    remedies = rules.remedies(
        name,
        shape,
        area=area,
        fixtures=fixtures_to_ask(data),
        when=rules.above_all(usual) if usual is not None else "",
        is_unsure=evidence is not None and evidence.sureness == "low",
    )
    if area is None:
        return remedies[0].short, remedies[0].text
    past = past_questions(data)
    for r in remedies:
        same = any((p.place, p.remedy) == (area.area_id, r.key) for p in past)
        asked = rules.Candidate(place=area.area_id, remedy=r.key, text=r.text, again=r.again, area_id=area.area_id)
        if rules.wording(asked, past, monday=data.monday) is not None:
            return (r.again, r.again) if same else (r.short, r.text)
    return "", ""
