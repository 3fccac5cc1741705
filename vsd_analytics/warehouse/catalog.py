"""The relations of one connection: each is there when it is first asked for, and what is asked twice is computed once.

A relation is a view until somebody reads it a second time, be it a second question or two relations of one question;
from then on it is a table. Facts of a range do not change while it is open, so that both have the same rows.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vsd_analytics.duck import one_thread
from vsd_analytics.warehouse.sqlfiles import Relation, relations

if TYPE_CHECKING:
    import duckdb

_WORD = re.compile(r"[a-z_][a-z0-9_]*")
_OFTEN = 2


@dataclass(frozen=True, slots=True)
class Source:
    """Where the rows of a relation come from.

    Attributes:
        query: They are its rows.
        reads: Facts and marts it reads.
        keep_after: It becomes a table when it is asked for so many times; None = never.
        is_files: It reads files, many and small ones, which threads only wait for one another to open.
    """

    query: str
    reads: tuple[str, ...] = ()
    keep_after: int | None = _OFTEN
    is_files: bool = False


class Catalog:
    """The facts and marts of one connection.

    Args:
        con: All dimensions stand on it.
        source: Tells where the rows of a relation come from; called once for each that is asked for.
    """

    def __init__(self, con: duckdb.DuckDBPyConnection, source: Callable[[Relation], Source]) -> None:
        self._con, self._source = con, source
        self._known = relations("facts", "marts")
        self._sources: dict[str, Source] = {}
        self._views, self._tables = set[str](), set[str]()
        self._asked: Counter[str] = Counter()

    def asked(self, query: str) -> None:
        """Make the relations that a query names, and keep those that it is not the first to read."""
        self._prepare({w for w in _WORD.findall(query.lower()) if w in self._known})

    def keep(self, names: Iterable[str]) -> None:
        """Compute relations and keep their rows."""
        for name in names:
            self._prepare({name})
            self._keep(name)

    def _prepare(self, named: set[str]) -> None:
        """Count who reads which relation for these, through views alone; make what is not there, in order."""
        reached = set[str]()
        left = list(named)
        self._asked.update(named)
        while left:
            name = left.pop()
            if name in reached or name in self._tables:
                continue
            reached.add(name)
            if name not in self._sources:
                self._sources[name] = self._source(self._known[name])
            read = [r for r in self._sources[name].reads if r in self._known]
            self._asked.update(read)
            left += read
        for name in (n for n in self._known if n in reached):
            keep_after = self._sources[name].keep_after
            if keep_after is not None and self._asked[name] >= keep_after:
                self._keep(name)
            elif name not in self._views:
                self._con.execute(f"create temp view {name} as {self._sources[name].query}")
                self._views.add(name)

    def _keep(self, name: str) -> None:
        if name in self._tables:
            return
        if name in self._views:
            is_view = self._con.execute(
                "select count(*) > 0 from duckdb_views() where view_name = $name", {"name": name}
            ).fetchall()[0][0]
            if not is_view:  # somebody else put something in its place
                self._tables.add(name)
                return
            self._con.execute(f"drop view {name}")
            self._views.discard(name)
        source = self._sources[name]
        with one_thread(self._con) if source.is_files else nullcontext():
            self._con.execute(f"create temp table {name} as {source.query}")
        self._tables.add(name)
