"""A node hands on what it acknowledged, and lets go of a file only when the site has signed a receipt for it.

Receipts and forgotten days that the site did not sign are not obeyed: whoever writes to the place can say anything
there, and has not the secret of the site.

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
    SITE,
    Exchange,
    NodeNotice,
    SiteNotice,
    reaching,
    site_notice,
    unusable,
)
from vsd_analytics.cluster.signatures import HandedFile, Signer, is_same
from vsd_analytics.errors import StoreError, VsdError, Where
from vsd_analytics.schema import TABLES
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
        if not notice.mark:
            raise unusable(
                site.exchange.place, "the site has made no secret yet; there: vsd node invite --out join.json"
            )
        signer = _signer(site, notice)
        receipts = set(exchange.names(f"{RECEIPTS}/{node}/"))
        there = set(exchange.names(f"{NODES}/{node}/"))
        fronts = {name.rpartition("-")[0] + "-" for name in there}
        n_written = n_received = 0
        for path in outbox.ready(root):
            if stop():
                break
            file = HandedFile.of_outbox(path, node=node)
            if file.receipt not in receipts and file.front in fronts:
                continue
            data = path.read_bytes()
            if durable.digest(data) != path.stem:
                refused = refused or damaged_segment(path)
            elif file.receipt in receipts and _is_signed(exchange, file, signer.receipt(file, data)):
                durable.remove(path)
                n_received += 1
            elif file.front not in fronts:
                exchange.add(signer.name(file, data), data)
                n_written += 1
        held = {HandedFile.of_outbox(path, node=node) for path in outbox.ready(root)}
        fronts_held, receipts_held = {file.front for file in held}, {file.receipt for file in held}
        for name in sorted(there):
            if _is_left_over(name, fronts_held, receipts):
                exchange.remove(name)
        for name in sorted(receipts - receipts_held):
            exchange.remove(name)
        n_forgotten = _forget(DayKeys(site.root / "secrets"), notice.closed())
        n_waiting = outbox.n_waiting(root)
        about = NodeNotice(node, now.astimezone(UTC), n_waiting, VERSION)
        exchange.replace(f"{NODES}/{node}/{ABOUT_NODE}", msgspec.json.encode(signer.signed(about)))
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


def _signer(site: Site, notice: SiteNotice) -> Signer:
    """Return what tells the site's signatures, once the site's own notice has one."""
    chain = read_chain(site.root / "secrets")
    if chain is None or (notice.mark and chain.mark() != notice.mark):
        raise StoreError(
            "this node has not joined the site" if chain is None else "the site has another secret than this node",
            code="E320",
            where=Where(str(site.root / "secrets")),
            why="without the secret of the site, a receipt of anybody would look like one of the site"
            if chain is None
            else "a person that two nodes see would get two pseudonyms and count twice",
            fix="at the site: vsd node invite --out join.json; here: vsd node join join.json"
            if chain is None
            else "at the site: vsd node invite --out join.json; in a new folder here: vsd node join join.json",
        )
    signer = Signer(chain)
    if not signer.has_signed(notice):
        assert site.exchange is not None
        raise unusable(
            site.exchange.place,
            f"{SITE} there is not signed by the site, so its receipts and forgotten days are not obeyed; "
            "a site of version 1.1 signs nothing: upgrade it, then at the site: vsd node receive",
        )
    return signer


def _is_signed(exchange: Exchange, file: HandedFile, receipt: bytes) -> bool:
    return is_same(exchange.read(file.receipt, most=len(receipt)) or b"", receipt)


def _is_left_over(name: str, fronts_held: set[str], receipts: set[str]) -> bool:
    """Return whether a file at the place is of no use: a copy that came after the receipt, or one of version 1.1."""
    front, kind = name.rpartition("-")[0] + "-", Path(name).parent.name
    if kind not in (*TABLES, outbox.IMPORTS) or front in fronts_held:
        return False
    stem = Path(name).stem
    file = f"{RECEIPTS}/{name.split('/')[1]}/{stem.rpartition('-')[0]}"
    is_unsigned = "-" not in stem
    return file in receipts or (is_unsigned and any(f"/{stem}-" in held for held in fronts_held))


def _forget(keys: DayKeys, closed: ClosedDays) -> int:
    """Destroy the keys of days that the site closed; return how many keys that were."""
    days = [day for day in keys.days() if day in closed]
    if days or closed.days - keys.forgotten():
        keys.forget({*days, *closed.days})
    return len(days)
