"""Who is staff, by UTC hour, from facts of all people: an input of the facts of visitors, and of those of staff.

The mart `staff_tracks` is the rule. It judges a track by its whole site day, and no fact of an hour reads so far; so
four facts of all people are computed first, which lie beside those that leave somebody out (`settings_variants`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Final

import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.site.model import Site
from vsd_analytics.store.duck import connect, literal_list
from vsd_analytics.warehouse.dimensions import STAFF, calendar, create_tables, register_site, site_days
from vsd_analytics.warehouse.input_fingerprint import text_hash
from vsd_analytics.warehouse.sqlfiles import relations

FACTS: Final = ("track_lives", "area_stays", "staff_tags", "joined_tracks")
"""What the mart `staff_tracks` reads of the records; the last two have files only where vsd.toml asks for them."""
_SITE_DAY_H = 26
"""Hours that a site day may reach beyond one of its own, on a day when clocks are set back, and one beside it."""


@dataclass(frozen=True)
class StaffHours:
    """The tracks of staff by UTC hour.

    Attributes:
        rows: Columns hour, camera_id and track_id, by hour.
    """

    rows: pa.Table

    def between(self, first_hour: int, last_hour: int) -> pa.Table:
        """Return the rows of the hours from `first_hour` to `last_hour`."""
        hour = self.rows["hour"]
        return self.rows.filter(pc.and_(pc.greater_equal(hour, first_hour), pc.less_equal(hour, last_hour)))

    def digest(self, hour: int) -> str:
        """Return a hash of who is staff in an hour and in those beside it, which its facts read; empty for nobody."""
        around = [self._by_hour[h] for h in (hour - 1, hour, hour + 1) if h in self._by_hour]
        return text_hash(around) if around else ""

    @cached_property
    def _by_hour(self) -> Mapping[int, list[tuple[int, str, str]]]:
        by_hour: dict[int, list[tuple[int, str, str]]] = {}
        for row in zip(*(self.rows[c].to_pylist() for c in STAFF.names), strict=True):
            by_hour.setdefault(row[0], []).append(row)
        return by_hour


NOBODY: Final = StaffHours(STAFF.empty_table())


def hours_around(first_day: int | None, last_day: int | None) -> tuple[int | None, int | None]:
    """Return the first and last UTC hour of all site days that a range of UTC days touches; None = open."""
    first = None if first_day is None else first_day * 24 - _SITE_DAY_H
    return first, None if last_day is None else last_day * 24 + 23 + _SITE_DAY_H


def staff_hours(site: Site, files: Mapping[str, Collection[Path]]) -> StaffHours:
    """Return the tracks of staff by UTC hour.

    Args:
        site: The project.
        files: Files of each of `FACTS`, of all people and of whole site days.
    """
    with connect() as con:
        for name, paths in files.items():
            rows = f"read_parquet({literal_list(sorted(paths))})" if paths else _none_of(name)
            con.execute(f"create temp view {name} as select * from {rows}")
        [extent] = con.execute("select min(first_ms), max(last_ms) from track_lives").fetchall()
        if extent[0] is None:
            return NOBODY
        first, last = (datetime.fromtimestamp(ms / 1000, tz=UTC).astimezone(site.zone).date() for ms in extent)
        register_site(con, site)
        create_tables(con, {"calendar": calendar(site, first, last), "site_days": site_days(site, first, last)})
        for name in ("joined_persons", "staff_tracks"):
            con.execute(f"create temp view {name} as {relations('marts')[name].sql}")
        query = "select hour, camera_id, track_id from staff_tracks order by hour, camera_id, track_id"
        return StaffHours(con.sql(query).to_arrow_table().cast(STAFF))


def _none_of(fact: str) -> str:
    """Return a query for no rows of a fact."""
    numbers = ("hour", "first_ms", "last_ms", "started_ms", "n_records", "exposure_ms", "n_staff")
    columns = [f"0::bigint as {c}" if c in numbers else f"'' as {c}" for c in relations("facts")[fact].columns]
    return f"(select {', '.join(columns)} where false)"
