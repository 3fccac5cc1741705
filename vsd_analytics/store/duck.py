"""Opening DuckDB: in memory, in UTC, without downloading extensions; only Parquet files persist."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from vsd_analytics.store.spill import new_folder

if TYPE_CHECKING:
    import duckdb

CAREFUL = "join_order"
"""The optimizer that a careful connection disables: joins then run in the order they are written."""

RECORDING_STATE: Final = """
create macro recording_state(open_s, recorded_share, full_hour_share, partial_hour_share) as case
    when open_s = 0 then 'closed'
    when recorded_share >= full_hour_share then 'full'
    when recorded_share >= partial_hour_share and recorded_share > 0 then 'partial'
    when recorded_share > 0 then 'low_data'
    else 'no_data'
end
"""
"""The state of an hour or a day by the share of its opening time that was recorded: the only place of this rule."""


def connect(
    *, memory_limit: str | None = None, threads: int | None = None, is_careful: bool = False
) -> duckdb.DuckDBPyConnection:
    """Return a new in-memory connection in UTC that never fetches an extension.

    Args:
        memory_limit: DuckDB's `memory_limit`, such as "4GB"; None = DuckDB's default.
        threads: DuckDB's `threads`; None = one per core.
        is_careful: Run joins in the order they are written: slower, for a query that failed with an internal error.

    Returns:
        The connection. It has the macros `unix_millis` and `array_join`, so that SQL files run on other engines too,
        and `recording_state` (`RECORDING_STATE`).
        Names in queries are relations, never Python variables. What does not fit into memory spills to a private
        folder (`spill`).
    """
    import duckdb

    config: dict[str, str | bool | int | float | list[str]] = {
        "autoinstall_known_extensions": False,
        "autoload_known_extensions": False,
        "python_enable_replacements": False,
        "temp_directory": str(new_folder()),
    }
    if memory_limit is not None:
        config["memory_limit"] = memory_limit
    if threads is not None:
        config["threads"] = threads
    if is_careful:
        config["disabled_optimizers"] = CAREFUL
    connection = duckdb.connect(config=config)
    connection.execute("set timezone = 'UTC'")
    if connection.execute("select current_setting('enable_progress_bar')").fetchall()[0][0]:
        connection.execute("set enable_progress_bar = false")  # setting it fails in notebooks without ipywidgets
    connection.execute("create macro unix_millis(t) as epoch_ms(t)")
    connection.execute(RECORDING_STATE)
    connection.execute("create macro array_join(texts, between) as array_to_string(texts, between)")
    return connection


def n_threads(connection: duckdb.DuckDBPyConnection) -> int:
    """Return the number of threads of a connection."""
    return int(connection.execute("select current_setting('threads')").fetchall()[0][0])


@contextlib.contextmanager
def one_thread(connection: duckdb.DuckDBPyConnection, *, restored_threads: int) -> Iterator[None]:
    """Let a connection of some threads use one meanwhile; one with locked settings is left as it is."""
    import duckdb

    is_changed = restored_threads > 1
    if is_changed:
        try:
            connection.execute("set threads = 1")
        except duckdb.InvalidInputException:  # the settings are locked
            is_changed = False
    try:
        yield
    finally:
        if is_changed:
            connection.execute(f"set threads = {restored_threads:d}")


def literal_list(paths: Iterable[Path]) -> str:
    """Return paths as a SQL list of texts, for views over `read_parquet`: a view cannot have bound values."""
    return "[" + ", ".join("'" + str(p).replace("'", "''") + "'" for p in paths) + "]"
