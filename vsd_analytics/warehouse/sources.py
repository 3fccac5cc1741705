"""Where the rows of facts and marts come from: files of hours, files of days, or a query over other relations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date, timedelta
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.duck import literal_list
from vsd_analytics.site import Site
from vsd_analytics.store.durable import publish, sweep_temporaries
from vsd_analytics.store.layout import list_parts
from vsd_analytics.store.seals import FOLDER as SEALED
from vsd_analytics.store.seals import Seals
from vsd_analytics.warehouse.build import BuildResult, damaged_facts, is_whole
from vsd_analytics.warehouse.catalog import Source
from vsd_analytics.warehouse.days import DayFile, Days
from vsd_analytics.warehouse.factfiles import fact_bytes, is_undamaged_file
from vsd_analytics.warehouse.sqlfiles import Relation

if TYPE_CHECKING:
    import duckdb

Day = TypeVar("Day", int, date)

_GREAT = ("pairs", "distance_times", "company_times")  # facts of so many rows that few questions are worth reading them


class Sources:
    """The sources of the relations of one range.

    Args:
        con: The connection they are for; rows that could not be written are registered on it.
        site: The project.
        built: Its facts of the range.
        hours: First and last UTC hour number of these.
        days: The day files of the range; None = every mart is computed from hourly facts.
        whole_facts: Makes files of hourly facts anew that are torn; called when one is.
        rows_of_days: Gives the rows of a mart of a range of days, computed from hourly facts.
    """

    def __init__(
        self,
        con: duckdb.DuckDBPyConnection,
        site: Site,
        *,
        built: BuildResult,
        hours: tuple[int, int],
        days: Days | None,
        whole_facts: Callable[[], None],
        rows_of_days: Callable[[Relation, date, date], pa.Table],
    ) -> None:
        self._con, self._site, self._built, self._hours, self._days = con, site, built, hours, days
        self._whole_facts, self._rows_of_days = whole_facts, rows_of_days
        self._read: list[Path] = []
        self.leftovers: list[Path] = []

    def of(self, relation: Relation) -> Source:
        """Return where the rows of a relation come from, its files made where they are lacking."""
        if relation.kept and self._days is not None:
            make = self._kept_fact if relation.layer == "facts" else self._kept_mart
            return Source(make(relation, self._days), is_files=True)
        if relation.layer == "marts":
            return Source(relation.sql, relation.reads)
        return Source(
            self._of_hours(relation, *self._hours),
            keep_after=None if relation.name in _GREAT else 1,
            is_files=True,
        )

    def refuse_damaged(self, error: Exception) -> None:
        """Raise StoreError when a file that was to be read is damaged: E302, or E313 for a sealed one."""
        seals = Seals(self._site.root / SEALED, site_id=self._site.site_id)
        sealed = [p for p in self._read if p.is_relative_to(seals.root)]
        seals.refuse_damaged(sealed)
        if not all(is_undamaged_file(p) for p in self._read if p not in sealed):
            raise damaged_facts(error) from None

    def _of_hours(self, relation: Relation, first_hour: int, last_hour: int) -> str:
        """Return a query of the fresh and sealed rows of a fact in a range of hours."""
        root, site_id, sealed = self._site.root / "facts", self._site.site_id, self._built.sealed
        if relation.unit == "day":
            first_hour, last_hour = first_hour - 48, last_hour + 48
            known = {d * 24: f for d, f in self._built.day_fingerprints.items()}
            parts = list_parts(root, relation.name, site_id, first_hour=first_hour, last_hour=last_hour)
            fresh = [(p.hour, p.path) for p in parts if known.get(p.hour) == p.digest]
        else:
            known = dict(self._built.fingerprints)
            parts = list_parts(root, relation.name, site_id, first_hour=first_hour, last_hour=last_hour)
            fresh = [(p.hour, p.path) for p in parts if known.get(p.hour) == p.digest and not sealed.holds(p.hour)]
            if not all(is_whole(path) for _, path in fresh):
                self._whole_facts()
        kept = [(h, p) for h, p in sealed.fact_paths(self._site, relation.name) if first_hour <= h <= last_hour]
        paths = [path for _, path in sorted([*fresh, *kept])]
        self._read += paths
        if not paths:
            return _empty(relation)
        if not kept:
            return f"select * from read_parquet({literal_list(paths)}, hive_partitioning = false)"
        # facts sealed by an older version may lack a column, and have others that are gone
        every = f"read_parquet({literal_list(paths)}, union_by_name = true, hive_partitioning = false)"
        return f"select {', '.join(relation.columns)} from ({_empty(relation)} union all by name select * from {every})"

    def _kept_fact(self, relation: Relation, days: Days) -> str:
        """Return a query of the rows of a fact: whole UTC days by their files, the hours beside them by theirs."""
        first, last = self._hours
        files = days.utc_files(relation, first_hour=first, last_hour=last)
        lacking = [d for d, file in files.items() if not is_whole(file.path)]
        made = ((d, self._con.sql(self._of_hours(relation, d * 24, d * 24 + 23)).to_arrow_table()) for d in lacking)
        rest = self._write(relation, files, made)
        before, after = _edges(first, last)
        return self._in_order(
            relation,
            [
                *([self._of_hours(relation, *before)] if before else ()),
                *(rest.get(d, file.path) for d, file in files.items()),
                *([self._of_hours(relation, *after)] if after else ()),
            ],
        )

    def _kept_mart(self, relation: Relation, days: Days) -> str:
        """Return a query of the rows of a mart: those of each day by its file."""
        files = days.files(relation)
        rest: dict[date, pa.Table] = {}
        for run in _runs([d for d, file in files.items() if not is_whole(file.path)]):
            rows = self._rows_of_days(relation, run[0], run[-1])
            rest |= self._write(relation, files, ((d, rows.filter(pc.equal(rows[relation.kept], d))) for d in run))
        return self._in_order(relation, [rest.get(d, file.path) for d, file in files.items()])

    def _write(
        self, relation: Relation, files: Mapping[Day, DayFile], made: Iterable[tuple[Day, pa.Table]]
    ) -> dict[Day, pa.Table]:
        """Write the rows of days; return those that the disk did not take."""
        refused: dict[Day, pa.Table] = {}
        for day, rows in made:
            file = files[day]
            try:
                publish(file.path, fact_bytes(rows, causes=file.causes), is_synced=False)
                sweep_temporaries(file.path.parent)
            except OSError:
                refused[day] = rows
            else:
                self.leftovers += [p for p in file.path.parent.glob("*.parquet") if p != file.path]
        return refused

    def _in_order(self, relation: Relation, pieces: Sequence[str | Path | pa.Table]) -> str:
        """Return a query of the rows of queries, files and tables, one after the other."""
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


def _edges(first: int, last: int) -> tuple[tuple[int, int] | None, tuple[int, int] | None]:
    """Return the hours at the two ends of [first, last] that are not of UTC days that lie whole in it."""
    low, high = -(-first // 24) * 24, (last + 1) // 24 * 24
    if low >= high:
        return (first, last), None
    return (first, low - 1) if first < low else None, (high, last) if high <= last else None


def _runs(days: Sequence[date]) -> list[list[date]]:
    """Return runs of days that follow each other."""
    found: list[list[date]] = []
    for day in days:
        if found and day - found[-1][-1] == timedelta(days=1):
            found[-1].append(day)
        else:
            found.append([day])
    return found


def _empty(relation: Relation) -> str:
    """Return a query with the columns of a fact and no rows."""
    columns = ", ".join(f"{_EMPTY_TYPES.get(c, 'null::bigint')} as {c}" for c in relation.columns)
    return f"select {columns} where false"


_EMPTY_TYPES = {
    "camera_id": "null::varchar",
    "calibration_id": "null::varchar",
    "track_a": "null::varchar",
    "track_b": "null::varchar",
    "track_id": "null::varchar",
    "other_camera_id": "null::varchar",
    "other_track_a": "null::varchar",
    "other_track_b": "null::varchar",
    "company": "null::varchar",
    "is_inferred": "null::boolean",
    "is_owned": "null::boolean",
    "is_derived": "null::boolean",
    "open_left": "null::boolean",
    "open_right": "null::boolean",
    "has_heartbeat": "null::boolean",
    "has_persons": "null::boolean",
    "has_tracks": "null::boolean",
    "sends_pairs": "null::boolean",
}
