"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from vsd_analytics.site.model import LANGUAGES

CONTEXT_SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 100}


json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")

floor_option = click.option("--floor", "floor_id", metavar="FLOOR", help="Floor id, where there are several.")


def _speak(context: click.Context, parameter: click.Parameter, value: str | None) -> None:
    from vsd_analytics.report.words.languages import speaking

    context.with_resource(speaking(value))


language_option = click.option(
    "--language",
    type=click.Choice(LANGUAGES),
    expose_value=False,
    callback=_speak,
    help="Language of the page (default: language of [site], else en).",
)
"""The command writes in this language; see `Project.speak` for that of the site."""


F = TypeVar("F", bound=Callable[..., Any])


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
