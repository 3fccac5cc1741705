"""`vsd check` of an architect's drawing: what it holds, and the floor plan that it makes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from vsd_analytics.cli.output import count, emit_json, plain
from vsd_analytics.config.drawing import M_PER_PX, FloorDrawing, read_drawing
from vsd_analytics.config.row_filter import FilterError, parse_filter
from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.reading.adapter import Source, unused_options

_USED = ("files", "unit", "where", "picture", "as_json")


def check_drawing(path: Path, picture: str | None, given: dict[str, Any], *, as_json: bool) -> int:
    """Print what a drawing holds, with the lines for vsd.toml; with `picture`, write the plan.

    Raises:
        UsageError: E101, an option that no drawing uses.
        InputError: See `read_drawing`.
    """
    context = click.get_current_context()
    is_said = {
        p.name: context.get_parameter_source(p.name or "") is ParameterSource.COMMANDLINE
        for p in context.command.params
    }
    unused = [p.opts[0] for p in context.command.params if is_said[p.name] and p.name not in _USED]
    if unused:
        raise unused_options(Source(path), unused, why="of a drawing, --unit and --where (layer, type) are read")
    if picture is not None and Path(picture).suffix.lower() != ".svg":
        raise UsageError(f"--picture {picture!r} does not end in .svg", fix="--picture plan.svg")
    try:
        where = () if given.get("where") is None else parse_filter(given["where"])
    except FilterError as error:
        raise UsageError(
            f"--where is not understood: {error}", fix="--where \"layer = 'A-WALL' and type != 'HATCH'\""
        ) from None
    drawing = read_drawing(path, unit=given.get("unit"), where=where)
    shown = picture or f"{path.stem}.svg"
    if picture is not None:
        write_plan(drawing, Path(picture))
    if as_json:
        emit_json(_as_dict(drawing, picture))
        return 0
    left, low, right, top = drawing.bounds_m
    n_lines = sum(map(len, drawing.lines.values()))
    click.echo(plain(f"{drawing.name}  [drawing]  {count(n_lines, 'line')}, {right - left:,.2f} x {top - low:,.2f} m"))
    click.echo(f"    unit      {drawing.unit} ({'$INSUNITS' if drawing.is_stated else '--unit'})")
    click.echo(f"    floor     x {left:,.2f} to {right:,.2f} m, y {low:,.2f} to {top:,.2f} m")
    for layer, lines in drawing.lines.items():
        click.echo(plain(f"    layer     {layer}: {count(len(lines), 'line')}"))
    for what, n in drawing.left_out.items():
        click.echo(plain(f"    left out: {n:,} {what}"))
    click.echo("for a [[floor]] of vsd.toml:\n" + plan_lines(drawing, shown))
    written = f"wrote {picture}" if picture is not None else f"nothing was written; the plan: --picture {shown}"
    click.echo(written, err=True)
    return 0


def write_plan(drawing: FloorDrawing, path: Path) -> None:
    """Write the SVG of a drawing."""
    from vsd_analytics.store.durable import publish

    path.parent.mkdir(parents=True, exist_ok=True)
    publish(path, drawing.svg().encode())


def plan_lines(drawing: FloorDrawing, file: str) -> str:
    """Return the lines of a `[[floor]]` that place the SVG of a drawing."""
    x, y = drawing.origin_m
    return f'plan = "{file}"\nplan_m_per_px = {M_PER_PX}\nplan_origin_m = [{x}, {y}]'


def _as_dict(drawing: FloorDrawing, picture: str | None) -> dict[str, Any]:
    return {
        "ok": True,
        "file": drawing.name,
        "unit": drawing.unit,
        "bounds_m": list(drawing.bounds_m),
        "layers": {layer: len(lines) for layer, lines in drawing.lines.items()},
        "left_out": dict(drawing.left_out),
        "plan": picture,
        "plan_m_per_px": M_PER_PX,
        "plan_origin_m": list(drawing.origin_m),
    }
