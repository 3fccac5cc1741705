"""`vsd hotspots`: where people spend more time too close than the crowd explains."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.estimates import why_none, with_limits
from vsd_analytics.cli.options import choice_option, floor_option, json_option, range_options
from vsd_analytics.cli.output import emit_json, plain, table
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import purged_hours_notes, resolve, warehouse_of, warn
from vsd_analytics.site.places import known_floor
from vsd_analytics.wording.reasons import encode_reason, reason_text

if TYPE_CHECKING:
    from vsd_analytics.figures.hotspots import FloorHotspots, FloorSpot, ResolvedSpot


@click.command()
@range_options
@floor_option
@choice_option(
    "--format",
    "kind",
    choices=["text", "json", "geojson", "csv"],
    default="text",
    help="GeoJSON has outlines in floor metres.",
)
@click.option("--out", metavar="FILE", help="Write here; default: standard output.")
@click.option("--cells", "with_cells", is_flag=True, help="JSON: add every tested cell.")
@json_option
@pass_project
def hotspots(
    project: Project,
    week: str | None,
    days: str | None,
    floor_id: str | None,
    kind: str,
    out: str | None,
    with_cells: bool,
    as_json: bool,
) -> None:
    """Print the places where people spend clearly more time too close than the crowd explains, and since when.

    Looks at the 28 days that end with the week or range (setting hotspot_days). A busy place is not a hotspot for being
    busy: the map of burden shows those. The test allows for chance and for differences between days and weeks. Places
    are ranked by the time above what crowding explains: what could be saved. Compared with the 28 days a week earlier,
    a hotspot is new or persisting; past hotspots are listed below. After a change of the log in or near a hotspot, it
    is watched until enough days have passed. The counts are exact, for the operator: the table to hand on is
    hotspots.csv of vsd report.

    \b
    Example:
      vsd hotspots --week last
      vsd hotspots --week last --format geojson --out hotspots.geojson
    """
    from vsd_analytics.figures import hotspot_export
    from vsd_analytics.figures import hotspots as analysis

    floor = known_floor(project.site, floor_id)
    _, until = resolve(project, week=week, days=days)
    first, _ = analysis.days_needed(project.site, until)
    with warehouse_of(project, week=None, days=f"{first}..{until}") as warehouse:
        warehouse.materialise("violations")
        found = analysis.hotspots(warehouse, floor_id=floor.floor_id, until=until)
        rules = purged_hours_notes(warehouse)
    kind = "json" if as_json else kind
    if kind == "json":
        printed = hotspot_export.as_dict(found, with_cells=with_cells)
        printed["notes"] += rules
        if out is None:
            emit_json(printed)
            return
        text = _json(printed)
    elif kind == "geojson":
        text = _json(hotspot_export.as_geojson(found))
    elif kind == "csv":
        text = _csv([hotspot_export.spot_row(s) for s in found.spots], hotspot_export.COLUMNS)
    else:
        text = plain(_text(found)) + "\n"
    if kind != "json":
        warn(rules)
    if kind in ("geojson", "csv") and found.reason is not None:
        project.say(f"no hotspots: {reason_text(found.reason)}")
    if out is None:
        click.echo(text, nl=False)
        return
    from pathlib import Path

    Path(out).write_text(text, encoding="utf-8")
    project.say(f"wrote {out}")


def _csv(rows: list[dict[str, Any]], columns: tuple[str, ...]) -> str:
    """Return CSV in which no text is a formula to a spreadsheet and no control character is left."""
    from vsd_analytics.store.spreadsheet import safe_cell

    made = io.StringIO()
    writer = csv.writer(made, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow(["" if v is None else safe_cell(plain(v)) if isinstance(v, str) else v for v in row.values()])
    return made.getvalue()


def _json(value: dict[str, Any]) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, indent=1, default=encode_reason) + "\n"


def _text(found: FloorHotspots) -> str:
    counted = "" if found.n is None else f", {found.n:,} violations in {found.exposure_h or 0:,.0f} person-hours"
    lines = [f"{found.floor_name}, {found.first} to {found.last}: {found.n_days} days recorded{counted}", ""]
    if found.state != "ok":
        lines.append(why_none(found.state, found.reason))
    elif not found.spots:
        lines.append("no place differs from the rest beyond chance")
    else:
        rows = [
            ("No", "place", "times what its crowd explains", "minutes above it a week", "since"),
            *map(_row, found.spots),
        ]
        lines += table(rows)
    if found.watching:
        lines += ["", "changed, and watched since:", *map(_watched, found.watching)]
    if found.resolved:
        lines += ["", f"standing out no more, against the days to {found.compared_with}:", *map(_gone, found.resolved)]
    return "\n".join([*lines, *(f"note: {reason_text(note)}" for note in found.notes)])


def _row(spot: FloorSpot) -> tuple[str, ...]:
    since = {"new": "new", None: "first look"}.get(
        spot.state, f"{spot.since}{' or earlier' if spot.is_since_first else ''}"
    )
    return (
        f"{spot.number:>2}",
        _place(spot),
        with_limits(spot.ratio, spot.lo, spot.hi, "{:.1f}".format),
        with_limits(spot.excess_min_per_week, spot.excess_min_lo, spot.excess_min_hi, "{:,.0f}".format),
        since,
    )


def _gone(spot: ResolvedSpot) -> str:
    between = "" if spot.lo is None or spot.hi is None else f" ({spot.lo:.1f} to {spot.hi:.1f})"
    now = "nobody was there" if spot.ratio is None else f"now {spot.ratio:.1f} times{between}"
    return f"  {_place(spot)}: was {spot.ratio_before:.1f} times what its crowd explains, {now}"


def _watched(spot: ResolvedSpot) -> str:
    return f"  {_place(spot)}: was {spot.ratio_before:.1f} times what its crowd explains; changed on {spot.changed_on}"


def _place(spot: FloorSpot | ResolvedSpot) -> str:
    place = spot.place
    if place.nearest_name is None or place.nearest_m is None:
        where = place.name
    elif place.nearest_m < 0.5:
        where = f"{place.name}, beside {place.nearest_name}"
    else:
        where = f"{place.name}, {place.nearest_m:.0f} m from {place.nearest_name}"
    return plain(where).replace("\n", " ")
