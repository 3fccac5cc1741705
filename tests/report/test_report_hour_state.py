"""The state of an hour is one rule: that of the relation `hours`, and of the page's timetable."""

from __future__ import annotations

from types import SimpleNamespace

import duckdb
import pytest

from vsd_analytics.figures.week.timetable import hour_state
from vsd_analytics.settings import Settings
from vsd_analytics.warehouse.sqlfiles import relations

CAMERA_HOUR = """
create table camera_hours as select
    0 as hour_start_ms, date '2026-11-09' as local_date, 9 as local_hour, 0 as fold, 1 as weekday, 3600.0 as length_s,
    ?::double as open_s, ?::double as recorded_s, ?::double as recorded_open_s, false as is_inferred,
    1 as person_records, 1.0 as exposure_s, 1 as violation_records, 1.0 as violation_s, 1 as n_violations,
    1 as n_violations_open
"""


@pytest.mark.parametrize("is_open", [True, False])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.49, 0.5, 0.91, 0.92, 1.0])
def test_relation_and_timetable_give_an_hour_the_same_state(share: float, is_open: bool) -> None:
    settings = Settings()
    open_s, recorded_s = (3600.0, 3600 * share) if is_open else (0.0, 3600 * share)
    with duckdb.connect() as con:
        con.execute(
            "create table params as select ?::double as full_hour_share, ?::double as partial_hour_share",
            [settings.full_hour_share, settings.partial_hour_share],
        )
        con.execute(CAMERA_HOUR, [open_s, recorded_s, recorded_s if is_open else 0.0])
        con.execute(f"create view hours as {relations('marts')['hours'].sql}")
        told = con.execute("select state from hours").fetchall()

    data = SimpleNamespace(site=SimpleNamespace(settings=settings))
    assert told == [(hour_state(share, data, is_open=is_open),)]  # type: ignore[arg-type]
