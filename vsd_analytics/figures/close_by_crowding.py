"""Time too close by how crowded it was: what a fair comparison of sites is made of (M6, by crowding and by day).

Crowding of a camera's hour is Lloyd's mean crowding per 100 m² of the floor that counts for the camera,

    c = 2 P / X / (A / 100),

with P the pair-hours of any two people in view at once, X the person-hours, and A the floor it sees that no other
camera counts, without fixtures. It is the number of others that a person has in view on average. Hours are put into
classes of c; each class is wider than the one before by the square root of two. Source of c: Lloyd, Mean crowding,
Journal of Animal Ecology 36 (1967).
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from itertools import pairwise
from typing import Final

import numpy as np
import shapely

from vsd_analytics.answer import Reason, State
from vsd_analytics.figures.close_time import SECONDS, close_time
from vsd_analytics.figures.floor_space import VIEW_UNKNOWN, fixtures_of, view_of
from vsd_analytics.figures.mixing import pair_time
from vsd_analytics.figures.panels import Array, Ints
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.week.results import CloseByCrowding, CloseInClasses, CloseInDays
from vsd_analytics.settings import OWNER_CELL_M
from vsd_analytics.warehouse.owner_spans import owner_spans

EDGES: Final = tuple(float(f"{0.5 * 2 ** (k / 2):.4g}") for k in range(15))
"""Where classes of crowding begin, after the first: 0.5 to 64 others in view per 100 m²."""


def close_by_crowding(period: Period, *, why_hidden: Reason | None, is_by_day: bool = True) -> CloseByCrowding:
    """Return person-hours and those too close by class of crowding, for each day and for all days.

    Of the camera-hours that enter rates. No part has a count of violations from 1 to under `mask_below`: days, and
    classes, are put together with the next until none has.

    Args:
        period: The days.
        why_hidden: Why no count of the floor is shown; None where they are.
        is_by_day: False: all days are one, as that of a day would tell an hour that is hidden.
    """
    data = period.data
    if (why := period.why_no_exposure or period.why_no_violations or period.why_no_places) is not None:
        return _missing("not_measurable", why)
    if why_hidden is not None:
        return _missing("not_enough_data", why_hidden)
    place = close_time(period, data.floor)
    used = (place.cameras & period.whole.cameras)[:, None] & data.hours.is_counted & period.is_inside
    if not used.any():
        return _missing("not_enough_data", NOTHING_OPEN)
    seen_m2 = counted_floor_m2(period)
    if np.isnan(seen_m2[used.any(axis=1)]).any():
        return _missing("not_measurable", VIEW_UNKNOWN)
    pairs = pair_time(data).exposure_h
    others = np.divide(2 * pairs, place.exposure_h, out=np.zeros_like(pairs), where=place.exposure_h > 0)
    of_class = np.searchsorted(EDGES, others * 100 / np.maximum(seen_m2, 1.0)[:, None], side="right")

    camera, hour = np.nonzero(used)
    at = data.hours.day[hour], of_class[camera, hour]
    first = period.first.toordinal()
    shape = (period.last.toordinal() - first + 1, len(EDGES) + 1)
    known, close = data.given(data.everyone), data.given(place)
    n, close_h, person_h = (
        _sums(shape, (at[0] - first, at[1]), values[camera, hour])
        for values in (known.n, close.n / SECONDS, close.exposure_h)
    )
    if data.mask.hides(float(n.sum())):
        return _missing("not_enough_data", data.mask.why)
    seen = np.flatnonzero(np.bincount(at[0] - first, minlength=shape[0]))
    return CloseByCrowding(
        edges=EDGES,
        days=tuple(
            CloseInDays(
                first=date.fromordinal(first + int(run[0])),
                last=date.fromordinal(first + int(run[-1])),
                close_h=float(close_h[run].sum()),
                person_h=tuple(person_h[run].sum(axis=0).tolist()),
            )
            for run in (runs(seen, n.sum(axis=1), mask=data.mask) if is_by_day else [seen])
        ),
        classes=tuple(
            CloseInClasses(first=int(run[0]), last=int(run[-1]), close_h=float(close_h[:, run].sum()))
            for run in runs(np.flatnonzero(person_h.any(axis=0)), n.sum(axis=0), mask=data.mask)
        ),
    )


def counted_floor_m2(period: Period) -> Array:
    """Return the floor that counts for each camera at the end of a period, square metres; NaN for an unknown view.

    It is the view within the plan, without fixtures and without the cells that another camera counts.
    """
    data, (_, end_ms) = period.data, period.span_ms
    fixtures = fixtures_of(period)
    spans = (s for s in owner_spans(data.site) if s.floor_id == data.floor.floor_id)
    cells = next(s.cells for s in spans if s.from_ms <= end_ms - 1 < s.to_ms)
    middles = (np.array([(c.cx, c.cy) for c in cells], dtype=np.float64).reshape(-1, 2) + 0.5) * OWNER_CELL_M
    owner = np.array([c.camera_id for c in cells], dtype=np.str_)
    counted_m2 = []
    for camera in data.cameras:
        view = view_of(period, camera)
        if view is None:
            counted_m2.append(np.nan)
            continue
        free = view.difference(fixtures)
        others = middles[owner != camera.camera_id]
        counted_m2.append(
            free.area - int(shapely.contains_xy(free, others[:, 0], others[:, 1]).sum()) * OWNER_CELL_M**2
        )
    return np.array(counted_m2, dtype=np.float64)


def runs(positions: Ints, counts: Array, *, mask: Mask) -> list[Ints]:
    """Return positions put together, in order, so that no run has a count that is too small to print.

    Args:
        positions: What there is, rising.
        counts: The count at each position there could be.
        mask: Tells which counts are too small.

    Returns:
        The runs; one run of all positions where their count is itself too small.
    """
    ends, total = [0], 0.0
    for k, position in enumerate(positions.tolist(), start=1):
        total += counts[position]
        if not mask.hides(total):
            ends.append(k)
            total = 0.0
    if ends[-1] < len(positions):
        while len(ends) > 1 and mask.hides(float(counts[positions[ends[-1] :]].sum())):
            ends.pop()
        ends.append(len(positions))
    return [positions[a:b] for a, b in pairwise(ends)]


def _sums(shape: tuple[int, int], at: Sequence[Ints], values: Array) -> Array:
    sums = np.zeros(shape)
    np.add.at(sums, tuple(at), values)
    return sums


def _missing(state: State, why: Reason) -> CloseByCrowding:
    return CloseByCrowding(state=state, reason=why)
