"""The page of `vsd engine live --look`: a camera's picture beside the plan, and sliders to calibrate by eye."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from vsd_analytics.calibration_page.page import MARGIN_M, Box, DrawingPane, plan_extent, plan_pane
from vsd_analytics.geometry.camera_views import view_polygon
from vsd_analytics.planner.script import one_script
from vsd_analytics.report.pages.week import policy_hash, rendered, shipped_style
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.version import VERSION
from vsd_analytics.wording import catalogue
from vsd_analytics.wording import format as fmt

SCRIPTS: Final = ("look.js",)
SAID: Final = "look_page.script."
RATIOS: Final = ("horizontal", "vertical")


@dataclass(frozen=True, slots=True, kw_only=True)
class LookPage:
    """Everything the template may use; each field is one variable."""

    title: str
    style: Markup
    script: Markup
    meta: Markup
    cameras: tuple[tuple[str, str, bool], ...]
    camera_name: str
    plan: DrawingPane
    ratios: tuple[tuple[str, str], ...]
    distance: str
    version: str


def look_policy() -> str:
    """Return the content security policy of the page: its own style and script, pictures from it, and its server."""
    style, script = policy_hash(_style()), policy_hash(one_script(SCRIPTS))
    return (
        f"default-src 'none'; script-src 'sha256-{script}'; style-src 'sha256-{style}'; img-src data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


def render_look_page(site: Site, camera: Camera, *, cameras: tuple[Camera, ...]) -> str:
    """Return the page of a camera.

    Args:
        site: Its site.
        camera: The camera.
        cameras: All that are looked at.
    """
    floor = next(f for f in site.floors if f.floor_id == camera.floor_id)
    extent = _extent(site, camera, floor)
    say, settings = catalogue.say, site.settings
    meta = {
        "camera": camera.camera_id,
        "extent": extent,
        "zone": site.timezone,
        "radius_m": settings.distance_m / 2,
        "words": {
            key.removeprefix(SAID): catalogue.template(key) for key in catalogue.catalogue() if key.startswith(SAID)
        },
    }
    text = json.dumps(meta, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return rendered(
        "look.html.j2",
        LookPage(
            title=say("look_page.title", site=site.name, camera=camera.name),
            style=Markup(_style()),
            script=Markup(one_script(SCRIPTS)),
            meta=Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")),
            cameras=tuple((c.camera_id, c.name, c.camera_id == camera.camera_id) for c in cameras),
            camera_name=camera.name,
            plan=plan_pane(floor, extent),
            ratios=tuple((name, say(f"look_page.{name}")) for name in RATIOS),
            distance=fmt.distance(settings.distance_m, settings.distance_unit),
            version=VERSION,
        ),
    )


def _extent(site: Site, camera: Camera, floor: Floor) -> Box:
    """Return the part of the plan that a camera sees, in whole metres; the whole plan where that is not known."""
    used = camera.calibrations[-1] if camera.calibrations else None
    view = view_polygon(camera, calibration=used)
    if view is None or view.is_empty:
        return plan_extent(site, camera, floor, ())
    x0, y0, x1, y1 = view.buffer(MARGIN_M).bounds
    return float(x0 // 1), float(y0 // 1), float(-(-x1 // 1)), float(-(-y1 // 1))


def sentences() -> dict[str, str]:
    """Return the sentences that the script says, with their places unfilled."""
    return {key.removeprefix(SAID): catalogue.template(key) for key in catalogue.catalogue() if key.startswith(SAID)}


def _style() -> str:
    return shipped_style("planner.css") + shipped_style("look.css")
