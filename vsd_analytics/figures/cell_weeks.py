"""The camera-hours and cells of many weeks, some days at a time.

The search for hotspots tests windows of four weeks, one after the other. A large site has millions of rows in ten
weeks, so only those of one window are in memory.
"""

from __future__ import annotations

from datetime import date
from typing import Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vsd_analytics.answer import Reason
from vsd_analytics.figures.cell_hours import CellHours, camera_hours, cells_of, ends_of, on_grid
from vsd_analytics.figures.floor_days import Grid, grid_over
from vsd_analytics.site.model import Floor
from vsd_analytics.warehouse.warehouse import Warehouse

PIECE_HOURS: Final = 2_000
"""Camera-hours of a piece, or one day: a week of 18 cameras and 12 hours a day is one piece and a bit."""


class CellWeeks:
    """The camera-hours of a warehouse's range whose person-time and distances are known, and their cells.

    Args:
        warehouse: Its range is read.
        floor: The floor.
        cell_m: Side of the cells.

    Attributes:
        grid: The cells of the whole range; None where nobody was seen, or the floor is too large.
    """

    def __init__(self, warehouse: Warehouse, floor: Floor, *, cell_m: float) -> None:
        self._warehouse, self._floor, self._cell_m = warehouse, floor, cell_m
        every = camera_hours(warehouse, floor, warehouse.first, warehouse.last, least_share=0.0)
        is_known = every["knows_people"].to_numpy() & every["knows_distances"].to_numpy()
        self._used = every.filter(pa.array(is_known))
        self.grid = self._grid_of()
        self._spans = self._pieces() if self.grid is not None else []
        self._read: dict[tuple[int, int], CellHours] = {}

    def window(self, first: date, last: date) -> list[CellHours]:
        """Return the camera-hours of some days piece by piece, days in order.

        Pieces that end before the first day are forgotten: windows are asked for from the oldest to the newest.
        """
        assert self.grid is not None
        day = self._days()
        asked = [(a, b) for a, b in self._spans if day[a] <= np.datetime64(last) and day[b - 1] >= np.datetime64(first)]
        self._read = {span: self._read.get(span) or self._cells(*span) for span in asked}
        pieces = self._read.values()
        return [piece.between(first, last) for piece in pieces]

    def _cells(self, start: int, end: int) -> CellHours:
        assert self.grid is not None
        used = self._used.slice(start, end - start)
        rows = cells_of(self._warehouse, self._floor, used, cell_m=self._cell_m)
        return on_grid(self.grid, used, rows, is_everything=True)

    def _grid_of(self) -> Grid | None:
        ends = ends_of(self._warehouse, self._floor, self._used, cell_m=self._cell_m)
        if ends is None:
            return None
        found = grid_over(*ends, floor=self._floor, cell_m=self._cell_m)
        return None if isinstance(found, Reason) else found

    def _pieces(self) -> list[tuple[int, int]]:
        """Return runs of whole days as first camera-hour and the one after the last."""
        _, starts = np.unique(self._days(), return_index=True)
        found: list[tuple[int, int]] = []
        for start, end in zip(starts.tolist(), [*starts[1:].tolist(), self._used.num_rows], strict=True):
            if found and end - found[-1][0] <= PIECE_HOURS:
                found[-1] = (found[-1][0], end)
            else:
                found.append((start, end))
        return found

    def _days(self) -> NDArray[np.datetime64]:
        return np.asarray(self._used["local_date"].to_numpy(), dtype="datetime64[D]")
