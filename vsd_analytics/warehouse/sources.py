"""Where the rows of facts and marts come from: files by hour, files by day, or a query over other relations."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.site.model import Site
from vsd_analytics.store.duck import literal_list
from vsd_analytics.store.durable import publish, sweep_temporaries
from vsd_analytics.store.seals import FOLDER as SEALED
from vsd_analytics.store.seals import Seals
from vsd_analytics.warehouse import beside
from vsd_analytics.warehouse.build import record_rows
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.day_files import DayFile, DayFiles, superseded
from vsd_analytics.warehouse.day_pieces import PIECE_BYTES, fact_sizes, pieces
from vsd_analytics.warehouse.fact_days import damaged_facts, is_whole
from vsd_analytics.warehouse.factfiles import fact_bytes, is_undamaged_file
from vsd_analytics.warehouse.relations import SECOND_READ, RelationSource
from vsd_analytics.warehouse.sqlfiles import Relation, facts_behind, marts_by_day
from vsd_analytics.warehouse.week_files import WeekFile, by_week, make_week, others_of, week_files

if TYPE_CHECKING:
    import duckdb

Day = TypeVar("Day", int, date)

_EPOCH = date(1970, 1, 1)
_FACTS_IN_FILES = ("distance_times", "company_times")
"""Facts with a row for almost every record. They stay views, so that a query reads only the columns it needs."""
_MARTS_IN_FILES = ("episodes", "cell_days", "cell_hours", "planner_cells", "distances", "pair_days", "track_days")
"""Marts with a row for every episode, cell, track or millimetre. Of most of them a report needs one week of ten, so
they stay views too, unless somebody asks for them in memory."""
HELD_BYTES = 8_000_000
"""Of the files of a mart whose rows are held in memory for several queries. Rows in memory take ten to twenty times
the room; a larger mart stays a view of its files."""

_MATERIALISE_AT = {"floor_cells": 2}
"""A page asks this large fact once, for the ends of the floor, and needs no row of it in memory for that."""


@dataclass(frozen=True, slots=True)
class _MartDays:
    """The files of a mart in the range.

    Attributes:
        relation: The mart.
        files: Day files by day.
        paths: Their paths by UTC day number.
        weeks: Week files of the range, written or not.
        single: The day files that are read, because no week file has their rows.
        unwritten: Rows of days without a file.
    """

    relation: Relation
    files: Mapping[date, DayFile]
    paths: Mapping[int, Path]
    weeks: Sequence[WeekFile]
    single: Mapping[date, DayFile]
    unwritten: dict[date, pa.Table] = field(default_factory=dict)

    def missing(self) -> set[date]:
        """Return the days whose file is not there, or torn."""
        return {d for d, file in self.single.items() if not is_whole(file.path)}


class RelationSources:
    """The sources of the relations of one range.

    Args:
        con: The connection they are for; rows that could not be written are registered on it.
        site: The project.
        built: The facts of the range.
        hours: First and last UTC hour number of these.
        days: The day files of the range; None = compute every mart from hourly facts.
        whole_facts: Computes missing and torn files of hourly facts, given the fact that is needed; called when one is
            not whole.
        rows_of_days: Yields the rows of some marts of a range of days, computed from hourly facts.
        superseded_files: List to which files are added that newer ones replace.
        asked: Names of relations that will be asked for, where that is known.
    """

    def __init__(
        self,
        con: duckdb.DuckDBPyConnection,
        site: Site,
        *,
        built: BuildResult,
        hours: tuple[int, int],
        days: DayFiles | None,
        whole_facts: Callable[[str], BuildResult],
        rows_of_days: Callable[[Sequence[Relation], date, date], Iterator[tuple[Relation, pa.Table]]],
        superseded_files: list[Path],
        asked: Collection[str] = (),
    ) -> None:
        self._con, self._site, self._built, self._hours, self._days = con, site, built, hours, days
        self._whole_facts, self._rows_of_days = whole_facts, rows_of_days
        self._read: list[Path] = []
        self._superseded = superseded_files
        self._roots = beside.roots(site)
        self._asked = tuple(asked)
        self._marts: dict[str, _MartDays] = {}

    def ahead(self, names: Iterable[str]) -> None:
        """Write the missing day files of all marts that some relations read, a few days at a time.

        Marts of the same days share what they are computed from, so they are computed together.
        """
        if self._days is None:
            return
        behind = marts_by_day([*names, *self._asked])
        new = [self._mart_days(r, self._days) for r in behind if r.name not in self._marts]
        missing = {mart.relation.name: mart.missing() for mart in new}
        if days := sorted(set().union(*missing.values())):
            sizes = fact_sizes(self._site, self._built, facts_behind(missing))
            for piece in pieces(days, sizes, most=PIECE_BYTES):
                wanted = {m.relation.name: m for m in new if not missing[m.relation.name].isdisjoint(piece)}
                of_piece = self._rows_of_days([m.relation for m in wanted.values()], piece[0], piece[-1])
                for relation, rows in of_piece:
                    mart, by = wanted[relation.name], rows[relation.stored_by]
                    own = [d for d in piece if d in missing[relation.name]]
                    by_day = ((d, rows.filter(pc.equal(by, d))) for d in own)
                    mart.unwritten.update(self._write(mart.files, by_day))
        self._marts |= {mart.relation.name: mart for mart in new}

    def of(self, relation: Relation) -> RelationSource:
        """Return where the rows of a relation come from, after writing its missing day files."""
        if relation.stored_by and self._days is not None:
            if relation.layer == "facts":
                return RelationSource(self._fact_by_days(relation, self._days), is_files=True)
            return self._mart_by_days(relation)
        if relation.layer == "marts":
            return RelationSource(relation.sql, relation.reads)
        if relation.layer == "staging":
            return RelationSource(self._of_records(relation), materialise_at=None, is_large=True)
        return RelationSource(
            self._of_hours(relation, *self._hours),
            materialise_at=None if relation.name in _FACTS_IN_FILES else _MATERIALISE_AT.get(relation.name, 1),
            is_files=True,
        )

    def refuse_damaged(self, error: Exception) -> None:
        """Raise StoreError when a file that a query read is damaged: E302, or E313 for a sealed one.

        Called after DuckDB failed. Comparing every file with its digest before each query would double the reading.
        """
        seals = Seals(self._site.root / SEALED, site_id=self._site.site_id)
        sealed = [p for p in self._read if p.is_relative_to(seals.root)]
        seals.refuse_damaged(sealed)
        if not all(is_undamaged_file(p) for p in self._read if p not in sealed):
            raise damaged_facts(error) from None

    def _of_hours(self, relation: Relation, first_hour: int, last_hour: int) -> str:
        """Return a query of the fresh and sealed rows of a fact in a range of hours."""
        is_day = relation.unit == "day"
        # The file of a day begins with its first hour. `camera_days` is read of the days beside those of the range too.
        first, last = (first_hour - 48, last_hour + 48) if is_day else (first_hour - 23, last_hour)
        sealed = [
            (h, path)
            for h, path in self._built.sealed.fact_paths(self._site, relation.name)
            if (first if is_day else first_hour) <= h <= last
        ]

        def fresh_files(built: BuildResult) -> dict[int, Path]:
            return {d: path for d, path in built.paths.get(relation.name, {}).items() if first <= d * 24 <= last}

        fresh = fresh_files(self._built)
        sealed_days = {h // 24 for h, _ in sealed}
        weeks = self._weeks(relation, {d: path for d, path in fresh.items() if d not in sealed_days})
        if not is_day and not all(map(is_whole, by_week(weeks, fresh).values())):
            fresh = fresh_files(self._whole_facts(relation.name))
        self._make(weeks)
        is_cut = not is_day and any(d * 24 < first_hour or d * 24 + 23 > last_hour for d in fresh)
        files = [(d * 24, path) for d, path in by_week(weeks, fresh).items()]
        paths = [path for _, path in sorted([*files, *sealed])]
        self._read += paths
        if not paths:
            return _empty(relation)
        within = f" where hour between {first_hour:d} and {last_hour:d}" if is_cut else ""
        if not sealed:
            return f"select * from read_parquet({literal_list(paths)}, hive_partitioning = false){within}"
        # Facts sealed by an older version may lack a column of today or have one that no longer exists.
        every = f"read_parquet({literal_list(paths)}, union_by_name = true, hive_partitioning = false)"
        columns = ", ".join(relation.columns)
        return f"select {columns} from ({_empty(relation)} union all by name select * from {every}){within}"

    def _of_records(self, relation: Relation) -> str:
        """Return a query of the rows of one of `RECORD_RELATIONS`, after computing them into a table of their own."""
        first, last = self._hours
        name = f"_of_records_{relation.name}"
        self._con.execute(f"create temp table {name} as {_empty(relation)}")
        for rows in record_rows(self._site, relation.name, first_hour=first, last_hour=last):
            self._con.register("_computed", rows)
            self._con.execute(f"insert into {name} select * from _computed")
            self._con.unregister("_computed")
        return f"select * from {name}"

    def _fact_by_days(self, relation: Relation, days: DayFiles) -> str:
        """Return a query of the rows of a fact: UTC days with sealed hours from day files, the others as they are."""
        first, last = self._hours
        files = days.sealed_files(relation, first_hour=first, last_hour=last)
        missing = [d for d, file in files.items() if not is_whole(file.path)]
        rows = ((d, self._con.sql(self._of_hours(relation, d * 24, d * 24 + 23)).to_arrow_table()) for d in missing)
        unwritten = self._write(files, rows)
        # An older file beside one that could not be written is superseded by nothing and stays.
        self._superseded += superseded(f for d, f in files.items() if d not in unwritten)
        read: list[str | Path | pa.Table] = []
        for d, file in files.items():
            if first < d * 24:
                read.append(self._of_hours(relation, first, d * 24 - 1))
            read.append(unwritten.get(d, file.path))
            first = d * 24 + 24
        if first <= last:
            read.append(self._of_hours(relation, first, last))
        return self._in_order(relation, read)

    def _mart_by_days(self, relation: Relation) -> RelationSource:
        """Return the rows of a mart: each day from its file, or from that of its week."""
        self.ahead([relation.name])
        mart = self._marts[relation.name]
        self._superseded += superseded(f for d, f in mart.single.items() if d not in mart.unwritten)
        self._make(mart.weeks)
        read: dict[int, Path | pa.Table] = {**by_week(mart.weeks, mart.paths)}
        read |= {_number(d): rows for d, rows in mart.unwritten.items()}
        pieces = [piece for _, piece in sorted(read.items(), key=itemgetter(0))]
        n_bytes = sum(p.stat().st_size for p in pieces if isinstance(p, Path))
        is_large = n_bytes > HELD_BYTES
        materialise_at = None if is_large or relation.name in _MARTS_IN_FILES else SECOND_READ
        query = self._in_order(relation, pieces)
        return RelationSource(query, materialise_at=materialise_at, is_files=True, is_large=is_large)

    def _mart_days(self, relation: Relation, days: DayFiles) -> _MartDays:
        files = days.files(relation)
        paths = {_number(d): file.path for d, file in files.items()}
        weeks = self._weeks(relation, {_number(d): file.path for d, file in files.items() if file.is_stored})
        read = by_week(weeks, paths)
        single = {d: file for d, file in files.items() if read.get(_number(d)) == file.path}
        return _MartDays(relation, files, paths, weeks, single)

    def _weeks(self, relation: Relation, paths: Mapping[int, Path]) -> list[WeekFile]:
        """Return the week files of a relation; none for a warehouse that computes the rows of days."""
        if self._days is None:
            return []
        root = beside.days_folder(self._site).parent if relation.layer == "marts" else self._roots[relation.name]
        return week_files(root, relation.name, self._site.site_id, paths)

    def _make(self, weeks: Iterable[WeekFile]) -> None:
        """Write the week files that are missing, and note what each replaces, also if its writer was killed."""
        for week in weeks:
            if make_week(week):
                self._superseded += others_of(week.path)

    def _write(self, files: Mapping[Day, DayFile], rows_by_day: Iterable[tuple[Day, pa.Table]]) -> dict[Day, pa.Table]:
        """Write day files, and return the rows that were not written.

        Not written are rows of days far from all facts, and all that a full or read-only disk refuses: a report then
        costs more time, but has every figure.
        """
        unwritten: dict[Day, pa.Table] = {}
        for day, rows in rows_by_day:
            file = files[day]
            if not file.is_stored:
                unwritten[day] = rows
                continue
            try:
                publish(file.path, fact_bytes(rows, inputs=file.inputs), is_synced=False)
                sweep_temporaries(file.path.parent)
            except OSError:
                unwritten[day] = rows
        return unwritten

    def _in_order(self, relation: Relation, pieces: Sequence[str | Path | pa.Table]) -> str:
        """Return a query of the rows of queries, files and tables, in the order given."""
        queries: list[str] = []
        for _, run in groupby(pieces, key=type):
            same = list(run)
            queries += [p for p in same if isinstance(p, str)]
            if paths := [p for p in same if isinstance(p, Path)]:
                self._read += paths
                queries.append(f"select * from read_parquet({literal_list(paths)}, hive_partitioning = false)")
            if tables := [p for p in same if isinstance(p, pa.Table)]:
                name = f"_unwritten_{relation.name}_{len(queries)}"
                self._con.register(name, pa.concat_tables(tables))
                queries.append(f"select * from {name}")
        return " union all ".join(queries) or _empty(relation)


def _number(day: date) -> int:
    return (day - _EPOCH).days


def _empty(relation: Relation) -> str:
    """Return a query with the columns of a fact and no rows."""
    columns = ", ".join(f"{_EMPTY_TYPES.get(c, 'null::bigint')} as {c}" for c in relation.columns)
    return f"select {columns} where false"


_TYPED = {
    "varchar": "camera_id calibration_id floor_id area_id track_a track_b track_id other_camera_id other_track_a "
    "other_track_b company",
    "boolean": "is_inferred is_owned is_entry_owned is_exit_owned is_derived open_left open_right has_heartbeat "
    "has_persons has_tracks sends_pairs",
    "integer": "cx cy n_ends x_mm y_mm x_a_mm y_a_mm x_b_mm y_b_mm distance_mm min_distance_mm first_x_mm first_y_mm "
    "last_x_mm last_y_mm",
}
_EMPTY_TYPES = {column: f"null::{kind}" for kind, columns in _TYPED.items() for column in columns.split()}
"""Columns of facts that are no bigint. Rows of days without facts have the types of all others: day files are read
together."""
