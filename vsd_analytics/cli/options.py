"""Options that several commands share."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from vsd_analytics.errors import UsageError
from vsd_analytics.owners import is_there
from vsd_analytics.resources import LANGUAGES

if TYPE_CHECKING:
    from vsd_analytics.site.model import Camera


CONTEXT_SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 100}


json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")

floor_option = click.option("--floor", "floor_id", metavar="FLOOR", help="Floor id, where there are several.")


def _speak(context: click.Context, parameter: click.Parameter, value: str | None) -> None:
    from vsd_analytics.wording.languages import speaking

    context.with_resource(speaking(value))


language_option = click.option(
    "--language",
    type=click.Choice(LANGUAGES),
    expose_value=False,
    callback=_speak,
    help="Language of the page (default: language of [site], else en).",
)
"""The command writes in this language; see `Project.speak` for that of the site."""


def _show_exact(context: click.Context, parameter: click.Parameter, value: bool) -> None:
    from vsd_analytics.cli.project import Project

    context.ensure_object(Project).is_exact |= value


exact_option = click.option(
    "--exact",
    is_flag=True,
    expose_value=False,
    callback=_show_exact,
    help="Exact figures of any days, small counts included: for the operator, not to share (docs/privacy.md).",
)
"""The command hides no small count; see `Project.is_exact`."""

F = TypeVar("F", bound=Callable[..., Any])


class FilePath(click.Path):
    """A path that the system lets us look at, and no address of a camera.

    A path that may not be read is E120, not one that is missing. An address may have a password in it, and errors show
    paths.
    """

    def __init__(self, *, must_exist: bool = False) -> None:
        super().__init__(path_type=Path, exists=must_exist, readable=False)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path; InputError (E204), without the password, for an address; PermissionError."""
        if "://" in str(value):
            from vsd_analytics.ingest.formats.recognise import refuse_streams

            refuse_streams([str(value)])
        if str(value) != "-":
            is_there(Path(value))
        return super().convert(value, param, ctx)


def path_option(*names: str, metavar: str = "FILE", **more: Any) -> Callable[[F], F]:
    """Return an option whose value is a path."""
    return click.option(*names, type=FilePath(), metavar=metavar, **more)


def choice_option(*names: str, choices: Sequence[str], default: str, help: str) -> Callable[[F], F]:
    """Return an option whose value is one of some words; its help names the default."""
    return click.option(*names, type=click.Choice(choices), default=default, show_default=True, help=help)


def range_options(command: F) -> F:
    """Add `--week` and `--range` to a command."""
    for option in (
        click.option(
            "--range", "days", metavar="DAYS", help="Local days: 2026-11-09..2026-11-15 (default: everything stored)."
        ),
        click.option("--week", metavar="WEEK", help="ISO week: 2026-W46, last, last-2."),
    ):
        command = option(command)
    return command


def parse_size(text: str) -> tuple[int, int]:
    """Return width and height in pixels of `1920x1080`.

    Raises:
        UsageError: E101.
    """
    match = re.fullmatch(r"(\d{2,5})[x×](\d{2,5})", text.strip().lower())
    if match is None or not (int(match[1]) and int(match[2])):
        raise UsageError(f"--size: {text!r} is not a picture size", fix="--size 1920x1080: width x height in pixels")
    return int(match[1]), int(match[2])


def known_size(camera: Camera, size_px: tuple[int, int] | None) -> tuple[int, int]:
    """Return the size of a camera's pictures; UsageError E101 where it is not known."""
    if size_px is None:
        raise UsageError(f"the picture size of {camera.camera_id} is not known", fix="--size 1920x1080")
    return size_px
