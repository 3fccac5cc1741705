"""A node hands on what it acknowledged, and lets go of a file only when the site has a receipt for it.

One round: make ready what came, let go of what has a receipt, write what is missing at the place, forget the days that
the site forgot. It can stop anywhere: what was written twice is counted once by the fold of the site.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from vsd_analytics.cluster.exchange import (
    ABOUT_NODE,
    NODES,
    RECEIPTS,
    Exchange,
    NodeNotice,
    SiteNotice,
    reaching,
    site_notice,
    unusable,
)
from vsd_analytics.errors import StoreError, VsdError, Where
from vsd_analytics.site.model import Site
from vsd_analytics.store import durable, outbox
from vsd_analytics.store.day_chain import read_chain
from vsd_analytics.store.part_files import damaged_segment
from vsd_analytics.store.secrets import ClosedDays, DayKeys
from vsd_analytics.store.store import Store
from vsd_analytics.version import VERSION


@dataclass(frozen=True, slots=True)
class HandedOn:
    """What a node did in one round.

    Attributes:
        n_written: Files written to the place.
        n_received: Files let go of, because the site has them.
        n_waiting: Files that the node still holds.
        n_forgotten: Site days whose keys were destroyed, as at the site.
    """

    n_written: int
    n_received: int
    n_waiting: int
    n_forgotten: int


def hand_on(site: Site, exchange: Exchange, *, now: datetime, stop: Callable[[], bool] = lambda: False) -> HandedOn:
    """Hand on what a node holds.

    Args:
        site: The project, with a node's name in `[exchange]`.
        exchange: The place.
        now: The clock, for the node's notice.
        stop: Called between files.

    Raises:
        StoreError: E319, the place cannot be used, or no site receives there; E320, it has another secret; E302, a
            file of the outbox is damaged.
        DiskError: E304 to E306, a disk refused.
    """
    assert site.exchange is not None
    assert site.node is not None
    root, node = site.acknowledged, site.node
    refused = _made_ready(site)
    with reaching(site.exchange.place):
        notice = site_notice(exchange, site)
        if notice is None:
            raise unusable(site.exchange.place, "no site receives there yet; at the site: vsd node receive")
        if site.settings.pseudonyms and not notice.mark:
            raise unusable(site.exchange.place, "the site has made no secret there yet; at the site: vsd node receive")
        _refuse_other_secret(site, notice)
        receipts = set(exchange.names(f"{RECEIPTS}/{node}/"))
        there = set(exchange.names(f"{NODES}/{node}/"))
        n_written = n_received = 0
        for path in outbox.ready(root):
            if stop():
                break
            name = f"{NODES}/{node}/{path.parent.name}/{path.name}"
            if f"{RECEIPTS}/{node}/{path.stem}" in receipts:
                durable.remove(path)
                n_received += 1
            elif name not in there:
                data = path.read_bytes()
                if durable.digest(data) != path.stem:
                    refused = refused or damaged_segment(path)
                    continue
                exchange.add(name, data)
                n_written += 1
        held = {path.stem for path in outbox.ready(root)}
        for name in sorted(there):
            if f"{RECEIPTS}/{node}/{(stem := Path(name).stem)}" in receipts and stem not in held:
                exchange.remove(name)  # a copy that came after the site had read the first one
        for name in sorted(receipts):
            if name.rpartition("/")[2] not in held:
                exchange.remove(name)
        n_forgotten = _forget(DayKeys(site.root / "secrets"), notice.closed())
        n_waiting = outbox.n_waiting(root)
        about = NodeNotice(node, now.astimezone(UTC), n_waiting, VERSION)
        exchange.replace(f"{NODES}/{node}/{ABOUT_NODE}", msgspec.json.encode(about))
    if refused is not None:
        raise refused
    return HandedOn(n_written, n_received, n_waiting, n_forgotten)


def _made_ready(site: Site) -> VsdError | None:
    """Make ready what came; return the error of a damaged file or a full disk.

    Neither may hold up the rest: letting go of what the site has is what makes room.
    """
    try:
        Store(site.acknowledged, site_id=site.site_id).fold()
    except StoreError as error:
        if error.code not in ("E302", "E304"):
            raise
        return error
    return None


def _refuse_other_secret(site: Site, notice: SiteNotice) -> None:
    chain = read_chain(site.root / "secrets")
    if not site.settings.pseudonyms or (chain is not None and chain.mark() == notice.mark):
        return
    raise StoreError(
        "the site has another secret than this node",
        code="E320",
        where=Where(str(site.root / "secrets")),
        why="a person that two nodes see would get two pseudonyms and count twice",
        fix="at the site: vsd node invite --out join.json; make this node in a new folder and vsd node join join.json",
    )


def _forget(keys: DayKeys, closed: ClosedDays) -> int:
    """Destroy the keys of days that the site closed; return how many keys that were."""
    days = [day for day in keys.days() if day in closed]
    if days or closed.days - keys.forgotten():
        keys.forget({*days, *closed.days})
    return len(days)
