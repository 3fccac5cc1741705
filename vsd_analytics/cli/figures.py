"""`vsd coverage`, `vsd hours`, `vsd heatmap`: exact figures for the operator."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Literal

import click

from vsd_analytics.cli.ranges import range_options, warehouse_of
from vsd_analytics.cli.shared import Project, emit_json, json_option, pass_project, render_error
from vsd_analytics.errors import VsdError

if TYPE_CHECKING:
    from datetime import date

    import pandas as pd

    from vsd_analytics.warehouse.warehouse import Warehouse

_GAPS_SHOWN = 20
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
@click.option("--share", is_flag=True, help="Hold back small counts: for a table that leaves your hands.")
@json_option
@pass_project
def hours(
    project: Project,
    week: str | None,
    days: str | None,
    by: Literal["camera", "area"] | None,
    share: bool,
    as_json: bool,
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
        notes = _notes(warehouse)
    below = int(project.site.settings.mask_below)
    if share:
        from vsd_analytics.sharing import shared_hours

        frame = shared_hours(frame, below=below)
    if as_json:
        emit_json({"hours": _records(frame), **({"notes": notes} if notes else {})})
        return
    _warn(notes)
    if by != "area":
        frame = frame[(frame["recorded_s"] > 0) | (frame["open_s"] > 0)]
    columns = [c for c in _HOUR_COLUMNS if c in frame]
    click.echo(_text(frame[columns], held_back=frame["masked"] if share else None, below=below))


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
@click.option("--share", is_flag=True, help="Hold back small counts: for a table that leaves your hands.")
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
    share: bool,
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
    if kind in ("png", "svg") and share:
        raise UsageError("--share is for tables", mend="the map of vsd report holds small counts back")
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
        notes = _notes(warehouse)
    below = int(project.site.settings.mask_below)
    if share:
        from vsd_analytics.sharing import shared_cells

        frame = shared_cells(frame, below=below)
    if kind == "json" or as_json:
        emit_json({"cell_m": cell_m, "at": at, "cells": _records(frame), **({"notes": notes} if notes else {})})
        return
    _warn(notes)
    if share:
        table = frame.drop(columns="masked").astype({"records": object}).fillna({"records": f"<{below}"})
    else:
        table = frame[frame["records"] > 0].drop(columns="exposure_s")
    text = table.to_csv(index=False, lineterminator="\n")
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
        notes = _notes(warehouse)
    if as_json:
        emit_json({**found, **({"notes": notes} if notes else {})})
        return
    _warn(notes)
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
    if found["gaps"]:
        _say_gaps(found)
    for r in found["restarts"][:_GAPS_SHOWN]:
        click.echo(f"  {r['camera_id']:<14} {r['start']} to {r['end']}  the engine began a new count")


def _say_gaps(found: dict[str, Any]) -> None:
    n, gaps = found["n_missing"], found["gaps"]
    plural = "" if n == 1 else "s"
    click.echo(f"\n{n:,} message{plural} never arrived (or went to quarantine), by the engine's running number:")
    for g in gaps[:_GAPS_SHOWN]:
        numbers = f"{g['first_missing']}" + (f" to {g['last_missing']}" if g["n_missing"] > 1 else "")
        click.echo(f"  {g['camera_id']:<14} {g['start']} to {g['end']}  {g['n_missing']:,}: {numbers}")
    if len(gaps) > _GAPS_SHOWN:
        click.echo(f"  and {len(gaps) - _GAPS_SHOWN:,} more gaps: vsd coverage --json")


def _days(first: date, last: date) -> str:
    return f"{first}" if first == last else f"{first} to {last}"


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a frame; what is missing is None."""
    rows: list[dict[str, Any]] = json.loads(frame.to_json(orient="records", double_precision=15))
    return rows


def _notes(warehouse: Warehouse) -> list[str]:
    """Return what a reader must know about figures of purged hours."""
    return [run.told(warehouse.site) for run in warehouse.other_rules()]


def _warn(notes: list[str]) -> None:
    for note in notes:
        click.echo(render_error(VsdError(note, code="W310"), word="warning"), err=True)


def _text(frame: pd.DataFrame, *, held_back: pd.Series | None = None, below: int = 0) -> str:
    counts = frame.select_dtypes("Int64").columns
    shown = frame.astype(dict.fromkeys(counts, "float64"))
    if held_back is not None:
        for column in counts:
            known = [f"{v:,.0f}" for v in shown[column].fillna(0)]
            missing = [f"<{below}" if held else "–" for held in held_back]
            is_missing = frame[column].isna()
            shown[column] = [m if gone else k for k, m, gone in zip(known, missing, is_missing, strict=True)]
    return shown.to_string(index=False, na_rep="–", float_format=lambda v: f"{v:,.0f}")
