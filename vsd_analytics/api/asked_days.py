"""The days that somebody asks about, and how their tables are made: from a query, or from the answers of each floor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import date, timedelta
from typing import TYPE_CHECKING, Final

from vsd_analytics.api.query_table import query_table
from vsd_analytics.api.table import Table
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.stored_days import has_records, stored_extent
from vsd_analytics.warehouse.warehouse import Warehouse, open_warehouse

if TYPE_CHECKING:
    from vsd_analytics.answer import Answer
    from vsd_analytics.figures.periods import Period

_NOTES: Final = {
    "violations": "numbers at different distances do not compare: a short distance cuts one meeting into several"
}


class AskedDays:
    """Local days of a project.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        name: For printing.
    """

    def __init__(self, site: Site, first: date, last: date, *, name: str) -> None:
        self.site = site
        self.first = first
        self.last = last
        self.name = name

    def __repr__(self) -> str:
        nothing = self._why_nothing()
        return f"{self.site.name}, {self.name}: {self.first} to {self.last}" + (f"; {nothing}" if nothing else "")

    def _why_nothing(self) -> str:
        """Return that nothing is stored of these days, and of which there is something; empty where there is."""
        if has_records(self.site, self.first, self.last):
            return ""
        extent = stored_extent(self.site)
        stored = "" if extent is None else f"; stored are {extent.first_day} to {extent.last_day}"
        return f"nothing is stored of these days{stored}"

    def _query(self, query: str, tables: Mapping[str, object]) -> Table:
        return query_table(self, query, tables)

    def _table(self, name: str) -> Table:
        rows = self._query(f"select * from {name}", {}).arrow()
        return Table(rows, title=self._title(name), note=self._why_nothing() or _NOTES.get(name, ""))

    def _answer(
        self, name: str, answers: Callable[[Period], Sequence[Answer]], *, n_weeks_before: int | None = None
    ) -> Table:
        from vsd_analytics.api.figure_tables import answer_table
        from vsd_analytics.figures import compare

        days = self.first, self.last
        needed = compare.days_needed(self.site, days)
        if n_weeks_before is not None:
            needed = self.first - timedelta(weeks=n_weeks_before), self.last
        return answer_table(
            self.site, days, lambda: self._warehouse(*needed), answers, name=name, title=self._title(name)
        )

    def _footfall(self, name: str) -> Table:
        from vsd_analytics.figures.footfall import footfall_answers
        from vsd_analytics.figures.trend import TREND_WEEKS

        is_week = self.first.weekday() == 0 and self.last - self.first == timedelta(days=6)
        if is_week:
            return self._answer(name, footfall_answers, n_weeks_before=TREND_WEEKS)
        monday = self.last - timedelta(days=self.last.weekday())
        week = AskedDays(self.site, monday, monday + timedelta(days=6), name=self.name)
        columns = week._footfall(name).arrow().schema.empty_table()
        return Table(columns, title=self._title(name), note=f'footfall is of whole weeks: site.week("{monday:%G-W%V}")')

    def _title(self, name: str) -> str:
        return f"{name.replace('_', ' ').capitalize()}, {self.name}"

    @contextmanager
    def _warehouse(self, first: date | None = None, last: date | None = None) -> Iterator[Warehouse]:
        with open_warehouse(self.site, first or self.first, last or self.last) as warehouse:
            yield warehouse
