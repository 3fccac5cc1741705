"""`vsd init`: write the first vsd.toml."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.config.drawing import M_PER_PX, is_drawing, read_drawing
from vsd_analytics.errors import InputError, UsageError
from vsd_analytics.resources import DEFAULT_LANGUAGE, LANGUAGES
from vsd_analytics.wording.languages import wording


@click.command()
@click.option("--id", "site_id", help="Site id (default: made from the name).")
@click.option("--name", help="Name of the site, as the report prints it.")
@click.option("--timezone", help="IANA time zone, such as Europe/Rome.")
@click.option("--opening", help='Opening hours, "mon-sat 08:00-12:30 14:00-19:00, sun 10:00-18:00", or "always".')
@click.option("--camera", "cameras", multiple=True, metavar="ID[=NAME]", help="A camera; may be given several times.")
@click.option("--plan", metavar="FILE", help="Floor plan: SVG, PNG, JPG or DXF, relative to the project folder.")
@click.option("--plan-m-per-px", type=float, help="Metres per pixel of the plan.")
@click.option("--unit", help="What positions of the engine are in: m, mm, cm, ft or px (the picture).")
@click.option("--language", type=click.Choice(LANGUAGES), help="Language of the pages (default: en).")
@click.option("--distance", "distance_m", type=float, default=2.0, show_default=True, help="Legal distance in metres.")
@click.option("--no-input", is_flag=True, help="Ask nothing; use options and defaults.")
@json_option
@pass_project
def init(
    project: Project,
    site_id: str | None,
    name: str | None,
    timezone: str | None,
    opening: str | None,
    cameras: tuple[str, ...],
    plan: str | None,
    plan_m_per_px: float | None,
    unit: str | None,
    language: str | None,
    distance_m: float,
    no_input: bool,
    as_json: bool,
) -> None:
    """Write vsd.toml from the answers to six questions.

    An option answers its question in advance.

    \b
    Example:
      vsd init
      vsd -C shop init --no-input --name "Riverside Store" --timezone Europe/Rome --camera cam-1=Entrance
    """
    from vsd_analytics.config.first_config import (
        ALWAYS,
        FirstAnswers,
        check_opening,
        check_unit,
        check_zone,
        write_first_config,
    )

    def ask(question: str, given: str | None, default: str, *, check: Callable[[str], object] = str) -> str:
        if given is not None or no_input:
            return default if given is None else given

        def checked(answer: str) -> str:
            try:
                check(answer.strip())
            except UsageError as error:  # asked again
                raise click.UsageError(f"{error.why or error.what}; {error.fix}") from None
            return answer.strip()

        return str(click.prompt(question, default=default, value_proc=checked, err=True))

    folder = Path(project.folder)
    name = ask("1 Name of the site", name, folder.absolute().name or "Site")
    timezone = ask("2 Time zone", timezone, "UTC", check=check_zone)
    opening = ask(
        '3 Opening hours ("mon-sat 08:00-21:00, sun 10:00-18:00", or always)', opening, ALWAYS, check=check_opening
    )
    named = ask("4 Cameras (ids, with =NAME where you like, separated by commas)", ",".join(cameras) or None, "cam-1")
    plan = ask("5 Floor plan picture (empty: none yet)", plan, "") or None
    origin_m = (0.0, 0.0)
    if plan is not None and is_drawing(folder / plan):
        plan, plan_m_per_px, origin_m = _plan_of_drawing(folder, plan)
    if plan is not None and plan_m_per_px is None and not no_input:
        plan_m_per_px = click.prompt("  Metres per pixel of the plan", type=float, err=True)
    unit = ask("6 Positions of your engine are in (m, mm, cm, ft, or px: the picture)", unit, "m", check=check_unit)
    check_unit(unit)
    split = tuple(part.strip() for part in named.split(",") if part.strip())
    answers = FirstAnswers(
        name,
        timezone,
        site_id,
        opening,
        split,
        plan,
        plan_m_per_px,
        origin_m,
        distance_m,
        language,
        floor_name=wording(language or DEFAULT_LANGUAGE)["words"]["ground_floor"],
    )
    site = write_first_config(folder, answers=answers)
    if as_json:
        emit_json({"ok": True, "file": str(folder / "vsd.toml"), "site": site.site_id})
        return
    click.echo(str(folder / "vsd.toml"))
    known = "" if unit in ("m", "px") else f" --unit {unit}"
    steps = ["vsd calibrate CAMERA --draw     (from pixels to metres)"] if unit == "px" else []
    steps += [
        f"vsd check FILE{known} --save engine     (what it understands, and how such files are read from then on)"
    ]
    steps += ["vsd ingest FILES..."]
    if plan is None:
        steps += ["add the floor plan to vsd.toml (plan, plan_m_per_px): maps are drawn on it, and units checked by it"]
    project.say("Next: " + "\n      ".join(steps))


def _plan_of_drawing(folder: Path, plan: str) -> tuple[str, float, tuple[float, float]]:
    """Write the SVG of an architect's drawing beside it; return its path, scale and origin.

    Raises:
        InputError: The drawing cannot be read, or does not say its unit.
        UsageError: E101, the SVG is there already.
    """
    from vsd_analytics.cli.drawing import write_plan

    svg = Path(plan).with_suffix(".svg")
    if (folder / svg).exists():
        raise UsageError(f"{svg} is already there", fix=f"--plan {shlex.quote(str(svg))} with its --plan-m-per-px")
    try:
        drawing = read_drawing(folder / plan)
    except InputError as error:
        if error.fix is not None and error.fix.startswith("--unit"):  # here, --unit is that of positions
            unit = error.fix.split()[1]
            error.fix = f"vsd check {shlex.quote(plan)} --unit {unit} --picture {svg}; then name {svg} as the plan"
        raise
    write_plan(drawing, folder / svg)
    return str(svg), M_PER_PX, drawing.origin_m
