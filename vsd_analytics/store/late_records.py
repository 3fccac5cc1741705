"""Records of the spool whose hour a purge sealed after the ingest had checked it: they go to quarantine.

The ingest applies the same rule to new records (`ingest.sealed_hours`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from vsd_analytics.schema import TableName
from vsd_analytics.store import quarantine
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.seals import SEALED, Seals

_CHUNK = 10_000
_TEXT_CHARS = 500
_DETAIL = "its hour was purged and sealed while it was on its way; the track ids in it are those of the store"


def is_late(rows: pa.Table, seals: Seals) -> pa.Array:
    """Return which rows of a stored table belong to sealed hours; StoreError E313 when a seal is damaged."""
    hours, of_row = np.unique(rows["ts"].cast(pa.int64()).to_numpy() // HOUR_MS, return_inverse=True)
    seal_of = {day: seals.read(day) for day in sorted({h // 24 for h in hours.tolist()})}
    is_sealed = [(seal := seal_of[h // 24]) is not None and seal.holds(h) for h in hours.tolist()]
    return pa.array(np.array(is_sealed, dtype=bool)[of_row])


def to_quarantine(folder: Path, table: TableName, rows: pa.Table, *, source: str) -> None:
    """Put rows of one segment into quarantine, durably; a second time changes nothing.

    The entries get no instant of arrival, so they cannot be replayed. A replay would replace their track ids, which
    are pseudonyms already, by pseudonyms of pseudonyms.
    """
    for start in range(0, rows.num_rows, _CHUNK):
        held = [
            quarantine.QuarantineEntry(
                source=source,
                line=line,
                reason=SEALED,
                detail=_DETAIL,
                text=", ".join(f"{c}={v}" for c, v in row.items())[:_TEXT_CHARS],
                table=table,
                row=_raw(row),
                import_id=owner or "",
            )
            for line, (row, owner) in enumerate(_with_owner(rows.slice(start, _CHUNK)), start + 1)
        ]
        quarantine.write(folder, held)


def _with_owner(rows: pa.Table) -> list[tuple[dict[str, Any], str | None]]:
    """Return the rows, each with the id of the import that brought it."""
    return [(row, row.pop(OWNER, None)) for row in rows.to_pylist()]


def _raw(row: dict[str, Any]) -> dict[str, Any]:
    """Return a stored row in the columns of `schema.RAW_SCHEMAS`, without what is missing."""
    record: dict[str, Any] = {"camera": row["camera_id"], "ts_ms": round(row["ts"].timestamp() * 1000)}
    for name, value in row.items():
        if value is not None and name not in ("camera_id", "ts"):
            is_mm = name.endswith("_mm")
            record[f"{name[:-3]}_m" if is_mm else "track" if name == "track_id" else name] = (
                value / 1000 if is_mm else value
            )
    return record
