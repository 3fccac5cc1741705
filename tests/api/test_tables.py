"""A table behaves like a table, has exactly the days asked for, and a row for everything that could have one."""

from __future__ import annotations

import json
from datetime import date, datetime
from pathlib import Path
from typing import Any

import duckdb
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import vsd_analytics as vsd
from vsd_analytics.api.computed_tables import COMPUTED_TABLES
from vsd_analytics.errors import UsageError
from vsd_analytics.warehouse.analyst_names import sql_tables

NAMES = sorted({*sql_tables(), *COMPUTED_TABLES})
DAY = "2026-11-10"


@pytest.fixture(scope="module")
def day(demo_project: Path) -> vsd.Days:
    return vsd.open(demo_project).days(DAY)


def table(**columns: Any) -> vsd.Table:
    return vsd.Table(pa.table(columns), title="Some rows")


def test_rows_are_indexed_iterated_counted_and_asked_for_columns() -> None:
    some = table(a=[1, None, 3], b=["x", "y", "z"])
    assert some["a"] == [1, None, 3]
    assert list(some) == [{"a": 1, "b": "x"}, {"a": None, "b": "y"}, {"a": 3, "b": "z"}]
    assert (len(some), "a" in some, "c" in some) == (3, True, False)
    with pytest.raises(UsageError, match="there is no column 'c': these are a, b"):
        some["c"]


def test_every_reader_of_arrow_streams_takes_a_table() -> None:
    rows = table(a=[1, None, 3])
    assert pl.DataFrame(rows)["a"].to_list() == [1, None, 3]
    assert pa.table(rows).equals(rows.arrow())
    assert pd.DataFrame.from_arrow(rows)["a"].isna().tolist() == [False, True, False]
    assert duckdb.sql("select sum(a) as s from rows").fetchall() == [(4,)]


@pytest.mark.parametrize(("values", "total"), [([1, None], 1), ([None, None], None), ([], None), ([0.5, 0.25], 0.75)])
def test_a_total_of_nothing_known_is_unknown(values: list[float | None], total: float | None) -> None:
    kind = pa.float64() if 0.5 in values else pa.int64()
    assert table(n=pa.array(values, kind)).total("n") == total


def test_texts_have_no_total() -> None:
    with pytest.raises(UsageError, match="cannot be summed"):
        table(a=["x"]).total("a")


@pytest.mark.parametrize("kind", [pa.int32(), pa.int64(), pa.float32(), pa.float64()])
def test_pandas_sums_known_values_and_knows_when_there_are_none(kind: pa.DataType) -> None:
    frame = table(k=["a", "a", "b"], n=pa.array([1, None, None], kind)).df()
    assert frame["n"].sum() == 1
    assert frame.groupby("k")["n"].sum().isna().to_dict() == {"a": False, "b": True}
    assert frame[frame["k"] == "b"]["n"].sum() is pd.NA
    assert frame.pivot_table("n", "k", aggfunc="sum")["n"].to_dict() == {"a": 1}
    assert frame["n"].to_numpy(dtype=float, na_value=float("nan"))[0] == 1


def test_places_are_geojson_and_a_table_without_them_says_so(day: vsd.Days) -> None:
    text = json.dumps(day.violations.geojson())
    assert len(json.loads(text)["features"]) == len(day.violations)
    with pytest.raises(UsageError, match=r"no places.*x_m and y_m.*cells"):
        day.hours.geojson()


@pytest.mark.parametrize("name", NAMES)
def test_a_table_is_the_same_in_python_and_in_sql(day: vsd.Days, name: str) -> None:
    assert day.sql(f"select * from {name}").arrow().equals(getattr(day, name).arrow())


@pytest.mark.parametrize("name", NAMES)
def test_instants_have_the_zone_of_the_site_and_lie_in_the_days_asked_for(day: vsd.Days, name: str) -> None:
    rows = getattr(day, name).arrow()
    first, end = datetime(2026, 11, 10, tzinfo=day.site.zone), datetime(2026, 11, 11, tzinfo=day.site.zone)
    for field in rows.schema:
        if pa.types.is_timestamp(field.type):
            assert field.type.tz == "Europe/Rome", field.name
            if field.name != "ended":
                assert all(first <= at < end for at in rows[field.name].to_pylist())
    if "local_date" in rows.column_names:
        assert set(rows["local_date"].to_pylist()) <= {date(2026, 11, 10)}


@pytest.mark.parametrize(
    ("name", "keys", "n"),
    [
        ("hours", ["start"], 24),
        ("camera_hours", ["camera_id", "start"], 4 * 24),
        ("area_hours", ["floor_id", "area_id", "start"], 5 * 24),
        ("days", ["local_date"], 1),
    ],
)
@pytest.mark.parametrize("asked", [DAY, "2026-06-01", "2026-10-25"])
def test_each_key_that_could_have_a_row_has_one(
    demo_project: Path, name: str, keys: list[str], n: int, asked: str
) -> None:
    """Also on a day without records, and on the day of 25 hours."""
    frame = getattr(vsd.open(demo_project).days(asked), name).df()
    n_hours = 25 if asked == "2026-10-25" else 24
    assert len(frame) == n // 24 * n_hours if n > 1 else 1
    assert not frame.duplicated(keys).any()
    assert {"state", "open_s", "recorded_s"} <= set(frame.columns)


def test_the_tables_of_a_range_are_those_of_its_days(demo_project: Path) -> None:
    site = vsd.open(demo_project)
    both = site.days("2026-11-10..2026-11-11")
    for name in ("violations", "hours", "area_hours", "trajectories"):
        parts = [len(getattr(site.days(d), name)) for d in (DAY, "2026-11-11")]
        assert len(getattr(both, name)) == sum(parts), name


@pytest.mark.parametrize(
    "ask",
    [
        lambda site: site.week(46),
        lambda site: site.week("46"),
        lambda site: site.week(None),
        lambda site: site.days(5),
        lambda site: site.days("2026-11-09", 3),
        lambda site: site.days((date(2026, 11, 9),)),
        lambda site: site.compare(1, 2),
        lambda site: site.plan("entrance", effect="a lot"),
        lambda site: site.plan("entrance", effect=-15),
        lambda site: site.plan("entrance", effect=-0.15, power=80),
        lambda site: site.plan("entrance", effect=0),
        lambda site: site.days(DAY).at(distance_m="near"),
        lambda site: site.days(DAY).sql(3),
        lambda site: site.days(DAY).sql("select * from hours", hours=pd.DataFrame()),
        lambda site: site.ingest("frame"),
    ],
)
def test_what_cannot_be_answered_is_an_error_that_says_how_to_ask(demo_project: Path, ask: Any) -> None:
    with pytest.raises(UsageError) as caught:
        ask(vsd.open(demo_project))
    assert caught.value.fix
    assert caught.value.fix in str(caught.value)
    assert caught.value.what in str(caught.value)


def test_an_error_of_a_query_says_why_where_a_notebook_shows_it(day: vsd.Days) -> None:
    with pytest.raises(vsd.VsdError, match=r"no_such_column.*week.hours.columns"):
        day.sql("select no_such_column from hours")
