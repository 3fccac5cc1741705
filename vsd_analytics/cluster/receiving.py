"""The store of a site receives what its nodes hand on.

Of each file: read it, compare it with the signature in its name, look into it, put it into the spool durably, write the
receipt, remove it from the place. A stop anywhere leaves the file or a receipt for it. What comes twice is counted once
by the fold, which also puts records of sealed hours into quarantine.

A file whose signature is wrong was damaged on its way, or somebody without the secret of the site put it there: it is
removed, and the node writes its own again. A file that this site cannot use now (a camera that vsd.toml does not
describe, another version of the tables, more than a part may hold) stays at the place without a receipt: it is received
when that is corrected. Bad rows go to quarantine, as those of files do.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path, PurePosixPath

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.cluster.exchange import (
    ABOUT_NODE,
    NODES,
    NOTICE_MAX_BYTES,
    RECEIPTS,
    SITE,
    Exchange,
    NodeNotice,
    SiteNotice,
    reaching,
    site_notice,
)
from vsd_analytics.cluster.parts_of_nodes import PART_MAX_BYTES, HandedPart, PartError, raw_rows
from vsd_analytics.cluster.signatures import HandedFile, Signer, is_same
from vsd_analytics.errors import StoreError
from vsd_analytics.ingest.intake.normalise import Fault, Normaliser
from vsd_analytics.ingest.intake.pseudonyms import Pseudonyms
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store import durable, quarantine
from vsd_analytics.store.day_chain import read_chain
from vsd_analytics.store.erasures import KnownErasures, are_erased
from vsd_analytics.store.imports import ImportLine, imports_of, next_run, note_import
from vsd_analytics.store.outbox import IMPORTS
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.secrets import DayKeys
from vsd_analytics.store.store import FoldResult, Store

RECEIPT_MAX_BYTES = 100
UNSIGNED = "it has no signature, as those of version 1.1: upgrade the node; it hands the records on again by itself"
NO_SECRET = "this site has no secret to tell whose it is: vsd node invite --out join.json, and join the node again"
_FILE = re.compile(
    rf"^{NODES}/(?P<node>[a-z0-9][a-z0-9_-]*)/(?P<kind>{'|'.join((*TABLES, IMPORTS))})"
    r"/(?P<digest>[0-9a-f]{16})(?:-(?P<stamp>[0-9a-f]{16})-[0-9a-f]{32})?(?P<suffix>\.parquet|\.jsonl)$"
)
_CHUNK = 10_000
_TEXT_CHARS, _NAME_CHARS = 500, 80
_ORDER = (*reversed(TABLES), IMPORTS)
"""A frame is received after the persons it counts."""


@dataclass
class Received:
    """What a site did in one round.

    Attributes:
        n_files: Files received.
        n_records: Records in them, by node.
        n_again: Files that were there again after their receipt.
        damaged: Files whose signature is wrong, removed: damaged on their way, or put there by somebody without the
            secret. The node writes its own again.
        n_erased: Records left out because they were erased here on request.
        n_quarantined: Records put into quarantine, by reason; those of sealed hours are in `fold`.
        held: Files that this site cannot use now, each with the reason.
        nodes: What each node said last, signed by it.
        fold: What the store gained.
    """

    n_files: int = 0
    n_records: Counter[str] = field(default_factory=Counter)
    n_again: int = 0
    damaged: list[str] = field(default_factory=list)
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
    chain = read_chain(keys.folder)
    signer = None if chain is None else Signer(chain)
    result = Received()
    with reaching(site.exchange.place):
        _say(site, exchange, keys, signer)
        names = exchange.names(f"{NODES}/")
        paths = sorted(
            (m for name in names if (m := _FILE.match(name))), key=lambda m: (_ORDER.index(m["kind"]), m.string)
        )
        receipts = set(exchange.names(f"{RECEIPTS}/")) if paths else set()
        desk = _Desk(site, keys, now, result)
        for match in paths:
            if stop():
                break
            if signer is None or match["stamp"] is None:
                result.held[match.string] = NO_SECRET if signer is None else UNSIGNED
                continue
            data = exchange.read(match.string, most=PART_MAX_BYTES)
            if data is None:
                continue
            file = HandedFile(match["node"], match["kind"], match["digest"], match["stamp"], match["suffix"])
            if len(data) > PART_MAX_BYTES or not is_same(signer.name(file, data), match.string):
                result.damaged.append(match.string)  # without a receipt the node writes it again
            elif file.receipt in receipts and _has_receipt(exchange, file, signer.receipt(file, data)):
                result.n_again += 1
            elif not desk.take(match.string, file, data):
                continue
            else:
                exchange.replace(file.receipt, signer.receipt(file, data))
            exchange.remove(match.string)
        result.nodes = _notices(exchange, names, signer)
    result.fold = desk.store.fold()
    return result


def _has_receipt(exchange: Exchange, file: HandedFile, receipt: bytes) -> bool:
    """Return whether the receipt of a file is there, and not another text in its place."""
    return is_same(exchange.read(file.receipt, most=RECEIPT_MAX_BYTES) or b"", receipt)


def _say(site: Site, exchange: Exchange, keys: DayKeys, signer: Signer | None) -> None:
    """Bring what the site says at the place up to date."""
    closed, chain = keys.closed(), read_chain(keys.folder)
    mark = "" if chain is None else chain.mark()
    notice = SiteNotice(site.site_id, tuple(sorted(closed.days)), closed.before, tuple(sorted(closed.held)), mark)
    if signer is not None:
        notice = signer.signed(notice)
    try:
        known = site_notice(exchange, site)
    except StoreError:
        data = exchange.read(SITE, most=NOTICE_MAX_BYTES)
        if data is not None and _is_notice(data):
            raise  # of another site
        known = None
    if known != notice:
        exchange.replace(SITE, msgspec.json.encode(notice))


def _is_notice(data: bytes) -> bool:
    try:
        msgspec.json.decode(data, type=SiteNotice)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return False
    return True


def _notices(exchange: Exchange, names: list[str], signer: Signer | None) -> list[NodeNotice]:
    """Return what nodes say of themselves; not what somebody else says of them."""
    notices = []
    for name in names:
        path = PurePosixPath(name)
        node = path.parent.name
        if (
            signer is not None
            and name == f"{NODES}/{node}/{ABOUT_NODE}"
            and (data := exchange.read(name, most=NOTICE_MAX_BYTES)) is not None
        ):
            try:
                notice = msgspec.json.decode(data, type=NodeNotice)
            except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
                continue
            if notice.node == node and signer.has_signed(notice):
                notices.append(notice)
    return notices


class _Desk:
    """Looks into files and puts them into the store of the site."""

    def __init__(self, site: Site, keys: DayKeys, now: datetime, result: Received) -> None:
        self.site, self.keys, self.result = site, keys, result
        self.store = Store(site.acknowledged, site_id=site.site_id, ballast_mb=site.settings.ballast_mb)
        self._now = now
        self._pseudonyms = Pseudonyms(site, keys)
        self._erasures = KnownErasures(self.store.root)
        self._cameras = pa.array([camera.camera_id for camera in site.cameras], pa.string())
        self._run = next_run(self.store.root)

    def take(self, name: str, file: HandedFile, data: bytes) -> bool:
        """Make a file durable here; return False, and note why, when it cannot be used now."""
        if file.kind == IMPORTS:
            self._note_imports(data, node=file.node)
        elif (table := _table(file.kind)) is not None:
            try:
                self.result.n_records[file.node] += self._store(name, table, file, data)
            except PartError as error:
                self.result.held[name] = str(error)
                return False
        self.result.n_files += 1
        return True

    def _store(self, name: str, table: TableName, file: HandedFile, data: bytes) -> int:
        """Put the rows of a part into the spool, bad ones into quarantine; return their number."""
        folder = self.store.root / "live" / table
        durable.make_dirs(folder)
        durable.sweep_temporaries(folder, file_name="received.parquet")
        with durable.temporary(folder / "received.parquet", mode=0o600) as (path, stream):
            stream.write(data)
            stream.flush()
            part = HandedPart(Path(path), table, name=name, settings=self.site.settings)
            for piece in part.pieces():  # all of it can be used, or nothing is stored
                self._refuse_unknown_cameras(piece.rows)
            normaliser = Normaliser(self.site, now=self._now, keys=self.keys if self.site.settings.pseudonyms else None)
            self._erasures.refresh()
            source, n_rows = f"{file.node}/{table}/{file.digest}.parquet", 0
            for piece in part.pieces():
                is_erased = are_erased(piece.rows, self._erasures.every)
                self.result.n_erased += is_erased.true_count
                rows = piece.rows.filter(pc.invert(is_erased))
                is_good = np.ones(rows.num_rows, dtype=bool)
                for fault in normaliser.faults(table, raw_rows(table, rows)):
                    self._quarantine(table, fault, rows[OWNER].take(pa.array(fault.at)), source=source, first=n_rows)
                    is_good[fault.at] = False
                for reject in piece.rejected:
                    entry = quarantine.QuarantineEntry(
                        source=source, line=reject.line, reason=reject.reason, detail=reject.detail, text=reject.text
                    )
                    quarantine.write(self.site.root / quarantine.FOLDER, [entry])
                    self.result.n_quarantined[reject.reason] += reject.n
                good = rows.filter(pa.array(is_good))
                if self.site.settings.pseudonyms:
                    for day in self._pseudonyms.days(good["ts"].cast(pa.int64()).to_numpy()):
                        self.keys.key(day)  # so that vsd purge --forget-keys knows the day
                self.store.append(table, good, engines=part.engines)
                n_rows += piece.rows.num_rows + len(piece.rejected)
        return n_rows

    def _quarantine(self, table: TableName, fault: Fault, owners: pa.ChunkedArray, *, source: str, first: int) -> None:
        """Put bad rows into quarantine, durably; a second time changes nothing.

        The entries get no instant of arrival, so they cannot be replayed. A replay would replace their track ids,
        which are pseudonyms already, by pseudonyms of pseudonyms.
        """
        folder = self.site.root / quarantine.FOLDER
        owner_of = owners.to_pylist()
        for start in range(0, fault.rows.num_rows, _CHUNK):
            held = []
            for at, row in enumerate(fault.rows.slice(start, _CHUNK).to_pylist(), start):
                record = {c: v for c, v in row.items() if v is not None and c not in ("line", "zone", "camera_id")}
                entry = quarantine.QuarantineEntry(
                    source=source,
                    line=first + row["line"],
                    reason=fault.reason,
                    detail=fault.detail,
                    text=", ".join(f"{c}={v}" for c, v in record.items())[:_TEXT_CHARS],
                    table=table,
                    row=record,
                    import_id=owner_of[at],
                )
                held.append(entry)
            quarantine.write(folder, held)
        self.result.n_quarantined[fault.reason] += fault.rows.num_rows

    def _refuse_unknown_cameras(self, rows: pa.Table) -> None:
        named = pc.unique(rows["camera_id"])
        unknown = named.filter(pc.invert(pc.is_in(named, value_set=self._cameras))).to_pylist()
        if unknown:
            shown = ", ".join(repr(name[:_NAME_CHARS]) for name in sorted(unknown)[:5])
            raise PartError(f"vsd.toml describes no camera {shown}")

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
