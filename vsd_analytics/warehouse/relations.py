"""The facts and marts of one DuckDB connection: created when a query first names them, computed at most once.

A relation is a view until it is read a second time, by a second query or by two relations of one query. From then on
it is a table. Facts of a range do not change while the connection is open, so view and table have the same rows.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsd_analytics.store.duck import n_threads, one_thread
from vsd_analytics.warehouse.sqlfiles import RECORD_RELATIONS, Relation, queried_relations, relations

if TYPE_CHECKING:
    import duckdb

_WORD = re.compile(r"[a-z_][a-z0-9_]*")
_RECORDS = re.compile(rf'(?:\b(?:from|join)|,)\s*"?({"|".join(RECORD_RELATIONS)})\b')
SECOND_READ = 2


@dataclass(frozen=True, slots=True)
class RelationSource:
    """Where the rows of a relation come from.

    Attributes:
        query: A query that returns them.
        reads: Facts and marts that the query reads.
        materialise_at: The relation becomes a table when it is read this many times; None = never.
        is_files: The query reads many small files. One thread reads them: several only wait for each other.
        is_large: Its rows would fill the memory: it stays a view also where `materialise` names it.
    """

    query: str
    reads: tuple[str, ...] = ()
    materialise_at: int | None = SECOND_READ
    is_files: bool = False
    is_large: bool = False


def named_relations(query: str) -> list[str]:
    """Return the relations that a query names, in order.

    A fact or mart counts wherever its name occurs, in a text literal too: one view too many costs nothing. One of
    `RECORD_RELATIONS` would cost a computation, so it counts only where a table can be named.
    """
    text, known = query.lower(), relations("facts", "marts")
    return list(dict.fromkeys([*(w for w in _WORD.findall(text) if w in known), *_RECORDS.findall(text)]))


class Catalog:
    """The facts and marts of one connection.

    Args:
        con: The connection; the small relations of `dimensions` are on it already.
        source: Returns where the rows of a relation come from; called once for each relation that is read.
        ahead: Called with the names of relations before they are read.
    """

    def __init__(
        self,
        con: duckdb.DuckDBPyConnection,
        source: Callable[[Relation], RelationSource],
        ahead: Callable[[Iterable[str]], None],
    ) -> None:
        self._con, self._source, self._ahead = con, source, ahead
        self._threads = n_threads(con)
        self._known = queried_relations()
        self._sources: dict[str, RelationSource] = {}
        self._views, self._tables = set[str](), set[str]()
        self._n_reads: Counter[str] = Counter()

    def prepare(self, query: str) -> None:
        """Create the relations that a query names, and materialise those that are read a second time."""
        self._create(set(self.named(query)))

    def named(self, query: str) -> list[str]:
        """Return the relations whose names occur in a query; see `named_relations`."""
        return named_relations(query)

    def materialise(self, names: Iterable[str]) -> None:
        """Compute relations now and hold their rows in tables, except those that are large."""
        wanted = [name for name in names if name not in self._tables]
        self._create(set(wanted))
        for name in wanted:
            if not self._sources[name].is_large:
                self._materialise(name)

    def is_table(self, name: str) -> bool:
        """Return whether the rows of a relation are held in a table."""
        return name in self._tables

    def _create(self, named: set[str]) -> None:
        """Create relations and all they read, in order; count how often each is read, views by views included."""
        self._ahead(n for n in named if n not in self._sources)
        reached = set[str]()
        queue = list(named)
        self._n_reads.update(named)
        while queue:
            name = queue.pop()
            # A table has its rows: nothing behind it is read any more, so the count stops here.
            if name in reached or name in self._tables:
                continue
            reached.add(name)
            if name not in self._sources:
                self._sources[name] = self._source(self._known[name])
            read = [r for r in self._sources[name].reads if r in self._known]
            self._n_reads.update(read)
            queue += read
        for name in (n for n in self._known if n in reached):
            materialise_at = self._sources[name].materialise_at
            if materialise_at is not None and self._n_reads[name] >= materialise_at:
                self._materialise(name)
            elif name not in self._views:
                self._con.execute(f"create temp view {name} as {self._sources[name].query}")
                self._views.add(name)

    def _materialise(self, name: str) -> None:
        import duckdb

        if name in self._tables:
            return
        if name in self._views:
            try:
                self._con.execute(f"drop view {name}")
            except duckdb.CatalogException:  # a caller replaced the view by a table of its own
                self._tables.add(name)
                return
            self._views.discard(name)
        source = self._sources[name]
        with one_thread(self._con, restored_threads=self._threads) if source.is_files else nullcontext():
            self._con.execute(f"create temp table {name} as {source.query}")
        self._tables.add(name)
