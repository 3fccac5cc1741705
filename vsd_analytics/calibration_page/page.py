"""One page to calibrate a camera by hand: points on its picture and on the plan, and what is drawn on the floor.

It needs no server and no network, and changes no file: it gives the points as CSV and the lines for `vsd.toml`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, get_args

from markupsafe import Markup

from vsd_analytics.errors import CalibrationError, ReportError
from vsd_analytics.geometry.calibration_files import PointPair, read_points
from vsd_analytics.geometry.camera_views import plan_bounds, view_polygon
from vsd_analytics.geometry.embedded_pictures import photo_image, plan_image
from vsd_analytics.planner.script import one_script
from vsd_analytics.report.pages.week import policy_hash, rendered, shipped_style
from vsd_analytics.site.model import Calibration, Camera, FixtureKind, Floor, Site
from vsd_analytics.version import VERSION
from vsd_analytics.wording import catalogue
from vsd_analytics.wording import format as fmt

SCRIPTS: Final = ("calibrate_homography.js", "calibrate_page.js", "calibrate_panes.js", "calibrate_start.js")
TOOLS: Final = ("points", "area", "fixture", "view")
SAID: Final = "calibrate_page.script."
UNIT: Final = 100
"""Units of the plan's drawing in a metre."""
BLANK_PX: Final = (1920, 1080)
BLANK_M: Final = (0.0, 0.0, 20.0, 15.0)
MARGIN_M: Final = 1.0
WIDEST_M: Final = 300.0
"""A view or a plan wider than this is cut: the grid has a line for each metre."""
PLAN_BYTES: Final = 300_000
SAME_SHAPE: Final = 0.01

Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawingTool:
    """What a click draws."""

    name: str
    title: str
    how: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawingPane:
    """One of the two drawings, in units of its own."""

    name: str
    kind: str
    title: str
    label: str
    width: int
    height: int
    image: str | None
    box: Box
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationPage:
    """Everything the template may use; each field is one variable."""

    title: str
    style: Markup
    style_hash: str
    script: Markup
    script_hash: str
    meta: Markup
    tools: tuple[DrawingTool, ...]
    panes: tuple[DrawingPane, ...]
    csv_name: str
    toml_name: str
    command: str
    version: str


def render_calibration_page(site: Site, camera: Camera, *, picture: Path | None = None) -> str:
    """Return the page of a camera.

    Args:
        site: Its site.
        camera: The camera.
        picture: Picture to click on; None = the camera's own, else a blank ground.

    Raises:
        ReportError: A picture cannot be shown (E501, E502), or has not the proportions of the camera's (E501).
    """
    floor = next(f for f in site.floors if f.floor_id == camera.floor_id)
    used = camera.calibrations[-1] if camera.calibrations else None
    given = _points(used)
    image, size = _picture(camera, picture or camera.picture)
    extent = plan_extent(site, camera, floor, given)
    style = shipped_style("planner.css") + shipped_style("calibrate.css")
    code = one_script(SCRIPTS)
    say = catalogue.say
    csv_name = f"{camera.camera_id}-points.csv"
    return rendered(
        "calibrate.html.j2",
        CalibrationPage(
            title=say("calibrate_page.title", site=site.name, camera=camera.name),
            style=Markup(style),
            style_hash=policy_hash(style),
            script=Markup(code),
            script_hash=policy_hash(code),
            meta=Markup(_json(_meta(site, camera, used, given, size=size, extent=extent))),
            tools=tuple(
                DrawingTool(name=t, title=say(f"calibrate_page.tools.{t}"), how=say(f"calibrate_page.how.{t}"))
                for t in TOOLS
            ),
            panes=(_picture_pane(image, size), plan_pane(floor, extent)),
            csv_name=csv_name,
            toml_name=f"{camera.camera_id}-lines.toml",
            command=f"vsd calibrate {camera.camera_id} --points {csv_name}",
            version=VERSION,
        ),
    )


def sentences() -> dict[str, str]:
    """Return the sentences that the script says, with their places unfilled."""
    return {key.removeprefix(SAID): catalogue.template(key) for key in catalogue.catalogue() if key.startswith(SAID)}


def _points(used: Calibration | None) -> tuple[PointPair, ...]:
    """Return the points of the calibration in force where it was made from some."""
    if used is None or used.source is None:
        return ()
    for path in (used.source, used.source.with_name(f"{used.source.stem}-points.csv")):
        if path.suffix == ".csv" and path.is_file():
            try:
                return read_points(path)
            except CalibrationError:
                return ()
    return ()


def _picture(camera: Camera, path: Path | None) -> tuple[str | None, tuple[int, int]]:
    if path is None:
        return None, camera.picture_px or BLANK_PX
    image, size = photo_image(path)
    known = camera.picture_px
    if known is not None and abs(size[0] * known[1] / (size[1] * known[0]) - 1) > SAME_SHAPE:
        raise ReportError(
            f"{path.name} has {size[0]}x{size[1]} pixels, and the camera's pictures {known[0]}x{known[1]}",
            code="E501",
            why="points clicked on it would be in the wrong places",
            fix="give a picture as the engine sees it, or correct picture_px in vsd.toml",
        )
    return image, known or size


def _picture_pane(image: str | None, size: tuple[int, int]) -> DrawingPane:
    say = catalogue.say
    return DrawingPane(
        name="picture",
        kind="photo",
        title=say("calibrate_page.picture"),
        label=say("calibrate_page.picture_label"),
        width=size[0],
        height=size[1],
        image=image,
        box=(0, 0, *size),
        note="" if image else say("calibrate_page.no_picture"),
    )


def plan_pane(floor: Floor, extent: Box) -> DrawingPane:
    """Return the drawing of a floor's plan, with as much of it as `extent` has."""
    say = catalogue.say
    x0, _, x1, y1 = extent
    shown, image, box = plan_bounds(floor), None, (0.0, 0.0, 0.0, 0.0)
    if shown is not None and floor.plan is not None:
        image, _ = plan_image(floor.plan, max_bytes=PLAN_BYTES)
        left, low, right, high = (round(side * UNIT, 1) for side in shown)
        box = (left - x0 * UNIT, y1 * UNIT - high, right - left, high - low)
    return DrawingPane(
        name="plan",
        kind="plan",
        title=say("calibrate_page.plan", floor=floor.name),
        label=say("calibrate_page.plan_label"),
        width=round((x1 - x0) * UNIT),
        height=round((extent[3] - extent[1]) * UNIT),
        image=image,
        box=box,
        note="" if image else say("calibrate_page.no_plan"),
    )


def plan_extent(site: Site, camera: Camera, floor: Floor, given: tuple[PointPair, ...]) -> Box:
    """Return the part of the floor to draw, in whole metres: the plan and all that is known on it."""
    import shapely

    known = [shapely.Polygon(a.polygon) for a in site.areas if a.floor_id == floor.floor_id]
    known += [shapely.Polygon(f.polygon) for f in site.fixtures if f.floor_id == floor.floor_id]
    known += [shapely.Point(x, y) for _, _, x, y in given]
    shown = plan_bounds(floor)
    if shown is not None:
        known.append(shapely.box(*shown))
    if not known:
        known = [view for view in _views(site, camera) if not view.is_empty]
    if not known:
        return BLANK_M
    x0, y0, x1, y1 = shapely.union_all(known).buffer(MARGIN_M).bounds
    x1, y1 = max(min(x1, x0 + WIDEST_M), x0 + 4), max(min(y1, y0 + WIDEST_M), y0 + 4)
    return float(x0 // 1), float(y0 // 1), float(-(-x1 // 1)), float(-(-y1 // 1))


def _views(site: Site, camera: Camera) -> list[Any]:
    """Return what the camera and the others of its floor see, as far as it is known."""
    views = []
    for other in site.cameras:
        used = other.calibrations[-1] if other.calibrations else None
        if other.floor_id == camera.floor_id:
            views.append(view_polygon(other, calibration=used))
    return [view for view in views if view is not None]


def _meta(
    site: Site,
    camera: Camera,
    used: Calibration | None,
    given: tuple[PointPair, ...],
    *,
    size: tuple[int, int],
    extent: Box,
) -> dict[str, Any]:
    settings = site.settings
    shapes = [("area", s.name, s.polygon) for s in site.areas if s.floor_id == camera.floor_id]
    shapes += [("fixture", s.name, s.polygon) for s in site.fixtures if s.floor_id == camera.floor_id]
    known = [{"kind": kind, "name": name, "points": polygon} for kind, name, polygon in shapes]
    return {
        "camera": camera.camera_id,
        "floor": camera.floor_id,
        "picture": {"size": size},
        "plan": {"extent": extent},
        "homography": None if used is None else [number for row in used.homography for number in row],
        "points": given,
        "known": known,
        "views": [
            [[round(x, 2), round(y, 2)] for x, y in view.exterior.coords[:-1]]
            for view in _views(site, camera)
            if view.geom_type == "Polygon" and not view.is_empty
        ],
        "taken": {"area": [a.area_id for a in site.areas], "fixture": [f.fixture_id for f in site.fixtures]},
        "kinds": get_args(FixtureKind),
        "radii": [
            {"m": metres, "text": fmt.distance(metres, settings.distance_unit)}
            for metres in (settings.distance_m / 2, settings.distance_m)
        ],
        "words": sentences(),
    }


def _json(value: Any) -> str:
    """Return JSON that is safe inside a script element."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
