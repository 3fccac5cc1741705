"""Where the rows of facts and marts come from: files by hour, files by day, or a query over other relations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import date, timedelta
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
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.day_files import DayFile, DayFiles, superseded
from vsd_analytics.warehouse.fact_days import damaged_facts, is_whole
from vsd_analytics.warehouse.factfiles import fact_bytes, is_undamaged_file
from vsd_analytics.warehouse.relations import RelationSource
from vsd_analytics.warehouse.sqlfiles import Relation
from vsd_analytics.warehouse.week_files import WeekFile, by_week, make_week, others_of, week_files

if TYPE_CHECKING:
    import duckdb

Day = TypeVar("Day", int, date)

_EPOCH = date(1970, 1, 1)
_NEVER_IN_MEMORY = ("pairs", "distance_times", "company_times")
"""Facts with a row for almost every record. They stay views, so that a query reads only the columns it needs."""

_MATERIALISE_AT = {"floor_cells": 2}
"""A page asks this large fact once, for the ends of the floor, and needs no row of it in memory for that."""


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
        rows_of_days: Returns the rows of a mart of a range of days, computed from hourly facts.
        superseded_files: List to which files are added that newer ones replace.
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
        rows_of_days: Callable[[Relation, date, date], pa.Table],
        superseded_files: list[Path],
    ) -> None:
        self._con, self._site, self._built, self._hours, self._days = con, site, built, hours, days
        self._whole_facts, self._rows_of_days = whole_facts, rows_of_days
        self._read: list[Path] = []
        self._superseded = superseded_files
        self._roots = beside.roots(site)

    def of(self, relation: Relation) -> RelationSource:
        """Return where the rows of a relation come from, after writing its missing day files."""
        if relation.stored_by and self._days is not None:
            query = self._fact_by_days if relation.layer == "facts" else self._mart_by_days
            return RelationSource(query(relation, self._days), is_files=True)
        if relation.layer == "marts":
            return RelationSource(relation.sql, relation.reads)
        return RelationSource(
            self._of_hours(relation, *self._hours),
            materialise_at=None if relation.name in _NEVER_IN_MEMORY else _MATERIALISE_AT.get(relation.name, 1),
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
            return {d: path for d, path in built.paths[relation.name].items() if first <= d * 24 <= last}

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

    def _fact_by_days(self, relation: Relation, days: DayFiles) -> str:
        """Return a query of the rows of a fact: UTC days with sealed hours from day files, the others as they are."""
        first, last = self._hours
        files = days.sealed_files(relation, first_hour=first, last_hour=last)
        missing = [d for d, file in files.items() if not is_whole(file.path)]
        rows = ((d, self._con.sql(self._of_hours(relation, d * 24, d * 24 + 23)).to_arrow_table()) for d in missing)
        unwritten = self._write(files, rows)
        pieces: list[str | Path | pa.Table] = []
        for d, file in files.items():
            if first < d * 24:
                pieces.append(self._of_hours(relation, first, d * 24 - 1))
            pieces.append(unwritten.get(d, file.path))
            first = d * 24 + 24
        if first <= last:
            pieces.append(self._of_hours(relation, first, last))
        return self._in_order(relation, pieces)

    def _mart_by_days(self, relation: Relation, days: DayFiles) -> str:
        """Return a query of the rows of a mart: each day from its file, computing runs of missing days at once."""
        files = days.files(relation)
        paths = {_number(d): file.path for d, file in files.items()}
        weeks = self._weeks(relation, {_number(d): file.path for d, file in files.items() if file.is_stored})
        read = by_week(weeks, paths)
        single = {d: file for d, file in files.items() if read.get(_number(d)) == file.path}
        missing = _runs([d for d, file in single.items() if not is_whole(file.path)])

        def rows_by_day() -> Iterator[tuple[date, pa.Table]]:
            for run in missing:
                rows = self._rows_of_days(relation, run[0], run[-1])
                yield from ((d, rows.filter(pc.equal(rows[relation.stored_by], d))) for d in run)

        unwritten = self._write(single, rows_by_day())
        self._make(weeks)
        pieces: dict[int, Path | pa.Table] = {**by_week(weeks, paths), **{_number(d): t for d, t in unwritten.items()}}
        return self._in_order(relation, [piece for _, piece in sorted(pieces.items(), key=itemgetter(0))])

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
        """Write day files, note what they supersede, and return the rows that were not written.

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
        # An older file beside one that could not be written is superseded by nothing and stays.
        self._superseded += superseded(f for d, f in files.items() if d not in unwritten)
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


def _runs(days: Sequence[date]) -> list[list[date]]:
    """Return the runs of consecutive days."""
    found: list[list[date]] = []
    for day in days:
        if found and day - found[-1][-1] == timedelta(days=1):
            found[-1].append(day)
        else:
            found.append([day])
    return found


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
    "integer": "cx cy n_ends x_a_mm y_a_mm x_b_mm y_b_mm distance_mm min_distance_mm first_x_mm first_y_mm last_x_mm "
    "last_y_mm",
}
_EMPTY_TYPES = {column: f"null::{kind}" for kind, columns in _TYPED.items() for column in columns.split()}
"""Columns of facts that are no bigint. Rows of days without facts have the types of all others: day files are read
together."""
