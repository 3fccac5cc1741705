"""`vsd doctor`: check machine and project."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

from vsd_analytics.cli.options import json_option, path_option
from vsd_analytics.cli.output import emit_json, plain
from vsd_analytics.cli.project import Project, pass_project


@click.command()
@click.option("--show-config", is_flag=True, help="Print each setting with its value and where it comes from.")
@path_option(
    "--broker-config",
    help="Check this mosquitto.conf too (default: the usual one, when the broker of [mqtt] is on this machine).",
)
@json_option
@pass_project
def doctor(project: Project, show_config: bool, broker_config: Path | None, as_json: bool) -> int:
    """Check machine and project for a weekly report; exit code 1 when something needs you.

    \b
    Example:
      vsd doctor
      vsd doctor --show-config
      vsd doctor --broker-config /etc/mosquitto/mosquitto.conf
    """
    from vsd_analytics.doctor import checks as doctors
    from vsd_analytics.doctor.finding import NEEDS_YOU

    start = Path(project.folder)
    findings = doctors.examine(start, now=project.now, environ=os.environ, broker_config=broker_config)
    settings = doctors.settings_in_force(_site_if_valid(start)) if show_config else ()
    needs_you = any(finding.state == NEEDS_YOU for finding in findings)
    if as_json:
        printed: dict[str, Any] = {
            "ok": not needs_you,
            "findings": [
                {"subject": f.subject, "state": f.state, "detail": f.detail, "fix": f.fix, "mend": f.fix}
                for f in findings
            ],
        }
        if show_config:
            printed["settings"] = [
                {"name": s.name, "value": s.value, "unit": s.unit, "source": s.source} for s in settings
            ]
        emit_json(printed)
        return int(needs_you)
    for finding in findings:
        click.echo(plain(f"{finding.state:9}  {finding.subject}: {finding.detail}"))
        if finding.fix:
            click.echo(plain(f"{'':9}   fix: {finding.fix}"))
    for setting in settings:
        click.echo(f"{setting.name} = {setting.value} {setting.unit}".rstrip() + f"   ({setting.source})")
    return int(needs_you)


def _site_if_valid(start: Path) -> Any:
    """Return the site, or None when there is none to read: `examine` has reported why."""
    from vsd_analytics.config.project import find_project, load_site
    from vsd_analytics.errors import VsdError

    try:
        return load_site(find_project(start), environ=os.environ)
    except VsdError:
        return None
