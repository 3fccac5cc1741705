"""One way to open DuckDB: in memory, UTC, no extension ever fetched, nothing persisted but Parquet."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import duckdb


def connect(*, memory_limit: str | None = None) -> duckdb.DuckDBPyConnection:
    """Return a new in-memory connection in UTC that never fetches an extension.

    Args:
        memory_limit: DuckDB's `memory_limit`, such as "4GB"; None = DuckDB's default.

    Returns:
        The connection; it knows `unix_millis(ts)`, the one function house SQL shares with other engines by macro.
    """
    import duckdb

    config = {"autoinstall_known_extensions": "false", "autoload_known_extensions": "false"}
    if memory_limit is not None:
        config["memory_limit"] = memory_limit
    connection = duckdb.connect(config=config)
    connection.execute("set timezone = 'UTC'")
    connection.execute("set enable_progress_bar = false")
    connection.execute("create macro unix_millis(t) as epoch_ms(t)")
    return connection
