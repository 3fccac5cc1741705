"""`vsd listen`: live MQTT into the store."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import LiveError, VsdError, Where

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from datetime import datetime

    from vsd_analytics.live.posts import PostInbox
    from vsd_analytics.site.model import Broker


F = TypeVar("F", bound="Callable[..., Any]")


def rhythm_options(command: F) -> F:
    """Add the options of a command that stores messages around the clock: how often it folds and tells its state."""
    for option in (
        click.option(
            "--status-every",
            "status_every_s",
            type=click.FloatRange(min=0.1),
            default=5,
            show_default=True,
            metavar="SECONDS",
            help="Time between two heartbeats.",
        ),
        click.option(
            "--fold-every",
            "fold_every_s",
            type=click.FloatRange(min=1),
            default=3600,
            show_default=True,
            metavar="SECONDS",
            help="Fold the spool a minute after each multiple of this; sooner when it grows.",
        ),
    ):
        command = option(command)
    return command


@click.command()
@click.option("--once", is_flag=True, help="Take what the broker has queued, store it, fold, and stop.")
@click.option(
    "--connect-timeout",
    "connect_timeout_s",
    type=click.FloatRange(min=0.1),
    metavar="SECONDS",
    help="Give up when the broker cannot be reached within this time at the start (default: never).",
)
@rhythm_options
@click.option(
    "--http",
    "http",
    is_flag=False,
    flag_value="127.0.0.1:8765",
    metavar="[HOST:PORT]",
    help="Take messages by HTTP as well, or without [mqtt] only so  [alone: 127.0.0.1:8765]",
)
@click.option("--broker-config", is_flag=True, help="Print the recommended mosquitto.conf and stop.")
@json_option
@pass_project
def listen(
    project: Project,
    once: bool,
    connect_timeout_s: float | None,
    fold_every_s: float,
    status_every_s: float,
    http: str | None,
    broker_config: bool,
    as_json: bool,
) -> int:
    """Store messages from the MQTT broker of [mqtt], and by HTTP, around the clock.

    A message is acknowledged to the broker, or answered with 202, only after its records are on disk. Messages are VSD
    frame messages, or any JSON that a [[source]] maps. SIGTERM and Ctrl-C store and
    acknowledge what was received, and end with exit code 0. status/listen.json and vsd doctor show its state.

    \b
    Example:
      vsd listen
      vsd listen --once --connect-timeout 10
      vsd listen --http
      vsd listen --broker-config > /etc/mosquitto/conf.d/vsd.conf
    """
    import os
    import zlib
    from functools import partial

    from vsd_analytics.cli.alarms import live_alarms
    from vsd_analytics.cli.exit_codes import stop_signals
    from vsd_analytics.live.listener import Listener
    from vsd_analytics.live.mqtt import password_of, recommended_config
    from vsd_analytics.live.single_instance import single_listener

    if broker_config:
        click.echo(recommended_config(_own_port(project)), nl=False)
        return 0
    broker = _broker(project, is_needed=http is None or once)
    with (
        single_listener(project.root),
        stop_signals(is_second_final=True) as stopped,
        live_alarms(project, clock=machine_clock(project)) as alarms,
    ):
        posts = None if http is None else _posts(project, http, environ=os.environ)
        listener = Listener(
            project.site,
            broker=broker,
            password=None if broker is None else password_of(broker, environ=os.environ),
            door=posts,
            clock=machine_clock(project),
            observers=[] if alarms is None else [alarms],
            fold_every_s=fold_every_s,
            status_every_s=status_every_s,
            seed=zlib.crc32(b"http" if broker is None else broker.client_id.encode()),
            report=project.say,
        )
        if posts is not None:
            listener.status.http = posts.as_dict
        if alarms is not None and listener.link is not None:
            alarms.delivery.publish = partial(listener.link.publish, qos=1)
        if alarms is not None:
            listener.status.alarms = alarms.as_dict
        status = listener.run(should_stop=stopped.is_set, is_once=once, connect_timeout_s=connect_timeout_s)
    if as_json:
        emit_json(status.as_dict(now=machine_clock(project)()))
    else:
        bad = sum(status.n_rejected.values())
        rows = sum(status.n_stored.values())
        summary = f"{status.n_acknowledged:,} messages acknowledged, {rows:,} records stored, {bad:,} in quarantine"
        project.say(summary)
    return 0


def _posts(project: Project, address: str, *, environ: Mapping[str, str]) -> PostInbox:
    """Return the HTTP server, which takes requests from now on."""
    from vsd_analytics.live.mapped import mapped_readers
    from vsd_analytics.live.posts import TOKEN_FILE, TOKEN_VARIABLE, PostInbox, token_of

    token = token_of(project.root, environ=environ)
    sources = [reader.rule_id for reader in mapped_readers(project.site)]
    posts = PostInbox(address, token=token, sources=sources, body_max_bytes=int(project.site.settings.line_max_bytes))
    where = f"${TOKEN_VARIABLE}" if TOKEN_VARIABLE in environ else str(project.root / TOKEN_FILE)
    paths = ", ".join(f"/{path}" for path in posts.paths)
    project.say(f"listening at http://{posts.address} to POST {paths}; the token is in {where}")
    if not posts.is_loopback:
        project.say("other machines can reach it, and nothing is encrypted: put a proxy with TLS before it")
    return posts


def _broker(project: Project, *, is_needed: bool) -> Broker | None:
    if project.site.broker is None and is_needed:
        raise LiveError(
            "vsd.toml names no broker",
            code="E703",
            where=Where(str(project.root / "vsd.toml")),
            fix='add [mqtt] with host = "localhost", or take messages by HTTP: vsd listen --http',
        )
    return project.site.broker


def _own_port(project: Project) -> int:
    """Return the port that vsd.toml names for a broker without TLS, else the usual one; there may be no project."""
    from vsd_analytics.live.mqtt import PORT

    try:
        broker = project.site.broker
    except VsdError:
        return PORT
    return PORT if broker is None or broker.is_tls else broker.port


def machine_clock(project: Project) -> Callable[[], datetime]:
    """Return a clock that starts at `--now`, or is the machine's."""
    import time
    from datetime import UTC, datetime, timedelta

    if project.now_text is None:
        return lambda: datetime.now(tz=UTC)
    start, began_s = project.now, time.monotonic()
    return lambda: start + timedelta(seconds=time.monotonic() - began_s)
