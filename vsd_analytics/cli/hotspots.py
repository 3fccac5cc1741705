"""`vsd hotspots`: where people spend more time too close than the crowd explains."""

from __future__ import annotations

import json
from typing import Any, Final

import click

from vsd_analytics.cli.answers import answers_json, answers_text
from vsd_analytics.cli.options import choice_option, floor_option, json_option, range_options
from vsd_analytics.cli.output import emit_json
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import purged_hours_notes, resolve, warehouse_of, warn
from vsd_analytics.render.text import Layout, TableLayout
from vsd_analytics.site.places import known_floor
from vsd_analytics.wording.reasons import reason_text

_PLACE: Final = ("name", "nearest_name", "nearest_m")
LAYOUTS: Final[dict[str, Layout]] = {
    "hotspots": (
        TableLayout(("rank", *_PLACE, "excess_ratio", "excess_min_per_week", "change", "since", "is_since_first")),
    ),
    "past_hotspots": (
        TableLayout((*_PLACE, "change", "changed_on", "excess_ratio_before", "excess_ratio", "n_violations")),
    ),
    "hotspot_window": (TableLayout(("n_days", "n_violations", "exposure_h", "compared_with")),),
}


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
    is watched until enough days have passed. The counts are exact, for the operator: the table to share is
    hotspots.csv of vsd report.

    \b
    Example:
      vsd hotspots --week last
      vsd hotspots --week last --format geojson --out hotspots.geojson
    """
    from vsd_analytics.answer import Answers
    from vsd_analytics.figures import hotspot_answers as as_answers
    from vsd_analytics.figures import hotspots as analysis
    from vsd_analytics.render.frame import csv_text
    from vsd_analytics.render.geojson import geojson
    from vsd_analytics.render.significant import rounded

    floor = known_floor(project.site, floor_id)
    _, until = resolve(project, week=week, days=days)
    first, _ = analysis.days_needed(project.site, until)
    with warehouse_of(project, week=None, days=f"{first}..{until}") as warehouse:
        warehouse.materialise("violations")
        floor_hotspots = analysis.hotspots(warehouse, floor_id=floor.floor_id, until=until)
        rules, inputs = purged_hours_notes(warehouse), warehouse.inputs_digest
    holds = as_answers.window_holds(project.site, floor_hotspots, inputs=inputs)
    answers = Answers(as_answers.hotspot_answers(floor_hotspots, holds))
    kind = "json" if as_json else kind
    if kind == "json":
        drawn: dict[str, Any] = {"outlines": as_answers.outlines(floor_hotspots)}
        if with_cells:
            drawn["cells"] = as_answers.cell_tests(floor_hotspots)
        printed = answers_json(
            answers, days=(floor_hotspots.first, floor_hotspots.last), notes=rules, beside=rounded(drawn)
        )
        if out is None:
            emit_json(printed)
            return
        text = _json(printed)
    else:
        warn(rules)
        if kind == "geojson":
            lists = [answers["hotspots"], answers["past_hotspots"]]
            text = _json(geojson(lists, as_answers.outlines(floor_hotspots), key="spot_id"))
        else:
            text = csv_text(answers["hotspots"]) if kind == "csv" else answers_text(answers, LAYOUTS) + "\n"
    if kind in ("geojson", "csv") and floor_hotspots.reason is not None:
        project.say(f"no hotspots: {reason_text(floor_hotspots.reason)}")
    if out is None:
        click.echo(text, nl=False)
        return
    from pathlib import Path

    Path(out).write_text(text, encoding="utf-8")
    project.say(f"wrote {out}")


def _json(value: dict[str, Any]) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, indent=1, default=str) + "\n"
