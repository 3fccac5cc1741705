"""Hotspots as answers: those of a window, those of earlier windows that are none now, and the window itself (M20).

Outlines and tested cells are no tables; they go with the answers, by `spot_id` and by cell.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import date
from typing import Any, Final

import numpy as np

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.figures.cell_places import CellPlace, Polygon
from vsd_analytics.figures.hotspots import FloorHotspots, FloorSpot, ResolvedSpot
from vsd_analytics.figures.values import known, lack
from vsd_analytics.site.model import Site

_PLACE: Final = (
    Column("name", "place"),
    Column("area_id", "fact"),
    Column("nearest_name", "fact"),
    Column("nearest_m", "fact", "m"),
    Column("x_m", "place", "m"),
    Column("y_m", "place", "m"),
    Column("peak_x_m", "place", "m"),
    Column("peak_y_m", "place", "m"),
    Column("area_m2", "fact", "m2"),
)
"""Where the cells of a hotspot are: `x_m`, `y_m` their mean by excess, `peak_x_m`, `peak_y_m` the one with the most."""
_RATIO: Final = Column("excess_ratio", "rate", "ratio", "M20", digits=2, tells=("n_violations",))
_COUNTED: Final = Column("n_violations", "count", "violations", "M20")
HOTSPOTS: Final = (
    Column("floor_id", "key"),
    Column("spot_id", "key"),
    Column("rank", "fact"),
    Column("change", "fact"),
    Column("since", "fact"),
    Column("is_since_first", "fact"),
    *_PLACE,
    _RATIO,
    _COUNTED,
    Column("violation_h", "rate", "h", "M20", tells=("n_violations",)),
    Column("expected_h", "rate", "h", "M20", tells=("n_violations",)),
    Column("exposure_h", "rate", "h", tells=("n_violations",), audience="operator"),
    Column("excess_min_per_week", "rate", "minutes", "M20", tells=("n_violations",)),
    Column("q", "share", "share", "M20", tells=("n_violations",)),
    Column("n_days", "fact", "days"),
)
"""Columns of `hotspots`."""
PAST_HOTSPOTS: Final = (
    Column("floor_id", "key"),
    Column("spot_id", "key"),
    Column("change", "fact"),
    Column("changed_on", "fact"),
    *_PLACE,
    Column("excess_ratio_before", "rate", "ratio", digits=2, tells=("n_violations",), audience="operator"),
    _RATIO,
    _COUNTED,
    Column("n_days", "fact", "days"),
)
"""Columns of `past_hotspots`."""
HOTSPOT_WINDOW: Final = (
    Column("floor_id", "key"),
    Column("n_days", "fact", "days"),
    Column("n_violations", "count", "violations"),
    Column("exposure_h", "rate", "h"),
    Column("compared_with", "fact"),
)
"""Columns of `hotspot_window`."""


def hotspot_answers(floor_hotspots: FloorHotspots, holds: HoldsFor) -> tuple[Answer, Answer, Answer]:
    """Return the hotspots of a floor as `hotspots`, `past_hotspots` and `hotspot_window`.

    `hotspots`: by excess, greatest first; `change` is "new", "persisting", or None in the first window; time in
    violation over that which crowding explains; violations near the cells; person-hours in violation, expected, and in
    view; person-minutes above the expected in a week; least false discovery rate. `past_hotspots`: `change` is
    "resolved", or "watching" since the day `changed_on`; the ratio of its cells when it last was a hotspot, and now.
    `hotspot_window`: recorded days, violations and person-hours of all cells, and the last day of the window that tells
    new from persisting.

    Args:
        floor_hotspots: The hotspots.
        holds: Site, settings and inputs; the days are those of the window.
    """
    holds = replace(holds, floor_id=floor_hotspots.floor_id, first=floor_hotspots.first, last=floor_hotspots.last)
    none = None if floor_hotspots.state == "ok" else lack(floor_hotspots.state, floor_hotspots.reason)
    notes = [*floor_hotspots.notes]
    if none is None and not floor_hotspots.spots:
        notes.append(Reason("hotspots.none"))
    now = tuple(_spot(floor_hotspots, spot) for spot in floor_hotspots.spots)
    past = [_past(floor_hotspots, spot, "watching") for spot in floor_hotspots.watching]
    past += [_past(floor_hotspots, spot, "resolved") for spot in floor_hotspots.resolved]
    nothing: dict[str, Any] = {} if none is None else {"nothing": none.reason, "state": none.state}
    window: Row = {
        "floor_id": floor_hotspots.floor_id,
        "n_days": floor_hotspots.n_days,
        "n_violations": none or known(floor_hotspots.n, Reason("hidden.gives_away")),
        "exposure_h": none or known(floor_hotspots.exposure_h, None),
        "compared_with": floor_hotspots.compared_with,
    }
    return (
        Answer("hotspots", HOTSPOTS, now, holds, notes=tuple((None, note) for note in notes), **nothing),
        Answer("past_hotspots", PAST_HOTSPOTS, tuple(past), holds, **nothing),
        Answer("hotspot_window", HOTSPOT_WINDOW, (window,), holds),
    )


def window_holds(site: Site, floor_hotspots: FloorHotspots, *, inputs: str) -> HoldsFor:
    """Return what answers on the hotspots of a window are about."""
    settings = site.settings.settings_id()
    return HoldsFor(
        site.site_id,
        floor_hotspots.floor_id,
        floor_hotspots.first,
        floor_hotspots.last,
        settings=settings,
        inputs=inputs,
    )


def outlines(floor_hotspots: FloorHotspots) -> dict[str, tuple[Polygon, ...]]:
    """Return the outlines of all hotspots, also past ones, by `spot_id`."""
    spots: Iterable[FloorSpot | ResolvedSpot] = (
        *floor_hotspots.spots,
        *floor_hotspots.resolved,
        *floor_hotspots.watching,
    )
    return {spot.spot_id: spot.place.polygons for spot in spots}


def cell_tests(floor_hotspots: FloorHotspots) -> list[dict[str, Any]]:
    """Return every tested cell: cx, cy (floor(x / cell), floor(y / cell)) and what the test says of it."""
    if floor_hotspots.cells is None or floor_hotspots.grid is None:
        return []
    rows, columns = np.nonzero(floor_hotspots.cells.is_tested)
    names = ("observed", "expected", "ratio", "t", "q")
    values = [getattr(floor_hotspots.cells, name)[rows, columns].tolist() for name in names]
    hot = floor_hotspots.cells.is_hot[rows, columns].tolist()
    return [
        {
            "cx": floor_hotspots.grid.cx + int(column),
            "cy": floor_hotspots.grid.cy + int(row),
            **dict(zip(names, content, strict=True)),
            "is_hot": is_hot,
        }
        for row, column, is_hot, *content in zip(rows, columns, hot, *values, strict=True)
    ]


def _spot(floor_hotspots: FloorHotspots, spot: FloorSpot) -> Row:
    return {
        "floor_id": floor_hotspots.floor_id,
        "spot_id": spot.spot_id,
        "rank": spot.number,
        "change": spot.state,
        "since": spot.since,
        "is_since_first": spot.is_since_first,
        **_where(spot.place),
        "excess_ratio": Value(spot.ratio, spot.lo, spot.hi),
        "n_violations": Value(spot.n),
        "violation_h": Value(spot.violation_h),
        "expected_h": Value(spot.expected_h),
        "exposure_h": Value(spot.exposure_h),
        "excess_min_per_week": Value(spot.excess_min_per_week, spot.excess_min_lo, spot.excess_min_hi),
        "q": Value(spot.q),
        "n_days": floor_hotspots.n_days,
    }


def _past(floor_hotspots: FloorHotspots, spot: ResolvedSpot, change: str) -> Row:
    nobody = Reason("nobody.there")
    return {
        "floor_id": floor_hotspots.floor_id,
        "spot_id": spot.spot_id,
        "change": change,
        "changed_on": spot.changed_on,
        **_where(spot.place),
        "excess_ratio_before": Value(spot.ratio_before),
        "excess_ratio": Value.missing(nobody) if spot.ratio is None else Value(spot.ratio, spot.lo, spot.hi),
        "n_violations": known(spot.n, nobody),
        "n_days": floor_hotspots.n_days,
    }


def _where(place: CellPlace) -> Mapping[str, str | float | date | None]:
    return {
        "name": place.name,
        "area_id": place.area_id,
        "nearest_name": place.nearest_name,
        "nearest_m": place.nearest_m,
        "x_m": place.x_m,
        "y_m": place.y_m,
        "peak_x_m": place.peak_x_m,
        "peak_y_m": place.peak_y_m,
        "area_m2": place.area_m2,
    }
