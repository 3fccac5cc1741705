"""Where people spend more time too close than the crowd explains, and since when (M20).

The test is made over the trailing `hotspot_days` (28) days (`hotspot_windows`). The same test over windows that end
one, two, ... weeks earlier shows which hotspots are new (`hotspot_history`). A change of the log in or near a place
restarts its window: until enough days have passed, a hotspot there is watched.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import date, timedelta
from typing import Final, Literal

import numpy as np
from scipy import ndimage

from vsd_analytics.answer import Reason
from vsd_analytics.figures.cell_places import CellPlace, place_of
from vsd_analytics.figures.floor_days import Flags, FloorDays, Grid
from vsd_analytics.figures.hotspot_history import Found, Identity, PastSpot, follow
from vsd_analytics.figures.hotspot_windows import CELL_M, State, Window, floor_windows, untested_by_change, window_of
from vsd_analytics.figures.week.model_estimate import same_fields
from vsd_analytics.site.model import Area, Site
from vsd_analytics.stats import hotspots as test
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import Warehouse

LOOKS_BACK: Final = 12
"""Weeks of earlier windows that are compared."""
WEEK: Final = timedelta(days=7)
OUTLINED_SHARE: Final = 0.95
"""Share of a hotspot's excess that its outline holds."""

SpotState = Literal["new", "persisting"]


@dataclass(frozen=True, slots=True)
class FloorSpot:
    """One hotspot.

    Attributes:
        number: Its rank by excess, from 1.
        spot_id: Stays the same from week to week (`spot_history`).
        state: "persisting" when it also stood out a week earlier, else "new"; None without an earlier window.
        since: Last day of the earliest window from which on it stood out in every one.
        is_since_first: That window is the earliest looked at, so that it may be older.
        place: The fewest of the cells that pass together that hold 95 % of their excess: its cells.
        ratio: Time in violation over that which crowding explains.
        lo, hi: Its interval; None where days do not allow one.
        n: Violations in the window whose midpoint lies in its cells or within half the legal distance of them: so far
            from the midpoint do the two people stand whose time is in the cells.
        by_week: The same by seven days, the last first; the earliest may be fewer days.
        violation_h: Person-hours in violation in its cells.
        expected_h: Those that crowding explains.
        exposure_h: Person-hours in its cells.
        excess_min_per_week: Person-minutes in violation above the expected, per week of as many open days as the window
            has on average.
        excess_min_lo, excess_min_hi: The same at the ends of the interval.
        q: Least false discovery rate at which one of its cells passes.
    """

    number: int
    spot_id: str
    state: SpotState | None
    since: date
    is_since_first: bool
    place: CellPlace
    ratio: float
    lo: float | None
    hi: float | None
    n: int
    by_week: tuple[int, ...]
    violation_h: float
    expected_h: float
    exposure_h: float
    excess_min_per_week: float
    excess_min_lo: float | None
    excess_min_hi: float | None
    q: float


@dataclass(frozen=True, slots=True)
class ResolvedSpot:
    """A hotspot of an earlier window that is none now, or that is watched after a change: its own cells then and now.

    Attributes:
        spot_id: As for `FloorSpot`.
        place: Where it was.
        ratio_before: Its ratio in the last window in which it was a hotspot.
        ratio, lo, hi: The ratio of the same cells now, since the change where there was one; None without anybody
            there.
        n: Violations now, as for `FloorSpot`; None likewise.
        by_week: As for `FloorSpot`.
        changed_on: Day of the last change of the log in or near it within the window; None without one.
    """

    spot_id: str
    place: CellPlace
    ratio_before: float
    ratio: float | None
    lo: float | None
    hi: float | None
    n: int | None
    by_week: tuple[int, ...]
    changed_on: date | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FloorHotspots:
    """The hotspots of a floor.

    Attributes:
        floor_id, floor_name: The floor.
        first, last: The window, from its first day on which a camera recorded anything.
        state: "ok", or why there is no result.
        reason: Why not, unless "ok".
        n_days: Days of the window on which a camera recorded enough.
        n: Violations on them; None where they cannot be known.
        exposure_h: Person-hours on them; likewise.
        compared_with: Last day of the window that tells new from persisting; None without one.
        spots: By excess, greatest first.
        resolved: Hotspots of that window that are no hotspots any more.
        watching: Hotspots of earlier windows in or near which something was changed, with too few days since to decide.
        grid: The cells, None unless "ok".
        cells: What the test says of each; likewise.
        notes: What a reader must know beside.
    """

    floor_id: str
    floor_name: str
    first: date
    last: date
    state: State
    reason: Reason | None
    n_days: int
    n: int | None
    exposure_h: float | None
    compared_with: date | None
    spots: tuple[FloorSpot, ...]
    resolved: tuple[ResolvedSpot, ...]
    watching: tuple[ResolvedSpot, ...]
    grid: Grid | None
    cells: test.Cells | None
    notes: tuple[Reason, ...]


def days_needed(site: Site, until: date) -> tuple[date, date]:
    """Return the days to open the warehouse over, for hotspots of the window that ends with `until`: all windows."""
    first = until - LOOKS_BACK * WEEK - timedelta(days=int(site.settings.hotspot_days) - 1)
    extent = stored_extent(site, near=until)
    return (first if extent is None else min(until, max(first, extent.first_day))), until


def hotspots(warehouse: Warehouse, *, floor_id: str | None = None, until: date | None = None) -> FloorHotspots:
    """Return the hotspots of a floor in the trailing window, ranked by what could be saved, and what became of others.

    Args:
        warehouse: Opened over `days_needed`; windows it does not reach back to are not looked at.
        floor_id: The floor; None = the first.
        until: Last day of the window; None = the warehouse's last.

    Raises:
        KeyError: The site has no floor of this id.

    Example:
        >>> vsd.hotspots(warehouse).state  # needs 14 recorded days
        'not_enough_data'
    """
    site, last = warehouse.site, until or warehouse.last
    floor = next((f for f in site.floors if floor_id in (None, f.floor_id)), None)
    if floor is None:
        raise KeyError(floor_id)
    data = FloorDays(warehouse, floor, cell_m=CELL_M)
    whole = floor_windows(warehouse, data)
    looks = [window_of(whole, last - k * WEEK) for k in range(LOOKS_BACK, -1, -1)]
    now = looks[-1]
    is_open = data.is_open[now.days]
    known = data.is_used[:, now.days].any(axis=0)
    compared = [look for look in looks[:-1] if look.tested is not None]
    spots: tuple[FloorSpot, ...] = ()
    resolved: tuple[ResolvedSpot, ...] = ()
    watching: tuple[ResolvedSpot, ...] = ()
    if now.tested is not None and data.grid is not None:
        areas = [a for a in site.areas if a.floor_id == floor.floor_id]
        looked = [*compared, now]
        history = follow(
            [Found(look.last, look.tested, untested_by_change(look)) for look in looked if look.tested is not None],
            floor_id=floor.floor_id,
            cell_m=CELL_M,
            first_cell=(data.grid.cx, data.grid.cy),
        )
        per_week = float(is_open.sum()) / len(is_open) * 7
        spots = tuple(
            _spot(
                s, history.now[s.label], now, data.grid, areas, open_days_per_week=per_week,
                reach_m=site.settings.distance_m / 2, confidence=site.settings.confidence,
            )
            for s in now.tested.spots
        )  # fmt: skip
        ranked = sorted(spots, key=lambda s: (-s.excess_min_per_week, s.number))
        spots = tuple(replace(s, number=i) for i, s in enumerate(ranked, 1))
        resolved, watching = (
            tuple(_past(one, now, looked[one.window], data.grid, areas, site) for one in past)
            for past in (history.resolved, history.watching)
        )
    cube = now.cube
    return FloorHotspots(
        floor_id=floor.floor_id,
        floor_name=floor.name,
        first=_first_recorded(warehouse, data, now),
        last=last,
        state=now.state,
        reason=now.reason,
        n_days=int(known.sum()),
        n=None if cube is None else round(float(cube.n.sum())),
        exposure_h=None if cube is None else float(cube.exposure_h.sum()),
        compared_with=compared[-1].last if now.tested is not None and compared else None,
        spots=spots,
        resolved=resolved,
        watching=watching,
        grid=data.grid if now.tested is not None else None,
        cells=now.tested.cells if now.tested is not None else None,
        notes=_notes(warehouse, data, now),
    )


def _first_recorded(warehouse: Warehouse, data: FloorDays, look: Window) -> date:
    """Return the first day of a window on which a camera of the floor recorded anything; its first day without any."""
    first = look.last - timedelta(days=int(warehouse.site.settings.hotspot_days) - 1)
    [row] = warehouse.rows(
        "select min(local_date) as day from camera_hours "
        "where floor_id = $floor and recorded_s > 0 and local_date between $first and $last",
        {"floor": data.floor.floor_id, "first": first, "last": look.last},
    )
    return first if row["day"] is None else row["day"]


def _spot(
    spot: test.Spot,
    identity: Identity,
    now: Window,
    grid: Grid,
    areas: Sequence[Area],
    *,
    open_days_per_week: float,
    reach_m: float,
    confidence: float,
) -> FloorSpot:
    assert now.tested is not None
    cells, inside = now.tested.cells, _outlined(now.tested, spot.label)
    rate = test.place_rate(now.tested.explained, inside, confidence=confidence) or spot.rate
    per_week = 60 * open_days_per_week / rate.n_days
    by_week = _by_week(now, inside, reach_m=reach_m)
    return same_fields(
        FloorSpot,
        rate,
        **asdict(identity),
        ratio=rate.value,
        number=spot.number,
        place=place_of(grid, inside, weights=cells.observed - cells.expected, areas=areas),
        n=sum(by_week),
        by_week=by_week,
        excess_min_per_week=(rate.violation_h - rate.expected_h) * per_week,
        excess_min_lo=None if rate.lo is None else (rate.lo - 1) * rate.expected_h * per_week,
        excess_min_hi=None if rate.hi is None else (rate.hi - 1) * rate.expected_h * per_week,
        q=spot.q,
    )


def _past(one: PastSpot, now: Window, then: Window, grid: Grid, areas: Sequence[Area], site: Site) -> ResolvedSpot:
    """Return a hotspot of an earlier window with what its cells show now."""
    assert now.tested is not None
    assert then.tested is not None
    cells = then.tested.cells
    inside = _outlined(then.tested, one.label)
    spot = next(s for s in then.tested.spots if s.label == one.label)
    before = test.place_rate(then.tested.explained, inside)
    rate = test.place_rate(now.tested.explained, inside, confidence=site.settings.confidence)
    by_week = _by_week(now, inside, reach_m=site.settings.distance_m / 2)
    return ResolvedSpot(
        spot_id=one.spot_id,
        place=place_of(grid, inside, weights=cells.observed - cells.expected, areas=areas),
        ratio_before=spot.rate.value if before is None else before.value,
        ratio=None if rate is None else rate.value,
        lo=None if rate is None else rate.lo,
        hi=None if rate is None else rate.hi,
        n=None if rate is None else sum(by_week),
        by_week=by_week,
        changed_on=now.changed_on(inside),
    )


def _outlined(window_hotspots: test.Hotspots, label: int) -> Flags:
    """Return the fewest cells of a hotspot that hold `OUTLINED_SHARE` of its excess, as measured.

    The test smooths person-time by a metre, so that cells beside a hotspot pass with it though hardly anybody is there.
    """
    inside = window_hotspots.cells.label == label
    excess_h = (window_hotspots.explained.violation_h - window_hotspots.explained.expected_h).sum(axis=0)
    excess_h = np.where(inside, np.maximum(excess_h, 0.0), 0.0).ravel()
    order = np.argsort(-excess_h, kind="stable")
    before_h = np.cumsum(excess_h[order]) - excess_h[order]
    core = np.zeros(inside.size, dtype=np.bool_)
    core[order] = (excess_h[order] > 0) & (before_h < OUTLINED_SHARE * excess_h.sum())
    return core.reshape(inside.shape) if core.any() else np.asarray(inside)


def _by_week(look: Window, inside: Flags, *, reach_m: float) -> tuple[int, ...]:
    """Return the violations in some cells, or so near them, by seven days of a window, the last seven first."""
    assert look.cube is not None
    near = ndimage.binary_dilation(inside, np.ones((3, 3), dtype=bool), iterations=math.ceil(reach_m / CELL_M))
    by_day = look.cube.n[:, near].sum(axis=1)[::-1]
    return tuple(round(float(by_day[k : k + WEEK.days].sum())) for k in range(0, len(by_day), WEEK.days))


def _notes(warehouse: Warehouse, data: FloorDays, look: Window) -> tuple[Reason, ...]:
    """Return what a reader must know of the window: cameras left out, recalibrations, borders unknown."""
    days = range(look.days.start, look.days.stop)
    notes = []
    for k, camera in enumerate(data.cameras):
        unknown = [data.unknown[k, d] for d in days if (k, d) in data.unknown]
        if unknown and look.state == "ok":
            notes.append(
                Reason("hotspots.left_out", camera=camera.camera_id, n=len(unknown), days=len(days), reason=unknown[-1])
            )
    ids = [c.camera_id for c in data.cameras]
    moved = warehouse.rows(
        "select camera_id from calibrations_used inner join (select distinct floor(quarter / 4)::bigint as hour "
        "from calendar where is_open and local_date between $first and $last) using (hour) "
        "where list_contains($ids::varchar[], camera_id) group by camera_id having count(distinct calibration_id) > 1 "
        "order by camera_id",
        {"ids": ids, "first": data.day(look.days.start), "last": data.day(look.days.stop - 1)},
    )
    if moved:
        who = ", ".join(row["camera_id"] for row in moved)
        notes.append(Reason("hotspots.recalibrated", cameras=who))
    if not look.is_border_known:
        notes.append(Reason("hotspots.border_unknown"))
    return tuple(notes)
