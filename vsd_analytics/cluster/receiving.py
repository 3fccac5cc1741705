"""The store of a site receives what its nodes hand on.

Of each file: read it, compare it with its name, look into it, put it into the spool durably, write the receipt, remove
it from the place. A stop anywhere leaves the file or a receipt for it. What comes twice is counted once by the fold,
which also puts records of sealed hours into quarantine.

A file that this site cannot use now (a camera that vsd.toml does not describe, another version of the tables) stays at
the place without a receipt: it is received when that is corrected.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import PurePosixPath

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

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
)
from vsd_analytics.errors import StoreError
from vsd_analytics.ingest.intake.camera_lives import NOT_THERE, DescribedLives
from vsd_analytics.ingest.intake.pseudonyms import Pseudonyms
from vsd_analytics.ingest.intake.sealed_hours import FORGOTTEN
from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store import durable, late_records, quarantine
from vsd_analytics.store.day_chain import read_chain
from vsd_analytics.store.erasures import KnownErasures, are_erased
from vsd_analytics.store.imports import ImportLine, imports_of, next_run, note_import
from vsd_analytics.store.outbox import IMPORTS
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.part_files import engines_in
from vsd_analytics.store.secrets import DayKeys
from vsd_analytics.store.store import FoldResult, Store

FUTURE = "time-out-of-range"
_FILE = re.compile(
    rf"^{NODES}/(?P<node>[a-z0-9][a-z0-9_-]*)/(?P<kind>{'|'.join((*TABLES, IMPORTS))})"
    r"/(?P<digest>[0-9a-f]{16})\.(parquet|jsonl)$"
)
_ORDER = (*reversed(TABLES), IMPORTS)
"""A frame is received after the persons it counts."""


@dataclass
class Received:
    """What a site did in one round.

    Attributes:
        n_files: Files received.
        n_records: Records in them, by node.
        n_again: Files that were there again after their receipt.
        n_damaged: Files whose bytes did not match their name; the node writes them again.
        n_erased: Records left out because they were erased here on request.
        n_quarantined: Records put into quarantine, by reason; those of sealed hours are in `fold`.
        held: Files that this site cannot use now, each with the reason.
        nodes: What each node said last.
        fold: What the store gained.
    """

    n_files: int = 0
    n_records: Counter[str] = field(default_factory=Counter)
    n_again: int = 0
    n_damaged: int = 0
    n_erased: int = 0
    n_quarantined: Counter[str] = field(default_factory=Counter)
    held: dict[str, str] = field(default_factory=dict)
    nodes: list[NodeNotice] = field(default_factory=list)
    fold: FoldResult = field(default_factory=FoldResult)


def receive(site: Site, exchange: Exchange, *, now: datetime, stop: Callable[[], bool] = lambda: False) -> Received:
    """Receive what nodes handed on, and fold it.

    Args:
        site: The project, without a node's name in `[exchange]`.
        exchange: The place.
        now: The clock: later records are quarantined.
        stop: Called between files.

    Raises:
        StoreError: E319, the place cannot be used; E302, the store is damaged.
        DiskError: E304 to E306, the disk refused: what has no receipt is still at its node.
    """
    assert site.exchange is not None
    keys = DayKeys(site.root / "secrets")
    result = Received()
    with reaching(site.exchange.place):
        _say(site, exchange, keys)
        names = exchange.names(f"{NODES}/")
        paths = sorted(
            (m for name in names if (m := _FILE.match(name))), key=lambda m: (_ORDER.index(m["kind"]), m.string)
        )
        receipts = set(exchange.names(f"{RECEIPTS}/")) if paths else set()
        desk = _Desk(site, keys, now, result)
        for match in paths:
            if stop():
                break
            receipt = f"{RECEIPTS}/{match['node']}/{match['digest']}"
            if receipt in receipts:
                result.n_again += 1
            elif (data := exchange.read(match.string)) is None:
                continue
            elif durable.digest(data) != match["digest"]:
                result.n_damaged += 1  # without a receipt the node writes it again
            elif not desk.take(match, data):
                continue
            else:
                exchange.replace(receipt, b"received\n")
            exchange.remove(match.string)
        result.nodes = _notices(exchange, names)
    result.fold = desk.store.fold()
    return result


def _say(site: Site, exchange: Exchange, keys: DayKeys) -> None:
    """Bring what the site says at the place up to date."""
    closed, chain = keys.closed(), read_chain(keys.folder)
    mark = "" if chain is None else chain.mark()
    notice = SiteNotice(site.site_id, tuple(sorted(closed.days)), closed.before, tuple(sorted(closed.held)), mark)
    try:
        known = site_notice(exchange, site)
    except StoreError:
        data = exchange.read(SITE)
        if data is not None and _is_notice(data):
            raise  # of another site
        known = None
    if known != notice:
        exchange.replace(SITE, msgspec.json.encode(notice))


def _is_notice(data: bytes) -> bool:
    try:
        msgspec.json.decode(data, type=SiteNotice)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return False
    return True


def _notices(exchange: Exchange, names: list[str]) -> list[NodeNotice]:
    notices = []
    for name in names:
        if PurePosixPath(name).name == ABOUT_NODE and (data := exchange.read(name)) is not None:
            try:
                notices.append(msgspec.json.decode(data, type=NodeNotice))
            except (msgspec.DecodeError, UnicodeDecodeError):
                continue
    return notices


class _Desk:
    """Looks into files and puts them into the store of the site."""

    def __init__(self, site: Site, keys: DayKeys, now: datetime, result: Received) -> None:
        self.site, self.keys, self.result = site, keys, result
        self.store = Store(site.acknowledged, site_id=site.site_id, ballast_mb=site.settings.ballast_mb)
        self._pseudonyms = Pseudonyms(site, keys)
        self._lives = DescribedLives(site)
        self._erasures = KnownErasures(self.store.root)
        self._cameras = pa.array([camera.camera_id for camera in site.cameras], pa.string())
        self._last_ms = int((now.timestamp() + site.settings.future_max_s) * 1000)
        self._run = next_run(self.store.root)

    def take(self, match: re.Match[str], data: bytes) -> bool:
        """Make a file durable here; return False, and note why, when it cannot be used now."""
        if match["kind"] == IMPORTS:
            self._note_imports(data, node=match["node"])
        elif (table := _table(match["kind"])) is not None:
            try:
                rows = _read(table, data)
                self._refuse_unknown_cameras(rows)
            except ValueError as error:
                self.result.held[match.string] = str(error)
                return False
            self._store(table, rows, data, match)
            self.result.n_records[match["node"]] += rows.num_rows
        self.result.n_files += 1
        return True

    def _store(self, table: TableName, rows: pa.Table, data: bytes, match: re.Match[str]) -> None:
        self._erasures.refresh()
        is_erased = are_erased(rows, self._erasures.every)
        self.result.n_erased += is_erased.true_count
        n_all, rows = rows.num_rows, rows.filter(pc.invert(is_erased))
        bad = self._bad(rows)
        is_good = np.ones(rows.num_rows, dtype=bool)
        folder = self.site.root / quarantine.FOLDER
        for reason, (mask, detail) in bad.items():
            late = rows.filter(pa.array(mask))
            source = f"{match['node']}/{table}/{match['digest']}.parquet"
            late_records.to_quarantine(folder, table, late, source=source, reason=reason, detail=detail)
            self.result.n_quarantined[reason] += late.num_rows
            is_good &= ~mask
        if is_good.all() and len(is_good) == n_all:
            durable.publish(self.store.root / "live" / table / f"{match['digest']}.parquet", data)
        else:
            engines = engines_in(rows.schema.metadata)
            self.store.append(table, rows.filter(pa.array(is_good)), engines=engines)

    def _bad(self, rows: pa.Table) -> dict[str, tuple[np.ndarray, str]]:
        """Return which rows are too late in time or of a forgotten day, by reason; give each other day its key."""
        ts_ms = rows["ts"].cast(pa.int64()).to_numpy()
        bad: dict[str, tuple[np.ndarray, str]] = {}
        is_future = ts_ms > self._last_ms
        if is_future.any():
            bad[FUTURE] = (is_future, "its time lies beyond the clock of this machine")
        if self._lives and (is_outside := self._lives.are_outside(rows).to_numpy(zero_copy_only=False)).any():
            bad[NOT_THERE] = (is_outside, self._lives.detail)
        if self.site.settings.pseudonyms:
            closed = self.keys.closed()
            is_closed = self._pseudonyms.of_days(ts_ms, closed) & ~is_future
            if is_closed.any():
                bad[FORGOTTEN] = (is_closed, "the key of its day was destroyed before it came")
            for day in self._pseudonyms.days(ts_ms[~is_future & ~is_closed]):
                self.keys.key(day)  # so that vsd purge --forget-keys knows the day
        return bad

    def _refuse_unknown_cameras(self, rows: pa.Table) -> None:
        named = pc.unique(rows["camera_id"])
        unknown = named.filter(pc.invert(pc.is_in(named, value_set=self._cameras))).to_pylist()
        if unknown:
            raise ValueError(f"vsd.toml describes no camera {', '.join(map(repr, sorted(unknown)[:5]))}")

    def _note_imports(self, data: bytes, *, node: str) -> None:
        known = imports_of(self.store.root)
        for text in data.splitlines():
            try:
                line = msgspec.json.decode(text, type=ImportLine)
            except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
                continue
            if line.id not in known or known[line.id].is_taken_back:
                note_import(self.store.root, msgspec.structs.replace(line, node=node, run=self._run))


def _table(kind: str) -> TableName | None:
    return next((table for table in TABLES if table == kind), None)


def _read(table: TableName, data: bytes) -> pa.Table:
    """Return the rows of a segment; ValueError where they are not of this version's tables."""
    try:
        rows = pq.read_table(pa.BufferReader(data), use_threads=False)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise ValueError(f"it is no segment of records: {str(error)[:200]}") from None
    wanted, columns = SCHEMAS[table], [n for n in rows.column_names if n != OWNER]
    if columns != wanted.names or any(rows.schema.field(f.name).type != f.type for f in wanted):
        raise ValueError("its columns are those of another version of this program: install one version everywhere")
    if any(rows[f.name].null_count for f in wanted if not f.nullable):
        raise ValueError("values are missing that every record has")
    return rows
