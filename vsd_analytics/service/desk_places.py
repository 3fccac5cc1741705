"""The page of a floor's areas and fixtures: its plan to point at, what is there, what was marked, and by whom."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from markupsafe import Markup

from vsd_analytics.config.log_records import NAME_MAX_CHARS
from vsd_analytics.config.place_edits import KINDS, PlaceEdit, can_take_back, standing
from vsd_analytics.report.pages.week import policy_hash, rendered, shipped_style
from vsd_analytics.service.desk_jobs import place_line
from vsd_analytics.service.plan_picture import PlanPicture, corners_of, corners_text
from vsd_analytics.site.model import Floor, Site
from vsd_analytics.site.places import fixtures_at
from vsd_analytics.version import VERSION
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

WIDTHS_PX: Final = {"wide": 680, "narrow": 288}
"""Of the plan on a screen, and on a phone: a click is sent in pixels, so each size is one that is known."""
FIELDS: Final = ("job", "kind", "name", "from", "corners", "place", "until")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSize:
    """The plan in one size.

    Attributes:
        name: Of the field that a click is sent in.
        width_px, height_px: Its size.
    """

    name: str
    width_px: int
    height_px: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceLine:
    """Something that was marked or ended: texts.

    Attributes:
        line: What names it in a form; empty where it cannot be taken back.
        text: What was done.
        who: By whom, and when.
    """

    line: str
    text: str
    who: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacesPage:
    """Everything the template of the page may use; each field is one variable.

    Attributes:
        site, title, style, style_hash, writer, form_token, request_id, said, mistake, filled, version: As of the desk.
        floor_id: The floor.
        floor: Its name.
        floors: Id and name of all floors.
        kinds: Key and word of each kind of place.
        picture: Address of the plan with the corners so far.
        sizes: Its sizes.
        n_corners: Corners so far.
        today: The first day of a new place, unless another is chosen.
        there: Id and name of what is there now, without an end.
        lines: What was marked or ended, the last first.
        name_max: Longest name.
    """

    site: str
    title: str
    style: Markup
    style_hash: str
    writer: str
    form_token: str
    request_id: str
    said: str
    mistake: tuple[str, str] | None
    filled: Mapping[str, str]
    version: str
    floor_id: str
    floor: str
    floors: tuple[tuple[str, str], ...]
    kinds: tuple[tuple[str, str], ...]
    picture: str
    sizes: tuple[PlanSize, ...]
    n_corners: int
    today: str
    there: tuple[tuple[str, str], ...]
    lines: tuple[PlaceLine, ...]
    name_max: int


def render_places(
    site: Site,
    floor: Floor,
    *,
    writer: str,
    form_token: str,
    request_id: str,
    now: datetime,
    said: str = "",
    mistake: tuple[str, str] | None = None,
    filled: Mapping[str, str],
) -> str:
    """Return the page of a floor's areas and fixtures.

    Args:
        site: The site.
        floor: The floor.
        writer: Who is signed in.
        form_token: What each form sends back.
        request_id: Id of the next request.
        now: The present.
        said: What was done.
        mistake: Name of a field that cannot be taken, and why.
        filled: What was filled in, and under `job` which form; a click on the plan adds a corner.
    """
    today, style = now.astimezone(site.zone).date(), shipped_style("report.css") + shipped_style("desk.css")
    plan = PlanPicture(site, floor, day=today)
    fields = dict.fromkeys(FIELDS, "") | dict(filled)
    if fields["job"] == "draw":
        fields["corners"] = _drawn(plan, fields)
    try:
        corners = corners_of(fields["corners"])
    except ValueError:
        corners = ()
        mistake = mistake or ("corners", say("desk.mistake.corners"))
    return rendered(
        "desk/places.html.j2",
        PlacesPage(
            site=site.name,
            title=say("desk.places.page_title", site=site.name),
            style=Markup(style),
            style_hash=policy_hash(style),
            writer=writer,
            form_token=form_token,
            request_id=request_id,
            said=said,
            mistake=mistake,
            filled=fields | ({"job": "mark"} if fields["job"] == "draw" else {}),
            version=VERSION,
            floor_id=floor.floor_id,
            floor=floor.name,
            floors=tuple((f.floor_id, f.name) for f in site.floors),
            kinds=tuple((kind, say(f"desk.places.kind.{kind}")) for kind in KINDS),
            picture=plan.uri(corners),
            sizes=tuple(
                PlanSize(name=name, width_px=width, height_px=plan.height_px(width))
                for name, width in WIDTHS_PX.items()
            ),
            n_corners=len(corners),
            today=f"{today}",
            there=(
                *((a.area_id, a.name) for a in site.areas if a.floor_id == floor.floor_id and a.end_day is None),
                *((f.fixture_id, f.name) for f in fixtures_at(site, floor.floor_id, today) if f.valid_to is None),
            ),
            lines=_lines(site, floor, now=now),
            name_max=NAME_MAX_CHARS,
        ),
    )


def _drawn(plan: PlanPicture, fields: Mapping[str, str]) -> str:
    """Return the corners with one more where the plan was clicked, or one less."""
    try:
        corners = corners_of(fields["corners"])
    except ValueError:
        return fields["corners"]
    if "drop" in fields:
        return corners_text(corners[:-1])
    for name, width_px in WIDTHS_PX.items():
        x, y = (fields.get(f"{name}.{axis}", "") for axis in "xy")
        if x.isdecimal() and y.isdecimal() and len(x + y) < 10:
            place = plan.place_m((int(x), int(y)), width_px=width_px)
            corners = (*corners, *([place] if place is not None and place not in corners[-1:] else []))
    return corners_text(corners)


def _lines(site: Site, floor: Floor, *, now: datetime) -> tuple[PlaceLine, ...]:
    """Return what was marked or ended on a floor, the last first."""
    own = {a.area_id for a in site.areas if a.floor_id == floor.floor_id}
    own |= {f.fixture_id for f in site.fixtures if f.floor_id == floor.floor_id}
    can_undo = can_take_back(site, today=now.astimezone(site.zone).date())
    return tuple(_line(c, can_undo=c in can_undo) for c in reversed(standing(site)) if c.place_id in own)


def _line(change: PlaceEdit, *, can_undo: bool) -> PlaceLine:
    key = "desk.places.since" if change.action == "marked" else "desk.places.until"
    return PlaceLine(
        line=place_line(change) if can_undo else "",
        text=say(key, name=change.name, day=fmt.date_short(change.day)),
        who=", ".join(filter(None, (change.by, fmt.instant_short(change.at)))),
    )
