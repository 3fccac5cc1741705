"""`vsd explain CODE`: what each message means, what usually causes it, how to fix it."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json
from vsd_analytics.errors import UsageError


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
    from vsd_analytics.config.reader import nearest

    known = explanations().get(code.strip().upper())
    if known is not None:
        return known
    close = nearest(code, [each.lower() for each in explanations()])
    fix = f"vsd explain {close.upper()}" if close else "vsd explain   (lists all codes)"
    raise UsageError(f"no message has the code {code!r}", fix=fix)


@click.command()
@click.argument("code", required=False)
@json_option
def explain(code: str | None, as_json: bool) -> None:
    """Explain a message code at length; without one, list them all.

    \b
    Example:
      vsd explain E201
    """
    if code is None:
        if as_json:
            emit_json({"codes": dict(explanations())})
        else:
            for each, text in sorted(explanations().items()):
                click.echo(f"{each}  {text.splitlines()[0]}")
        return
    text = explanation(code)
    if as_json:
        emit_json({"code": code.upper(), "explanation": text})
    else:
        click.echo(f"{code.upper()}: {text}")
