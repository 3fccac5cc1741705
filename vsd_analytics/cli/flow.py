"""`vsd flow`: where people go from one area to the next, and the routes they take from door to door."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any, Literal

import click

from vsd_analytics.cli.estimates import rate_text, share_text
from vsd_analytics.cli.flow_links import link_lines, links_dict
from vsd_analytics.cli.options import choice_option, floor_option, range_options
from vsd_analytics.cli.output import emit_json, plain, rounded, table
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.figures.flow import AreaFlow, Destination, Flow, Route
    from vsd_analytics.figures.periods import Period
    from vsd_analytics.stats.estimates import RateEstimate
    from vsd_analytics.stats.groups import ShareEstimate

_COLUMNS = (
    *("what", "from", "to", "share", "lo", "hi"),
    *("followed_per_open_h", "lo_per_open_h", "hi_per_open_h", "reason"),
)


@click.command()
@range_options
@floor_option
@choice_option("--format", "kind", choices=["text", "json", "csv"], default="text", help="Output format.")
@pass_project
def flow(
    project: Project,
    week: str | None,
    days: str | None,
    floor_id: str | None,
    kind: Literal["text", "json", "csv"],
) -> int:
    """Print where people go next from each area (origin-destination matrix), and their routes from door to door.

    The areas are those with visits = true. At those with door = true, people come in and leave. Tracks that are lost
    on the way went nowhere: they count as long as they were followed (Aalen-Johansen). Those who come into an area are
    counted without these links, too: where the flows bring more or fewer, the command says so.

    Over floor that no camera sees, and from one camera's view to the next, nobody is followed. There links are
    estimated by time and walking speed, less as many as fit with time running backwards, which is chance. They are
    printed apart and are in no other share.

    Exit code 1: no area asks for visits, or of none enough people were followed.

    \b
    Example:
      vsd flow --week last
      vsd flow --range 2026-11-02..2026-11-15 --format json
    """
    from vsd_analytics.cli.ranges import noted, period_with_history, purged_hours_notes, warn
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures import flow as figures
    from vsd_analytics.site.places import known_floor

    floor = known_floor(project.site, floor_id)
    if not any(a.has_visits for a in project.site.areas if a.floor_id == floor.floor_id):
        raise UsageError(
            f"no area of floor {floor.floor_id!r} asks for visits",
            why="flow is computed only between areas that ask for visits",
            fix="add visits = true to two [[area]] of vsd.toml or more; door = true where people come and go",
        )
    with period_with_history(project, floor, week=week, days=days) as period:
        found = figures.flow(period)
        notes = purged_hours_notes(period.data.warehouse)
    assert found is not None
    below = int(project.site.settings.mask_below)
    if kind == "json":
        printed = {**_as_dict(found, below), "links": links_dict(found.links)}
        emit_json(noted({"first": period.first, "last": period.last, **printed}, notes))
    else:
        warn(notes)
        text = _csv(found) if kind == "csv" else _text(found, period)
        click.echo(plain(text).rstrip("\n"))
    return 0 if any(to.share.state == "ok" for a in found.areas for to in a.to) else 1


def _as_dict(found: Flow, below: int) -> dict[str, Any]:
    def small(n: float) -> float | None:
        return n if n == 0 or n >= below else None

    def share(of: ShareEstimate) -> dict[str, Any]:
        return {"value": of.value, "lo": of.lo, "hi": of.hi, "n": small(of.n), "reason": of.reason}

    def rate(of: RateEstimate) -> dict[str, Any]:
        is_small = of.n_events is not None and small(of.n_events) is None
        value, lo, hi = (None, None, None) if is_small else (of.value, of.lo, of.hi)
        return {"value": value, "lo": lo, "hi": hi, "reason": of.reason}

    def lost(of: ShareEstimate) -> dict[str, Any]:
        is_small = small(of.n) is None or small(of.of - of.n) is None
        limits = (None, None, None) if is_small else (of.value, of.lo, of.hi)
        return dict(zip(("value", "lo", "hi"), limits, strict=True))

    def area(of: AreaFlow) -> dict[str, Any]:
        check, n = of.inflow, of.following
        return {
            "area_id": of.area.area_id,
            "leave_per_open_h": rate(of.often),
            "to": [
                {
                    "area_ids": [a.area_id for a in to.areas],
                    "share": share(to.share),
                    "followed_per_open_h": rate(to.often),
                }
                for to in of.to
            ],
            "n_left": small(n.n),
            "not_followed": lost(n.not_followed),
            "unseen": n.unseen,
            "n_days": n.n_days,
            "inflow": {"n_arrived": small(check.n_arrived), "ratio": check.value, "lo": check.lo, "hi": check.hi,
                       "agrees": check.agrees},
            "reason": n.reason,
        }  # fmt: skip

    routes = found.routes
    printed: dict[str, Any] = rounded(
        {
            "areas": [area(of) for of in found.areas],
            "routes": {
                "shares": [{"area_ids": [a.area_id for a in r.areas], "share": share(r.share)} for r in routes.routes],
                "n_began": small(routes.following.n),
                "not_followed": lost(routes.following.not_followed),
                "unseen": routes.following.unseen,
                "has_doors": routes.has_doors,
                "reason": routes.following.reason,
            },
            "recorded_share": found.recorded_share,
            "silent_cameras": found.silent_cameras,
        }
    )
    return printed


def _csv(found: Flow) -> str:
    out = io.StringIO()
    write = csv.writer(out, lineterminator="\n")
    write.writerow(_COLUMNS)

    def row(*cells: object) -> None:
        write.writerow(["" if c is None else f"{c:.6g}" if isinstance(c, float) else c for c in cells])

    for of in found.areas:
        for to in of.to:
            s, r = to.share, to.often
            ids = " ".join(a.area_id for a in to.areas)
            row("flow", of.area.area_id, ids, s.value, s.lo, s.hi, r.value, r.lo, r.hi, reason_text(s.reason))
        if not of.to:
            row("flow", of.area.area_id, "", *([None] * 6), reason_text(of.following.reason))
    for route in found.routes.routes:
        s = route.share
        ids = " ".join(a.area_id for a in route.areas) or "other"
        row("route", "", ids, s.value, s.lo, s.hi, None, None, None, reason_text(s.reason))
    for link in found.links.found:
        of_link, ends = link.share, (link.origin.area_id, link.to.area_id)
        limits = (of_link.value, of_link.lo, of_link.hi)
        row("estimated link", *ends, *limits, None, None, None, reason_text(of_link.reason))
    return out.getvalue()


def _text(found: Flow, period: Period) -> str:
    rows = [("from", "to", "share of those who leave", "followed per open hour")]
    for of in found.areas:
        rows.append((of.area.name, "", "", rate_text(of.often) + (" leave" if of.often.value is not None else "")))
        rows += [("", _names(to), share_text(to.share), rate_text(to.often)) for to in of.to]
    days = f"{period.first} to {period.last}"
    lines = [f"Flow, {days}, {found.recorded_share:.0%} of the opening hours recorded", "", *table(rows), ""]
    for of in found.areas:
        lines += [f"{of.area.name}: {line}" for line in _notes(of)]
    if found.silent_cameras:
        lines.append(f"Nothing was recorded by {', '.join(found.silent_cameras)}: flow there is not known")
    return "\n".join([*lines, *link_lines(found.links), "", *_routes(found)])


def _names(to: Destination) -> str:
    return to.areas[0].name if len(to.areas) == 1 else "other areas"


def _notes(of: AreaFlow) -> list[str]:
    n, check = of.following, of.inflow
    lines = []
    if n.not_followed.value is not None:
        lines.append(f"{n.not_followed.value:.0%} of those who leave were lost before they came to an area")
    if n.reason is not None:
        lines.append(reason_text(n.reason))
    if check.agrees is False and check.value is not None:
        way = (
            "people come in where no area is, or are lost on the way here"
            if check.value > 1
            else "people leave where no area is, or are lost on the way elsewhere"
        )
        lines.append(
            f"{check.value:.2f} times as many people come in as the flows bring: "
            f"shares that lead here are not certain. Likely {way}"
        )
    return lines


def _routes(found: Flow) -> list[str]:
    routes = found.routes
    if not routes.has_doors:
        return ["Routes: no area that asks for visits is a door (door = true)"]
    if routes.following.reason is not None and not any(r.share.value is not None for r in routes.routes):
        return [f"Routes: {reason_text(routes.following.reason)}"]
    rows = [("route from door to door", "share"), *((_way(r), share_text(r.share)) for r in routes.routes)]
    lost = routes.following.not_followed.value
    note = [] if lost is None else [f"{lost:.0%} of those who came in were lost before they left"]
    return [*table(rows), "", *note]


def _way(route: Route) -> str:
    return " > ".join(a.name for a in route.areas) or "other routes"
