"""One way to open DuckDB: in memory, UTC, no extension ever fetched, nothing persisted but Parquet."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import duckdb


def connect(*, memory_limit: str | None = None, threads: int | None = None) -> duckdb.DuckDBPyConnection:
    """Return a new in-memory connection in UTC that never fetches an extension.

    Args:
        memory_limit: DuckDB's `memory_limit`, such as "4GB"; None = DuckDB's default.
        threads: DuckDB's `threads`; None = one per core.

    Returns:
        The connection; it knows `unix_millis(ts)`, the one function house SQL shares with other engines by macro. Names
        in queries are relations, never Python variables; what does not fit into memory spills to the system's
        temporary folder.
    """
    import os
    import tempfile

    import duckdb

    config: dict[str, str | bool | int | float | list[str]] = {
        "autoinstall_known_extensions": False,
        "autoload_known_extensions": False,
        "python_enable_replacements": False,
        "temp_directory": str(Path(tempfile.gettempdir()) / f"vsd-{os.getpid()}"),
    }
    if memory_limit is not None:
        config["memory_limit"] = memory_limit
    if threads is not None:
        config["threads"] = threads
    connection = duckdb.connect(config=config)
    connection.execute("set timezone = 'UTC'")
    if connection.execute("select current_setting('enable_progress_bar')").fetchall()[0][0]:
        connection.execute("set enable_progress_bar = false")  # a notebook without ipywidgets cannot even set it off
    connection.execute("create macro unix_millis(t) as epoch_ms(t)")
    return connection


@contextlib.contextmanager
def one_thread(connection: duckdb.DuckDBPyConnection) -> Iterator[None]:
    """Let a connection work with one thread meanwhile; one whose settings are locked goes on with its own."""
    before, is_locked = connection.execute(
        "select current_setting('threads'), current_setting('lock_configuration')"
    ).fetchall()[0]
    if is_locked:
        yield
        return
    connection.execute("set threads = 1")
    try:
        yield
    finally:
        connection.execute(f"set threads = {int(before):d}")


def literal_list(paths: Iterable[Path]) -> str:
    """Return paths as a SQL list of texts, for views over `read_parquet`, in which nothing can be bound."""
    return "[" + ", ".join("'" + str(p).replace("'", "''") + "'" for p in paths) + "]"
