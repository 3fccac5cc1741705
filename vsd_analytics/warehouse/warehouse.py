"""The warehouse: facts of a range and every mart over them, as relations of one DuckDB connection."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from types import TracebackType
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from vsd_analytics.duck import connect
from vsd_analytics.errors import StoreError
from vsd_analytics.site import Site
from vsd_analytics.store import Store, removal
from vsd_analytics.store.seals import FOLDER, Seals
from vsd_analytics.warehouse import leftovers
from vsd_analytics.warehouse.build import BuildResult, build
from vsd_analytics.warehouse.catalog import Catalog
from vsd_analytics.warehouse.days import AROUND_H, Days
from vsd_analytics.warehouse.dimensions import calendar, register_site, site_days
from vsd_analytics.warehouse.sealed import OtherRules, other_rules
from vsd_analytics.warehouse.sources import Sources
from vsd_analytics.warehouse.sqlfiles import Relation

if TYPE_CHECKING:
    import duckdb
    import pandas as pd


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
        uses_days: Marts are read from day files, and written to such where they are lacking (`days`); False = they are
            computed from hourly facts.
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
        uses_days: bool = True,
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
            site,
            first_hour=hours[0],
            last_hour=hours[1],
            on_plan=on_plan,
            on_hours=on_hours,
            has_lock=True,
            is_trusting=uses_days,
        )
        self._of_days: dict[tuple[date, date], Warehouse] = {}
        self.con: duckdb.DuckDBPyConnection = connect()
        register_site(self.con, site, heat_cell_m=heat_cell_m)
        self.con.register("_calendar", calendar(site, first, last))
        self.con.execute("create temp table calendar as select * from _calendar")
        self.con.register("_site_days", site_days(site, first, last))
        self.con.execute("create temp table site_days as select * from _site_days")
        self._sources = Sources(
            self.con,
            site,
            built=self.built,
            hours=self._hours,
            days=Days(site, self.built, first=first, last=last) if uses_days else None,
            whole_facts=self._whole_facts,
            rows_of_days=self._rows_of_days,
        )
        self._catalog = Catalog(self.con, self._sources.of)

    def __enter__(self) -> Warehouse:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        self.con.close()
        for inner in self._of_days.values():
            inner.__exit__(kind, value, tb)
        self._reading_facts.close()
        leftovers.clear(self.site.root / "facts", [*self.built.leftovers, *self._sources.leftovers])
        self._reading.close()

    def other_rules(self) -> list[OtherRules]:
        """Return the purged hours of the range that were computed by other rules than today's and stay so."""
        first, last = self._hours[0] + AROUND_H, self._hours[1] - AROUND_H
        return other_rules(self.site, self.built.sealed, first_hour=first, last_hour=last)

    def keep(self, *names: str) -> None:
        """Compute facts and marts once and keep their rows, before several queries read them."""
        with self.telling_damage():
            self._catalog.keep(names)

    def prepare(self, query: str) -> None:
        """Make the facts and marts that a query names; the methods below do it themselves."""
        with self.telling_damage():
            self._catalog.asked(query)

    def table(self, query: str, values: dict[str, Any] | None = None) -> pa.Table:
        """Return a query's rows as an Arrow table; values are bound, never pasted."""
        with self.telling_damage():
            self._catalog.asked(query)
            return self.con.sql(query, params=values or None).to_arrow_table()

    def frame(self, query: str, values: dict[str, Any] | None = None) -> pd.DataFrame:
        """Return a query's rows as a pandas frame."""
        with self.telling_damage():
            self._catalog.asked(query)
            return self.con.execute(query, values or {}).df()

    def rows(self, query: str, values: dict[str, Any] | None = None) -> list[dict[str, Any]]:
        """Return a query's rows as dictionaries."""
        found: list[dict[str, Any]] = self.table(query, values).to_pylist()
        return found

    @contextlib.contextmanager
    def telling_damage(self) -> Iterator[None]:
        """Tell of a query that failed whether it was for a damaged file."""
        import duckdb

        try:
            yield
        except duckdb.OutOfMemoryException:
            raise
        except duckdb.Error as error:
            self._sources.refuse_damaged(error)
            raise

    def _whole_facts(self) -> None:
        """Look at every file of hourly facts of the range, and make anew what is torn."""
        build(self.site, first_hour=self._hours[0], last_hour=self._hours[1], has_lock=True)

    def _rows_of_days(self, relation: Relation, first: date, last: date) -> pa.Table:
        """Return the rows of a mart of the days from `first` to `last`, computed from hourly facts."""
        days = (max(first, self.first), min(last, self.last))
        if days not in self._of_days:
            self._of_days[days] = Warehouse(self.site, *days, uses_days=False)
        inner = self._of_days[days]
        inner.keep(relation.name)
        return inner.table(f"select * from {relation.name}")


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
