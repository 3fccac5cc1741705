"""Small tables in the store's schemas, and what a store holds, for the tests in this folder."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.schema import SCHEMAS, TABLES, TableName

NINE = int(datetime(2026, 11, 9, 9, tzinfo=UTC).timestamp() * 1000)
HOUR = 3_600_000


def person(
    ts: int = NINE, track: str | None = "a", x_mm: int | None = 1000, *, camera: str = "cam-1", index: int = 0
) -> dict[str, Any]:
    return {
        "camera_id": camera,
        "ts": ts,
        "person": index,
        "track_id": track,
        "x_mm": x_mm,
        "y_mm": 2000,
        "u_px": None,
        "v_px": None,
        "quality": "metric",
    }


def frame(ts: int = NINE, n_persons: int | None = 1, *, camera: str = "cam-1") -> dict[str, Any]:
    return {"camera_id": camera, "ts": ts, "n_persons": n_persons, "n_pairs": None, "seq": None}


def pair(
    ts: int = NINE, a: str | None = "a", b: str | None = "b", *, mm: int = 1500, members: tuple[int, int] = (0, 1)
) -> dict[str, Any]:
    blank = dict.fromkeys(SCHEMAS["pairs"].names)
    return {
        **blank,
        "camera_id": "cam-1",
        "ts": ts,
        "person_a": members[0],
        "person_b": members[1],
        "track_a": a,
        "track_b": b,
        "distance_mm": mm,
        "quality": "metric",
    }


def table(name: TableName, rows: list[dict[str, Any]]) -> pa.Table:
    schema = SCHEMAS[name]
    return pa.table([pa.array([r.get(c.name) for r in rows], c.type) for c in schema], schema=schema)


def stored(root: Path) -> dict[str, list[dict[str, Any]]]:
    """Return all rows below a store's tables, read by a plain glob as anybody would."""
    return {
        name: [row for p in sorted((root / name).rglob("*.parquet")) for row in pq.ParquetFile(p).read().to_pylist()]
        for name in TABLES
    }


def part_names(root: Path) -> list[str]:
    return sorted(str(p.relative_to(root)) for t in TABLES for p in (root / t).rglob("*.parquet"))


def litter_of(project: Path) -> list[str]:
    """Return what a removal may leave nowhere: temporary files and intents."""
    return sorted(str(p) for p in [*project.rglob("*.tmp"), *(project / "store" / "purge").glob("*")])
