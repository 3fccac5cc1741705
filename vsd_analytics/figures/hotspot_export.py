"""Hotspots for other programs: one dictionary, GeoJSON in floor metres, one row per hotspot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import date
from typing import Any, Final

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.cell_places import CellPlace
from vsd_analytics.figures.hotspots import FloorHotspots, FloorSpot, ResolvedSpot

DIGITS: Final = 6
PLANE: Final = Reason("unit.plane")
UNIT: Final = Reason("unit.ratio")
COLUMNS: Final = (
    *("number", "id", "state", "since", "area_id", "place", "x_m", "y_m", "peak_x_m", "peak_y_m", "area_m2"),
    *("ratio", "lo", "hi", "n", "violation_h", "expected_h", "exposure_h"),
    *("excess_min_per_week", "excess_min_lo", "excess_min_hi", "q"),
)


def as_dict(found: FloorHotspots, *, with_cells: bool = False) -> dict[str, Any]:
    """Return everything as dictionaries, lists, texts and numbers; a missing number is None, floats have 6 digits."""
    content: dict[str, Any] = {
        "floor_id": found.floor_id,
        "floor_name": found.floor_name,
        "first": found.first,
        "last": found.last,
        "state": found.state,
        "reason": found.reason,
        "unit": UNIT,
        "n_days": found.n_days,
        "n": found.n,
        "exposure_h": found.exposure_h,
        "compared_with": found.compared_with,
        "hotspots": [{**spot_row(s), "polygons": s.place.polygons} for s in found.spots],
        "resolved": [{**_past_row(r, "resolved"), "polygons": r.place.polygons} for r in found.resolved],
        "watching": [{**_past_row(r, "watching"), "polygons": r.place.polygons} for r in found.watching],
        "notes": list(found.notes),
    }
    if with_cells:
        content["cells"] = cell_rows(found)
    return {key: _plain(value) for key, value in content.items()}


def as_geojson(found: FloorHotspots) -> dict[str, Any]:
    """Return a GeoJSON FeatureCollection (RFC 7946 but for its plane: floor metres), one feature per hotspot.

    Properties are those of a row; the hotspots that are gone follow with state "resolved", those watched after a change
    with "watching". `coordinate_system`, of the collection and of each feature, names the plane.
    """
    rows = [(spot_row(s), s.place) for s in found.spots]
    rows += [(_past_row(r, "resolved"), r.place) for r in found.resolved]
    rows += [(_past_row(r, "watching"), r.place) for r in found.watching]
    features = [
        {
            "type": "Feature",
            "id": row["id"],
            "properties": _plain({**row, "floor_id": found.floor_id, "coordinate_system": PLANE}),
            "geometry": {"type": "MultiPolygon", "coordinates": _plain(_closed(place))},
        }
        for row, place in rows
    ]
    content = {"floor_id": found.floor_id, "first": found.first, "last": found.last, "coordinate_system": PLANE}
    state = {"state": found.state, "reason": found.reason, "notes": list(found.notes)}
    return {"type": "FeatureCollection", **_plain({**content, **state}), "features": features}


def spot_row(spot: FloorSpot) -> dict[str, Any]:
    """Return a hotspot as one row, keys as in `COLUMNS`."""
    content = asdict(replace(spot, place=replace(spot.place, polygons=())))
    place = content.pop("place")
    row = {**content, **place, "id": spot.spot_id, "place": spot.place.name}
    return {key: _plain(row[key]) for key in COLUMNS}


def cell_rows(found: FloorHotspots) -> list[dict[str, Any]]:
    """Return every tested cell: cx, cy (floor(x / cell), floor(y / cell)) and what the test says of it."""
    if found.cells is None or found.grid is None:
        return []
    rows, columns = np.nonzero(found.cells.is_tested)
    names = ("observed", "expected", "ratio", "t", "q")
    values = [getattr(found.cells, name)[rows, columns].tolist() for name in names]
    hot = found.cells.is_hot[rows, columns].tolist()
    return [
        {
            "cx": found.grid.cx + int(column),
            "cy": found.grid.cy + int(row),
            **{name: _plain(v) for name, v in zip(names, content, strict=True)},
            "is_hot": is_hot,
        }
        for row, column, is_hot, *content in zip(rows, columns, hot, *values, strict=True)
    ]


def _past_row(spot: ResolvedSpot, state: str) -> dict[str, Any]:
    return {
        "id": spot.spot_id,
        "state": state,
        "area_id": spot.place.area_id,
        "place": spot.place.name,
        "x_m": _plain(spot.place.x_m),
        "y_m": _plain(spot.place.y_m),
        "ratio_before": _plain(spot.ratio_before),
        "ratio": _plain(spot.ratio),
        "lo": _plain(spot.lo),
        "hi": _plain(spot.hi),
        "n": spot.n,
        "changed_on": _plain(spot.changed_on),
    }


def _closed(place: CellPlace) -> Sequence[Any]:
    return [[[*ring, ring[0]] for ring in polygon] for polygon in place.polygons]


def _plain(value: Any) -> Any:
    match value:
        case float():
            return float(f"{value:.{DIGITS}g}")
        case date():
            return value.isoformat()
        case dict():
            return {k: _plain(v) for k, v in value.items()}
        case list() | tuple():
            return [_plain(v) for v in value]
        case _:
            return value
