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
from vsd_analytics.figures.cell_hours import CellHours, camera_hours, on_grid
from vsd_analytics.figures.floor_days import Grid, grid_over
from vsd_analytics.site.model import Floor
from vsd_analytics.warehouse.warehouse import Warehouse

SIDE_M: Final = 1.0
"""Side of the cells of the mart `square_hours`."""
PIECE_HOURS: Final = 1_000
"""Camera-hours of a piece, or one day: four days of 18 cameras and 12 hours a day."""


class CellWeeks:
    """The camera-hours of a warehouse's range whose person-time and distances are known, and their cells.

    Args:
        warehouse: Its range is read.
        floor: The floor.

    Attributes:
        grid: The cells of `SIDE_M` of the whole range; None where nobody was seen, or the floor is too large.
    """

    def __init__(self, warehouse: Warehouse, floor: Floor) -> None:
        self._warehouse, self._floor = warehouse, floor
        every = camera_hours(warehouse, floor, warehouse.first, warehouse.last, least_share=0.0)
        is_known = every["knows_people"].to_numpy() & every["knows_distances"].to_numpy()
        # in the order of the mart, so that the rows of a query come in order without being sorted
        in_order = [("hour_start_ms", "ascending"), ("camera_id", "ascending")]
        self._used = every.filter(pa.array(is_known)).sort_by(in_order).combine_chunks()
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
        self._read = {span: cells for span, cells in self._read.items() if span in asked}
        for span in asked:
            self._read[span] = self._read.get(span) or self._cells(*span)
        return [self._read[span].between(first, last) for span in asked]

    def _cells(self, start: int, end: int) -> CellHours:
        assert self.grid is not None
        used = self._used.slice(start, end - start)
        rows = self._asked(_CELLS, used)
        number = rows["number"].to_numpy()
        if (number[1:] < number[:-1]).any():  # no query promises an order that it does not ask for
            rows = rows.take(np.argsort(number, kind="stable"))
        return on_grid(self.grid, used, rows, is_everything=True)

    def _grid_of(self) -> Grid | None:
        ends = self._asked(_ENDS, self._used).to_pylist()[0] if self._used.num_rows else {"x0": None}
        if ends["x0"] is None:
            return None
        x, y = (np.array([ends[f"{axis}0"], ends[f"{axis}1"]], dtype=np.int64) for axis in "xy")
        grid = grid_over(x, y, floor=self._floor, cell_m=SIDE_M)
        return None if isinstance(grid, Reason) else grid

    def _asked(self, query: str, used: pa.Table) -> pa.Table:
        """Return the rows of a query of camera-hours, and read no files of other days."""
        days = used["local_date"].to_pylist()
        asked = {"cameras": used["camera_id"].to_pylist(), "hours": used["hour_start_ms"].to_pylist()}
        return self._warehouse.table(_USED + query, {**asked, "first": days[0], "last": days[-1]})

    def _pieces(self) -> list[tuple[int, int]]:
        """Return runs of whole days as first camera-hour and the one after the last."""
        _, starts = np.unique(self._days(), return_index=True)
        pieces: list[tuple[int, int]] = []
        for start, end in zip(starts.tolist(), [*starts[1:].tolist(), self._used.num_rows], strict=True):
            if pieces and end - pieces[-1][0] <= PIECE_HOURS:
                pieces[-1] = (pieces[-1][0], end)
            else:
                pieces.append((start, end))
        return pieces

    def _days(self) -> NDArray[np.datetime64]:
        return np.asarray(self._used["local_date"].to_numpy(), dtype="datetime64[D]")


_USED: Final = """
with used as (
    select
        unnest($cameras::varchar[]) as camera_id,
        unnest($hours::bigint[]) as hour_start_ms,
        unnest(range(len($hours))) as number
)

"""
_CELLS: Final = """
select
    used.number::integer as number,
    cx::integer as cx,
    cy::integer as cy,
    exposure_open_s::double as exposure_s,
    violation_open_s::double as violation_s
from square_hours
inner join used using (camera_id, hour_start_ms)
where local_date between $first and $last
"""
_ENDS: Final = """
select min(cx) as x0, max(cx) as x1, min(cy) as y0, max(cy) as y1
from square_hours
semi join used using (camera_id, hour_start_ms)
where local_date between $first and $last
"""
