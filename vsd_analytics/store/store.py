"""The store: append (durable when it returns) and fold (immutable hour parts, no record twice).

Records may come more than once; the tables hold each record exactly once. An append writes a batch to the spool under
the hash of its bytes. A fold puts every record whose key the table lacks into a new part of its UTC hour. A crash
anywhere, followed by another run, gives the same table. No part is ever replaced: a reader sees all of it or nothing.

A purge by age may seal an hour after an ingest checked the seals and before it appends. An append takes no lock,
because it must not wait for a fold. So the fold checks the seals again, under the lock that sealing also holds, and
puts late records into quarantine.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field
from operator import add
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.errors import DiskError, VsdError, disk_error
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.store import ballast, durable, late_records, outbox, quarantine, removal
from vsd_analytics.store.erasures import are_erased, erasures
from vsd_analytics.store.layout import (
    HOUR_MS,
    Part,
    day_folders,
    has_parts,
    list_days,
    list_parts,
    segment_paths,
    unit_folder,
)
from vsd_analytics.store.new_rows import new_rows
from vsd_analytics.store.owners import OWNER, owned_by
from vsd_analytics.store.part_files import damaged, damaged_segment, engines_in, part_bytes
from vsd_analytics.store.repeats import AGAIN
from vsd_analytics.store.reused_memory import reused_memory
from vsd_analytics.store.seals import FOLDER, Seals
from vsd_analytics.store.segments import ARROW, about, read_segment, segment_bytes, sent_bytes
from vsd_analytics.store.spans import hours_in, spans_of


@dataclass(frozen=True, slots=True)
class TableCounts:
    """What a fold did with one table's spool.

    Attributes:
        n_new: Records added to the table.
        n_known: Records the table (or the same spool) already held.
        n_second: Records left out because another one in the spool has their key and other values.
        n_sealed: Records put into quarantine because their hour was sealed before they were folded.
        n_erased: Records left out because they were erased on request (`erasures`).
    """

    n_new: int = 0
    n_known: int = 0
    n_second: int = 0
    n_sealed: int = 0
    n_erased: int = 0

    def __add__(self, other: TableCounts) -> TableCounts:
        return TableCounts(*map(add, astuple(self), astuple(other)))


@dataclass(frozen=True, slots=True)
class FoldResult:
    """What a fold did.

    Attributes:
        tables: Counts by table.
        hours: UTC hour numbers that gained a part.
        is_ballast_spent: The disk was full, and the fold released the ballast to get space (W304).
        n_to_hand_on: Records of a node that were made ready for the site's store; a node folds nothing.
    """

    tables: Mapping[TableName, TableCounts] = field(default_factory=dict)
    hours: frozenset[int] = frozenset()
    is_ballast_spent: bool = False
    n_to_hand_on: int = 0

    @property
    def n_new(self) -> int:
        """Return the number of records the tables gained."""
        return sum(c.n_new for c in self.tables.values())

    @property
    def n_sealed(self) -> int:
        """Return the number of records put into quarantine because their hour is sealed."""
        return sum(c.n_sealed for c in self.tables.values())

    @property
    def n_erased(self) -> int:
        """Return the number of records left out because they were erased on request."""
        return sum(c.n_erased for c in self.tables.values())


class Store:
    """The three tables of one site.

    Args:
        root: The store folder (`<project>/store`), or the outbox of a node.
        site_id: The site's id, the Hive folder of its parts.
        ballast_mb: Ballast that a fold reserves when there is space, in megabytes; 0 removes it, None leaves it.
    """

    def __init__(self, root: Path, *, site_id: str, ballast_mb: float | None = None) -> None:
        self.root = root
        self.site_id = site_id
        self.ballast_mb = ballast_mb

    def append(self, table: TableName, rows: pa.Table, *, engines: Sequence[str] = (), import_id: str = "") -> int:
        """Put a batch into the spool; it is durable when this returns.

        Args:
            table: Table of the rows.
            rows: Rows in `SCHEMAS[table]`, perhaps with their owners (`owners.owned_by`).
            engines: Engine names and versions the rows came from, noted in the file's metadata.
            import_id: The import that brings them; "" = none, such as a broker.

        Returns:
            Number of rows acknowledged.

        Raises:
            DiskError: E304 to E306, the disk refused; nothing is acknowledged then.
        """
        if rows.num_rows == 0:
            return 0
        owned = owned_by(import_id, rows) if import_id and OWNER not in rows.column_names else rows
        names = sorted(set(engines))
        if self.root.name == outbox.FOLDER:  # on a full disk a node hands it on as it is
            data, suffix = sent_bytes(table, owned, names, compression="lz4"), ".parquet"
        else:
            data, suffix = segment_bytes(table, owned, names), ARROW
        durable.publish(self.root / "live" / table / f"{durable.digest(data)}{suffix}", data)
        return int(rows.num_rows)

    def fold(self, *, on_rows: Callable[[int], None] | None = None) -> FoldResult:
        """Move the spool into parts; on a node make it ready to be handed on (`store.outbox`).

        Args:
            on_rows: Called with the number of spool rows done, for a progress bar.

        Returns:
            Counts per table and the hours that changed.

        Raises:
            StoreError: E302, a file of the spool or the store is damaged; nothing is removed from the spool then.
            DiskError: E304 to E306, the disk refused; what was acknowledged stays in the spool.
        """
        if not self.root.is_dir() or self._has_nothing_to_do():
            return FoldResult()
        if self.root.name == outbox.FOLDER:
            with durable.exclusive(self.root / ".lock"):
                return FoldResult(n_to_hand_on=outbox.make_ready(self.root))
        while True:
            # an unfinished removal needs `.purge.lock`, which comes before `.lock` in the order of locks: finish it
            # outside, and look again inside, because another purge may have begun in between
            removal.complete(self.root)
            with durable.exclusive(self.root / ".lock"):
                if not removal.pending(self.root):
                    return self.fold_held(on_rows=on_rows)

    def fold_held(self, *, on_rows: Callable[[int], None] | None = None) -> FoldResult:
        """Fold for a caller that holds the store's lock already; see `fold`."""
        had_ballast = ballast.is_held(self.root)
        durable.sweep_temporaries(self.root)
        tables: dict[TableName, TableCounts] = {}
        hours: set[int] = set()
        with reused_memory():
            for table in TABLES:
                segments = segment_paths(self.root, table)
                if segments:
                    tables[table] = self._fold_table(table, segments, hours, on_rows)
        is_spent = had_ballast and not ballast.is_held(self.root)
        if self.ballast_mb is not None and not is_spent:
            ballast.hold(self.root, n_bytes=int(self.ballast_mb * 1_000_000))
        return FoldResult(tables, frozenset(hours), is_spent)

    def n_spooled(self) -> int:
        """Return the number of rows acknowledged but not yet folded."""
        n_rows = 0
        for path in (p for t in TABLES for p in segment_paths(self.root, t)):
            try:
                n_rows += about(path).n_rows
            except FileNotFoundError:
                continue  # a fold removed it meanwhile
            except (pa.ArrowException, ValueError, OSError) as error:
                if getattr(error, "errno", None):
                    raise
                raise damaged_segment(path) from None
        return n_rows

    def parts(self, table: TableName, *, first_hour: int | None = None, last_hour: int | None = None) -> list[Part]:
        """Return the parts of one table by hour; see `layout.list_parts`."""
        return list_parts(self.root, table, self.site_id, first_hour=first_hour, last_hour=last_hour)

    def repeats(self, table: TableName, *, first_hour: int | None = None, last_hour: int | None = None) -> list[Part]:
        """Return the parts of records that another import brought again (`repeats`), as `parts`."""
        return list_parts(self.root / AGAIN, table, self.site_id, first_hour=first_hour, last_hour=last_hour)

    def hours(self) -> tuple[int, int] | None:
        """Return the first and last UTC hour number with a part, or None for an empty store."""
        hours = [p.hour for t in TABLES for p in self.parts(t)]
        return (min(hours), max(hours)) if hours else None

    def days(self) -> set[int]:
        """Return the UTC day numbers with a part, by their folders alone."""
        tables: dict[int, list[TableName]] = {}
        for table in TABLES:
            for day in day_folders(self.root, table, self.site_id):
                tables.setdefault(day, []).append(table)
        # a removal that was killed leaves empty folders; one table with a part is enough
        return {
            day
            for day, own_tables in tables.items()
            if any(has_parts(self.root, t, self.site_id, day) for t in own_tables)
        }

    def damaged(self) -> list[Path]:
        """Return the paths of parts whose bytes do not match the hash in their name."""
        return [p.path for t in TABLES for p in self.parts(t) if durable.file_digest(p.path) != p.digest]

    def refuse_damaged(self, parts: Iterable[Part] | None = None) -> None:
        """Raise StoreError E302 when a part is damaged: before its rows are used, or after it could not be read.

        Args:
            parts: Parts to check; None = all.
        """
        for part in parts if parts is not None else (p for t in TABLES for p in self.parts(t)):
            if durable.file_digest(part.path) != part.digest:
                raise damaged(part.path, "stored records", fix="restore it from a backup, or move it away")

    @contextlib.contextmanager
    def reporting_damage(self) -> Iterator[None]:
        """Turn errors of reading parts into one that names the damaged part, or says that the disk refused.

        Raises:
            StoreError: E302, a part is damaged.
            DiskError: E304 to E306, the disk refused.
        """
        import duckdb

        try:
            yield
        except VsdError:
            raise
        except (duckdb.Error, pa.ArrowException, ValueError, OSError) as error:
            if refused := disk_error(error):
                raise refused from None
            self.refuse_damaged()
            raise

    def _fold_table(
        self, table: TableName, segments: list[Path], hours: set[int], on_rows: Callable[[int], None] | None
    ) -> TableCounts:
        for path in segments:
            if durable.file_digest(path) != path.stem:
                raise damaged_segment(path)
        # publish all parts, sync their folders, and only then remove the segments: after a crash at any step the next
        # fold reads the same segments again and finds the records it has already moved by their keys
        segments, n_sealed, n_erased = self._without_late(table, segments)
        done = TableCounts(n_sealed=n_sealed, n_erased=n_erased)
        folders: set[Path] = set()
        for span in spans_of(segments, stored_days=set(list_days(self.root, table, self.site_id))):
            hours_of = {"first_hour": span.first_hour, "last_hour": span.last_hour}
            known, noted = self.parts(table, **hours_of), self.repeats(table, **hours_of)
            self.refuse_damaged([*known, *noted])  # a flipped bit in a key would let a record in twice
            near = span.overlapping(p.path for p in known)
            fresh = new_rows(table, span, known=near, noted=[p.path for p in noted])
            for root, rows in ((self.root, fresh.fresh), (self.root / AGAIN, fresh.again)):
                for hour, part in _by_hour(rows):
                    data = part_bytes(table, part, fresh.engines[hour // 24])
                    folder = unit_folder(root, table, self.site_id, hour)
                    self._publish(folder / f"{hour % 24:02d}-{durable.digest(data)}.parquet", data)
                    folders.add(folder)
            hours |= {hour for hour, _ in _by_hour(fresh.fresh)}
            n_new = fresh.fresh.num_rows
            done += TableCounts(n_new, fresh.n_read - n_new - fresh.n_second, fresh.n_second)
            folders |= {part.path.parent for part in known}
            if on_rows is not None:
                on_rows(fresh.n_read)
        for folder in sorted(folders):  # an earlier fold may have been killed between the rename and the sync
            durable.fsync_dir(folder)
        for path in segments:
            durable.remove(path)
        durable.fsync_dir(self.root / "live" / table)
        return done

    def _without_late(self, table: TableName, segments: list[Path]) -> tuple[list[Path], int, int]:
        """Drop erased records, and put those of sealed hours into quarantine.

        Returns the remaining segments, how many records were late, and how many erased.

        A segment that holds both kinds is replaced by one with the rest. A crash in between does no harm: equal
        entries are written once, and a record in two segments is folded once.
        """
        seals = Seals(self.root.parent / FOLDER, site_id=self.site_id)
        days = frozenset(seals.days())
        left: list[Path] = []
        n_late = n_erased = 0
        erased = erasures(self.root)
        for path in segments:
            left.append(path)
            is_sealed = bool(days) and not days.isdisjoint(h // 24 for h in hours_in(path))
            if not is_sealed and not erased:
                continue
            every = read_segment(path)
            rows = every.filter(pc.invert(are_erased(every, erased)))
            mask = late_records.is_late(rows, seals) if is_sealed else pa.array(np.zeros(rows.num_rows, dtype=bool))
            rest = rows.filter(pc.invert(mask))
            if rest.num_rows == every.num_rows:
                continue
            if rest.num_rows < rows.num_rows:
                late, source = rows.filter(mask), f"store/live/{table}/{path.name}"
                late_records.to_quarantine(self.root.parent / quarantine.FOLDER, table, late, source=source)
            n_erased += every.num_rows - rows.num_rows
            n_late += rows.num_rows - rest.num_rows
            left.pop()
            if rest.num_rows:
                data = segment_bytes(table, rest, engines_in(rest.schema.metadata))
                left.append(path.parent / f"{durable.digest(data)}{ARROW}")
                durable.publish(left[-1], data)
            durable.remove(path)
        return sorted(set(left)), n_late, n_erased

    def _has_nothing_to_do(self) -> bool:
        """Return whether the spool is empty and the disk read-only, so that nothing can be swept either."""
        return not os.access(self.root, os.W_OK) and not any(segment_paths(self.root, t) for t in TABLES)

    def _publish(self, path: Path, data: pa.Buffer) -> None:
        """Publish a part; on a full disk release the ballast and try once more."""
        try:
            durable.publish(path, data)
        except DiskError as error:
            if error.code != "E304" or not ballast.give_up(self.root):
                raise
            durable.publish(path, data)


def _by_hour(rows: pa.Table) -> Iterator[tuple[int, pa.Table]]:
    """Yield each UTC hour number with its rows, from rows that are sorted by hour."""
    import numpy as np

    hours = rows["ts"].cast(pa.int64()).to_numpy() // HOUR_MS
    starts = np.flatnonzero(np.diff(hours, prepend=hours[:1] - 1))
    lengths = np.diff(starts, append=len(hours))
    for start, length in zip(starts.tolist(), lengths.tolist(), strict=True):
        yield int(hours[start]), rows.slice(start, length)
