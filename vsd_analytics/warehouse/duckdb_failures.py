"""Internal failures of DuckDB: which errors they are, and the message for users when a second try fails too.

Such a failure closes the whole database, so the second try needs a new connection with simpler query plans
(`duck.connect(is_careful=True)`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime

from vsd_analytics.errors import SqlError
from vsd_analytics.schema import TableName
from vsd_analytics.store.duck import connect
from vsd_analytics.store.layout import Part


def inside() -> tuple[type[Exception], ...]:
    """Return the errors that DuckDB raises when it fails internally, and on every query after that.

    They are looked up where an error came, so that facts without a query need not import DuckDB.
    """
    import duckdb

    return duckdb.InternalException, duckdb.FatalException


def failed_inside(
    error: Exception, *, relation: str, parts: Mapping[TableName, Sequence[Part]], first_hour: int, last_hour: int
) -> SqlError:
    """Return the error E604 for a relation that could not be computed with careful settings either.

    Args:
        error: DuckDB's error.
        relation: The relation that was computed.
        parts: Stored parts of the hours. The message names their most crowded frame, the likely cause.
        first_hour: First UTC hour number that was computed.
        last_hour: Last one, inclusive.
    """
    crowd = _most_crowded([*parts.get("observations", ()), *parts.get("pairs", ())])
    fix = "vsd -v with the same command prints what to report"
    if crowd is not None:
        camera_id, ts_ms, _ = crowd
        hour = datetime.fromtimestamp(ts_ms // 3_600_000 * 3600, tz=UTC)
        after = datetime.fromtimestamp((ts_ms // 3_600_000 + 1) * 3600, tz=UTC)
        fix = (
            f"look at that frame; if it is wrong: vsd purge --camera {camera_id} "
            f"--range {hour:%Y-%m-%dT%H:%MZ}..{after:%Y-%m-%dT%H:%MZ}; {fix}"
        )
    return SqlError(
        f"the database failed while it computed {relation} {_span(first_hour, last_hour)}",
        code="E604",
        why=f"{_crowd_in_words(crowd)}the database says: {' '.join(str(error).split())[:200]}",
        fix=fix,
    )


def _span(first_hour: int, last_hour: int) -> str:
    first, last = (datetime.fromtimestamp(h * 3600, tz=UTC) for h in (first_hour, last_hour))
    if first_hour == last_hour:
        return f"of the hour {first:%Y-%m-%dT%H:00Z}"
    return f"of the hours {first:%Y-%m-%dT%H:00Z} to {last:%Y-%m-%dT%H:00Z}"


def _crowd_in_words(crowd: tuple[str, int, int] | None) -> str:
    if crowd is None:
        return ""
    camera_id, ts_ms, n = crowd
    ts = datetime.fromtimestamp(ts_ms / 1000, tz=UTC).isoformat(timespec="milliseconds")
    return f"the most crowded frame is of camera {camera_id} at {ts} with {n:,} records; "


def _most_crowded(parts: Iterable[Part]) -> tuple[str, int, int] | None:
    """Return camera, milliseconds since 1970 and number of records of the frame with most records."""
    names = [str(p.path) for p in parts]
    if not names:
        return None
    import duckdb

    with contextlib.suppress(duckdb.Error), connect(is_careful=True) as con:
        row = con.execute(
            "select camera_id, epoch_ms(ts), count(*) from read_parquet($names, union_by_name = true) "
            "group by all order by 3 desc, 1, 2 limit 1",
            {"names": names},
        ).fetchone()
        return None if row is None else (str(row[0]), int(row[1]), int(row[2]))
    return None
