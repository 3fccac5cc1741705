"""What a map of the report knows: outlines, bands, areas, spots; part of `vsd_analytics.report.model`."""
# ruff: noqa: RUF009  (`_f` only wraps dataclasses.field)

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from vsd_analytics.report.fields import described as _f

Point = tuple[float, float]
Ring = tuple[Point, ...]
Polygon = tuple[Ring, ...]
Extent = tuple[float, float, float, float]
MapKind = Literal["plan", "floor", "picture"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapImage:
    """A picture below the bands."""

    data_uri: str = _f("The picture itself, `data:image/...`; see `pictures.plan_image`, `pictures.picture_image`.")
    extent: Extent = _f("x0, y0, x1, y1 it covers, in the map's unit.")
    is_opaque: bool = _f("True: its ground hides what lies below, so it is multiplied with the heat.", default=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class MapBand:
    """All floor where the density is at least `lower` (and, drawn first to last, below the next band's)."""

    lower: float = _f("Density at the outline.", "violations per m2 per open hour", "M17")
    polygons: tuple[Polygon, ...] = _f("Each an outer ring followed by its holes, in the map's unit.")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapArea:
    """Outline of a named area."""

    area_id: str = _f("Identifier.")
    name: str = _f("Display name; free text.")
    ring: Ring = _f("Outline in the map's unit.")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapCamera:
    """Where a camera stands, if known."""

    label: str = _f("Short label.")
    at: Point = _f("Position in the map's unit.")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapSpot:
    """A numbered busiest spot."""

    number: int = _f("Rank, 1 first.")
    name: str = _f("Name of the area it lies in; free text.")
    at: Point = _f("Its peak, in the map's unit.")
    peak: float | None = _f("Density at the peak.", "violations per m2 per open hour", default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorMap:
    """One map: the floor plan, bare floor, or a camera picture when there is no plan and no common floor."""

    kind: MapKind = _f("plan and floor are in metres with y up; picture is in pixels with y down.")
    title: str = _f("Floor or camera name; free text.")
    extent: Extent = _f("x0, y0, x1, y1 shown, in the map's unit.")
    image: MapImage | None = _f("Plan or camera picture; None for bare floor.", default=None)
    bands: tuple[MapBand, ...] = _f(
        "Weakest first; see `bands.heat_bands`.", "violations per m2 per open hour", "M17", default=()
    )
    unseen: tuple[Polygon, ...] = _f("Floor no camera sees.", default=())
    areas: tuple[MapArea, ...] = _f("Named areas.", default=())
    cameras: tuple[MapCamera, ...] = _f("Camera positions, if known.", default=())
    spots: tuple[MapSpot, ...] = _f("At most three.", "violations per m2 per open hour", "M20", default=())
    scale_bar_m: float | None = _f("Length of the scale bar; None on pictures.", "m", default=None)
