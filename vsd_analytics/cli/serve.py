"""`vsd serve`: figures and pages over HTTP, and the desk where answers and changes are written."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import click

from vsd_analytics.cli.options import path_option
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import LiveError, UsageError


@click.command()
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), default=8377, show_default=True, help="Port to listen on.")
@click.option(
    "--per-minute",
    type=click.FloatRange(min=1),
    default=120,
    show_default=True,
    metavar="N",
    help="Requests a minute of one client.",
)
@click.option(
    "--desk", "has_desk", is_flag=True,
    help="Also serve the desk at /desk, where people with its own token answer the week's question and log changes.",
)  # fmt: skip
@path_option("--index", metavar="DIR", help="Folder of vsd site build, shown at the desk (default: reports/).")
@pass_project
def serve(project: Project, host: str, port: int, per_minute: float, has_desk: bool, index: Path | None) -> None:
    """Answer requests for figures and pages of the weekly reports over HTTP; only the desk can change anything.

    Every request needs the token of secrets/serve.token, which the first start makes, or of VSD_SERVE_TOKEN. The
    numbers are those of vsd report --format json, with small counts hidden. /openapi.json describes all addresses. /now
    is a live page for a wall or a phone. HTTP is not encrypted: for other machines, put a proxy with TLS before it.

    With --desk, people sign in at /desk with a second token, of secrets/desk.token or VSD_DESK_TOKEN, and their name.
    What they write goes into log.jsonl with that name, as by vsd log. The index of vsd site build, with all sites and
    weeks, is one of its pages.

    \b
    Example:
      vsd serve
      vsd serve --desk
      vsd serve --desk --index ../public
      curl -H "Authorization: Bearer $(cat secrets/serve.token)" http://127.0.0.1:8377/v1/site
    """
    from vsd_analytics.config.access_token import is_loopback
    from vsd_analytics.service.access import RateLimit, token_of
    from vsd_analytics.service.answers import ReportAnswers
    from vsd_analytics.service.app import make_app
    from vsd_analytics.service.desk import Desk
    from vsd_analytics.service.http_server import HttpServer
    from vsd_analytics.service.index_files import IndexFiles

    token, where = token_of(project.root, environ=os.environ)
    now = project.now if project.now_text is not None else None
    limit = RateLimit(per_min=per_minute, burst=max(10, int(per_minute // 4)))
    answers, desk, desk_token = ReportAnswers(project.root, now=now), None, ""
    if index is not None and not has_desk:
        raise UsageError("--index is for the desk", fix="add --desk, or leave out --index")
    if has_desk:
        files = IndexFiles(index if index is not None else project.root / "reports", project=project.root)
        if index is not None and not files.is_there:
            raise UsageError(
                f"{index} has no index of reports",
                why="its index.html is missing, or another program wrote it",
                fix=f"vsd site build PROJECT PROJECT --out {shlex.quote(str(index))}",
            )
        written, desk_token = token_of(project.root, environ=os.environ, is_desk=True)
        if written == token:
            raise UsageError(
                "the token of the desk is that of readers", why="who may read could write", fix="choose another one"
            )
        desk = Desk(answers, token=written, index=files, present=project.clock)
    app = make_app(answers, token=token, limit=limit, title=project.site.name, desk=desk)
    try:
        server = HttpServer(app, host=host, port=port)
    except OSError as error:
        raise LiveError(
            f"nothing can listen at {host}:{port}",
            code="E709",
            why=str(error.strerror or error),
            fix="name another --port, or stop the program that has it: ss -ltnp",
        ) from None
    if not is_loopback(host):
        project.say(
            f"warning: {host} is not this machine alone, and HTTP is not encrypted: put a proxy with TLS before it"
        )
    shown = f"[{host}]" if ":" in host else host
    project.say(f"http://{shown}:{server.port}   token: {where}   Ctrl-C ends it")
    if desk is not None:
        project.say(f"http://{shown}:{server.port}/desk   token of the desk: {desk_token}")
    server.run()
