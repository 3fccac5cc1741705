"""Where a person-hour is riskier than elsewhere on the floor, and since when (M20).

The test is `vsd_analytics.stats.hotspots`, over the trailing `hotspot_days` (28) days and cells of 1 m. A cell enters
it when the cameras see at least 80 % of the disc of the legal distance around it: at the border of the view neighbours
are missing. The same test over windows that end one, two, ... weeks earlier tells which hotspots are new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.figures.cell_places import CellPlace, place_of
from vsd_analytics.figures.floor_days import Cube, FloorDays, Grid
from vsd_analytics.figures.hotspot_history import Found, Identity, follow
from vsd_analytics.figures.slots import NO_POSITIONS
from vsd_analytics.result import Reason
from vsd_analytics.site.model import Area, Floor, Site
from vsd_analytics.stats import hotspots as test
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import Warehouse

CELL_M: Final = 1.0
"""Side of the cells that are tested: the smoothing makes finer ones alike, and their tests cost power."""
SIGMA_M: Final = 1.0
"""Standard deviation of the smoothing of violations and person-hours."""
SEEN_SHARE: Final = 0.8
"""Share of the disc of the legal distance around a cell that cameras must see."""
LOOKS_BACK: Final = 12
"""Weeks of earlier windows that are compared."""
WEEK: Final = timedelta(days=7)

State = Literal["ok", "not_enough_data", "not_measurable"]
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
        place: Where it is.
        ratio: Violations over those expected at the floor's rate of each day.
        lo, hi: Its interval; None where days do not allow one.
        n: Violations in its cells in the window.
        by_week: The same by seven days, the last first; the earliest may be fewer days.
        expected: What they would be at the floor's rate.
        exposure_h: Person-hours in its cells.
        excess_per_week: Violations above the expected, per week of as many open days as the window has on average.
        excess_lo, excess_hi: The same at the ends of the interval.
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
    expected: float
    exposure_h: float
    excess_per_week: float
    excess_lo: float | None
    excess_hi: float | None
    q: float


@dataclass(frozen=True, slots=True)
class ResolvedSpot:
    """A hotspot of the window a week earlier that is no hotspot any more: its own cells then and now.

    Attributes:
        spot_id: As for `FloorSpot`.
        place: Where it was.
        ratio_before: Its ratio in the earlier window.
        ratio, lo, hi: The ratio of the same cells now; None where nobody was there.
        n: Violations in them now; None likewise.
        by_week: As for `FloorSpot`.
    """

    spot_id: str
    place: CellPlace
    ratio_before: float
    ratio: float | None
    lo: float | None
    hi: float | None
    n: int | None
    by_week: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class FloorHotspots:
    """The hotspots of a floor.

    Attributes:
        floor_id, floor_name: The floor.
        first, last: The window.
        state: "ok", or why there is no result.
        reason: Why not, unless "ok".
        n_days: Days of the window on which a camera recorded enough.
        n: Violations on them; None where they cannot be known.
        exposure_h: Person-hours on them; likewise.
        compared_with: Last day of the window that tells new from persisting; None without one.
        spots: By excess, greatest first.
        resolved: Hotspots of that window that are no hotspots any more.
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
    grid: Grid | None
    cells: test.Cells | None
    notes: tuple[Reason, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """The test over one window."""

    last: date
    days: slice
    state: State
    reason: Reason | None
    cube: Cube | None = None
    found: test.Hotspots | None = None
    is_border_known: bool = True


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
    """
    site, last = warehouse.site, until or warehouse.last
    floor = next((f for f in site.floors if floor_id in (None, f.floor_id)), None)
    if floor is None:
        raise KeyError(floor_id)
    data = FloorDays(warehouse, floor, cell_m=CELL_M)
    looks = [_look(warehouse, data, last - k * WEEK) for k in range(LOOKS_BACK, -1, -1)]
    now = looks[-1]
    is_open = data.is_open[now.days]
    known = data.is_used[:, now.days].any(axis=0)
    compared = [look for look in looks[:-1] if look.found is not None]
    spots: tuple[FloorSpot, ...] = ()
    resolved: tuple[ResolvedSpot, ...] = ()
    if now.found is not None and data.grid is not None:
        areas = [a for a in site.areas if a.floor_id == floor.floor_id]
        history = follow(
            [Found(look.last, look.found) for look in (*compared, now) if look.found is not None],
            floor_id=floor.floor_id,
            cell_m=CELL_M,
            first_cell=(data.grid.cx, data.grid.cy),
        )
        per_week = float(is_open.sum()) / len(is_open) * 7
        spots = tuple(_spot(s, history.now[s.label], now, data.grid, areas, per_week) for s in now.found.spots)
        resolved = tuple(
            _resolved(spot_id, label, now, compared[-1], data.grid, areas, site) for spot_id, label in history.resolved
        )
    cube = now.cube
    return FloorHotspots(
        floor_id=floor.floor_id,
        floor_name=floor.name,
        first=last - timedelta(days=int(site.settings.hotspot_days) - 1),
        last=last,
        state=now.state,
        reason=now.reason,
        n_days=int(known.sum()),
        n=None if cube is None else round(float(cube.n.sum())),
        exposure_h=None if cube is None else float(cube.exposure_h.sum()),
        compared_with=compared[-1].last if now.found is not None and compared else None,
        spots=spots,
        resolved=resolved,
        grid=data.grid if now.found is not None else None,
        cells=now.found.cells if now.found is not None else None,
        notes=_notes(warehouse, data, now),
    )


def _look(warehouse: Warehouse, data: FloorDays, last: date) -> _Look:
    """Return the test over the window that ends with `last`, or why it cannot be made."""
    settings = warehouse.site.settings
    n_days = int(settings.hotspot_days)
    days = data.span(last - timedelta(days=n_days - 1), last)
    if (why := data.why_unknown(days) or _why_no_places(warehouse, data.floor, last, n_days)) is not None:
        return _Look(last, days, "not_measurable", why)
    if data.why_no_grid is not None:
        return _Look(last, days, "not_measurable", data.why_no_grid)
    covered = int(data.is_used[:, days].any(axis=0).sum())
    if covered < settings.hotspot_min_days or data.grid is None:
        why = Reason(
            "hotspots.days",
            has=covered,
            n=n_days,
            share=settings.min_coverage,
            least=settings.hotspot_min_days,
        )
        return _Look(last, days, "not_enough_data", why)
    cube = data.cube(days)
    if cube.n.sum() < settings.hotspot_min_violations:
        why = Reason("hotspots.violations", least=settings.hotspot_min_violations, days=n_days)
        return _Look(last, days, "not_enough_data", why, cube)
    seen = data.seen_share(days, radius_m=settings.distance_m, cells=np.asarray(cube.exposure_h.any(axis=0)))
    found = test.hotspots(
        cube.n,
        cube.exposure_h,
        sigma_cells=SIGMA_M / CELL_M,
        is_recorded=cube.is_recorded,
        is_eligible=None if seen is None else np.nan_to_num(seen) >= SEEN_SHARE,
        q_max=settings.hotspot_false_share,
        min_ratio=settings.hotspot_min_ratio,
        min_days=int(settings.hotspot_min_days),
        confidence=settings.confidence,
    )
    return _Look(last, days, "ok", None, cube, found, seen is not None)


def _why_no_places(warehouse: Warehouse, floor: Floor, last: date, n_days: int) -> Reason | None:
    row = warehouse.rows(
        "select count(*) as n, count(*) filter (where cx is null) as n_unplaced from violations "
        "where floor_id = $floor and is_open and local_date between $first and $last",
        {"floor": floor.floor_id, "first": last - timedelta(days=n_days - 1), "last": last},
    )[0]
    return NO_POSITIONS if row["n_unplaced"] * 2 > row["n"] else None


def _spot(
    spot: test.Spot,
    identity: Identity,
    now: _Look,
    grid: Grid,
    areas: Sequence[Area],
    open_days_per_week: float,
) -> FloorSpot:
    assert now.found is not None
    rate, cells = spot.rate, now.found.cells
    per_week = open_days_per_week / rate.n_days
    return FloorSpot(
        number=spot.number,
        spot_id=identity.spot_id,
        state=identity.state,
        since=identity.since,
        is_since_first=identity.is_since_first,
        place=place_of(grid, cells.label == spot.label, weights=cells.observed - cells.expected, areas=areas),
        ratio=rate.ratio,
        lo=rate.lo,
        hi=rate.hi,
        n=round(rate.n),
        by_week=_by_week(now, cells.label == spot.label),
        expected=rate.expected,
        exposure_h=rate.exposure_h,
        excess_per_week=(rate.n - rate.expected) * per_week,
        excess_lo=None if rate.lo is None else (rate.lo - 1) * rate.expected * per_week,
        excess_hi=None if rate.hi is None else (rate.hi - 1) * rate.expected * per_week,
        q=spot.q,
    )


def _resolved(
    spot_id: str, label: int, now: _Look, before: _Look, grid: Grid, areas: Sequence[Area], site: Site
) -> ResolvedSpot:
    assert now.cube is not None
    assert before.found is not None
    cells = before.found.cells
    inside = cells.label == label
    rate = test.place_rate(
        now.cube.n,
        now.cube.exposure_h,
        inside,
        is_recorded=now.cube.is_recorded,
        confidence=site.settings.confidence,
    )
    return ResolvedSpot(
        spot_id=spot_id,
        place=place_of(grid, inside, weights=cells.observed - cells.expected, areas=areas),
        ratio_before=next(s.rate.ratio for s in before.found.spots if s.label == label),
        ratio=None if rate is None else rate.ratio,
        lo=None if rate is None else rate.lo,
        hi=None if rate is None else rate.hi,
        n=None if rate is None else round(rate.n),
        by_week=_by_week(now, inside),
    )


def _by_week(look: _Look, inside: NDArray[np.bool_]) -> tuple[int, ...]:
    """Return the violations in some cells by seven days of a window, the last seven first."""
    assert look.cube is not None
    by_day = look.cube.n[:, inside].sum(axis=1)[::-1]
    return tuple(round(float(by_day[k : k + WEEK.days].sum())) for k in range(0, len(by_day), WEEK.days))


def _notes(warehouse: Warehouse, data: FloorDays, look: _Look) -> tuple[Reason, ...]:
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
        "where camera_id in (select unnest($ids)) group by camera_id having count(distinct calibration_id) > 1 "
        "order by camera_id",
        {"ids": ids, "first": data.day(look.days.start), "last": data.day(look.days.stop - 1)},
    )
    if moved:
        who = ", ".join(row["camera_id"] for row in moved)
        notes.append(Reason("hotspots.recalibrated", cameras=who))
    if not look.is_border_known:
        notes.append(Reason("hotspots.border_unknown"))
    return tuple(notes)
