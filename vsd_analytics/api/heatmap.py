"""A map of a floor as an array, ready to draw."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.errors import UsageError
from vsd_analytics.figures.floor_days import Grid
from vsd_analytics.figures.maps import CellMap
from vsd_analytics.report.words.reasons import reason_text
from vsd_analytics.site.model import Floor

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True, eq=False)
class Heatmap:
    """One map of a floor (M16 to M19).

    Attributes:
        kind: exposure, burden, risk or excess.
        array: Shape (rows, columns), row 0 at the bottom of the floor; NaN where nothing is known: nobody was seen
            there, or too few to tell. Empty, of shape (0, 0), where the map cannot be made.
        unit: Of the values.
        extent_m: Left, right, bottom and top of the array in floor metres, as matplotlib's `extent`.
        exposure_h: Person-hours in each cell, same shape.
        floor: The floor.
        note: Why there is no map; empty where there is one.
    """

    kind: str
    array: NDArray[np.float64] = field(repr=False)
    unit: str
    extent_m: tuple[float, float, float, float]
    exposure_h: NDArray[np.float64] = field(repr=False)
    floor: Floor = field(repr=False)
    note: str

    @property
    def cell_m(self) -> float:
        """Return the side of a cell in metres."""
        return (self.extent_m[1] - self.extent_m[0]) / max(1, int(self.array.shape[1]))

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the map with its scale, metres on both axes, unknown cells left blank.

        Args:
            ax: Axes to draw on; None = new ones.
            **options: For `matplotlib.axes.Axes.imshow`, such as `cmap` or `vmax`.

        Raises:
            UsageError: E101, there is no map; `note` says why.
        """
        if not self.array.size:
            raise UsageError(f"there is no map of {self.kind}", why=self.note)
        import matplotlib.pyplot as plt

        if ax is None:
            _, ax = plt.subplots(layout="constrained")
        drawn = ax.imshow(self.array, origin="lower", extent=self.extent_m, **{"cmap": "YlOrBr", **options})
        ax.set(xlabel="x, m", ylabel="y, m", title=f"{self.floor.name}: {self.kind}")
        ax.figure.colorbar(drawn, ax=ax, label=self.unit)
        return ax

    def geojson(self) -> dict[str, Any]:
        """Return the known cells as GeoJSON polygons in floor metres, each with its `value`; row by row."""
        left, _, bottom, _ = self.extent_m
        side = self.cell_m
        features = []
        for row, column in np.argwhere(np.isfinite(self.array)).tolist():
            x, y = left + column * side, bottom + row * side
            ring = [[x, y], [x + side, y], [x + side, y + side], [x, y + side], [x, y]]
            features.append(
                {
                    "type": "Feature",
                    "properties": {"value": float(self.array[row, column]), "unit": self.unit},
                    "geometry": {"type": "Polygon", "coordinates": [ring]},
                }
            )
        return {"type": "FeatureCollection", "features": features}


def as_heatmap(kind: str, found: CellMap, floor: Floor) -> Heatmap:
    """Return a map of the figures as a `Heatmap`."""
    if found.grid is None or found.values is None or found.exposure_h is None:
        nothing = np.zeros((0, 0))
        return Heatmap(kind, nothing, found.unit, (0.0, 0.0, 0.0, 0.0), nothing, floor, reason_text(found.reason))
    return Heatmap(kind, found.values, found.unit, _extent_m(found.grid), found.exposure_h, floor, "")


def _extent_m(grid: Grid) -> tuple[float, float, float, float]:
    rows, columns = grid.shape
    x, y = grid.cx * grid.cell_m, grid.cy * grid.cell_m
    return x, x + columns * grid.cell_m, y, y + rows * grid.cell_m
