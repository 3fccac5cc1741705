"""Commands about the site itself: `init`, `calibrate`, `log`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.shared import Project, emit_json, instant, json_option, pass_project

if TYPE_CHECKING:
    from vsd_analytics.calibrate import Calibrated


@click.command()
@click.option("--id", "site_id", help="Site id (default: made from the name).")
@click.option("--name", help="Name of the site, as it stands on the report.")
@click.option("--timezone", help="IANA time zone, such as Europe/Rome.")
@click.option("--opening", help='Opening hours, "mon-sat 08:00-21:00, sun 10:00-18:00", or "always".')
@click.option("--camera", "cameras", multiple=True, metavar="ID[=NAME]", help="A camera; may be given several times.")
@click.option("--plan", metavar="FILE", help="Floor plan: SVG, PNG or JPG, relative to the project folder.")
@click.option("--plan-m-per-px", type=float, help="Metres per pixel of the plan.")
@click.option("--distance", "distance_m", type=float, default=2.0, show_default=True, help="Legal distance in metres.")
@click.option("--no-input", is_flag=True, help="Ask nothing; take flags and defaults.")
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
    distance_m: float,
    no_input: bool,
    as_json: bool,
) -> None:
    """Write vsd.toml, asking five questions.

    A flag answers its question beforehand.

    \b
    Example:
      vsd init
      vsd -C shop init --no-input --name "Riverside Store" --timezone Europe/Rome --camera cam-1=Entrance
    """
    from vsd_analytics.errors import UsageError
    from vsd_analytics.first_config import ALWAYS, Answers, check_opening, check_zone, write_first_config

    def ask(question: str, given: str | None, default: str, *, check: Callable[[str], object] = str) -> str:
        if given is not None or no_input:
            return default if given is None else given

        def checked(answer: str) -> str:
            try:
                check(answer.strip())
            except UsageError as error:  # asked again
                raise click.UsageError(f"{error.why or error.what}; {error.mend}") from None
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
    if plan is not None and plan_m_per_px is None and not no_input:
        plan_m_per_px = click.prompt("  Metres per pixel of the plan", type=float, err=True)
    split = tuple(part.strip() for part in named.split(",") if part.strip())
    answers = Answers(name, timezone, site_id, opening, split, plan, plan_m_per_px, distance_m)
    site = write_first_config(folder, answers=answers)
    if as_json:
        emit_json({"ok": True, "file": str(folder / "vsd.toml"), "site": site.site_id})
        return
    click.echo(str(folder / "vsd.toml"))
    project.say(
        "Next: vsd ingest FILES...   (engine output)\n      vsd calibrate CAMERA     (if the engine sends pixels)"
    )


@click.command()
@click.argument("camera")
@click.option(
    "--matrix", type=click.Path(path_type=Path), metavar="FILE", help="3x3 homography, picture px to floor m."
)
@click.option("--points", type=click.Path(path_type=Path), metavar="FILE", help="CSV of u,v,x,y: four spots or more.")
@click.option("--from", "valid_from", metavar="INSTANT", help="When the camera was put there (default: since ever).")
@json_option
@pass_project
def calibrate(
    project: Project, camera: str, matrix: Path | None, points: Path | None, valid_from: str | None, as_json: bool
) -> int:
    """Make a camera's map from picture to floor, and a picture to check it by.

    With neither --matrix nor --points, the calibration in force is looked at again.

    \b
    Example:
      vsd calibrate cam-1 --points points.csv
      vsd calibrate cam-1 --matrix cam-1.txt --from 2026-11-01T07:00
      vsd calibrate cam-1
    """
    from vsd_analytics import calibrate as calibration
    from vsd_analytics.errors import UsageError

    if matrix is not None and points is not None:
        raise UsageError("--matrix and --points are two ways to say the same", mend="keep one of them")
    since = None if valid_from is None else instant(valid_from, zone=project.site.timezone, what="--from")
    done = calibration.calibrate(project.site, camera_id=camera, matrix=matrix, points=points, valid_from=since)
    if as_json:
        emit_json(_calibrated(done))
    else:
        for line in _told(done):
            click.echo(line)
        for code, sentence in done.warnings:
            project.say(f"warning[{code}]: {sentence}")
    return 1 if {"W402", "W403"} & {code for code, _ in done.warnings} else 0


def _told(done: Calibrated) -> list[str]:
    lines = [f"{done.camera_id}: given matrix, nothing to measure its error by"]
    if done.error_m is not None and done.worst_m is not None:
        rms, worst = f"{done.error_m * 100:.1f} cm (root mean square)", f"{done.worst_m * 100:.1f} cm"
        lines = [f"{done.camera_id}: {done.n_points} points, error {rms}, worst {worst} at point {done.worst_point}"]
    return [
        *lines,
        f"{done.file}   calibration {done.calibration_id}",
        f"{done.overlay}   look: 1 m squares on the floor",
    ]


def _calibrated(done: Calibrated) -> dict[str, object]:
    return {
        "camera_id": done.camera_id,
        "file": str(done.file),
        "overlay": str(done.overlay),
        "calibration_id": done.calibration_id,
        "n_points": done.n_points,
        "error_m": done.error_m,
        "worst_m": done.worst_m,
        "worst_point": done.worst_point,
        "is_in_force": done.is_in_force,
        "warnings": [{"code": code, "message": sentence} for code, sentence in done.warnings],
    }


@click.group()
def log() -> None:
    """Keep the site's change log: what was moved, when, where.

    \b
    Example:
      vsd log add "moved the exhibit" --at 2026-11-11T12:00 --area entrance
      vsd log list
    """


@log.command("add")
@click.argument("text")
@click.option("--at", metavar="INSTANT", help="When, in the site's zone unless it has an offset (default: now).")
@click.option("--area", metavar="ID", help="Area it concerns (default: the whole site).")
@json_option
@pass_project
def log_add(project: Project, text: str, at: str | None, area: str | None, as_json: bool) -> None:
    """Add one entry.

    \b
    Example:
      vsd log add "moved the exhibit away from the entrance" --at 2026-11-11T12:00 --area entrance
    """
    from vsd_analytics.changelog import add_entry, entry_dict

    entry = add_entry(project.site, text=text, at=at if at is not None else project.now, area=area)
    if as_json:
        emit_json(entry_dict(entry))
    else:
        click.echo(f"{entry.at.isoformat(timespec='minutes')}  {entry.area_id or 'whole site'}  {entry.text}")


@log.command("list")
@json_option
@pass_project
def log_list(project: Project, as_json: bool) -> None:
    """List the entries by time, with their numbers for vsd compare --change.

    \b
    Example:
      vsd log list
      vsd log list --json
    """
    from vsd_analytics.changelog import entry_dict, read_log
    from vsd_analytics.cli.shared import plain

    entries = read_log(project.site)
    if as_json:
        emit_json({"log": [entry_dict(entry) for entry in entries]})
        return
    for number, entry in enumerate(entries, start=1):
        text, area = " ".join(plain(entry.text).split()), plain(entry.area_id or "whole site")
        click.echo(f"{number:>3}  {entry.at.isoformat(timespec='minutes')}  {area}  {text}")
    if not entries:
        project.say('no entries yet; add one: vsd log add "what was moved" --at 2026-11-11T12:00')
