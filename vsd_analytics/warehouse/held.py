"""The relations of one batch: arrays beside a DuckDB connection, converted when the other side first reads them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from vsd_analytics.store.duck import connect
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.warehouse.dimensions import create_tables
from vsd_analytics.warehouse.sqlfiles import Relation

if TYPE_CHECKING:
    import duckdb

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Columns = dict[str, NDArray[Any]]
"""A relation as plain arrays of one length. Ids are integers in the order of their names, -1 where unknown."""
NULL = -(2**62)
"""An unknown number. Sums of two stay far below every number that is known."""
ENUMS = {
    **dict.fromkeys(("camera_id", "other_camera_id"), "camera_name"),
    **dict.fromkeys(("track_id", "track_a", "track_b", "other_track_a", "other_track_b", "group_id"), "track_name"),
    **dict.fromkeys(("other_track_id", "first_other_id", "last_other_id"), "track_name"),
}
"""Columns of ids, and the enum type they have while facts are computed. An enum is a small integer in the order of its
names: joins, groups and orders of ids cost a fraction of those of texts, and the queries read the same."""
_INT32 = frozenset(
    [
        *("x_mm", "y_mm", "distance_mm", "min_distance_mm", "cx", "cy", "n_ends"),
        *(f"{n}{c}_{side}_mm" for n in ("", "next_") for c in "xy" for side in "ab"),
        *(f"{end}_{c}_mm" for end in ("first", "last") for c in "xy"),
    ]
)


class Held:
    """Relations of one batch. Use it as a context manager: it holds a connection from the first query on.

    Args:
        small: The small tables of the site and of the batch, by name.
        names: Names by enum type, in order.
        is_careful: Run joins in the order they are written (`store.duck.connect`).
    """

    def __init__(
        self, small: Mapping[str, pa.Table], names: Mapping[str, pa.Array], *, is_careful: bool = False
    ) -> None:
        self.small, self._names, self._is_careful = small, names, is_careful
        self._columns: dict[str, Columns] = {}
        self._unpublished: dict[str, tuple[str, ...]] = {}
        self._stored: dict[str, pa.Table] = {}

    def __enter__(self) -> Held:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        if "con" in self.__dict__:
            self.con.close()

    @cached_property
    def con(self) -> duckdb.DuckDBPyConnection:
        """The connection, with the small tables. A batch without a query never opens it, which takes 40 ms."""
        con = connect(is_careful=self._is_careful)
        create_tables(con, self.small)
        for enum, known in self._names.items():
            create_tables(con, {f"_names_of_{enum}": pa.table({"id": known})})
            con.execute(f"create type {enum} as enum (select id from _names_of_{enum})")
            con.execute(f"create temp table {enum}s as select cast(id as {enum}) as id from _names_of_{enum}")
            con.execute(f"drop table _names_of_{enum}")
        for name, rows in self.small.items():
            if "camera_id" in rows.column_names:
                con.execute(f"alter table {name} alter camera_id type camera_name")
        return con

    @property
    def n_names(self) -> dict[str, int]:
        """The number of names by enum type."""
        return {enum: len(known) for enum, known in self._names.items()}

    def __getitem__(self, name: str) -> Columns:
        """Return the columns of a relation, read from DuckDB where it is a table there only."""
        if name not in self._columns:
            rows = self.small[name] if name in self.small else self.con.sql(f"select * from {name}").to_arrow_table()
            self._columns[name] = self._read(rows)
        return self._columns[name]

    def add(self, name: str, columns: Iterable[str], rows: Columns) -> None:
        """Hold a relation; `columns` are those that queries may read."""
        self._columns[name] = rows
        self._unpublished[name] = tuple(columns)

    def add_stored(self, name: str, rows: pa.Table, columns: Columns) -> None:
        """Hold a stored table; queries read its rows as they are."""
        self._columns[name] = columns
        self._stored[name] = rows

    def replace(self, name: str, rows: Columns) -> None:
        """Hold other columns of a relation that is a table already."""
        self._columns[name] = rows

    def forget(self, name: str) -> None:
        """Free the columns of a relation that nothing reads any more."""
        self._columns.pop(name, None)
        self._unpublished.pop(name, None)
        self._stored.pop(name, None)

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    def publish(self, names: Iterable[str]) -> None:
        """Create the tables of those relations that are arrays only, for queries that read them."""
        for name in names:
            if name in self._stored:
                self._create(
                    name, self._stored.pop(name), lambda c: f"cast({c} as {ENUMS[c]}) as {c}" if c in ENUMS else c
                )
            if name not in self._unpublished:
                continue
            columns = self._unpublished.pop(name)
            rows = self._columns[name]
            self._create(name, pa.table({c: _array(c, rows[c]) for c in columns}), _named)

    def table(self, relation: Relation, first_hour: int, last_hour: int) -> pa.Table:
        """Return the rows of a held relation in a range of hours; ids are dictionaries. Those of facts are by hour."""
        rows = self._columns[relation.name]
        if "hour" in relation.columns:
            inside: slice | NDArray[np.bool_] = slice(*np.searchsorted(rows["hour"], [first_hour, last_hour + 1]))
        else:
            hour = rows["ts_ms"] // HOUR_MS
            inside = (hour >= first_hour) & (hour <= last_hour)
        columns = {}
        for column in relation.columns:
            values = rows[column][inside]
            enum = ENUMS.get(column)
            if values.dtype == object or enum is None:
                columns[column] = pa.array(values, pa.string()) if values.dtype == object else _array(column, values)
            else:
                columns[column] = pa.DictionaryArray.from_arrays(_array(column, values), self._names[enum], safe=False)
        return pa.table(columns)

    def names_of(self, enum: str) -> pa.Array:
        """Return the names of an enum type, in order."""
        return self._names[enum]

    def _create(self, name: str, rows: pa.Table, expression: Callable[[str], str]) -> None:
        self.con.register(f"_{name}", rows)
        columns = ", ".join(map(expression, rows.column_names))
        self.con.execute(f"create temp table {name} as select {columns} from _{name}")
        self.con.unregister(f"_{name}")

    def _read(self, table: pa.Table) -> Columns:
        columns = {}
        for name in table.column_names:
            values = table[name]
            if name in ENUMS and not pa.types.is_dictionary(values.type):
                values = pc.index_in(values, self._names[ENUMS[name]]).fill_null(-1)
            columns[name] = _values(values)
        return columns


def none_of(relation: Relation) -> Columns:
    """Return the columns of a relation without rows."""
    kinds = {"is_": np.bool_, **dict.fromkeys(("area_id", "floor_id", "line_id"), object)}
    return {c: np.zeros(0, dtype=kinds.get(c, kinds.get(c[:3], np.int64))) for c in relation.columns}


def _named(column: str) -> str:
    enum = ENUMS.get(column)
    return column if enum is None else f"(select list(id order by id) from {enum}s)[{column} + 1] as {column}"


def _array(column: str, values: NDArray[Any]) -> pa.Array:
    """Return a column for Arrow: nulls for unknown ids and numbers."""
    if values.dtype == np.bool_:
        return pa.array(values)
    if ENUMS.get(column) is not None:
        is_unknown = values < 0
        return pa.array(values.astype(np.int32, copy=False), mask=is_unknown if is_unknown.any() else None)
    if values.dtype.kind == "f":
        return pa.array(values, mask=np.isnan(values))
    mask = values == NULL if values.min(initial=0) <= NULL else None
    if column in _INT32:
        values = (values if mask is None else np.where(mask, 0, values)).astype(np.int32)
    return pa.array(values, mask=mask)


def _values(column: pa.ChunkedArray) -> NDArray[Any]:
    """Return a column of DuckDB as an array."""
    kind, filled = column.type, column
    if pa.types.is_dictionary(kind):
        codes = pa.chunked_array([chunk.indices for chunk in column.chunks], type=kind.index_type)
        filled = codes.cast(pa.int32()).fill_null(-1)
    elif pa.types.is_integer(kind):
        filled = column.cast(pa.int64()).fill_null(NULL)
    elif pa.types.is_boolean(kind):
        filled = column.fill_null(False)
    elif not pa.types.is_floating(kind):
        return np.asarray(column.to_pylist(), dtype=object)
    values: NDArray[Any] = filled.to_numpy()
    return values
