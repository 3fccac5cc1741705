"""`vsd coverage`, `vsd hours`, `vsd heatmap`: exact figures for the operator."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Literal

import click

from vsd_analytics.cli.ranges import range_options, warehouse_of
from vsd_analytics.cli.shared import Project, emit_json, json_option, pass_project

if TYPE_CHECKING:
    from datetime import date

    import pandas as pd

_HOUR_COLUMNS = (
    "start",
    "camera_id",
    "area_id",
    "person_records",
    "violation_records",
    "n_violations",
    "recorded_s",
    "state",
)


@click.command()
@range_options
@click.option("--by", type=click.Choice(["camera", "area"]), help="One row per camera or area as well.")
@json_option
@pass_project
def hours(
    project: Project, week: str | None, days: str | None, by: Literal["camera", "area"] | None, as_json: bool
) -> None:
    """Print hourly counts: people, violations, recorded time, state of the hour.

    An hour without data has state no_data: nothing is known about it, which is not the same as nothing happened.

    \b
    Example:
      vsd hours --week last
      vsd hours --range 2026-11-09..2026-11-15 --by camera --json
    """
    from vsd_analytics.warehouse import figures

    with warehouse_of(project, week=week, days=days) as warehouse:
        frame = figures.hours(warehouse, by=by)
    if as_json:
        emit_json({"hours": _records(frame)})
        return
    if by != "area":
        frame = frame[(frame["recorded_s"] > 0) | (frame["open_s"] > 0)]
    columns = [c for c in _HOUR_COLUMNS if c in frame]
    click.echo(_text(frame[columns]))


@click.command()
@range_options
@click.option(
    "--cell", "cell_m", type=float, default=1.0, show_default=True, help="Side of a cell in metres, a multiple of 0.25."
)
@click.option(
    "--at",
    type=click.Choice(["midpoint", "person"]),
    default="midpoint",
    show_default=True,
    help="Count a record at the pair's midpoint, or where each person stands.",
)
@click.option("--floor", "floor_id", metavar="FLOOR", help="Floor id, where there are several.")
@click.option(
    "--format",
    "kind",
    type=click.Choice(["csv", "json", "png", "svg"]),
    default="csv",
    show_default=True,
    help="Table or picture.",
)
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

    Columns cx and cy are floor(x / cell) and floor(y / cell) in floor metres.

    \b
    Example:
      vsd heatmap --cell 1 --at midpoint --format csv
      vsd heatmap --week last --cell 0.5 --format png --out where.png
    """
    from vsd_analytics.errors import UsageError
    from vsd_analytics.warehouse import figures

    stored_m = project.site.settings.cell_m
    if cell_m <= 0 or cell_m > 1000 or abs(cell_m / stored_m - round(cell_m / stored_m)) > 1e-9:
        raise UsageError(f"--cell {cell_m:g} is not a multiple of {stored_m:g} m", mend="--cell 0.5")
    if kind in ("png", "svg") and out is None:
        raise UsageError("a picture needs a file to go to", mend=f"--out where.{kind}")
    with warehouse_of(project, week=week, days=days, heat_cell_m=cell_m) as warehouse:
        frame = figures.heatmap(warehouse, floor_id=floor_id, at=at)
        if kind in ("png", "svg"):
            from vsd_analytics.report.plots import draw_heatmap

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
    if kind == "json" or as_json:
        emit_json({"cell_m": cell_m, "at": at, "cells": _records(frame)})
        return
    text = frame[frame["records"] > 0].drop(columns="exposure_s").to_csv(index=False, lineterminator="\n")
    if out is None:
        click.echo(text, nl=False)
    else:
        from pathlib import Path

        Path(out).write_text(text, encoding="utf-8")
        project.say(f"wrote {out}")


@click.command()
@range_options
@json_option
@pass_project
def coverage(project: Project, week: str | None, days: str | None, as_json: bool) -> None:
    """Print how much of the opening hours each camera recorded, and what is missing.

    \b
    Example:
      vsd coverage --week last
    """
    from vsd_analytics.warehouse import figures

    with warehouse_of(project, week=week, days=days) as warehouse:
        found = figures.coverage(warehouse)
    if as_json:
        emit_json(found)
        return
    dates = [d["date"][5:] for c in found["cameras"][:1] for d in c["days"][-14:]]
    click.echo(f"{'camera':<16} {'recorded':<28} {' '.join(dates)}")
    for camera in found["cameras"]:
        strip = " ".join("    –" if d["share"] is None else f"{d['share']:5.0%}" for d in camera["days"][-14:])
        share = (
            "no opening hours"
            if camera["share"] is None
            else f"{camera['share']:.0%} of {round(camera['scheduled_h'], 1):g} open hours"
        )
        click.echo(f"{camera['camera_id']:<16} {share:<28} {strip}")
    if found["outages"]:
        click.echo("\nmissing (10 minutes or more of opening hours):")
    for o in found["outages"]:
        inferred = "  inferred: the engine sends no heartbeat" if o["is_inferred"] else ""
        click.echo(f"  {o['camera_id']:<14} {o['start']} to {o['end']}  {o['open_h']:.1f} open h{inferred}")


def _days(first: date, last: date) -> str:
    return f"{first}" if first == last else f"{first} to {last}"


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a frame; what is missing is None."""
    rows: list[dict[str, Any]] = json.loads(frame.to_json(orient="records", double_precision=15))
    return rows


def _text(frame: pd.DataFrame) -> str:
    counts = frame.select_dtypes("Int64").columns
    return frame.astype(dict.fromkeys(counts, "float64")).to_string(
        index=False, na_rep="–", float_format=lambda v: f"{v:,.0f}"
    )
