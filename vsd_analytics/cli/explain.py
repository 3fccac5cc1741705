"""`vsd explain`: message codes at length."""

from __future__ import annotations

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json


@click.command()
@click.argument("code", required=False)
@json_option
def explain(code: str | None, as_json: bool) -> None:
    """Explain a message code at length; without one, list them all.

    \b
    Example:
      vsd explain E201
    """
    from vsd_analytics.cli.explanations import EXPLANATIONS, explanation

    if code is None:
        if as_json:
            emit_json({"codes": EXPLANATIONS})
        else:
            for each, text in sorted(EXPLANATIONS.items()):
                click.echo(f"{each}  {text.splitlines()[0]}")
        return
    text = explanation(code)
    if as_json:
        emit_json({"code": code.upper(), "explanation": text})
    else:
        click.echo(f"{code.upper()}: {text}")
