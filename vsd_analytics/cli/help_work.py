"""Commands that help: `explain`, `schema`, `doctor`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from vsd_analytics.cli.shared import Project, emit_json, json_option, pass_project, plain

SCHEMAS = ("frame", "report", "tables")


@click.command()
@click.argument("code", required=False)
@json_option
def explain(code: str | None, as_json: bool) -> None:
    """Explain a message code at length; without one, list them all.

    \b
    Example:
      vsd explain E201
    """
    from vsd_analytics.explanations import EXPLANATIONS, explanation

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


@click.command()
@click.argument("what", type=click.Choice(SCHEMAS))
@json_option
def schema(what: str, as_json: bool) -> None:
    """Print a format as JSON: the frame message, the report's twin, the stored tables.

    \b
    Example:
      vsd schema frame > frame.schema.json
      vsd schema tables
    """
    emit = emit_json if as_json else _emit_indented
    emit(_schema(what))


def _schema(what: str) -> dict[str, Any]:
    if what == "frame":
        from vsd_analytics.ingest import frames

        return frames.json_schema()
    if what == "report":
        from vsd_analytics.report import twins

        return twins.json_schema()
    from vsd_analytics.schema import KEYS, SCHEMAS

    return {
        name: {
            "columns": [{"name": f.name, "type": str(f.type), "nullable": f.nullable} for f in table],
            "key": list(KEYS[name]),
        }
        for name, table in SCHEMAS.items()
    }


def _emit_indented(value: dict[str, Any]) -> None:
    import json

    click.echo(json.dumps(value, indent=2, ensure_ascii=False))


@click.command()
@click.option("--show-config", is_flag=True, help="Print each setting with its value and where it comes from.")
@click.option(
    "--broker-config",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Check this mosquitto.conf too (default: the usual one, when the broker of [mqtt] is on this machine).",
)
@json_option
@pass_project
def doctor(project: Project, show_config: bool, broker_config: Path | None, as_json: bool) -> int:
    """Look whether machine and project are fit for a weekly report; exit code 1 when something needs you.

    \b
    Example:
      vsd doctor
      vsd doctor --show-config
      vsd doctor --broker-config /etc/mosquitto/mosquitto.conf
    """
    import os

    from vsd_analytics import doctor as doctors

    start = Path(project.folder)
    findings = doctors.examine(start, now=project.now, environ=os.environ, broker_config=broker_config)
    settings = doctors.settings_in_force(_site_if_valid(start)) if show_config else ()
    needs_you = any(finding.state == "needs you" for finding in findings)
    if as_json:
        told: dict[str, Any] = {
            "ok": not needs_you,
            "findings": [
                {"subject": f.subject, "state": f.state, "detail": f.detail, "mend": f.mend} for f in findings
            ],
        }
        if show_config:
            told["settings"] = [
                {"name": s.name, "value": s.value, "unit": s.unit, "source": s.source} for s in settings
            ]
        emit_json(told)
        return int(needs_you)
    for finding in findings:
        click.echo(plain(f"{finding.state:9}  {finding.subject}: {finding.detail}"))
        if finding.mend:
            click.echo(plain(f"{'':9}   mend: {finding.mend}"))
    for setting in settings:
        click.echo(f"{setting.name} = {setting.value} {setting.unit}".rstrip() + f"   ({setting.source})")
    return int(needs_you)


def _site_if_valid(start: Path) -> Any:
    """Return the site, or None when there is none to read: `examine` has told why."""
    import os

    from vsd_analytics.config import find_project, load_site
    from vsd_analytics.errors import VsdError

    try:
        return load_site(find_project(start), environ=os.environ)
    except VsdError:
        return None
