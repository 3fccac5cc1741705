"""The changes of the areas of a floor, judged together: how often and time too close are one family a week.

Encounters per person-hour (M7) and time too close per open hour are no claims of their own; each is judged as a family
of its own, so that a list of areas that prints them has few false verdicts as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from vsd_analytics.figures import close_time, rates
from vsd_analytics.figures.panels import Place
from vsd_analytics.figures.periods import TwoPeriods
from vsd_analytics.site.model import Area, Floor
from vsd_analytics.stats.estimates import ChangeEstimate
from vsd_analytics.stats.family import judge_family


@dataclass(frozen=True, slots=True)
class AreaChanges:
    """The changes of one place.

    Attributes:
        violation_rate: How often, M0.
        close: The share of person-time too close, M6.
        encounter_rate: Encounters per person-hour, M7.
        burden: Person-minutes too close per open hour.
    """

    violation_rate: ChangeEstimate
    close: ChangeEstimate
    encounter_rate: ChangeEstimate
    burden: ChangeEstimate


FAMILIES = (("violation_rate", "close"), ("encounter_rate",), ("burden",))
"""Which changes of all areas are judged together; the first are the claims about a week."""


def area_changes(pair: TwoPeriods) -> Mapping[str | None, AreaChanges]:
    """Return the changes of every area and (None) the rest of the floor, with the verdicts of their family.

    Ratios and intervals remain each area's own. An area's verdict is the same whichever areas are asked for.

    Args:
        pair: Two periods of a floor whose violations can be placed.
    """
    areas: list[Area | None] = [*pair.data.areas, None]
    floor = _changes(pair, pair.now.whole, pair.data.floor)
    keys = [None if area is None else area.area_id for area in areas]
    changes = [_changes(pair, pair.now.area(key), area) for key, area in zip(keys, areas, strict=True)]
    settings = pair.data.site.settings
    for names in FAMILIES:
        judged = judge_family(
            [(getattr(floor, name), [getattr(area, name) for area in changes]) for name in names],
            confidence=settings.confidence,
            about_same_share=settings.about_same_share,
        )
        for name, verdicts in zip(names, judged, strict=True):
            changes = [
                replace(area, **{name: replace(getattr(area, name), verdict=own.verdict)})
                for area, own in zip(changes, verdicts, strict=True)
            ]
    return dict(zip(keys, changes, strict=True))


def _changes(pair: TwoPeriods, place: Place, where: Floor | Area | None) -> AreaChanges:
    close = close_time.close_time(pair.now, where)
    return AreaChanges(
        violation_rate=rates.violation_rate_change(pair, place),
        close=close_time.change_close_time_share(pair, close),
        encounter_rate=rates.encounter_rate_change(pair, place),
        burden=close_time.change_burden(pair, close),
    )
