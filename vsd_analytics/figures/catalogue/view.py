"""Figures by catalogue id, as HTTP gives them: a view of answers and maps, computing nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from datetime import date, datetime
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from vsd_analytics.answer import VALUES, Answer, Cell, Column, Reason, Row, Scalar, State, value_of
from vsd_analytics.figures.floor_days import Flags, Grid
from vsd_analytics.figures.maps import MIN_EXPECTED_S, MIN_EXPOSURE_H, SIGMA_M, CellMap, CellMaps, ExcessMap
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.week.results import Figure

WHOLE: Final[dict[str, tuple[str, dict[str, Scalar]]]] = {
    "M8": ("n_violations", {}),
    "M23": ("behaviour_ratio", {}),
    "M26": ("close_time_share", {"is_legal_distance": True}),
    "M30": ("close_person_min", {}),
}
"""Which of several values a figure has at its top: the column, and the row it is in."""
MAPS: Final = {"M16": "exposure", "M17": "burden", "M18": "risk", "M19": "excess"}
"""Figures that are maps: each a field of `CellMaps`."""
MIN_CELL_S: Final = 60.0
"""Person-seconds a square metre needs to be printed: with less, it could show the way of a few people."""
_NO_CELL: Final = {
    "M16": Reason("map.no_cell_seconds", least=MIN_CELL_S),
    "M17": Reason("map.no_cell_seconds", least=MIN_CELL_S),
    "M18": Reason("map.no_cell_hours", least=MIN_EXPOSURE_H),
    "M19": Reason("map.no_cell_expected", least=MIN_EXPECTED_S),
}
_SMOOTHED_M: Final = {"M18": 4 * SIGMA_M, "M19": 4 * SIGMA_M}
"""How far from a square lies floor that adds to its value, of maps that are smoothed."""
_FLOOR: Final = ("floor_id",)
Place = tuple[Answer, Row, Column]
"""Where a value is."""


def figure_of(metric: str, answers: Iterable[Answer], *, unit: Reason) -> Figure:
    """Return the columns of one figure over all answers.

    Args:
        metric: Id in the catalogue.
        answers: The answers of a week.
        unit: Unit of the figure in words.

    Returns:
        `value`, `lo`, `hi`, `verdict`, `denominator`: those of the only column of the figure in an answer with one row
        for the floor, or of the one that `WHOLE` names. `rows`: one for each row and column of the
        figure, with the keys and facts of the row, `column`, `what` (its name in words), `unit`, `value`, `lo`, `hi`,
        `state`, `reason` and `denominator`. Where nothing has a value, the figure has the first reason that is given.
    """
    chosen = [a for a in answers if any(c.figure == metric for c in a.columns)]
    places = [(a, row, c) for a in chosen for row in a.rows for c in a.columns if c.figure == metric]
    whole = _whole(metric, places)
    is_alone = whole is not None and metric not in WHOLE
    rows = tuple(_row(*place) for place in places if not (is_alone and place is whole))
    note = _joined([reason for a in chosen for k, reason in a.notes if k is None])
    if whole is not None and (value := value_of(whole[1], whole[2].name)).value is not None:
        return Figure(
            unit=unit,
            value=value.value,
            rows=rows if rows or any(a.keys != _FLOOR for a in chosen) else None,
            denominator=_denominator(whole[1], whole[2].per),
            lo=value.lo,
            hi=value.hi,
            verdict=whole[1].get(f"{whole[2].name}_verdict"),  # type: ignore[arg-type]
            reason=value.reason,
            note=note,
        )
    has_rows = any(row["value"] is not None for row in rows)
    if whole is None and (has_rows or not (places or any(a.nothing for a in chosen))):
        return Figure(unit=unit, rows=rows, note=note)
    state, reason = _why_nothing(whole, places, chosen)
    return Figure(unit=unit, state=state, reason=reason)


def map_figure(
    maps: CellMaps, metric: str, *, unit: Reason, hidden: BaseGeometry, why_hidden: Reason | None = None
) -> Figure:
    """Return a map as a row for each square metre on which people spent a minute or more: `x_m`, `y_m`, `value`.

    Args:
        maps: The maps of a week.
        metric: Which, a key of `MAPS`.
        unit: Unit of the figure in words.
        hidden: Floor of which no square is given; nor one, of a map that is smoothed, to whose value it adds.
        why_hidden: Why no violations of the floor are shown; None = they are.
    """
    floor_map: CellMap = getattr(maps, MAPS[metric])
    if why_hidden is not None and metric != "M16":
        return Figure(unit=unit, state="not_enough_data", reason=why_hidden)
    if floor_map.grid is None or floor_map.values is None or floor_map.exposure_h is None:
        state: State = "not_enough_data" if floor_map.state == "ok" else floor_map.state
        return Figure(unit=unit, state=state, reason=floor_map.reason or NOTHING_OPEN)
    is_printed = np.isfinite(floor_map.values) & (floor_map.exposure_h * 3600 >= MIN_CELL_S)
    if not is_printed.any():
        return Figure(unit=unit, state="not_enough_data", reason=_NO_CELL[metric])
    n_printed = int(is_printed.sum())
    is_printed &= ~_touching(floor_map.grid, hidden.buffer(_SMOOTHED_M.get(metric, 0.0)))
    if not is_printed.any():
        return Figure(unit=unit, state="not_enough_data", reason=Reason("hidden.squares"))
    clear = floor_map.is_clear if isinstance(floor_map, ExcessMap) else None
    rows: list[dict[str, float | bool | None]] = []
    for r, c in zip(*np.nonzero(is_printed), strict=True):
        x_m, y_m = float(floor_map.grid.x_m(c)), float(floor_map.grid.y_m(r))
        is_clear = (
            {"is_clear": None if clear is None else bool(clear[r, c])} if isinstance(floor_map, ExcessMap) else {}
        )
        rows.append({"x_m": x_m, "y_m": y_m, "value": float(floor_map.values[r, c]), **is_clear})
    notes = [Reason("note.cells", side_m=floor_map.grid.cell_m)]
    if len(rows) < n_printed:
        notes.append(Reason("hidden.squares"))
    return Figure(unit=unit, rows=tuple(rows), denominator=floor_map.denominator, note=_joined(notes))


def _touching(grid: Grid, shape: BaseGeometry) -> Flags:
    """Return the squares of a grid that have floor in common with a shape, shape (n_y, n_x)."""
    if shape.is_empty:
        return np.zeros(grid.shape, dtype=np.bool_)
    y, x = np.indices(grid.shape)
    half = grid.cell_m / 2
    squares = shapely.box(grid.x_m(x) - half, grid.y_m(y) - half, grid.x_m(x) + half, grid.y_m(y) + half)
    return np.asarray(shapely.relate_pattern(squares, shape, "T********"))


def _whole(metric: str, places: Sequence[Place]) -> Place | None:
    """Return where the value is that a figure has at its top."""
    if metric in WHOLE:
        name, facts = WHOLE[metric]
        return next((p for p in places if p[2].name == name and facts.items() <= p[1].items()), None)
    of_floor = [p for p in places if p[0].keys == _FLOOR and len(p[0].rows) == 1]
    return of_floor[0] if len(of_floor) == 1 else None


def _why_nothing(whole: Place | None, places: Sequence[Place], chosen: Sequence[Answer]) -> tuple[State, Reason]:
    """Return why a figure has no value: that of the value at its top, else the first that is given."""
    values = [value_of(row, column.name) for _, row, column in ([whole] if whole else []) + list(places)]
    lacks = [(v.state, v.reason) for v in values] + [(a.state, a.nothing) for a in chosen]
    for state, reason in lacks:
        if reason is not None:
            return "not_enough_data" if state == "ok" else state, reason
    return "not_enough_data", NOTHING_OPEN


def _joined(notes: Sequence[Reason]) -> Reason | None:
    different = tuple(dict.fromkeys(notes))
    return Reason("joined", reasons=different) if len(different) > 1 else next(iter(different), None)


def _row(answer: Answer, row: Row, column: Column) -> dict[str, Any]:
    value = value_of(row, column.name)
    return {
        **dict(_facts(answer, row)),
        "column": column.name,
        "what": Reason(f"column.{column.name}"),
        "unit": column.unit,
        "value": value.value,
        "lo": value.lo,
        "hi": value.hi,
        "state": value.state,
        "reason": value.reason,
        "denominator": _denominator(row, column.per),
    }


def _facts(answer: Answer, row: Row) -> Iterator[tuple[str, Any]]:
    for column in answer.columns:
        if column.kind not in VALUES:
            yield column.name, _plain(row[column.name])


def _denominator(row: Row, name: str) -> Any:
    if not name:
        return None
    cell = row.get(name)
    return cell if isinstance(cell, int | float) or cell is None else value_of(row, name).value


def _plain(cell: Cell) -> Any:
    if isinstance(cell, tuple):
        return list(cell)
    return cell.isoformat() if isinstance(cell, date | datetime) else cell
