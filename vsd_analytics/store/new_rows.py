"""Which rows of a span of the spool the table lacks: each once, in the order of a part.

Few keys come twice. So rows are compared by a 64-bit hash of their key first, and only those that share one with
another row, spooled or stored, are compared by the keys themselves. Unequal keys with equal hashes cost time only.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from vsd_analytics.errors import StoreError, VsdError, disk_error
from vsd_analytics.schema import KEYS, PLACES, SCHEMAS, TRACKS, TableName
from vsd_analytics.store.duck import connect
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.store.owners import OWNER, owned_by
from vsd_analytics.store.part_files import engines_in, with_every_column
from vsd_analytics.store.repeats import brought_again, key_aliases, same_key
from vsd_analytics.store.segments import read_segment
from vsd_analytics.store.spans import FoldSpan

if TYPE_CHECKING:
    import duckdb

Ints = NDArray[np.int64]
Hashes = NDArray[np.uint64]

_ROOM = 2**62
_NULL = -(2**61)
"""In place of an unknown value in a hash of keys."""
_ODD = (np.uint64(0x9E3779B97F4A7C15), np.uint64(0xC2B2AE3D27D4EB4F))
"""Multipliers that spread neighbouring numbers over all bits."""


@dataclass(frozen=True, slots=True)
class NewRows:
    """What a fold stores of a span.

    Attributes:
        fresh: Rows that the table lacks, sorted by hour and then by all columns, with the column `owners.OWNER`. Of
            several rows with one key the least by its columns is taken, so the order of files changes nothing.
        again: Rows that an import brought of records which belong to another (`repeats`), likewise. Texts are
            dictionaries in both.
        n_read: Number of spooled rows.
        n_second: Number of those left out because another one has their key and other values.
        engines: Engine names and versions that sent rows of each UTC day.
    """

    fresh: pa.Table
    again: pa.Table
    n_read: int
    n_second: int
    engines: Mapping[int, Sequence[str]]


def new_rows(table: TableName, span: FoldSpan, *, known: Sequence[Path], noted: Sequence[Path]) -> NewRows:
    """Return the rows of a span that a table lacks.

    Args:
        table: The table.
        span: Hours, and the segments with rows of them.
        known: Parts of these hours in the table.
        noted: Parts of these hours in `again`.

    Raises:
        StoreError: E302, the spool or a part cannot be read.
        DiskError: E304 to E306, the disk refused.
    """
    try:
        pieces = {path: _read(table, path) for path in span.segments}
        engines = {
            day: sorted({e for path in paths for e in engines_in(pieces[path].schema.metadata)})
            for day, paths in span.by_day.items()
        }
        names = [*SCHEMAS[table].names, OWNER]
        inside = [_inside(piece.select(names).replace_schema_metadata(), span) for piece in pieces.values()]
        rows = pa.concat_tables(inside).unify_dictionaries()
        del pieces, inside
        is_doubtful = _doubtful(table, rows, known)
        fresh, again, n_second = rows, rows.slice(0, 0), 0
        if is_doubtful.any():
            doubtful = rows.filter(pa.array(is_doubtful))
            new, again, n_second = _compared(table, doubtful, known, noted)
            others = rows.filter(pa.array(~is_doubtful)).combine_chunks()
            fresh = pa.concat_tables([others, new]).unify_dictionaries()
    except (pa.ArrowException, OSError) as error:
        raise _not_folded(error) from None
    return NewRows(_in_order(table, fresh), _in_order(table, again), rows.num_rows, n_second, engines)


def _not_folded(error: Exception) -> VsdError:
    why = str(error)[:300]
    return disk_error(error) or StoreError(
        "the spool cannot be folded into the store", code="E302", why=why, fix="vsd doctor"
    )


def _read(table: TableName, path: Path) -> pa.Table:
    """Return the rows of a segment with their owners. Texts stay numbers of a dictionary until a part is written."""
    rows = with_every_column(table, read_segment(path))
    if OWNER not in rows.column_names:
        return owned_by("", rows)
    if not rows[OWNER].null_count:
        return rows
    at = rows.column_names.index(OWNER)
    return rows.set_column(at, OWNER, pc.fill_null(rows[OWNER].cast(pa.string()), "").dictionary_encode())


def _inside(rows: pa.Table, span: FoldSpan) -> pa.Table:
    """Return the rows of a segment that belong to a span: mostly all."""
    hours = _instants(rows) // HOUR_MS
    is_inside = (hours >= span.first_hour) & (hours <= span.last_hour)
    return rows if is_inside.all() else rows.filter(pa.array(is_inside))


def _texts(table: TableName) -> list[str]:
    return [column.name for column in SCHEMAS[table] if pa.types.is_string(column.type)]


def _plain(table: TableName, rows: pa.Table) -> pa.Table:
    """Return rows with texts in place of numbers of dictionaries."""
    return rows.cast(SCHEMAS[table].append(pa.field(OWNER, pa.string())))


def _doubtful(table: TableName, rows: pa.Table, known: Sequence[Path]) -> NDArray[np.bool_]:
    """Return which rows may have the key of another one, in the spool or in a known part."""
    read = ["camera_id", "ts", *TRACKS[table], *PLACES[table]]
    keys = rows.select(read)
    if known:  # pieces with one dictionary are joined first: each would be looked up again
        others = list[pa.Table]()
        for path in known:
            with pq.ParquetFile(path, read_dictionary=_texts(table)) as file:
                others.append(file.read(columns=read))
        keys = pa.concat_tables([keys.combine_chunks(), *others], promote_options="default").unify_dictionaries()
    hashes = _key_hashes(table, keys)
    fresh, stored = hashes[: rows.num_rows], hashes[rows.num_rows :]
    # half of each hash first: numbers of 32 bits are sorted in two thirds of the time, and few halves come twice
    is_shared = _are_shared(*((side >> np.uint64(32)).astype(np.uint32) for side in (fresh, stored)))
    if is_shared.any():
        is_shared[is_shared] = _are_shared(fresh[is_shared], stored)
    return is_shared


def _are_shared(fresh: NDArray[Any], stored: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which numbers come twice in `own`, or are in `stored`."""
    stored = np.sort(stored)
    in_order = np.sort(fresh)  # `numpy.unique` and `numpy.isin` hash, which takes many times as long
    others = np.concatenate([in_order[1:][in_order[1:] == in_order[:-1]], in_order[_is_in(in_order, stored)]])
    # few numbers are looked up among few: those that share their first 16 bits with one of them
    first_bits = np.array(8 * fresh.itemsize - 16, dtype=fresh.dtype)
    is_possible = np.zeros(2**16, dtype=np.bool_)
    is_possible[others >> first_bits] = True
    at = np.flatnonzero(is_possible[fresh >> first_bits])
    is_shared = np.zeros(len(fresh), dtype=np.bool_)
    is_shared[at] = _is_in(fresh[at], np.sort(others))
    return is_shared


def _is_in(hashes: NDArray[Any], in_order: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which numbers are among others, which are in order."""
    if not len(in_order):
        return np.zeros(len(hashes), dtype=np.bool_)
    at = np.minimum(np.searchsorted(in_order, hashes), len(in_order) - 1)
    is_there: NDArray[np.bool_] = in_order[at] == hashes
    return is_there


def _key_hashes(table: TableName, rows: pa.Table) -> Hashes:
    """Return a hash of the key of each row: equal for equal keys (`schema.KEYS`)."""
    hashes = np.zeros(rows.num_rows, dtype=np.uint64)
    has_no_track = np.zeros(rows.num_rows, dtype=np.bool_)
    for name in ("camera_id", "ts", *TRACKS[table]):
        if name in TRACKS[table] and rows[name].null_count:
            has_no_track |= rows[name].is_null().to_numpy()
        _mix(hashes, _numbers(rows[name]))
    if has_no_track.any():
        without = hashes[has_no_track]
        for name in PLACES[table]:
            _mix(without, _numbers(rows[name].filter(pa.array(has_no_track))))
        hashes[has_no_track] = without
    return hashes


def _mix(hashes: Hashes, numbers: Ints) -> None:
    hashes ^= numbers.view(np.uint64) * _ODD[0]
    hashes *= _ODD[1]
    hashes ^= hashes >> np.uint64(32)


def _indices(values: pa.ChunkedArray) -> pa.Array:
    """Return the numbers of a column whose pieces have one dictionary."""
    return pa.concat_arrays([piece.indices for piece in values.chunks] or [pa.array([], pa.int32())])


def _numbers(values: pa.ChunkedArray) -> Ints:
    """Return a column as integers that are equal where its values are; ids as numbers of this column alone."""
    if pa.types.is_dictionary(values.type):
        values = _indices(values)
    elif pa.types.is_timestamp(values.type):
        values = values.cast(pa.int64())
    elif pa.types.is_floating(values.type):
        known = values.fill_null(np.nan).to_numpy().astype(np.float64) + 0.0  # -0.0 equals 0.0
        known[np.isnan(known)] = np.nan
        of_floats: Ints = np.where(values.is_null().to_numpy(), _NULL, known.view(np.int64))
        return of_floats
    numbers = values.cast(pa.int64())
    return np.ascontiguousarray((numbers.fill_null(_NULL) if numbers.null_count else numbers).to_numpy())


def _compared(
    table: TableName, doubtful: pa.Table, known: Sequence[Path], noted: Sequence[Path]
) -> tuple[pa.Table, pa.Table, int]:
    """Return those of some rows that the table lacks, their repeats, and the number of second sightings."""
    import duckdb

    try:
        with connect() as con:
            return _compared_on(con, table, doubtful, known, noted)
    except duckdb.Error as error:
        raise _not_folded(error) from None


def _compared_on(
    con: duckdb.DuckDBPyConnection, table: TableName, doubtful: pa.Table, known: Sequence[Path], noted: Sequence[Path]
) -> tuple[pa.Table, pa.Table, int]:
    columns, key = ", ".join(SCHEMAS[table].names), ", ".join(KEYS[table])
    con.register("_spooled", _plain(table, doubtful))
    con.execute("create temp table spooled as select * from _spooled")
    con.execute(
        f"create temp table fresh as select distinct on ({key}) {columns}, {OWNER} from spooled "
        f"order by {key}, {columns}, {OWNER}"
    )
    (n_second,) = con.execute(
        f"select (select count(*) from (select distinct {columns} from spooled)) "
        f"- (select count(*) from (select distinct {key} from spooled))"
    ).fetchall()[0]
    if known:
        con.execute(
            f"create or replace temp table fresh as select {columns}, {OWNER} "
            f"from (select *, {key_aliases(table)} from fresh) as f "
            f"anti join (select {key_aliases(table)} from read_parquet($names)) as s on {same_key(table)}",
            {"names": [str(path) for path in known]},
        )
    brought_again(con, table, stored=known, noted=noted)
    compared = [con.sql(f"select {columns}, {OWNER} from {name}").to_arrow_table() for name in ("fresh", "again")]
    return compared[0].cast(doubtful.schema), compared[1].cast(doubtful.schema), n_second


def _in_order(table: TableName, rows: pa.Table) -> pa.Table:
    """Return the rows in the order of a part.

    Pieces are joined column by column: joining all of them first takes as much memory again.
    """
    order = _order(table, rows)
    return pa.table([_taken(c, order) for c in rows.columns], schema=rows.schema)


def _taken(values: pa.ChunkedArray, order: pa.Array) -> pa.Array:
    """Return a column in another order; one without any value, or with one, is in each order the same."""
    if values.null_count == len(values):
        return pa.nulls(len(values), values.type)
    whole = values.combine_chunks()
    is_one = pa.types.is_dictionary(whole.type) and len(whole.dictionary) == 1 and not whole.null_count
    return whole if is_one else whole.take(order)


def _order(table: TableName, rows: pa.Table) -> pa.Array:
    """Return the numbers of the rows by UTC hour and then by all columns, unknown values last."""
    order = np.arange(rows.num_rows)
    for words in _words(table, rows) if rows.num_rows else ():
        order = np.argsort(words[0], kind="stable") if len(words) == 1 else np.lexsort(words[::-1])
        if _are_different([w[order] for w in words]):
            break
    return pa.array(order)


def _words(table: TableName, rows: pa.Table) -> Iterator[list[Ints]]:
    """Yield hours and columns as integers in their order, as many packed into each as it holds: more of them each time.

    First without the track ids: mostly no two records are equal up to there, and ids would have to be sorted. Then with
    them: without missing ids, no two records are equal.
    """
    instants = _instants(rows)
    hours = instants // HOUR_MS
    packed, room = hours - hours.min(), int(hours.max() - hours.min()) + 1
    full = list[Ints]()
    ids = TRACKS[table]
    for name in rows.column_names:
        if name in ids[:1] and any(_rank(rows[c])[1] > 2 for c in rows.column_names if c.startswith("person")):
            yield [*full, packed]
        numbers, size = (instants - hours * HOUR_MS, HOUR_MS) if name == "ts" else _rank(rows[name])
        if room * size >= _ROOM:
            full.append(packed)
            packed, room = np.zeros(rows.num_rows, dtype=np.int64), 1
        packed = packed * size + numbers
        room *= size
        if name == ("ts", *ids)[-1]:
            yield [*full, packed]
    yield [*full, packed]


def _rank(values: pa.ChunkedArray) -> tuple[Ints, int]:
    if values.null_count == len(values):
        return np.zeros(len(values), dtype=np.int64), 1
    if pa.types.is_dictionary(values.type):
        coded = values.combine_chunks()
        n = len(coded.dictionary)
        rank_of = np.empty(n + 1, dtype=np.int64)
        rank_of[pc.sort_indices(coded.dictionary).to_numpy()] = np.arange(n)
        rank_of[n] = n
        return rank_of[(coded.indices.fill_null(n) if coded.null_count else coded.indices).to_numpy()], n + 1
    least, greatest = pc.min_max(values).as_py().values()
    if pa.types.is_integer(values.type) and greatest - least < _ROOM // 2:
        size = greatest - least + 1
        if values.null_count:
            values = values.cast(pa.int64()).fill_null(greatest + 1)
        return np.subtract(values.to_numpy(), least, dtype=np.int64), size + 1
    known, of_row = np.unique(values.drop_null().to_numpy(), return_inverse=True)
    ranks = np.full(len(values), len(known), dtype=np.int64)
    ranks[values.is_valid().to_numpy()] = of_row
    return ranks, len(known) + 1


def _are_different(words: Sequence[Ints]) -> bool:
    """Return whether no two neighbours are equal in all words."""
    is_new: NDArray[Any] = np.zeros(max(len(words[0]) - 1, 0), dtype=np.bool_)
    for word in words:
        is_new |= word[1:] != word[:-1]
    return bool(is_new.all())


def _instants(rows: pa.Table) -> Ints:
    instants: Ints = rows["ts"].cast(pa.int64()).to_numpy()
    return instants
