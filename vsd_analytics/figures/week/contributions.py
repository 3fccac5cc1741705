"""Where the change of a floor lies: what each area adds to it, and what became of the floor without one area."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vsd_analytics.answer import Verdict
from vsd_analytics.figures import rates
from vsd_analytics.figures.panels import Place
from vsd_analytics.figures.week.data import WeekData


def difference(data: WeekData, place: Place) -> float:
    """Return what a place adds to the floor's change in violations per open hour, week over week.

    The sum over cameras of n/h of this week less n/h of the week before, over the camera-hours compared: n the
    violations in the place, h the camera's recorded open hours. Areas and the rest of the floor add up to the floor.
    """
    (_, then_h), (_, now_h) = (_sums(data, data.whole, k) for k in (0, 1))
    always = replace(place, is_there=None)  # before an area began, its violations are the rest of the floor's
    then, now = (_sums(data, always, k)[0] for k in (0, 1))
    is_known = (then_h > 0) & (now_h > 0)
    return float((now[is_known] / now_h[is_known] - then[is_known] / then_h[is_known]).sum())


def share_of_change(data: WeekData, place: Place) -> float | None:
    """Return the part of the floor's change that lies in a place; None where the floor did not change.

    Above 1, or below 0, where other places changed the other way.
    """
    whole = difference(data, data.whole)
    return difference(data, place) / whole if whole else None


def verdict_without(data: WeekData, place: Place) -> Verdict | None:
    """Return the verdict on how often (M0) on the floor without a place."""
    whole = data.whole
    rest = Place(whole.n - place.n * whole.cameras[:, None], whole.exposure_h - place.exposure_h, whole.cameras)
    return rates.violation_rate_change(data.pair, rest).verdict


def _sums(data: WeekData, place: Place, which: int) -> tuple[np.ndarray, np.ndarray]:
    panel = data.compared(place)[which]
    return panel.n.sum(axis=1), panel.x_h.sum(axis=1)
