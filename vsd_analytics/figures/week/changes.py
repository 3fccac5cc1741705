"""What moved: where the change of a floor lies, and figures before and after an instant of a change at the site."""

from __future__ import annotations

from dataclasses import replace
from datetime import date

import numpy as np

from vsd_analytics.answer import Reason, Verdict
from vsd_analytics.figures import rates
from vsd_analytics.figures.panels import Place
from vsd_analytics.figures.week import estimates
from vsd_analytics.figures.week.data import WeekData


def not_compared(data: WeekData) -> dict[str, Reason]:
    """Return why cameras are left out of the comparison though the rest of the floor is compared, by camera."""
    if not (data.pair.is_comparable & data.whole.cameras).any():
        return {}
    since = {r.camera_id: data.local(r.at_ms) for r in data.pair.recalibrated}
    was, is_now = (recorded_cameras(data, first) for first in (data.monday - data.span, data.monday))
    new = {c: Reason("compare.new_camera") for c in data.ids if was and c in is_now - was}
    return new | {camera_id: Reason("compare.calibrated_at", at=at) for camera_id, at in since.items()}


def recorded_cameras(data: WeekData, monday: date) -> set[str]:
    """Return the cameras that recorded any opening time of a week."""
    hours = data.hours.recorded_s[:, data.week(monday)]
    return {c for i, c in enumerate(data.ids) if hours[i].any()}


def moved_since(data: WeekData, place: Place, ms: int) -> float | None:
    """Return the share of a place's change over the week that came after an instant; None where it is not known.

    Nothing is reported where a count before or after the instant, in either week, is too small to print, or would
    tell an hour that is hidden.
    """
    if data.why_no_violations is not None or data.why_no_places is not None:
        return None
    whole, after = (estimates.measure(data, place, is_compared=True, since=at) for at in (None, ms))
    counts = (whole.n, after.n, whole.n - after.n, whole.n_before, after.n_before, whole.n_before - after.n_before)
    if data.hidden.hides_hours or data.hidden_before.hides_hours or data.mask.hides(*counts):
        return None
    change, late = (_difference(data, place, since=at) for at in (None, ms))
    return None if change == 0 else min(1.0, max(0.0, late / change))


def _difference(data: WeekData, place: Place, *, since: int | None) -> float:
    before, now = data.compared(place, since=since)
    return float(now.n.sum() - before.n.sum())


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
