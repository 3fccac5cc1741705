"""`vsd heatmap`: violation records per floor cell, as a table or picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import click

from vsd_analytics.cli.options import choice_option, floor_option, json_option, range_options
from vsd_analytics.cli.output import emit_json, rows_of
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import noted, purged_hours_notes, warehouse_of, warn

if TYPE_CHECKING:
    from datetime import date


@click.command()
@range_options
@click.option(
    "--cell", "cell_m", type=float, default=1.0, show_default=True, help="Side of a cell in metres, a multiple of 0.25."
)
@choice_option(
    "--at",
    choices=["midpoint", "person"],
    default="midpoint",
    help="Count a record at the pair's midpoint, or where each person is.",
)
@floor_option
@choice_option("--format", "kind", choices=["csv", "json", "png", "svg"], default="csv", help="Table or picture.")
@click.option("--out", metavar="FILE", help="Write here (pictures need it); default: standard output.")
@json_option
@pass_project
def heatmap(
    project: Project,
    week: str | None,
    days: str | None,
    cell_m: float,
    at: Literal["midpoint", "person"],
    floor_id: str | None,
    kind: str,
    out: str | None,
    as_json: bool,
) -> None:
    """Print or draw violation records per floor cell.

    The counts are exact, for the operator: the maps to share are those of vsd report.

    Columns cx and cy are floor(x / cell) and floor(y / cell) in floor metres.

    \b
    Example:
      vsd heatmap --cell 1 --at midpoint --format csv
      vsd heatmap --week last --cell 0.5 --format png --out where.png
    """
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures import operator_counts

    operator_counts.check_cell_m(cell_m)
    if kind in ("png", "svg") and out is None:
        raise UsageError("a picture needs a file", fix=f"--out where.{kind}")
    with warehouse_of(project, week=week, days=days, heat_cell_m=cell_m, relations=("heatmap",)) as warehouse:
        frame = operator_counts.heatmap(warehouse, floor_id=floor_id, at=at)
        if kind in ("png", "svg"):
            from vsd_analytics.report.draw.heatmap_file import draw_heatmap

            draw_heatmap(
                frame,
                project.site,
                floor_id=floor_id,
                cell_m=cell_m,
                path=str(out),
                title=f"Violation records, {_days(warehouse.first, warehouse.last)}",
            )
            project.say(f"wrote {out}")
            return
        notes = purged_hours_notes(warehouse)
    if kind == "json" or as_json:
        emit_json(noted({"cell_m": cell_m, "at": at, "cells": rows_of(frame)}, notes))
        return
    warn(notes)
    table = frame[frame["records"] > 0].drop(columns="exposure_s")
    text = table.to_csv(index=False, lineterminator="\n")
    if out is None:
        click.echo(text, nl=False)
    else:
        from pathlib import Path

        Path(out).write_text(text, encoding="utf-8")
        project.say(f"wrote {out}")


def _days(first: date, last: date) -> str:
    return f"{first}" if first == last else f"{first} to {last}"
