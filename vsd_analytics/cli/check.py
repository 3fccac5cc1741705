"""`vsd check`: validate engine files and change nothing."""

from __future__ import annotations

import shlex
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.file_options import file_options, ingest_options
from vsd_analytics.cli.ingest import read_files
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.config.drawing import is_drawing
from vsd_analytics.errors import InputError, UsageError

if TYPE_CHECKING:
    from vsd_analytics.config.camera_in_name import CameraName


_GO_ON = (
    "there is no vsd.toml here, so nothing was compared with a plan, opening hours or stored records; times without an "
    "offset were taken as UTC. To go on: vsd init"
)


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@file_options
@click.option(
    "--save", metavar="NAME", help="Write the options and the format of one file into vsd.toml, as a profile."
)
@click.option(
    "--picture", metavar="FILE.svg", help="Draw the positions of one file on the plan, or on the camera's picture."
)
@json_option
@pass_project
def check(
    project: Project, /, files: tuple[str, ...], save: str | None, picture: str | None, as_json: bool, **given: Any
) -> int:
    """Validate files and change nothing: format, columns, times, cameras, numbers.

    In a project it also says whether a file is stored already, in whatever spelling. Without a project it says what can
    be said of the file alone.

    With --picture, the first positions of a file are drawn as they are understood: look at it once per kind of file. No
    number tells that an axis points the other way, or that positions are of heads.

    An architect's drawing (DXF) becomes a floor plan: --picture writes it as SVG, and the lines for vsd.toml are
    printed. --where "layer = 'A-WALL'" chooses layers, --unit says the unit where the drawing does not. Needs the extra
    dxf.

    With --save, a file that can be read gets a profile: a [[source]] of vsd.toml, appended at its end. From then on
    check and ingest read files of such a name in the same way. Options of the command win over a profile.

    \b
    Example:
      vsd check export/*.csv
      vsd check till-2026-11-09.csv --map ts=time --unit mm --save tills
      vsd check till-2026-11-09.csv --picture where.svg
      vsd check architect.dxf --where "layer = 'A-WALL'" --picture plans/ground.svg
    """
    if any(is_drawing(Path(file)) for file in files):
        from vsd_analytics.cli.drawing import check_drawing

        if len(files) != 1 or save is not None:
            raise UsageError("a drawing is checked alone", fix=f"vsd check {shlex.quote(files[0])} --picture plan.svg")
        return check_drawing(Path(files[0]), picture, given, as_json=as_json)
    with _site_of(project, files, given, needs_project=save is not None) as has_project:
        if picture is not None:
            _draw(project, files, picture, given)
        if save is None:
            code = read_files(project, files, given, is_dry_run=True, as_json=as_json)
    if save is None:
        if not has_project:
            project.say(_GO_ON)
        return code
    from vsd_analytics.config.new_source import refuse_name

    if len(files) != 1 or files[0] == "-":
        raise UsageError(
            "--save takes one file, by whose name the profile is chosen", fix=f"--save {save} with one FILE"
        )
    refuse_name(project.site, save)
    named = _camera_in_name(project, files[0], given)
    given = given if named is None else {**given, "camera": named.camera}
    formats: list[str] = []
    code = read_files(project, files, given, is_dry_run=True, as_json=as_json, read_as=formats)
    if not formats:
        project.say("no profile was saved: first correct what is said above")
        return code
    _save(project, save, Path(files[0]).name, formats[0], given, named)
    return code


@contextmanager
def _site_of(project: Project, files: tuple[str, ...], given: dict[str, Any], *, needs_project: bool) -> Iterator[bool]:
    """Yield whether there is a project; where there is none, the site is one made of the files' own cameras.

    Raises:
        UsageError: E102, there is none, and it is needed or a folder was named with -C.
    """
    from vsd_analytics.config.project import find_project

    try:
        find_project(Path(project.folder))
    except UsageError as error:
        if needs_project or error.code != "E102" or not Path(project.folder).is_dir():
            raise
    else:
        yield True
        return
    from vsd_analytics.ingest.intake.site_of_files import site_of_files
    from vsd_analytics.ingest.reading.adapter import IngestOptions

    with tempfile.TemporaryDirectory(prefix="vsd-check-") as folder:
        # options are read with the site's clock, and the site's cameras with the options
        project.site = site_of_files([], IngestOptions(), root=Path(folder))
        paths = [Path(file) for file in files if file != "-"]
        project.site = site_of_files(paths, ingest_options(project, given), root=Path(folder))
        yield False


def _draw(project: Project, files: tuple[str, ...], picture: str, given: dict[str, Any]) -> None:
    """Draw the first positions of one file."""
    from vsd_analytics.ingest.intake.site_of_files import first_positions
    from vsd_analytics.ingest.reading.adapter import Source
    from vsd_analytics.report.draw.positions_file import draw_positions
    from vsd_analytics.store.durable import publish

    if len(files) != 1 or files[0] == "-":
        raise UsageError("--picture takes one file", fix=f"--picture {picture} with one FILE")
    if Path(picture).suffix.lower() != ".svg":
        raise UsageError(f"--picture {picture!r} does not end in .svg", fix="--picture where.svg: any browser shows it")
    source = Source(Path(files[0]), settings=project.site.settings)
    try:
        sample = first_positions(project.site, source, ingest_options(project, given))
    except (InputError, OSError):  # reading the file reports it
        return
    publish(Path(picture), draw_positions(project.site, sample, file_name=source.file_name).encode())
    project.say(f"wrote {picture}")


def _camera_in_name(project: Project, file: str, given: dict[str, Any]) -> CameraName | None:
    """Return the camera that a file's name says, where its records do not say it, and neither do options or profile."""
    from vsd_analytics.ingest.intake.pipeline import options_for
    from vsd_analytics.ingest.intake.rule_camera import name_to_save
    from vsd_analytics.ingest.reading.adapter import Source

    source = Source(Path(file), settings=project.site.settings)
    try:
        options = options_for(project.site, source, ingest_options(project, given))
    except InputError:  # reading the file reports it
        return None
    return name_to_save(project.site, source, options)


def _save(
    project: Project, name: str, file_name: str, kind: str, given: dict[str, Any], named: CameraName | None
) -> None:
    from vsd_analytics.config.new_source import save_source
    from vsd_analytics.config.reading_rules import NewReadingRule
    from vsd_analytics.site.model import ReadingRule

    options = ingest_options(project, given)
    names = [f.name for f in fields(ReadingRule) if hasattr(options, f.name)]
    stated = {name.removesuffix("_px"): getattr(options, name) for name in names}
    stated |= {"format": kind, "map": options.map or None}
    if named is not None:
        stated |= {"camera": None, "camera_from_name": named.pattern}
    profile = NewReadingRule(name, file_name, stated, () if named is None else named.files)
    written = save_source(project.site, profile)
    project.say(f"saved in vsd.toml:\n{written.rstrip()}")
    if named is not None:
        project.say(f"it is for files named {', '.join(named.files)}; the name says the camera: {named.pattern}")
        return
    wider = profile.wider_pattern
    also = "" if wider is None else f'; for others of its kind, widen it there: files = "{wider}"'
    project.say(f"it is for files named {profile.pattern}{also}")
