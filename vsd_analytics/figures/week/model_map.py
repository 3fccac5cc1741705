"""What a map of the report knows: outlines, bands, areas, spots; part of `vsd_analytics.report.model.week`."""
# ruff: noqa: RUF009  (`_f` only wraps dataclasses.field)

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from vsd_analytics.figures.week.model_estimate import described as _f
from vsd_analytics.figures.week.model_estimate import optional as _o

Point = tuple[float, float]
Ring = tuple[Point, ...]
Polygon = tuple[Ring, ...]
Extent = tuple[float, float, float, float]
MapKind = Literal["plan", "floor", "picture"]
FixtureKind = Literal["shelf", "wall", "till", "other"]


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
class MapFixture:
    """Something nobody walks through."""

    fixture_id: str = _f("Identifier.")
    name: str = _f("Display name; free text.")
    kind: FixtureKind = _f("shelf, wall, till or other.")
    is_movable: bool = _f("True: staff could move it.", default=False)
    ring: Ring = _f("Footprint in the map's unit.")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapCamera:
    """Position of a camera, if known."""

    label: str = _f("Short label.")
    at: Point = _f("Position in the map's unit.")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapSpot:
    """A numbered busiest spot."""

    number: int = _f("Rank, 1 first.")
    name: str = _f("Name of the area it lies in; free text.")
    at: Point = _f("Its peak, in the map's unit.")
    peak: float | None = _o("Density at the peak.", "violations per m2 per open hour")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangedPlace:
    """What changed on the coloured floor of a place."""

    area_id: str | None = _f("Area; None for the rest of the floor.")
    name: str = _f("Its display name; free text.")
    fewer: float = _f("Violations per open hour fewer, on floor coloured as fewer.", "per open hour")
    more: float = _f("Violations per open hour more, on floor coloured as more.", "per open hour")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeMaps:
    """The week before, this week, and the difference, over the same camera-hours; on the floor of the first map."""

    before: tuple[MapBand, ...] = _f("Bands of the week before.", "violations per m2 per open hour", "M17")
    now: tuple[MapBand, ...] = _f("Bands of this week.", "violations per m2 per open hour", "M17")
    fewer: tuple[MapBand, ...] = _f("Floor with fewer by at least `lower`.", "violations per m2 per open hour", "M17")
    more: tuple[MapBand, ...] = _f("Floor with more by at least `lower`.", "violations per m2 per open hour", "M17")
    steps: tuple[float, float] = _f("Lower ends of the two bands of the difference.", "violations per m2 per open hour")
    hours_compared: float = _f("Camera-hours recorded in both weeks.", "h")
    places: tuple[ChangedPlace, ...] = _f("Areas with coloured floor, the greatest change first.", default=())
    fixtures_before: tuple[MapFixture, ...] | None = _o(
        "What stood on the floor at the end of the week before; None: what is there now."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Footsteps:
    """Where people walked or stood: cells of the floor with the steps of enough people."""

    cell_m: float = _f("Side of a cell.", "m")
    min_tracks: int = _f("Fewest tracks that show a cell.", "tracks")
    runs: tuple[tuple[int, int, int], ...] = _f(
        "Such cells side by side: floor(y / cell_m), floor(x / cell_m) of the first, and how many they are.",
        metric="M5",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class MapView:
    """What one camera sees of the floor."""

    camera_id: str = _f("Identifier.")
    name: str = _f("Display name; free text.")
    polygons: tuple[Polygon, ...] = _f("Its view as far as the map shows the floor, floor metres.")
    area_m2: float = _f("Size of that.", "m2")
    alone_m2: float = _f("Size of what no other camera sees.", "m2")
    label: str = _f("Short label, as in the table of recorded hours.")
    at: Point = _f("Where it is written: the floor nearest to the camera.", "m")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapViews:
    """What the cameras see of the floor, and what several see."""

    cameras: tuple[MapView, ...] = _f("In the order of vsd.toml.")
    shared: tuple[Polygon, ...] = _f("Floor that two cameras or more see, floor metres.")
    floor_m2: float = _f("Size of the floor shown, without fixtures; so are the sizes below.", "m2")
    shared_m2: float = _f("Size of `shared`.", "m2")
    unseen_m2: float = _f("Size of the floor no camera sees.", "m2")


@dataclass(frozen=True, slots=True, kw_only=True)
class SpotPicture:
    """The surroundings of a numbered spot, with its bands: an empty scene, or that part of the floor."""

    number: int = _f("Number of the spot.")
    camera_id: str | None = _o("The camera that shows it most finely; None for a part of the floor.")
    camera_name: str | None = _o("Its display name; free text.")
    px_per_m: float | None = _o("How finely it shows the spot: picture pixels per metre of floor.", "px/m")
    across_m: float = _f("Floor from the left to the right edge of the picture, at the spot.", "m")
    shown: FloorMap = _f(
        "The picture or floor, cut to the spot, and its bands; in pixels of the camera's picture, or metres."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorMap:
    """One map: the floor plan, bare floor, or a camera picture when there is no plan and no common floor."""

    kind: MapKind = _f("plan and floor are in metres with y up; picture is in pixels with y down.")
    title: str = _f("Floor or camera name; free text.")
    extent: Extent = _f("x0, y0, x1, y1 shown, in the map's unit.")
    image: MapImage | None = _o("Plan or camera picture; None for bare floor.")
    bands: tuple[MapBand, ...] = _f(
        "Weakest first; see `bands.heat_bands`.", "violations per m2 per open hour", "M17", default=()
    )
    unseen: tuple[Polygon, ...] = _f("Floor that no camera sees which recorded this week.", default=())
    uncertain: tuple[Polygon, ...] = _f(
        "Floor without bands: the calibration states an sd of a distance above half the legal one.", default=()
    )
    fixtures: tuple[MapFixture, ...] = _f("What stands on the floor; no band runs below it.", default=())
    areas: tuple[MapArea, ...] = _f("Named areas.", default=())
    cameras: tuple[MapCamera, ...] = _f("Camera positions, if known.", default=())
    spots: tuple[MapSpot, ...] = _f("At most three.", "violations per m2 per open hour", "M20", default=())
    scale_bar_m: float | None = _o("Length of the scale bar; None on pictures.", "m")
