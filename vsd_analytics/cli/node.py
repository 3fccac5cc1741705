"""`vsd node`: records from several machines into one store."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.ingest_output import warn_of_erased
from vsd_analytics.cli.options import FilePath, json_option, path_option
from vsd_analytics.cli.output import count, emit_json, plain
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError, Where

if TYPE_CHECKING:
    from collections.abc import Callable

    from vsd_analytics.cluster.receiving import Received
    from vsd_analytics.site.routes import ExchangeRoute

_SHOWN = 20
_every = click.option(
    "--every",
    "every_s",
    type=click.FloatRange(min=1),
    metavar="SECONDS",
    help="Go on until stopped, a round so many seconds after the last (default: one round).",
)


@click.group()
def node() -> None:
    """Bring the records of several machines into one store.

    A node takes records as any project does (vsd listen, vsd ingest) and hands them on to a place that the site's store
    receives from: a folder that both see, or a bucket. [exchange] in vsd.toml names the place and, on a node only, the
    node. A node lets go of records only when the site has a receipt there for them.

    \b
    Example:
      vsd node invite --out join.json    (at the site, once for each node)
      vsd node join join.json            (on the node, once)
      vsd node send --every 60           (on the node, beside vsd listen)
      vsd node receive --every 60        (at the site)
    """


@node.command()
@path_option("--out", metavar="FILE", required=True, help="File to write; only its owner can read it.")
@pass_project
def invite(project: Project, out: Path) -> None:
    """Write the file with which a node joins this site: the secret that gives the keys of all days.

    The first time this makes the secret. Carry the file to the node on a way that nobody else can read (scp, a stick),
    and delete it afterwards: who has it can link pseudonyms to the track ids of the engine.

    \b
    Example:
      vsd node invite --out join.json
    """
    from vsd_analytics.cluster.joining import invitation
    from vsd_analytics.store.durable import publish

    if project.site.node is not None:
        raise UsageError(f"this project is the node {project.site.node!r}", fix="run it at the site: vsd node invite")
    if out.exists():
        raise UsageError(f"{out} is there already", fix="--out with another name, or delete it")
    publish(out, invitation(project.site), is_private=True)
    project.say(f"{out} is secret: carry it to the node, vsd node join there, then delete it in both places")


@node.command(name="join")
@click.argument("file", type=FilePath())
@pass_project
def join_site(project: Project, file: Path) -> None:
    """Take over the secret of the site from the file of vsd node invite.

    \b
    Example:
      vsd node join join.json
    """
    from vsd_analytics.cluster.joining import join

    route, name = _route(project, is_node=True), project.site.node
    join(project.site, file.read_bytes(), file=str(file))
    project.say(f"node {name} of site {project.site.site_id} hands on to {route.place}; now delete {file}")


@node.command()
@_every
@json_option
@pass_project
def send(project: Project, every_s: float | None, as_json: bool) -> int:
    """Hand on what this node acknowledged, and let go of what the site has.

    \b
    Example:
      vsd node send
      vsd node send --every 60
    """
    from vsd_analytics.cluster.exchange import exchange_of
    from vsd_analytics.cluster.handing_on import hand_on
    from vsd_analytics.ingest.intake.pseudonyms import keys_of

    exchange = exchange_of(_route(project, is_node=True))
    keys_of(project.site)  # a node that has not joined must not begin

    def one_round(stop: Callable[[], bool]) -> dict[str, Any]:
        done = hand_on(project.site, exchange, now=project.clock(), stop=stop)
        return {
            "node": project.site.node,
            "written": done.n_written,
            "received": done.n_received,
            "waiting": done.n_waiting,
            "forgotten_days": done.n_forgotten,
        }

    status = _rounds(project, one_round, every_s=every_s)
    if as_json:
        emit_json(status)
    elif status:
        words = f"{count(status['written'], 'file')} handed on, {status['received']:,} received by the site"
        click.echo(f"{words}, {status['waiting']:,} waiting for a receipt")
    return 0


@node.command()
@_every
@json_option
@pass_project
def receive(project: Project, every_s: float | None, as_json: bool) -> int:
    """Receive what the nodes of this site handed on, and fold it.

    A file that this site cannot use now (a camera that vsd.toml does not describe, tables of another version) stays at
    the place and at its node until that is corrected.

    \b
    Example:
      vsd node receive
      vsd node receive --every 60
    """
    from vsd_analytics.cluster.exchange import exchange_of
    from vsd_analytics.cluster.receiving import receive as receive_all

    exchange = exchange_of(_route(project, is_node=False))

    def one_round(stop: Callable[[], bool]) -> dict[str, Any]:
        return _as_dict(receive_all(project.site, exchange, now=project.clock(), stop=stop))

    status = _rounds(project, one_round, every_s=every_s)
    if as_json:
        emit_json(status)
    elif status:
        _print_received(status)
    return int(bool(status.get("held") or status.get("quarantined") or status.get("is_ballast_spent")))


def _as_dict(done: Received) -> dict[str, Any]:
    from vsd_analytics.live.status import iso_utc
    from vsd_analytics.store.seals import SEALED

    quarantined = done.n_quarantined + Counter({SEALED: done.fold.n_sealed})
    return {
        "files": done.n_files,
        "records": dict(sorted(done.n_records.items())),
        "again": done.n_again,
        "damaged": len(done.damaged),
        "damaged_files": sorted(done.damaged)[:_SHOWN],
        "new": done.fold.n_new,
        "erased": done.n_erased + done.fold.n_erased,
        "quarantined": dict(quarantined),
        "held": dict(sorted(done.held.items())),
        "nodes": [
            {"node": n.node, "at": iso_utc(n.at), "waiting": n.n_waiting, "version": n.version} for n in done.nodes
        ],
        "is_ballast_spent": done.fold.is_ballast_spent,
    }


def _print_received(status: dict[str, Any]) -> None:
    for name, n in status["records"].items():
        click.echo(f"{name:<16} {count(n, 'record')}")
    for name, why in status["held"].items():
        click.echo(plain(f"held at the place: {name}: {why}"), err=True)
    if status["damaged"]:
        first = plain(status["damaged_files"][0])
        several = f" and {status['damaged'] - 1:,} more" if status["damaged"] > 1 else ""
        click.echo(f"{first}{several}: damaged on the way or not signed by a node of this site; removed", err=True)
    for reason, n in sorted(status["quarantined"].items()):
        click.echo(f"{count(n, 'record')} quarantined: {reason}", err=True)
    warn_of_erased(status["erased"])
    again = f", {status['again']:,} of them again" if status["again"] else ""
    click.echo(f"{count(status['files'], 'file')} received{again}, {count(status['new'], 'new record')} stored")


def _route(project: Project, *, is_node: bool) -> ExchangeRoute:
    """Return `[exchange]`, refusing a command of the other side."""
    route, where = project.site.exchange, Where(str(project.root / "vsd.toml"))
    if route is None:
        own = '\nnode = "north"' if is_node else ""
        fix = f'add [exchange] with place = "/mnt/exchange"{own.replace(chr(10), " and ")}'
        raise UsageError("vsd.toml has no [exchange]", where=where, fix=fix)
    if is_node and route.node is None:
        raise UsageError("this project is no node", where=where, fix='add node = "north" under [exchange]')
    if not is_node and route.node is not None:
        raise UsageError(f"this project is the node {route.node!r}, which hands on", where=where, fix="vsd node send")
    return route


def _rounds(
    project: Project, one_round: Callable[[Callable[[], bool]], dict[str, Any]], *, every_s: float | None
) -> dict[str, Any]:
    """Do one round, or rounds until SIGTERM or Ctrl-C; return what the last one found."""
    from vsd_analytics.cli.exit_codes import stop_signals
    from vsd_analytics.live.exchange_rounds import ONCE, keep_on, write_status

    if every_s is None:
        status = one_round(lambda: False)
        write_status(project.root, status, state=ONCE, error=None, now=project.clock())
        return status
    last: dict[str, Any] = {}

    with stop_signals() as stopped:

        def noted() -> dict[str, Any]:
            last.update(one_round(stopped.is_set))
            return dict(last)

        keep_on(
            project.root,
            noted,
            every_s=every_s,
            clock=project.clock,
            sleep=stopped.wait,
            stop=stopped.is_set,
            report=project.say,
        )
    return last
