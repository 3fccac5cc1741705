"""What `vsd doctor` says of nodes: has this one joined and does it get rid of its records, is the site hearing them."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from vsd_analytics.doctor.finding import NEEDS_YOU, Finding
from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.intake.pseudonyms import keys_of
from vsd_analytics.live.exchange_rounds import STOPPED, read_exchange_status
from vsd_analytics.site.model import Site
from vsd_analytics.site.routes import ExchangeRoute
from vsd_analytics.store import outbox

SILENT_S = 3600.0
"""A side of the exchange that was not heard of for so long needs somebody."""
_SHOWN = 3


def examine_exchange(site: Site, *, now: datetime) -> Iterator[Finding]:
    """Yield the findings of a project with `[exchange]`; none of another one."""
    if site.exchange is None:
        return
    if not site.exchange.place.startswith("s3://") and not Path(site.exchange.place).is_dir():
        fix = "mount it or make it; records wait at their nodes meanwhile"
        yield Finding("exchange", NEEDS_YOU, f"there is no folder {site.exchange.place}", fix)
    status = read_exchange_status(site.root)
    if site.node is not None:
        yield from _node(site, status, now=now)
    else:
        yield from _site(site.exchange, status, now=now)


def _node(site: Site, status: dict[str, Any] | None, *, now: datetime) -> Iterator[Finding]:
    try:
        keys_of(site)
    except VsdError as error:
        yield Finding("node", NEEDS_YOU, error.what, error.fix)
    n = outbox.n_waiting(site.acknowledged)
    waiting = f"node {site.node}: {n:,} file{'' if n == 1 else 's'} without a receipt of the site"
    command = "vsd node send --every 60"
    if status is None:
        yield Finding("handing on", NEEDS_YOU if n else "note", f"{waiting}; nothing was handed on yet", command)
    elif status.get("error"):
        yield Finding("handing on", NEEDS_YOU, f"{waiting}; {status['error']}", "correct that; nothing is lost")
    elif n and _age_s(status.get("at"), now) > SILENT_S:
        yield Finding("handing on", NEEDS_YOU, f"{waiting}; the last round was at {status.get('at')}", command)
    else:
        yield Finding("handing on", "ok", f"{waiting}; the last round was at {status.get('at')}")


def _site(route: ExchangeRoute, status: dict[str, Any] | None, *, now: datetime) -> Iterator[Finding]:
    command = "vsd node receive --every 60"
    if status is None:
        yield Finding("receiving", NEEDS_YOU, f"nothing was received from {route.place} yet", command)
        return
    at, error = status.get("at"), status.get("error")
    if error:
        yield Finding("receiving", NEEDS_YOU, str(error), "correct that; records wait at their nodes meanwhile")
    elif _age_s(at, now) > SILENT_S:
        end = "was stopped" if status.get("state") == STOPPED else "was"
        yield Finding("receiving", NEEDS_YOU, f"the last round {end} at {at}", command)
    else:
        yield Finding("receiving", "ok", f"from {route.place}; the last round was at {at}")
    held = status.get("held") or {}
    for name, why in list(held.items())[:_SHOWN]:
        fix = "correct that: the file is received with the next round"
        yield Finding("receiving", NEEDS_YOU, f"{name} waits: {why}", fix)
    for node in status.get("nodes") or ():
        last_heard = f"last heard of at {node['at']}, {node['waiting']:,} files waiting then, version {node['version']}"
        if _age_s(node["at"], now) > SILENT_S:
            yield Finding(f"node {node['node']}", NEEDS_YOU, last_heard, "look at its link, and vsd doctor there")
        else:
            yield Finding(f"node {node['node']}", "ok", last_heard)


def _age_s(at: object, now: datetime) -> float:
    """Return the seconds since an ISO instant; infinite where it is none."""
    try:
        return (now - datetime.fromisoformat(str(at))).total_seconds()
    except ValueError:
        return float("inf")
