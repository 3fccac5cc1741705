"""`vsd groups`: who is together, and the violations between groups."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import click

from vsd_analytics.cli.answers import print_answers
from vsd_analytics.cli.options import json_option, range_options
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import purged_hours_notes, warehouse_of
from vsd_analytics.render.text import Layout, TableLayout

if TYPE_CHECKING:
    from vsd_analytics.figures.group_list import Group

LAYOUTS: Final[dict[str, Layout]] = {
    "together": (
        TableLayout(("n_groups", "people_share", "within_time_share", "between_share", "n_violations", "n_unknown")),
    ),
    "groups_by_size": (TableLayout(("n_people", "n_groups")),),
    "readings": (TableLayout(("floor_id", "reading", "violation_rate", "encounter_rate", "n_violations")),),
    "track_lives": (
        TableLayout(("camera_id", "n_tracks", "life_median_s", "long_lived_share", "cut_share", "takes_part")),
    ),
}


@click.command()
@range_options
@click.option("--camera", "camera_id", metavar="CAMERA", help="Only this camera.")
@json_option
@pass_project
def groups(project: Project, week: str | None, days: str | None, camera_id: str | None, as_json: bool) -> int:
    """Print who is together, and every count in two readings: all violations, and those between groups.

    Two people walk together when they stay within reach of each other, for most of the time either is seen, while
    walking. They stand together while they stay close to each other and to those around them, in windows of two
    minutes. The first reading still includes violations within groups. Where the engine's track ids are too short to
    know, the command says so and exits with 1. The JSON names the tracks of each group.

    \b
    Example:
      vsd groups --week last
      vsd groups --range 2026-11-09..2026-11-15 --camera cam-1 --json
    """
    from vsd_analytics.answer import Answers
    from vsd_analytics.figures import groups as analysis
    from vsd_analytics.figures.group_answers import group_answers

    with warehouse_of(project, week=week, days=days) as warehouse:
        warehouse.materialise("violations", "camera_hours")
        site_groups = analysis.groups(warehouse, camera_id=camera_id)
        answers = Answers(group_answers(site_groups, project.site, inputs=warehouse.inputs_digest))
        notes = purged_hours_notes(warehouse)
    tracks = {"groups": [_group(g) for g in site_groups.groups]}
    dates = (site_groups.first, site_groups.last)
    print_answers(answers, days=dates, layouts=LAYOUTS, as_json=as_json, notes=notes, beside=tracks)
    return 0 if site_groups.state == "ok" else 1


def _group(group: Group) -> dict[str, Any]:
    """Return a group as JSON: the operator's only, as it names tracks."""
    return {
        "date": group.day.isoformat(),
        "camera_id": group.camera_id,
        "is_standing": group.is_standing,
        "tracks": list(group.tracks),
        "start": group.start.isoformat(timespec="milliseconds"),
        "end": group.end.isoformat(timespec="milliseconds"),
    }
