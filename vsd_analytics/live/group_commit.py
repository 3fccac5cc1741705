"""Making many small batches durable together: a disk sync takes as long for ten records as for ten thousand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.store.owners import owned_by
from vsd_analytics.store.store import Store

if TYPE_CHECKING:
    import pyarrow as pa

HELD_ROWS = 200_000


class GroupCommitStore(Store):
    """A store whose `append` is durable only after `commit`, which it calls itself after `HELD_ROWS` rows."""

    def __init__(self, root: Path, *, site_id: str, ballast_mb: float | None = None) -> None:
        super().__init__(root, site_id=site_id, ballast_mb=ballast_mb)
        self._held: dict[TableName, list[tuple[pa.Table, Sequence[str]]]] = {t: [] for t in reversed(TABLES)}
        self._n_held = 0

    def append(self, table: TableName, rows: pa.Table, *, engines: Sequence[str] = (), import_id: str = "") -> int:
        """Hold a batch; see `Store.append`. Nothing is acknowledged before `commit`."""
        self._held[table].append((owned_by(import_id, rows), engines))
        self._n_held += rows.num_rows
        if self._n_held >= HELD_ROWS:
            self.commit()
        return int(rows.num_rows)

    def commit(self) -> None:
        """Write the rows held to the spool; they are durable when this returns.

        Raises:
            OSError: The disk refused; the rows held are dropped, and their sources must be read again.
        """
        import pyarrow as pa

        held = {table: list(batches) for table, batches in self._held.items()}  # a frame after the persons it counts
        self.forget()
        for table, batches in held.items():
            if batches:
                engines = sorted({engine for _, names in batches for engine in names})
                super().append(table, pa.concat_tables([rows for rows, _ in batches]), engines=engines)

    def forget(self) -> None:
        """Drop the rows held: their sources will be read again."""
        for batches in self._held.values():
            batches.clear()
        self._n_held = 0
