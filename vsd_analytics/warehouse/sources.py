"""Where the rows of facts and marts come from: files of facts, files by week, or a query over other relations."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from vsd_analytics.site.model import Site
from vsd_analytics.store.duck import literal_list
from vsd_analytics.store.durable import publish, sweep_temporaries
from vsd_analytics.store.seals import FOLDER as SEALED
from vsd_analytics.store.seals import Seals
from vsd_analytics.warehouse import settings_variants
from vsd_analytics.warehouse.build import record_rows
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.day_files import SITE_DAY, DayFile, DayFiles
from vsd_analytics.warehouse.day_pieces import PIECE_BYTES, fact_sizes, pieces
from vsd_analytics.warehouse.fact_weeks import days_besides
from vsd_analytics.warehouse.factfiles import damaged_facts, fact_bytes, is_undamaged_file, is_whole
from vsd_analytics.warehouse.relations import SECOND_READ, RelationSource
from vsd_analytics.warehouse.sqlfiles import Relation, facts_behind, marts_by_day
from vsd_analytics.warehouse.week_files import DAYS, WeekFile, others_of

if TYPE_CHECKING:
    import duckdb

_FACTS_IN_FILES = ("distance_times", "company_times", "floor_cells", "cell_tracks", "episode_cells", "track_lives")
"""Facts with a row for almost every record or track. They stay views: a query reads only the columns it needs."""
_MARTS_IN_FILES = (
    *("episodes", "cell_days", "cell_hours", "square_hours", "planner_cells", "distances", "pair_days", "track_days"),
)
"""Marts with a row for every episode, cell, track or millimetre. Of most of them a report needs one week of ten, so
they stay views too, unless somebody asks for them in memory."""
HELD_BYTES = 8_000_000
"""Of the files of a mart whose rows are held in memory for several queries. Rows in memory take ten to twenty times
the room; a larger mart stays a view of its files."""

_FORMERLY_IN = {"cell_tracks": "floor_cells"}
"""Facts that were a column of another fact before: hours that were sealed then have them in its files."""


@dataclass(frozen=True, slots=True)
class _Absent:
    """A week of a mart that has no file.

    Attributes:
        relation: The mart.
        week: The week.
        older: Days whose rows older files have.
        missing: All other days.
    """

    relation: Relation
    week: WeekFile
    older: Mapping[Path, Sequence[date]]
    missing: frozenset[date]

    @classmethod
    def of(cls, relation: Relation, week: WeekFile) -> _Absent:
        older = week.older()
        return cls(relation, week, older, frozenset(week.inputs).difference(*older.values()))

    def add(self, days: Sequence[date], rows: pa.Table) -> None:
        """Take the computed rows of some days; the last of them write the file."""
        column = self.relation.stored_by
        if min(self.missing) in days:
            self.week.reuse(self.older, column)
        for day in sorted(self.missing.intersection(days)):
            self.week.take(rows, [day], column)
            if self.week.is_stored:
                self.week.encode()
        if self.week.is_stored and max(self.missing) in days:
            self.week.write(column)


class RelationSources:
    """The sources of the relations of one range.

    Args:
        con: The connection they are for; rows that could not be written are registered on it.
        site: The project.
        built: The facts of the range.
        hours: First and last UTC hour number of these.
        days: The files of marts of the range; None = compute every mart from hourly facts.
        whole_facts: Computes missing and torn files of hourly facts, given the fact that is needed; called when one is
            not whole.
        rows_of_days: Yields the rows of some marts of a range of days with these days, computed from hourly facts: of
            each mart days in order, all or one after the other.
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
        rows_of_days: Callable[[Sequence[Relation], date, date], Iterator[tuple[Relation, Sequence[date], pa.Table]]],
        superseded_files: list[Path],
        asked: Collection[str] = (),
    ) -> None:
        self._con, self._site, self._built, self._hours, self._days = con, site, built, hours, days
        self._whole_facts, self._rows_of_days = whole_facts, rows_of_days
        self._read: list[Path] = []
        self._superseded = superseded_files
        self._roots = settings_variants.roots(site)
        self._asked = tuple(asked)
        self._marts: dict[str, list[WeekFile]] = {}

    def prefetch(self, names: Iterable[str]) -> None:
        """Write the missing week files of all marts that some relations read, a few days at a time.

        Marts of the same days share what they are computed from, so they are computed together.
        """
        if self._days is None:
            return
        new = {r.name: r for r in marts_by_day([*names, *self._asked]) if r.name not in self._marts}
        weeks = {name: self._days.weeks(relation) for name, relation in new.items()}
        absent = [
            _Absent.of(new[n], week)
            for n, week_files in weeks.items()
            for week in week_files
            if not is_whole(week.path)
        ]
        if days := sorted(set[date]().union(*(a.missing for a in absent))):
            behind = facts_behind({a.relation.name for a in absent if a.missing})
            sizes = fact_sizes(self._site, self._built, behind.difference(_FACTS_IN_FILES))
            for piece in pieces(days, sizes, most=PIECE_BYTES):
                wanted = {a.relation.name: a.relation for a in absent if not a.missing.isdisjoint(piece)}
                for relation, days_of, rows in self._rows_of_days([*wanted.values()], piece[0], piece[-1]):
                    for a in absent:
                        if a.relation is relation and not a.missing.isdisjoint(days_of):
                            a.add(days_of, rows)
        for a in absent:
            if not a.missing:
                a.week.reuse(a.older, a.relation.stored_by)
        self._superseded += [
            o for week_files in weeks.values() for w in week_files if not w.rows for o in others_of(w.path)
        ]
        self._marts |= weeks

    def of(self, relation: Relation) -> RelationSource:
        """Return where the rows of a relation come from, after writing its missing files."""
        if relation.stored_by and self._days is not None:
            if relation.layer == "facts":
                return RelationSource(self._fact_by_days(relation, self._days), is_files=True)
            return self._mart_by_weeks(relation)
        if relation.layer == "marts":
            return RelationSource(relation.sql, relation.reads)
        if relation.layer == "staging":
            return RelationSource(self._of_records(relation), materialise_at=None, is_large=True)
        return RelationSource(
            self._of_hours(relation, *self._hours),
            materialise_at=None if relation.name in _FACTS_IN_FILES else 1,
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
        sealed = self._built.sealed.fact_paths(
            self._site,
            relation.name,
            first_hour=first if is_day else first_hour,
            last_hour=last,
            formerly_in=_FORMERLY_IN.get(relation.name, ""),
        )

        def fresh_files(built: BuildResult) -> dict[int, Path]:
            return {d: path for d, path in built.paths.get(relation.name, {}).items() if first <= d * 24 <= last}

        fresh = fresh_files(self._built)
        if not is_day and not all(map(is_whole, set(fresh.values()))):
            fresh = fresh_files(self._whole_facts(relation.name))
        files = {path: d * 24 for d, path in sorted(fresh.items(), reverse=True)}  # a week's by the first of its days
        others = {d for path in files for d in days_besides(path, fresh)}
        paths = [path for _, path in sorted([*((h, path) for path, h in files.items()), *sealed])]
        self._read += paths
        if not paths:
            return _empty(relation)
        of_days = {*fresh, *(h // 24 for h, _ in sealed)}
        within = ""
        if is_day and others:
            within = f" where utc_day not in ({', '.join(map(str, sorted(others)))})"
        elif not is_day and (others or any(d * 24 < first_hour or d * 24 + 23 > last_hour for d in of_days)):
            within = f" where hour between {first_hour:d} and {last_hour:d}"
            if gone := [str(d) for d in sorted(others) if first_hour <= d * 24 and d * 24 + 23 <= last_hour]:
                within += f" and hour // 24 not in ({', '.join(gone)})"
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
        """Return a query of the rows of a fact, those of days whose hours were sealed each alone from day files."""
        first, last = self._hours
        files = days.sealed_files(relation, first_hour=first, last_hour=last)
        missing = [d for d, file in files.items() if not is_whole(file.path)]
        rows = ((d, self._con.sql(self._of_hours(relation, d * 24, d * 24 + 23)).to_arrow_table()) for d in missing)
        unwritten = self._write(files, rows)
        # An older file beside one that could not be written is superseded by nothing and stays.
        self._superseded += [o for d, f in files.items() if d not in unwritten for o in others_of(f.path)]
        read: list[str | Path | pa.Table] = []
        for d, file in files.items():
            if first < d * 24:
                read.append(self._of_hours(relation, first, d * 24 - 1))
            read.append(unwritten.get(d, file.path))
            first = d * 24 + 24
        if first <= last:
            read.append(self._of_hours(relation, first, last))
        return self._in_order(relation, read)

    def _mart_by_weeks(self, relation: Relation) -> RelationSource:
        """Return the rows of a mart: of each week from its file, or as they were computed."""
        self.prefetch([relation.name])
        weeks = self._marts[relation.name]
        paths = [week.path for week in weeks if not week.rows]
        mondays = {week.monday for week in weeks}
        firsts = [m for m in sorted(mondays) if m - timedelta(days=DAYS) not in mondays]
        pieces: list[Path | pa.Table] = []
        for week in weeks:
            own = [d for d in week.rows if d >= week.monday or week.monday in firsts]
            pieces += [week.rows[d] for d in sorted(own)] or [week.path]
        # the Sunday before a week is read with the week before it
        in_first = ", ".join(f"date '{monday}'" for monday in firsts)
        is_own = f"site_day >= date or date in ({in_first})" if relation.stored_by == SITE_DAY else ""
        is_large = sum(path.stat().st_size for path in paths) > HELD_BYTES
        materialise_at = None if is_large or relation.name in _MARTS_IN_FILES else SECOND_READ
        query = self._in_order(relation, pieces, is_own)
        return RelationSource(query, materialise_at=materialise_at, is_files=True, is_large=is_large)

    def _write(self, files: Mapping[int, DayFile], rows_by_day: Iterable[tuple[int, pa.Table]]) -> dict[int, pa.Table]:
        """Write day files, and return the rows that a full or read-only disk refuses."""
        unwritten: dict[int, pa.Table] = {}
        for day, rows in rows_by_day:
            file = files[day]
            try:
                publish(file.path, fact_bytes(rows, inputs=file.inputs), is_synced=False)
                sweep_temporaries(file.path.parent)
            except OSError:
                unwritten[day] = rows
        return unwritten

    def _in_order(self, relation: Relation, pieces: Sequence[str | Path | pa.Table], where: str = "") -> str:
        """Return a query of the rows of queries, files and tables, in the order given.

        Args:
            relation: The relation.
            pieces: What is read.
            where: Condition for rows of files, in which `date` is that of their folder; empty = all rows.
        """
        queries: list[str] = []
        columns = ", ".join(relation.columns)
        for _, run in groupby(pieces, key=type):
            same = list(run)
            queries += [p for p in same if isinstance(p, str)]
            if paths := [p for p in same if isinstance(p, Path)]:
                self._read += paths
                rows = f"read_parquet({literal_list(paths)}, hive_partitioning = {bool(where)})"
                queries.append(f"select {columns} from {rows} where {where}" if where else f"select * from {rows}")
            if tables := [p for p in same if isinstance(p, pa.Table)]:
                name = f"_unwritten_{relation.name}_{len(queries)}"
                self._con.register(name, pa.concat_tables(tables))
                queries.append(f"select * from {name}")
        return " union all ".join(queries) or _empty(relation)


def _empty(relation: Relation) -> str:
    """Return a query with the columns of a fact and no rows."""
    columns = ", ".join(f"{_EMPTY_TYPES.get(c, 'null::bigint')} as {c}" for c in relation.columns)
    return f"select {columns} where false"


_TYPED = {
    "varchar": "camera_id calibration_id floor_id area_id line_id track_a track_b track_id other_camera_id "
    "other_track_a other_track_b company group_id",
    "boolean": "is_inferred is_owned is_entry_owned is_exit_owned is_derived open_left open_right has_heartbeat "
    "has_persons has_tracks sends_pairs is_standing is_to_left",
    "integer": "cx cy n_ends x_mm y_mm x_a_mm y_a_mm x_b_mm y_b_mm distance_mm min_distance_mm first_x_mm first_y_mm "
    "last_x_mm last_y_mm",
}
_EMPTY_TYPES = {column: f"null::{kind}" for kind, columns in _TYPED.items() for column in columns.split()}
"""Columns of facts that are no bigint. Rows of days without facts have the types of all others: files are read
together."""
