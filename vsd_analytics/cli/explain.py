"""`vsd explain`: what each message means and how to fix it, and what the manual says about some words."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from vsd_analytics.wording.manual import Section

SECTIONS_SHOWN = 3
LINES_SHOWN = 12
"""Of each section, on a terminal; the JSON output has all of it."""


@cache
def explanations() -> Mapping[str, str]:
    """Return the texts of `explanations.toml` by code, in its order."""
    return tomllib.loads(Path(__file__).with_name("explanations.toml").read_text(encoding="utf-8"))


def explanation(code: str) -> str:
    """Return what a code means, its common causes, and how to fix them.

    Args:
        code: Such as "E201", in any case.

    Raises:
        UsageError: No message has this code (E101).
    """
    from vsd_analytics.errors import nearest

    known = explanations().get(code.strip().upper())
    if known is not None:
        return known
    close = nearest(code, [each.lower() for each in explanations()])
    fix = f"vsd explain {close.upper()}" if close else "vsd explain   (lists all codes)"
    raise UsageError(f"no message has the code {code!r}", fix=fix)


def _is_code(words: str) -> bool:
    return re.fullmatch(r"[eEwW]\d+", words.strip()) is not None


@click.command()
@click.argument("words", nargs=-1, metavar="[CODE|WORDS...]")
@json_option
def explain(words: tuple[str, ...], as_json: bool) -> None:
    """Explain a message code at length, or show what the manual says about some words; without either, list all codes.

    The manual comes with the program: nothing is fetched.

    \b
    Example:
      vsd explain E201
      vsd explain opening hours
    """
    asked = " ".join(words)
    if not words:
        if as_json:
            emit_json({"codes": dict(explanations())})
        else:
            for each, text in sorted(explanations().items()):
                click.echo(f"{each}  {text.splitlines()[0]}")
    elif _is_code(asked):
        text = explanation(asked)
        if as_json:
            emit_json({"code": asked.upper(), "explanation": text})
        else:
            click.echo(f"{asked.upper()}: {text}")
    else:
        from vsd_analytics.wording.manual import Manual

        sections = Manual(explanations()).search(asked, most=SECTIONS_SHOWN)
        if not sections:
            raise UsageError(f"the manual says nothing about {asked!r}", fix="vsd help   (all commands by job)")
        if as_json:
            emit_json({"words": asked, "sections": [section._asdict() for section in sections]})
        else:
            click.echo("\n\n".join(map(_shown, sections)))


def _shown(section: Section) -> str:
    """Return the first lines of a section below its place in the manual."""
    lines = section.text.splitlines()
    more = [f"  ... {len(lines) - LINES_SHOWN} more lines"] if len(lines) > LINES_SHOWN else []
    return "\n".join([f"{section.page}: {section.heading}", *(f"  {line}" for line in lines[:LINES_SHOWN]), *more])
