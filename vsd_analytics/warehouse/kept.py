"""Marts that are worth keeping: what is read twice is computed once.

A mart is a view until somebody reads it a second time, be it a second question or two marts of one question; from then
on it is a table. Facts of a range do not change while it is open, so that both have the same rows.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

from vsd_analytics.warehouse.sqlfiles import relations

if TYPE_CHECKING:
    import duckdb

_WORD = re.compile(r"[a-z_][a-z0-9_]*")
_OFTEN = 2


class Marts:
    """The marts of one connection.

    Args:
        con: All facts and dimensions stand on it.
    """

    def __init__(self, con: duckdb.DuckDBPyConnection) -> None:
        self._con = con
        self._views = set(relations("marts"))
        self._asked: Counter[str] = Counter()
        for relation in relations("marts").values():
            con.execute(f"create temp view {relation.name} as {relation.sql}")

    def asked(self, query: str) -> None:
        """Keep the marts that a query is not the first to read, or reads in several ways."""
        named = self._views.intersection(_WORD.findall(query.lower()))
        if named:
            self._prepare(named)

    def keep(self, names: Iterable[str]) -> None:
        """Compute marts and keep their rows."""
        for name in names:
            if name in self._views:
                self._prepare({name})
                self._keep(name)

    def _prepare(self, named: set[str]) -> None:
        """Count who reads which mart for these, through views alone, and keep what is read often, in order."""
        known, reached = relations("marts"), set[str]()
        left = list(named)
        self._asked.update(named)
        while left:
            name = left.pop()
            if name in reached:
                continue
            reached.add(name)
            read = self._views.intersection(known[name].reads)
            self._asked.update(read)
            left += read
        for name in (n for n in known if n in reached and self._asked[n] >= _OFTEN):
            self._keep(name)

    def _keep(self, name: str) -> None:
        if name not in self._views:
            return
        self._views.discard(name)
        is_view = self._con.execute(
            "select count(*) > 0 from duckdb_views() where view_name = $name", {"name": name}
        ).fetchall()[0][0]
        if is_view:  # somebody else put something in its place
            self._con.execute(f"drop view {name}")
            self._con.execute(f"create temp table {name} as {relations('marts')[name].sql}")
