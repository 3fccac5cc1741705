"""The warehouse: facts of a range and every mart over them, as relations of one DuckDB connection."""

from __future__ import annotations

import contextlib
import hashlib
import pickle
from collections.abc import Callable, Collection, Iterator, Sequence
from datetime import date, datetime, timedelta
from functools import cached_property
from itertools import pairwise
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import pyarrow as pa

from vsd_analytics.errors import SqlError, StoreError
from vsd_analytics.schema import TABLES
from vsd_analytics.site.instants import parse_range
from vsd_analytics.site.model import Site
from vsd_analytics.store import removal
from vsd_analytics.store.duck import connect
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse import superseded
from vsd_analytics.warehouse.accelerated.switch import accelerated_marts, cell_marts, needs_violations
from vsd_analytics.warehouse.build import build, record_rows
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.counter_lines import counter_quarters
from vsd_analytics.warehouse.day_files import AROUND_H, DayFiles
from vsd_analytics.warehouse.dimensions import calendar, create_tables, register_site, site_days
from vsd_analytics.warehouse.duckdb_failures import failed_inside, inside
from vsd_analytics.warehouse.relations import Catalog
from vsd_analytics.warehouse.sealed import OtherRules, other_rules
from vsd_analytics.warehouse.sources import RelationSources
from vsd_analytics.warehouse.sqlfiles import Relation, facts_behind
from vsd_analytics.warehouse.stored_days import SPARE_DAYS, calendar_days, days_of, stored_extent

if TYPE_CHECKING:
    import duckdb
    import pandas as pd

T = TypeVar("T")
MOST_ANSWERS = 500
"""Answers a warehouse remembers. A weekly page asks 75 questions 139 times."""
MEMORY_LIMIT = "800MB"
"""Of DuckDB, for one warehouse: what does not fit goes to disk meanwhile. So a report of a large site needs less than 2
GiB together with its arrays, and with the second warehouse that computes new days."""
ANSWER_BYTES = 1_000_000
"""Larger answers are not remembered: a page asks for them once."""


class Warehouse:
    """Facts and marts of a range of local days.

    Use it as a context manager: no record is removed while it is open. Query every relation of `sql/facts` and
    `sql/marts`, `located` and `pairs`, and `calendar`, `site_days`, `cameras`, `areas`, `area_cells`, `owner_cells`,
    `calibrations` and `params`, by name.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        heat_cell_m: Side of the cells of the mart `heatmap`.
        on_plan: Progress of the build; see `build`.
        on_hours: The same, hour by hour.
        uses_days: Read marts from week files, and write the missing ones (`day_files`); False = compute them from
            hourly facts.
        spare_days: Where more than a year has no records, the calendar has this many days of it after the last record
            before and before the next one; it leaves out the rest (`stored_days.calendar_days`).
        relations: Facts and marts that will be asked for: only facts behind these are computed first, all others when
            a query names them. None = all.
        threads: Threads of the connection; days that are computed have connections of their own. None = one per core.

    Attributes:
        counted_together: Groups of hours by floor, as UTC starts in milliseconds, of which a reader of what is made
            from this warehouse knows only the violations of all together (`figures.share.together`); none for the
            operator.
        timed_together: The same, of their person-time.
        withheld_days: Days by floor of which such a reader knows no violations.
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
        spare_days: int = SPARE_DAYS,
        relations: Collection[str] | None = None,
        threads: int | None = None,
    ) -> None:
        self.site, self.first, self.last = site, first, last
        self.counted_together: dict[str, tuple[frozenset[int], ...]] = {}
        self.timed_together: dict[str, tuple[frozenset[int], ...]] = {}
        self.withheld_days: dict[str, frozenset[date]] = {}
        store = Store(site.root / "store", site_id=site.site_id)
        if store.n_spooled():
            store.fold()
        self._hours = (
            _utc_hour(first, site) - AROUND_H,
            _utc_hour(last + timedelta(days=1), site) - 1 + AROUND_H,
        )
        # Two locks, because `__exit__` removes superseded files after it releases the lock on facts (`clear` needs that
        # lock exclusively) and while it still holds off a purge.
        self._reading, self._reading_facts = contextlib.ExitStack(), contextlib.ExitStack()
        self._facts = None if relations is None else facts_behind(relations)
        with contextlib.ExitStack() as on_error:
            # whoever catches the error may go on, and a purge must not wait until Python collects this half-made object
            on_error.callback(self._reading.close)
            on_error.callback(self._reading_facts.close)
            self._reading.enter_context(removal.reading(store.root))
            self._reading_facts.enter_context(superseded.reading(site.root / "facts"))
            self.built: BuildResult = build(
                site,
                first_hour=self._hours[0],
                last_hour=self._hours[1],
                facts=self._facts,
                on_plan=on_plan,
                on_hours=on_hours,
                has_lock=True,
                is_trusting=uses_days,
            )
            on_error.pop_all()
        self._relations = tuple(relations or ())
        self._of_days: tuple[tuple[date, date], Warehouse] | None = None
        self.extents = calendar_days(site, first, last, spare_days=spare_days)
        self._heat_cell_m, self._uses_days, self._threads = heat_cell_m, uses_days, threads
        self._superseded = [*self.built.superseded_files]
        self._is_careful = False
        self._answers: dict[tuple[str, bytes], pa.Table] = {}
        self._open()

    def _open(self) -> None:
        """Open a connection on which every relation can be queried."""
        site = self.site
        self._con: duckdb.DuckDBPyConnection = connect(
            memory_limit=MEMORY_LIMIT, threads=self._threads, is_careful=self._is_careful
        )
        # A view is read by several queries, and to open its files again costs more than the rows of most.
        self._con.execute("set parquet_metadata_cache = true")
        register_site(self._con, site, heat_cell_m=self._heat_cell_m)
        calendars = pa.concat_tables([calendar(site, e.first_day, e.last_day) for e in self.extents])
        tables = {
            "calendar": calendars,
            "counter_quarters": counter_quarters(site, calendars["quarter"]),
            "site_days": pa.concat_tables([site_days(site, e.first_day, e.last_day) for e in self.extents]),
        }
        create_tables(self._con, tables)
        self._sources = RelationSources(
            self._con,
            site,
            built=self.built,
            hours=self._hours,
            days=DayFiles(site, self.built, extents=self.extents) if self._uses_days else None,
            whole_facts=self._whole_facts,
            rows_of_days=self._rows_of_days,
            superseded_files=self._superseded,
            asked=self._relations,
        )
        self._catalog = Catalog(self._con, self._sources.of, self._sources.prefetch)

    def __enter__(self) -> Warehouse:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        self.con.close()
        self._close_days()
        self._reading_facts.close()
        superseded.clear(self.site.root / "facts", self._superseded)
        self._reading.close()

    @property
    def con(self) -> duckdb.DuckDBPyConnection:
        """Return the connection. Whoever takes it may change relations, so answers given before are forgotten."""
        self._answers.clear()
        return self._con

    def days(self, first: date, last: date) -> list[date]:
        """Return local days from `first` to `last`, without those that the calendar leaves out between records."""
        return days_of(self.extents, first, last)

    def left_out(self) -> list[str]:
        """Return a sentence for each run of days that the calendar leaves out: over a year without any record."""
        gaps = ((a.last_day, b.first_day) for a, b in pairwise(self.extents))
        return [
            f"no record is stored of {(b - a).days - 1:,} days between {a} and {b}: they are left out, as neither "
            "recorded nor missing"
            for a, b in gaps
        ]

    @cached_property
    def inputs_digest(self) -> str:
        """Return a hash of the facts of the range: the same facts give the same figures."""
        digest = hashlib.blake2b(digest_size=8)
        for hour, fingerprint in sorted(self.built.fingerprints.items()):
            digest.update(f"{hour}:{fingerprint};".encode())
        return digest.hexdigest()

    def other_rules(self) -> list[OtherRules]:
        """Return the runs of purged hours of the range that were computed by other rules than today's."""
        first, last = self._hours[0] + AROUND_H, self._hours[1] - AROUND_H
        return other_rules(self.site, self.built.sealed, first_hour=first, last_hour=last)

    def materialise(self, *names: str) -> None:
        """Compute facts and marts now and hold their rows in memory, for several queries to read.

        A mart with large files is not held: each query reads the columns and days it needs from them.
        """
        self._retry_carefully(", ".join(names), lambda: self._catalog.materialise(names))

    def prefetch(self, *marts: str) -> None:
        """Compute and store the days of marts that have no file yet, all of these marts together.

        Marts of the same days share what they are computed from. A page that asks for one mart after the other would
        have it computed as often as it asks.
        """
        self._retry_carefully(", ".join(marts), lambda: self._sources.prefetch(marts))
        self._close_days()  # facts of the last days, which nothing else reads

    def prepare(self, query: str) -> None:
        """Create the facts and marts that a query names. `run`, `table`, `frame` and `rows` do it themselves."""
        self.run(query, lambda _con: None)

    def table(self, query: str, values: dict[str, Any] | None = None) -> pa.Table:
        """Return a query's rows as an Arrow table; values are bound, never pasted.

        Facts of a range do not change, so a question asked again gets the same answer without a query.
        """
        question = (query, pickle.dumps(values or {}))
        if question not in self._answers:
            rows = self.run(query, lambda con: con.sql(query, params=values or None).to_arrow_table())
            if rows.nbytes > ANSWER_BYTES or len(self._answers) >= MOST_ANSWERS:
                return rows
            self._answers[question] = rows
        return self._answers[question]

    def frame(self, query: str, values: dict[str, Any] | None = None) -> pd.DataFrame:
        """Return a query's rows as a pandas frame."""
        return self.run(query, lambda con: con.execute(query, values or {}).df())

    def run(self, query: str, read: Callable[[duckdb.DuckDBPyConnection], T]) -> T:
        """Create the facts and marts that a query names, and return the result of `read` on the connection.

        Args:
            query: The query's text.
            read: Runs the query; called again on a new connection when DuckDB fails internally.

        Raises:
            SqlError: E604, DuckDB fails internally, also with the careful settings of a second try.
            StoreError: E302 or E313, a file that was read is damaged.
        """

        def prepare_and_read() -> T:
            self._catalog.prepare(query)
            return read(self._con)

        return self._retry_carefully(", ".join(self._catalog.named(query)) or "a query", prepare_and_read)

    def rows(self, query: str, values: dict[str, Any] | None = None) -> list[dict[str, Any]]:
        """Return a query's rows as dictionaries."""
        rows: list[dict[str, Any]] = self.table(query, values).to_pylist()
        return rows

    def person_records(self) -> Iterator[pa.Table]:
        """Yield the rows of `located`, a batch of hours at a time, in order of hours: no batch is held.

        Ids are texts, or dictionaries that have other names, too; the rows of a batch come in any order. Purged hours
        have none.
        """
        first, last = self._hours
        return record_rows(self.site, "located", first_hour=first, last_hour=last)

    def _retry_carefully(self, relation: str, work: Callable[[], T]) -> T:
        """Return the result of `work`; when DuckDB fails internally, try once more with careful settings.

        An internal failure closes the whole database, so the second try needs a new connection. A query that needs more
        than `MEMORY_LIMIT` even with the help of the disk is tried again with DuckDB's own limit.
        """
        import duckdb

        is_limited = True
        with self._reporting_damage():
            while True:
                try:
                    return work()
                except duckdb.OutOfMemoryException:
                    if not is_limited:
                        raise
                    is_limited = False
                    self._con.execute("reset memory_limit")
                except inside() as error:
                    if self._is_careful:
                        raise self._failed_inside(error, relation) from error
                    self._is_careful = True
                    self._con.close()
                    self._open()

    def _failed_inside(self, error: Exception, relation: str) -> SqlError:
        self._sources.refuse_damaged(error)
        first, last = self._hours
        store = Store(self.site.root / "store", site_id=self.site.site_id)
        parts = {t: store.parts(t, first_hour=first, last_hour=last) for t in TABLES}
        return failed_inside(error, relation=relation, parts=parts, first_hour=first, last_hour=last)

    @contextlib.contextmanager
    def _reporting_damage(self) -> Iterator[None]:
        """When a query fails because of a damaged file, raise the error that names the file instead."""
        import duckdb

        try:
            yield
        except duckdb.OutOfMemoryException:
            raise
        except duckdb.Error as error:
            self._sources.refuse_damaged(error)
            raise

    def _whole_facts(self, name: str) -> BuildResult:
        """Check the files of hourly facts of the range and compute the missing ones: all facts where not asked for."""
        if self._facts is not None and name not in self._facts:
            self._facts = None
        return build(self.site, first_hour=self._hours[0], last_hour=self._hours[1], facts=self._facts, has_lock=True)

    def _rows_of_days(
        self, marts: Sequence[Relation], first: date, last: date
    ) -> Iterator[tuple[Relation, Sequence[date], pa.Table]]:
        """Yield the rows of marts of the days from `first` to `last` in order, all or one, computed from hourly facts.

        The warehouse of these days stays open for marts that are asked for later, until other days are computed.
        """
        days = (max(first, self.first), min(last, self.last))
        if self._of_days is None or self._of_days[0] != days:
            self._close_days()
            self._of_days = days, Warehouse(self.site, *days, uses_days=False, relations=self._facts)
        inner, by_day = self._of_days[1], {r.name: r for r in marts if r.name in accelerated_marts()}
        whole = [relation for relation in marts if relation.name not in by_day]
        read = ["violations"] if needs_violations(by_day) else []
        inner.prepare(" ".join([*(relation.name for relation in whole), *read]))
        for relation in whole:
            is_table = inner._catalog.is_table(relation.name)
            rows = inner.table(f"select * from {relation.name}" if is_table else relation.sql)
            yield relation, [first + timedelta(days=k) for k in range((last - first).days + 1)], rows
        inner.materialise(*read)
        for day in days_of(inner.extents, *days) if by_day else ():
            for name, rows in cell_marts(inner.table, day, by_day):
                yield by_day[name], [day], rows

    def _close_days(self) -> None:
        if self._of_days is not None:
            self._of_days[1].__exit__(None, None, None)
            self._of_days = None


def open_warehouse(site: Site, first: date | str, last: date | str, **options: Any) -> Warehouse:
    """Return the warehouse of a range of local days, dates or text such as "2026-11-09", its facts made fresh.

    Raises:
        StoreError: E301, nothing is stored.
        UsageError: E101, a text is no day.

    Example:
        >>> with vsd.open_warehouse(site.site, date(2026, 11, 9), date(2026, 11, 15)) as warehouse:
        ...     warehouse.rows("select count(*) as n_hours from hours")
        [{'n_hours': 168}]
    """
    if stored_extent(site) is None:
        raise StoreError(
            "nothing is stored yet",
            code="E301",
            why=f"{site.root.name}/store holds no records of site {site.site_id!r}",
            fix="vsd ingest FILES...",
            in_python="site.ingest(frame), or vsd ingest FILES... in a terminal",
        )
    begin = parse_range(first)[0] if isinstance(first, str) else first
    end = parse_range(last)[1] if isinstance(last, str) else last
    return Warehouse(site, begin, end, **options)


def _utc_hour(day: date, site: Site) -> int:
    return int(datetime(day.year, day.month, day.day, tzinfo=site.zone).timestamp()) // 3600
