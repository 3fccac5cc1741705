"""The changes of the areas of a floor, judged together: how often and how risky of every area are one family a week."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from vsd_analytics.figures import rates
from vsd_analytics.figures.panels import TwoPeriods
from vsd_analytics.stats.estimates import ChangeEstimate
from vsd_analytics.stats.family import judge_family

Changes = tuple[ChangeEstimate, ChangeEstimate]
"""How often and how risky."""


def area_changes(pair: TwoPeriods) -> Mapping[str | None, Changes]:
    """Return the changes of every area and (None) the rest of the floor, with the verdicts of their family.

    Ratios and intervals remain each area's own. An area's verdict is the same whichever areas are asked for.

    Args:
        pair: Two periods of a floor whose violations can be placed.
    """
    keys = [*(a.area_id for a in pair.data.areas), None]
    floor, *areas = (
        (rates.change_often(pair, place), rates.change_risky(pair, place))
        for place in (pair.now.whole, *map(pair.now.area, keys))
    )
    settings = pair.data.site.settings
    often, risky = judge_family(
        [(floor[k], [area[k] for area in areas]) for k in (0, 1)],
        confidence=settings.confidence,
        about_same_share=settings.about_same_share,
    )
    return {
        key: (replace(area[0], verdict=first.verdict), replace(area[1], verdict=second.verdict))
        for key, area, first, second in zip(keys, areas, often, risky, strict=True)
    }
