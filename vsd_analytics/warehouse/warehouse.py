"""The warehouse: facts of a range and every mart over them, as relations of one DuckDB connection."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from types import TracebackType
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from vsd_analytics.duck import connect, literal_list, one_thread
from vsd_analytics.errors import StoreError
from vsd_analytics.site import Site
from vsd_analytics.store import Store, removal
from vsd_analytics.store.layout import list_parts
from vsd_analytics.store.seals import FOLDER, Seals
from vsd_analytics.warehouse import leftovers
from vsd_analytics.warehouse.build import BuildResult, build, damaged_facts
from vsd_analytics.warehouse.dimensions import calendar, register_site, site_days
from vsd_analytics.warehouse.kept import Marts
from vsd_analytics.warehouse.sealed import OtherRules, other_rules
from vsd_analytics.warehouse.sqlfiles import relations

if TYPE_CHECKING:
    import duckdb
    import pandas as pd

AROUND_H = 25
"""Hours of facts loaded on either side of a range, so that episodes and the site days that touch it are whole."""
_GREAT = ("pairs", "distance_times", "company_times")  # facts of so many rows that few questions are worth reading them


@dataclass(frozen=True, slots=True)
class Extent:
    """What is stored.

    Attributes:
        first_day, last_day: First and last local day with records.
    """

    first_day: date
    last_day: date


def stored_extent(site: Site) -> Extent | None:
    """Return the local days with records, present or sealed, or None without any; what is spooled is folded first."""
    store = Store(site.root / "store", site_id=site.site_id)
    if store.n_spooled():
        store.fold()
    found = [h for h in (store.hours(), Seals(site.root / FOLDER, site_id=site.site_id).hours()) if h is not None]
    if not found:
        return None
    hours = (min(h[0] for h in found), max(h[1] for h in found))
    first, last = (
        datetime.fromtimestamp(h * 3600 + s, tz=site.zone).date() for h, s in ((hours[0], 0), (hours[1], 3599))
    )
    return Extent(first, last)


class Warehouse:
    """Facts and marts of a range of local days.

    Use it as a context manager: no record is removed while it is open. Every relation of `sql/facts` and `sql/marts`,
    and `calendar`, `site_days`, `cameras`, `areas`, `area_cells`, `owner_cells`, `calibrations`, `params`, can be
    queried by name.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        heat_cell_m: Side of the cells of the mart `heatmap`.
        on_plan, on_hours: Progress of the build; see `build`.
    """

    def __init__(
        self,
        site: Site,
        first: date,
        last: date,
        *,
        heat_cell_m: float = 1.0,
        on_plan: Callable[[int], None] | None = None,
        on_hours: Callable[[int], None] | None = None,
    ) -> None:
        self.site, self.first, self.last = site, first, last
        store = Store(site.root / "store", site_id=site.site_id)
        if store.n_spooled():
            store.fold()
        hours = [_utc_hour(first, site) - AROUND_H, _utc_hour(last + timedelta(days=1), site) - 1 + AROUND_H]
        self._hours = (hours[0], hours[1])
        self._reading = contextlib.ExitStack()
        self._reading.enter_context(removal.reading(store.root))
        self._reading_facts = contextlib.ExitStack()
        self._reading_facts.enter_context(leftovers.reading(site.root / "facts"))
        self.built: BuildResult = build(
            site, first_hour=hours[0], last_hour=hours[1], on_plan=on_plan, on_hours=on_hours, has_lock=True
        )
        self.con: duckdb.DuckDBPyConnection = connect()
        register_site(self.con, site, heat_cell_m=heat_cell_m)
        self.con.register("_calendar", calendar(site, first, last))
        self.con.execute("create temp table calendar as select * from _calendar")
        self.con.register("_site_days", site_days(site, first, last))
        self.con.execute("create temp table site_days as select * from _site_days")
        with one_thread(self.con):  # a fact is many small files, which threads only wait for one another to open
            self._facts(hours[0], hours[1])
        self._marts = Marts(self.con)

    def __enter__(self) -> Warehouse:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        self.con.close()
        self._reading_facts.close()
        leftovers.clear(self.site.root / "facts", self.built.leftovers)
        self._reading.close()

    def other_rules(self) -> list[OtherRules]:
        """Return the purged hours of the range that were computed by other rules than today's and stay so."""
        first, last = self._hours[0] + AROUND_H, self._hours[1] - AROUND_H
        return other_rules(self.site, self.built.sealed, first_hour=first, last_hour=last)

    def keep(self, *marts: str) -> None:
        """Compute marts once and keep their rows, before several queries read them."""
        self._marts.keep(marts)

    def table(self, query: str, values: dict[str, Any] | None = None) -> pa.Table:
        """Return a query's rows as an Arrow table; values are bound, never pasted."""
        self._marts.asked(query)
        return self.con.sql(query, params=values or None).to_arrow_table()

    def frame(self, query: str, values: dict[str, Any] | None = None) -> pd.DataFrame:
        """Return a query's rows as a pandas frame."""
        self._marts.asked(query)
        return self.con.execute(query, values or {}).df()

    def rows(self, query: str, values: dict[str, Any] | None = None) -> list[dict[str, Any]]:
        """Return a query's rows as dictionaries."""
        found: list[dict[str, Any]] = self.table(query, values).to_pylist()
        return found

    def _facts(self, first_hour: int, last_hour: int) -> None:
        """Make every fact a relation of the fresh files of the range; the great ones are read when asked."""
        import duckdb

        root, site_id, sealed = self.site.root / "facts", self.site.site_id, self.built.sealed
        for relation in relations("facts").values():
            if relation.unit == "day":
                days = self.built.day_fingerprints
                parts = list_parts(root, relation.name, site_id, first_hour=first_hour - 48, last_hour=last_hour + 48)
                fresh = [(p.hour, p.path) for p in parts if days.get(p.hour // 24) == p.digest]
            else:
                parts = list_parts(root, relation.name, site_id, first_hour=first_hour, last_hour=last_hour)
                known = self.built.fingerprints
                fresh = [(p.hour, p.path) for p in parts if known.get(p.hour) == p.digest and not sealed.holds(p.hour)]
            kept = sealed.fact_paths(self.site, relation.name)
            paths = [path for _, path in sorted([*fresh, *kept])]
            kind = "view" if relation.name in _GREAT else "table"
            rows = (
                f"read_parquet({literal_list(paths)}, hive_partitioning = false)"
                if paths
                else f"({_empty(relation.name)})"
            )
            if kept:  # facts sealed by an older version may lack a column, and have others that are gone
                every = f"read_parquet({literal_list(paths)}, union_by_name = true, hive_partitioning = false)"
                rows = f"({_empty(relation.name)} union all by name select * from {every})"
            try:
                columns = ", ".join(relation.columns) if kept else "*"
                self.con.execute(f"create temp {kind} {relation.name} as select {columns} from {rows}")
            except duckdb.OutOfMemoryException:
                raise
            except duckdb.Error as error:
                Seals(self.site.root / FOLDER, site_id=site_id).refuse_damaged(path for _, path in kept)
                raise damaged_facts(error) from None


def open_warehouse(site: Site, first: date, last: date, **options: Any) -> Warehouse:
    """Return the warehouse of a range, its facts made fresh.

    Raises:
        StoreError: E301, nothing is stored.
    """
    if stored_extent(site) is None:
        raise StoreError(
            "nothing is stored yet",
            code="E301",
            why=f"{site.root.name}/store holds no records of site {site.site_id!r}",
            mend="vsd ingest FILES...",
        )
    return Warehouse(site, first, last, **options)


def _utc_hour(day: date, site: Site) -> int:
    return int(datetime(day.year, day.month, day.day, tzinfo=site.zone).timestamp()) // 3600


def _empty(name: str) -> str:
    """Return a query with the columns of a fact and no rows."""
    columns = ", ".join(f"{_EMPTY_TYPES.get(c, 'null::bigint')} as {c}" for c in relations("facts")[name].columns)
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
