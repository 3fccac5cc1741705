"""`vsd failed`: mail that services failed, with what they printed last."""

from __future__ import annotations

import os
import sys

import click

from vsd_analytics.cli.output import plain
from vsd_analytics.cli.project import Project, pass_project


@click.command()
@click.argument("services", metavar="SERVICE...", nargs=-1, required=True)
@pass_project
def failed(project: Project, services: tuple[str, ...]) -> int:
    """Mail that services failed, with what they printed last, read from standard input.

    The mail goes by [mail] of vsd.toml, to its failures_to, or else to its to. The unit vsd-failed@SITE runs this
    command when another unit of the site fails. Exit code 1: vsd.toml names nobody, and nothing was sent.

    \b
    Example:
      vsd failed vsd-report@shop < last-lines.txt
    """
    from vsd_analytics.report.send.failure_mail import failure_mail
    from vsd_analytics.report.send.mail_server import password_of, send

    site = project.site
    route = site.mail
    to = () if route is None else route.failures_to or route.to
    if route is None or not to:
        click.echo("nothing was sent: [mail] of vsd.toml names nobody (failures_to, to)", err=True)
        return 1
    printed = "" if sys.stdin.isatty() else sys.stdin.buffer.read().decode("utf-8", "replace")
    at = project.now.astimezone(site.zone)
    mail = failure_mail(site, services=services, printed=printed, sender=route.sender, to=to, at=at)
    sent = send(mail, route=route, to=to, password=password_of(route, environ=os.environ))
    project.say(f"sent to {', '.join(sent.accepted)}")
    for address, why in sent.refused.items():
        click.echo(plain(f"not sent to {address}: the mail server says {why}"), err=True)
    return 2 if sent.refused else 0
