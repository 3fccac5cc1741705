"""Checks of the axes of positions on a plan: walls, shelves and doors fit them better turned round (W220)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from vsd_analytics.ingest.checks.check_case import Case, SourceCheck, SourceWarning, is_on_floor, plan_bounds_m
from vsd_analytics.ingest.checks.sample import Ints, Sample, is_last, is_new

if TYPE_CHECKING:
    from vsd_analytics.ingest.checks.check_case import Bounds
    from vsd_analytics.site.model import Area, Camera, Fixture

Turn = Callable[[np.ndarray, np.ndarray, "Bounds"], tuple[np.ndarray, np.ndarray]]

CELL_M: Final = 0.25
"""Places are counted once per cell of this side: who stands for an hour on a badly drawn till counts as one place."""
EDGE_M: Final = 0.25
"""Nobody is doubted this near to the edge of a fixture, and this far outside a plan: drawings and positions err."""
CELLS_MIN: Final = 100
"""Fewer places show no pattern."""
INSIDE_MIN: Final = 0.05
"""Doubted from this share of places inside fixtures on; `SURE_MIN`: almost surely wrong."""
SURE_MIN: Final = 0.10
FITS_SHARE: Final = 0.2
"""Turned round, at most this share of it may be left."""
DOOR_M: Final = 1.0
"""A way that begins this near to a door begins at it."""
CUT_S: Final = 5.0
"""Ways that begin or end this near to the ends of a sample were cut by it."""
ENDS_MIN: Final = 30
DOORS_MIN: Final = 0.6
"""Turned round, at least this share of ways begins and ends at doors, and as read at most `DOORS_SHARE` of that."""
DOORS_SHARE: Final = 0.3
WORSE: Final = 0.02
"""Turned round, places may be inside fixtures this much more often, where doors alone raise the doubt."""

NEARLY: Final = 0.02
"""Turns that fit equally well within this: the first of `_TURNS` is named, the commonest mistake."""

_TURNS: Final[Mapping[str, tuple[Turn, str]]] = {
    "with y turned round": (
        lambda x, y, b: (x, b[2] + b[3] - y),
        "y seems to point down: export it upwards from the lower left corner of the plan",
    ),
    "with x turned round": (
        lambda x, y, b: (b[0] + b[1] - x, y),
        "x seems to point left: export it to the right from the lower left corner of the plan",
    ),
    "turned by 180 degrees": (
        lambda x, y, b: (b[0] + b[1] - x, b[2] + b[3] - y),
        "x and y seem to begin at the upper right corner: export them from the lower left corner of the plan",
    ),
    "with x and y exchanged": (lambda x, y, b: (y, x), "x and y seem to be exchanged: map each to the other column"),
    "read as yards": (lambda x, y, b: (0.9144 * x, 0.9144 * y), "--unit yd if positions are in yards"),
}
_PICTURE: Final = "vsd check FILE --picture where.svg shows them on the plan"


@dataclass(frozen=True)
class _OnFloor:
    """Places of one camera on its floor's plan.

    Attributes:
        bounds: Rectangle of the plan.
        x, y: Places, once per cell.
        ends: x and y of the first and last places of ways, two columns.
        closed: Insides of the fixtures, a geometry of shapely.
        doors: Doors with `DOOR_M` around them, likewise.
    """

    bounds: Bounds
    x: np.ndarray
    y: np.ndarray
    ends: np.ndarray
    closed: Any
    doors: Any

    def n_inside(self, turn: Turn | None) -> int:
        """Count places inside fixtures or beyond the plan, where nobody can be."""
        import shapely

        x, y = (self.x, self.y) if turn is None else turn(self.x, self.y, self.bounds)
        left, right, low, high = self.bounds
        is_out = (x < left - EDGE_M) | (x > right + EDGE_M) | (y < low - EDGE_M) | (y > high + EDGE_M)
        return int((is_out | shapely.contains_xy(self.closed, x, y)).sum())

    def n_at_doors(self, turn: Turn | None) -> int:
        """Count ends of ways at doors."""
        import shapely

        x, y = self.ends[:, 0], self.ends[:, 1]
        if turn is not None:
            x, y = turn(x, y, self.bounds)
        return int(shapely.contains_xy(self.doors, x, y).sum())


def _turned(case: Case) -> Iterator[SourceWarning]:
    fixed = {f.floor_id for f in case.site.fixtures} | {a.floor_id for a in case.site.areas if a.is_door}
    if fixed.isdisjoint(c.floor_id for c in case.cameras):
        return
    floors = [one for camera in case.cameras if (one := _on_floor(case, camera)) is not None]
    n_cells, n_ends = sum(len(f.x) for f in floors), sum(len(f.ends) for f in floors)
    if n_cells < CELLS_MIN:
        return
    inside = sum(f.n_inside(None) for f in floors) / n_cells
    at_doors = sum(f.n_at_doors(None) for f in floors) / n_ends if n_ends >= ENDS_MIN else None
    best: tuple[float, float, str, str] | None = None
    for name, (turn, fix) in _TURNS.items():
        inside_then = sum(f.n_inside(turn) for f in floors) / n_cells
        doors_then = None if at_doors is None else sum(f.n_at_doors(turn) for f in floors) / n_ends
        by_fixtures = inside >= INSIDE_MIN and inside_then <= FITS_SHARE * inside
        by_doors = doors_then is not None and doors_then >= DOORS_MIN and (at_doors or 0) <= DOORS_SHARE * doors_then
        is_denied = doors_then is not None and at_doors is not None and doors_then < at_doors - 0.1
        if (by_fixtures and not is_denied) or (by_doors and inside_then <= inside + WORSE):
            better_turn = (inside_then - inside, doors_then or 0.0, name, fix)
            is_better = best is None or inside_then - inside < best[0] - NEARLY or better_turn[1] > best[1] + NEARLY
            best = better_turn if is_better else best
    if best is None:
        return
    less, doors, name, fix = best
    if inside >= INSIDE_MIN and inside + less <= FITS_SHARE * inside:
        what = f"{inside:.0%} of the places where people were would be inside fixtures; {name}, {inside + less:.1%}"
        why = "nobody walks through shelves and walls: x must point right and y up, from the plan's lower left corner"
        yield SourceWarning(what, why, f"{fix}; {_PICTURE}", is_sure=inside >= SURE_MIN)
        return
    what = f"{at_doors or 0:.0%} of the ways would begin and end at a door; {name}, {doors:.0%}"
    why = "people come and go by doors: x must point right and y up, from the plan's lower left corner"
    yield SourceWarning(what, why, f"{fix}; {_PICTURE}")


def _on_floor(case: Case, camera: Camera) -> _OnFloor | None:
    floor = next((f for f in case.site.floors if f.floor_id == camera.floor_id), None)
    bounds = None if floor is None else plan_bounds_m(floor)
    if bounds is None:
        return None
    sample = case.sample
    is_usable = (np.abs(sample.floor_m) <= case.site.settings.coordinate_max_m).all(axis=1)  # NaN is not
    row = np.flatnonzero(is_usable & sample.camera.is_in([camera.camera_id, *camera.engine_ids]))
    if not len(row):
        return None
    ts_ms = sample.ts_ms[row]
    first, last = (datetime.fromtimestamp(ms / 1000, UTC) for ms in (ts_ms.min(), ts_ms.max()))
    at = [f for f in case.site.fixtures if f.floor_id == camera.floor_id and f.is_there(first, until=last)]
    doors = [
        a
        for a in case.site.areas
        if a.is_door and a.floor_id == camera.floor_id and a.is_there(first.date(), last.date())
    ]
    cells = np.unique(np.floor(sample.floor_m[row] / CELL_M), axis=0)
    x, y = ((cells + 0.5) * CELL_M).T
    return _OnFloor(bounds, x, y, _ends(sample, row) if doors else np.empty((0, 2)), _closed(at), _doors(doors))


def _closed(fixtures: Sequence[Fixture]) -> Any:
    """Return the insides of fixtures; a thin one stays as it is drawn."""
    import shapely

    drawn = [shapely.make_valid(shapely.Polygon(f.polygon)) for f in fixtures]
    return _prepared([inner if (inner := shape.buffer(-EDGE_M)).area > 0 else shape for shape in drawn])


def _doors(doors: Sequence[Area]) -> Any:
    import shapely

    return _prepared([shapely.make_valid(shapely.Polygon(a.polygon)).buffer(DOOR_M) for a in doors])


def _prepared(shapes: Sequence[Any]) -> Any:
    import shapely

    whole = shapely.union_all(shapes)
    shapely.prepare(whole)
    return whole


def _ends(sample: Sample, row: Ints) -> np.ndarray:
    """Return where ways begin and end that the sample does not cut, of some of its records."""
    ts_ms, track_no = sample.ts_ms[row], sample.track.no[row]
    order = np.lexsort((ts_ms, track_no))
    order = order[track_no[order] >= 0]
    is_first = is_new(track_no[order])
    begin, end = order[is_first], order[is_last(is_first)]
    begin = begin[ts_ms[begin] > ts_ms.min() + 1000 * CUT_S]
    end = end[ts_ms[end] < ts_ms.max() - 1000 * CUT_S]
    return np.asarray(sample.floor_m[row[np.concatenate([begin, end])]])


AXIS_CHECKS: Final = (
    SourceCheck("W220", is_on_floor, _turned, "positions that fit fixtures and doors only when they are turned round"),
)
