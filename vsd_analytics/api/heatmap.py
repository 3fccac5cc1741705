"""A map of a floor as an array, ready to draw."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import date
from html import escape
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.api.floor_view import PictureView, ink, picture_view
from vsd_analytics.errors import UsageError, nearest
from vsd_analytics.figures import maps
from vsd_analytics.figures.floor_days import Grid
from vsd_analytics.figures.maps import CellMap
from vsd_analytics.figures.operator_counts import check_cell_m
from vsd_analytics.figures.week.model_map import FloorMap
from vsd_analytics.report.draw.bare_floor import bare_floor
from vsd_analytics.report.draw.cell_map import LOW, MapCell, cell_map, doubling_steps
from vsd_analytics.report.draw.svg import RAMP_LIGHT
from vsd_analytics.site.model import Floor, Site
from vsd_analytics.site.places import known_floor
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap


EXCESS_STEPS: Final = (1.0, 1.25, 1.5, 2.0, 3.0)
"""Classes of excess: 1 is what the crowd explains."""
UNIT_LETTERS: Final = 64
"""Letters in a line below the scale of a plot."""


@dataclass(frozen=True, slots=True, eq=False)
class Heatmap:
    """One map of a floor (M16 to M19); a notebook shows it on the floor's plan.

    Attributes:
        kind: exposure, burden, risk or excess.
        array: Shape (rows, columns), row 0 at the bottom of the floor; NaN where nothing is known: nobody was seen
            there, or too few to tell. Empty, of shape (0, 0), where the map cannot be made.
        unit: Of the values.
        extent_m: Left, right, bottom and top of the array in floor metres, as matplotlib's `extent`.
        exposure_h: Person-hours in each cell, same shape.
        floor: The floor.
        note: Why there is no map, or why it is blank; else empty.
        site: The site, for its plan, fixtures, areas and cameras.
        until: Last day of the map, for what stood on the floor.
    """

    kind: str
    array: NDArray[np.float64] = field(repr=False)
    unit: str
    extent_m: tuple[float, float, float, float]
    exposure_h: NDArray[np.float64] = field(repr=False)
    floor: Floor = field(repr=False)
    note: str
    site: Site = field(repr=False)
    until: date = field(repr=False)

    @property
    def cell_m(self) -> float:
        """Return the side of a cell in metres.

        Example:
            >>> week.heatmap("risk", cell_m=1.0).cell_m
            1.0
        """
        return (self.extent_m[1] - self.extent_m[0]) / max(1, int(self.array.shape[1]))

    def plot(self, ax: Axes | None = None, *, over: str | None = None, **options: Any) -> Axes:
        """Draw the map in the colours of the report; unknown cells stay blank.

        The scale goes from 0 to what 97 % of the known cells stay below: one cell does not make the others pale.

        Args:
            ax: Axes to draw on; None = new ones.
            over: "plan" adds the floor's plan, fixtures and areas; the id of a camera draws the cells that it sees
                whole into its picture, in pixels; None = bare floor.
            **options: For matplotlib's `imshow` (over a camera: `PolyCollection`), such as `cmap` or `vmax`.

        Raises:
            UsageError: E101, there is no map (`note` says why), or no such camera.

        Example:
            >>> axes = week.heatmap("risk").plot(over="plan")
            >>> axes.get_xlabel()
            'x, m'
        """
        if not self.array.size:
            raise UsageError(f"there is no map of {self.kind}", why=self.note)
        view = (
            None if over in (None, "plan") else picture_view(self.site, str(over), floor=self.floor, until=self.until)
        )
        import matplotlib.pyplot as plt
        from matplotlib.ticker import PercentFormatter

        if ax is None:
            _, ax = plt.subplots(layout="constrained")
        limits = self._limits()
        options = {"cmap": _colours(0.25 if view else 1.0), "vmin": limits[0], "vmax": limits[1], **options}
        if view is not None:
            drawn = self._plot_picture(ax, view, options)
        else:
            drawn = ax.imshow(self.array, origin="lower", extent=self.extent_m, **options)
            if over == "plan":
                self._plot_plan(ax)
            ax.set(xlabel="x, m", ylabel="y, m", title=f"{self.floor.name}: {self.kind}")
        label = "\n".join(wrap(self.unit, UNIT_LETTERS))
        is_cut = bool((self.array > drawn.get_clim()[1]).any())
        scale = ax.figure.colorbar(
            drawn, ax=ax, location="bottom", label=label, shrink=0.6, aspect=40, extend="max" if is_cut else "neither"
        )
        scale.outline.set_visible(False)
        if self.kind == "risk":
            scale.ax.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        return ax

    def geojson(self) -> dict[str, Any]:
        """Return the known cells as GeoJSON polygons in floor metres, each with its `value`; row by row.

        Example:
            >>> week.heatmap("burden", cell_m=1.0).geojson()["features"][0]["geometry"]["type"]
            'Polygon'
        """
        known, corners = self._cells()
        features = [
            {
                "type": "Feature",
                "properties": {"value": value, "unit": self.unit},
                "geometry": {"type": "Polygon", "coordinates": [[*ring, ring[0]]]},
            }
            for value, ring in zip(known.tolist(), corners.tolist(), strict=True)
        ]
        return {"type": "FeatureCollection", "features": features}

    def _repr_html_(self) -> str:
        """Return the map on the floor's plan as SVG, drawn as in the report."""
        if not self.array.size:
            return f"<p><b>{escape(self.floor.name)}: {self.kind}</b></p><p>{escape(self.note)}</p>"
        known, corners = self._cells()
        cells = [
            MapCell(tuple((x, y) for x, y in ring), value)
            for value, ring in zip(known.tolist(), corners.tolist(), strict=True)
        ]
        label = f"{self.floor.name}: {self.kind}, {self.unit}"
        steps = EXCESS_STEPS if self.kind == "excess" else doubling_steps(self.array)
        drawn = cell_map(self._floor(), cells, steps=steps, unit=self.unit, label=label, name=f"vsd-{self.kind}")
        note = f"<p>{escape(self.note)}</p>" if self.note else ""
        return f"<p><b>{escape(self.floor.name)}: {self.kind}</b></p>{note}{drawn}"

    def _limits(self) -> tuple[float, float]:
        """Return the ends of the scale; they are the same over the plan and over every camera."""
        known = self.array[np.isfinite(self.array)]
        return 0.0, float(np.percentile(known, 97)) if (known > 0).any() else 1.0

    def _cells(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the known values, shape (n,), and the corners of their cells in metres, shape (n, 4, 2)."""
        rows, columns = np.nonzero(np.isfinite(self.array))
        lower_left = np.stack([self.extent_m[0] + columns * self.cell_m, self.extent_m[2] + rows * self.cell_m], axis=1)
        around = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * self.cell_m
        return self.array[rows, columns], lower_left[:, None, :] + around

    def _floor(self) -> FloorMap:
        left, right, bottom, top = self.extent_m
        return bare_floor(self.site, self.floor, until=self.until, extent=(left, bottom, right, top))

    def _plot_plan(self, ax: Axes) -> None:
        shown = self._floor()
        x0, y0, x1, y1 = shown.extent
        ax.imshow(ink(shown), extent=(x0, x1, y0, y1), zorder=2)
        ax.set(xlim=(x0, x1), ylim=(y0, y1))

    def _plot_picture(self, ax: Axes, view: PictureView, options: dict[str, Any]) -> Any:
        from matplotlib.collections import PolyCollection

        known, corners = self._cells()
        seen, corners_px = view.corners_px(corners)
        limits = {name: options.pop(name) for name in ("vmin", "vmax") if name in options}
        drawn = PolyCollection(list(corners_px), array=known[seen], **{"linewidth": 0, **options})
        drawn.set_clim(**limits)
        width, height = view.size_px
        ax.imshow(view.pixels(), extent=(0, width, height, 0))
        ax.add_collection(drawn)
        ax.set(xlim=(0, width), ylim=(height, 0), xticks=[], yticks=[], title=f"{view.camera.name}: {self.kind}")
        return drawn


def _colours(faintest: float) -> Colormap:
    """Return the colours of the report's maps, the lowest as faint as asked, so that a picture shows through."""
    from matplotlib.colors import LinearSegmentedColormap, to_rgba

    ramp = (LOW, *RAMP_LIGHT)
    strength = np.linspace(faintest, min(1.0, faintest + 0.6), len(ramp)).tolist()
    return LinearSegmentedColormap.from_list("vsd", [to_rgba(c, a) for c, a in zip(ramp, strength, strict=True)])


def heatmap_of(site: Site, days: tuple[date, date], kind: str, *, floor_id: str | None, cell_m: float) -> Heatmap:
    """Return a map of some days of a floor; arguments and errors as of `Days.heatmap`."""
    functions: dict[str, Callable[..., CellMap]] = {
        "exposure": maps.exposure_map,
        "burden": maps.burden_map,
        "risk": maps.risk_map,
        "excess": maps.excess_map,
    }
    if kind not in functions:
        why = f"the maps are {', '.join(functions)}"
        near = nearest(str(kind), functions) or "burden"
        raise UsageError(f"there is no map of {kind!r}", why=why, fix=f'heatmap("{near}")')
    check_cell_m(cell_m)
    floor = known_floor(site, floor_id)
    with open_warehouse(site, *days) as warehouse:
        floor_map = functions[kind](warehouse, floor=floor, cell_m=cell_m)
    return as_heatmap(kind, floor_map, floor=floor, site=site, until=days[1])


def as_heatmap(kind: str, floor_map: CellMap, *, floor: Floor, site: Site, until: date) -> Heatmap:
    """Return a map of the figures as a `Heatmap`."""
    unit = reason_text(floor_map.unit)
    if floor_map.grid is None or floor_map.values is None or floor_map.exposure_h is None:
        nothing, nowhere = np.zeros((0, 0)), (0.0, 0.0, 0.0, 0.0)
        return Heatmap(kind, nothing, unit, nowhere, nothing, floor, reason_text(floor_map.reason), site, until)
    extent_m = _extent_m(floor_map.grid)
    note = "" if np.isfinite(floor_map.values).any() else "in no cell did people spend enough time to tell"
    return Heatmap(kind, floor_map.values, unit, extent_m, floor_map.exposure_h, floor, note, site, until)


def _extent_m(grid: Grid) -> tuple[float, float, float, float]:
    rows, columns = grid.shape
    x, y = grid.cx * grid.cell_m, grid.cy * grid.cell_m
    return x, x + columns * grid.cell_m, y, y + rows * grid.cell_m
