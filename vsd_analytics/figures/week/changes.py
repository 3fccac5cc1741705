"""What moved around a change at the site: cameras that do not compare, figures before and after an instant."""

from __future__ import annotations

from datetime import date

from vsd_analytics.answer import Reason
from vsd_analytics.figures.panels import Place
from vsd_analytics.figures.week import estimates
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_estimate import Estimate


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


def since_instant(data: WeekData, place: Place, ms: int) -> tuple[Estimate | None, float | None]:
    """Return a place since an instant against the same hours of the week before, and the share of its change.

    Nothing is reported where a count before or after the instant, in either week, is too small to print, or would
    tell an hour that is hidden.
    """
    if data.why_no_violations is not None or data.why_no_places is not None:
        return None, None
    whole, after = (estimates.measure(data, place, is_compared=True, since=at) for at in (None, ms))
    counts = (whole.n, after.n, whole.n - after.n, whole.n_before, after.n_before, whole.n_before - after.n_before)
    if data.hidden.hides_hours or data.hidden_before.hides_hours or data.mask.hides(*counts):
        return None, None
    change, late = (_difference(data, place, since=at) for at in (None, ms))
    return after.violation_rate, None if change == 0 else min(1.0, max(0.0, late / change))


def _difference(data: WeekData, place: Place, *, since: int | None) -> float:
    before, now = data.compared(place, since=since)
    return float(now.n.sum() - before.n.sum())
