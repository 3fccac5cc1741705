"""Ways in which small counts and the time of single people once left, and do no longer."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterator
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest
from report import ingested_worlds as w
from scipy.optimize import Bounds, LinearConstraint, milp

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.figures.maps import SIGMA_M, cell_maps
from vsd_analytics.planner.cell_counts import grid_of
from vsd_analytics.planner.planner_data import planner_pages
from vsd_analytics.report.pages.json_and_csv import to_csv, to_json
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.site.model import Site
from vsd_analytics.stats.hotspots import smoothed
from vsd_analytics.warehouse.warehouse import open_warehouse

PRAYER = {**w.AREAS, "prayer": ("Prayer room", (13, 7, 17, 11))}
HOURS = (9, 12)
MASK_BELOW = 5


def few_by_day(day: int, hour: int) -> dict[w.Place, int]:
    """Three violations in one hour of Tuesday at the door, many at the queue."""
    return {w.QUEUE: 30, w.DOOR: 3 if (day, hour) == (1, 10) else 0, w.AISLE: 20}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return a week in which one person is alone in the prayer room, and all others elsewhere."""
    config = w.toml(areas=PRAYER)
    return w.world(tmp_path_factory.mktemp("leaks") / "shop", config, w.messages(few_by_day))


def report_json(site: Site) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(to_json(week_report(site, w.MONDAY)))
    return found


def test_the_time_of_a_single_person_in_a_room_is_not_printed(site: Site) -> None:
    exact = {a["area_id"]: a for a in report_json(site.with_settings(mask_below=0))["areas"]}
    assert exact["prayer"]["exposure_h"] == pytest.approx(7 * (HOURS[1] - HOURS[0]), rel=0.01), "one person, all week"
    report = report_json(site)
    shared = {a["area_id"]: a for a in report["areas"]}
    for name in ("exposure_h", "encounter_rate", "close_time_share"):
        value = shared["prayer"][name]
        assert (value["value"] if isinstance(value, dict) else value) is None, name
    [row] = [r for r in report["answers"]["areas"]["rows"] if r["area_id"] == "prayer"]
    assert {row[name]["value"] for name in ("close_time_share", "encounter_rate")} == {None}
    assert row["exposure_h"] is None


def test_nor_is_it_what_all_other_places_leave_of_the_floor(site: Site) -> None:
    report = report_json(site)
    hidden = [a["area_id"] for a in report["areas"] if a["exposure_h"] is None]
    assert len(hidden) > 1
    assert "prayer" in hidden
    table = csv.DictReader(io.StringIO(to_csv(week_report(site, w.MONDAY))["areas.csv"]))
    assert [row["exposure_h"] for row in table if row["area"] == "prayer"] == [""]


def test_a_place_that_enough_people_use_keeps_its_time(site: Site) -> None:
    shared = {a["area_id"]: a for a in report_json(site)["areas"]}
    assert shared["queue"]["exposure_h"] == pytest.approx(
        {a["area_id"]: a for a in report_json(site.with_settings(mask_below=0))["areas"]}["queue"]["exposure_h"]
    )


def test_hours_by_area_of_the_operator_would_tell_what_the_week_hides(site: Site, tmp_path: Path) -> None:
    """An area whose week is hidden has four hours that are hidden among zeros: so the shared file has no such table."""
    shared, exact = tmp_path / "shared.duckdb", tmp_path / "exact.duckdb"
    common = ["-C", str(site.root), "--now", "2026-12-14", "export", "--range", "2026-11-09..2026-11-15", "--duckdb"]
    assert run(cli, [*common, str(shared)]) == 0
    assert run(cli, [*common, str(exact), "--exact"]) == 0
    with duckdb.connect(str(exact), read_only=True) as con:
        [(n,)] = con.execute("select sum(violations) from area_hours where area_id = 'door'").fetchall()
    with duckdb.connect(str(shared), read_only=True) as con:
        tables = {name for (name,) in con.execute("select table_name from duckdb_tables()").fetchall()}
        [(door,)] = con.execute("select violations from areas where area_id = 'door'").fetchall()
        [(total,)] = con.execute("select violations from weeks").fetchall()
        [(n_areas, n_shown)] = con.execute("select count(*), count(violations) from areas").fetchall()
    assert (n, door) == (3, None)
    assert {"area_hours", "camera_hours"} & tables == set()
    assert n_areas - n_shown > 1, "a sum over areas that skips what is hidden says so: several are null"
    assert total is not None, "and the right total is beside it"


def test_running_totals_told_the_hours_that_were_hidden(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    """100, 101, 104 and 107 give 1, 3 and 3: no total of a running week is given, whatever the hour."""
    assert solved([100, 101, 104, 107]) == [1, 3, 3]
    command = ["report", "--week", "2026-W46", "--json"]
    totals = []
    for day in range(9, 16):
        code = run(cli, ["-C", str(site.root), "--now", f"2026-11-{day:02}T23:05+01:00", *command])
        printed = capsys.readouterr().out
        totals.append(json.loads(printed)["level"]["violations"] if code == 0 else None)
        assert code == (2 if totals[-1] is None else 0)
    assert totals[:2] == [None, None]
    steps = np.diff([n for n in totals if n is not None])
    assert len(steps)
    assert not ((steps > 0) & (steps < MASK_BELOW)).any()


def test_a_week_is_over_when_its_last_site_day_is(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    last = {}
    for clock in ("03:55", "04:05"):
        now = f"2026-11-16T{clock}+01:00"
        assert run(cli, ["-C", str(site.root), "--now", now, "report", "--week", "2026-W46", "--json"]) == 0
        last[clock] = json.loads(capsys.readouterr().out)["week"]["sunday"]
    assert last == {"03:55": "2026-11-13", "04:05": "2026-11-15"}, "the last closed day stays back until then"


def solved(totals: list[int]) -> list[int | None]:
    """Return the hidden hours, 1 to 4 each, that running totals leave no choice of."""
    steps = LinearConstraint(np.eye(len(totals) - 1), np.diff(totals), np.diff(totals))
    found: list[int | None] = []
    for k in range(len(totals) - 1):
        c = np.eye(len(totals) - 1)[k]
        ends = {
            round(s * milp(s * c, constraints=steps, integrality=np.ones(len(c)), bounds=Bounds(1, 4)).fun)
            for s in (1, -1)
        }
        found.append(ends.pop() if len(ends) == 1 else None)
    return found


def test_maps_of_squares_told_the_time_and_the_count_that_areas_hide(site: Site) -> None:
    """A square metre of M16 is the time of its one person; of M17 that of three violations, 40 s for each of two."""
    exact, shared = (report_json(of)["figures"] for of in (site.with_settings(mask_below=0), site))
    assert values_in(exact["M16"], PRAYER["prayer"][1]) == [3600]
    assert sum(values_in(exact["M17"], PRAYER["door"][1])) * 21 == pytest.approx(3 * 2 * 40, rel=0.01)
    for name, area in (("M16", "prayer"), ("M17", "prayer"), ("M17", "door"), ("M18", "door"), ("M19", "door")):
        assert values_in(shared[name], PRAYER[area][1]) == [], (name, area)
    assert values_in(shared["M16"], PRAYER["queue"][1])


FAR = {"queue": ("Queue", (0, 0, 20, 20)), "door": ("Door", (40, 0, 46, 6)), "till": ("Till", (60, 0, 66, 6))}
FAR_QUEUE, FAR_DOOR, FAR_TILL = (10.0, 10.0), (42.0, 3.0), (62.0, 3.0)


def many_with_few_too_close(monday: date) -> Iterator[dict[str, Any]]:
    """Yield frames of a week: many people at the door one by one, and three pairs of them too close."""

    def counts(day: int, hour: int) -> dict[w.Place, int]:
        return {FAR_QUEUE: 30, FAR_DOOR: 3 if (day, hour) == (1, 10) else 0, FAR_TILL: 20}

    for k, message in enumerate(w.messages(counts, monday=monday, is_alone=False)):
        x, y = FAR_DOOR
        is_pair = any(abs(p["x_m"] - x) < 2 for p in message["persons"])
        one = [] if is_pair else [w.person(f"one-{k // 6}", x + 1.5 * (k // 6 % 2), y)]
        yield {**message, "persons": [*message["persons"], *one]}


def test_smoothed_maps_told_the_count_that_an_area_hides(tmp_path: Path) -> None:
    """Who knows where people were multiplies M18, or M19, by what it divides by: three violations at the door."""
    site = w.world(tmp_path / "shop", w.toml(areas=FAR), many_with_few_too_close(w.MONDAY))
    exact, shared = (report_json(of) for of in (site.with_settings(mask_below=0), site))
    assert {a["area_id"]: a["counted"] for a in exact["areas"]}["door"] == 3
    assert {a["area_id"]: a["counted"] for a in shared["areas"]}["door"] is None
    with open_warehouse(site, w.MONDAY, w.MONDAY + timedelta(days=6)) as warehouse:
        maps = cell_maps(warehouse, floor=site.floors[0], cell_m=1.0)
    assert maps.risk.grid is not None
    grid, of_one = maps.risk.grid, np.zeros(maps.risk.grid.shape)
    for x_m in (FAR_DOOR[0], FAR_DOOR[0] + 1.5):
        of_one[int(FAR_DOOR[1]) - grid.cy, int(x_m) - grid.cx] = w.CLOSE_S / 3600
    of_one = smoothed(of_one, SIGMA_M)
    for metric, hours in (("M18", maps.risk.exposure_h), ("M19", maps.excess.expected_h)):
        assert hours is not None
        near = smoothed(hours, SIGMA_M)
        found = []
        for figures in (exact["figures"], shared["figures"]):
            rows = [(int(r["y_m"]) - grid.cy, int(r["x_m"]) - grid.cx, r["value"]) for r in figures[metric]["rows"]]
            assert rows, metric
            found.append([value * near[i, k] / of_one[i, k] for i, k, value in rows if of_one[i, k] > 0])
        assert found[0] == pytest.approx([3] * len(found[0]), rel=1e-3)
        assert found[0]
        assert found[1] == [], "no square that is shared holds a part of the door's"


def test_squares_of_the_planner_told_the_time_and_the_count_that_areas_hide(site: Site) -> None:
    told = {}
    for name, of in (("exact", site.with_settings(mask_below=0)), ("shared", site)):
        [data] = planner_pages(of, w.MONDAY)
        assert data.shown is not None
        grid, cells = grid_of(data.shown.extent), data.week.cells
        assert grid is not None
        assert cells is not None
        x, y = grid.x0 + cells.time.cell % grid.n_x, grid.y0 + cells.time.cell // grid.n_x
        told[name] = {
            area: cells.time.values[:, (x >= x0) & (x < x1) & (y >= y0) & (y < y1)].sum(axis=1) * cells.unit_ms
            for area, (_, (x0, y0, x1, y1)) in PRAYER.items()
        }
    assert told["exact"]["prayer"].tolist() == [21 * 3_600_000, 0]
    assert told["exact"]["door"].tolist() == [3 * 2 * 40_000, 3 * 2 * 40_000]
    assert not any(told["shared"][area].any() for area in ("prayer", "door"))
    assert told["shared"]["queue"].any()


def values_in(figure: dict[str, Any], box: tuple[float, ...]) -> list[float]:
    """Return the values of a map's squares whose middle is in a box."""
    x0, y0, x1, y1 = box
    return [row["value"] for row in figure["rows"] or () if x0 < row["x_m"] < x1 and y0 < row["y_m"] < y1]


def test_how_long_the_visits_of_one_person_last_is_not_told(tmp_path: Path) -> None:
    """Visits times their mean length are the person-time that the page hides, and so are people times hours."""
    config = w.toml(areas=PRAYER)
    for area in ("prayer", "queue"):
        config = config.replace(f'id = "{area}"\n', f'id = "{area}"\nvisits = true\nqueue = true\ncapacity = 4\n')
    site = w.world(tmp_path / "shop", config, w.messages(few_by_day))
    exact, shared = (report_json(of)["answers"] for of in (site.with_settings(mask_below=0), site))
    [known] = [row for row in exact["queues"]["rows"] if row["area_id"] == "prayer"]
    assert known["people_waiting"]["value"] == pytest.approx(1), "one person, all week"
    for answer, names in {
        "visits": ("dwell_mean_s", "dwell_mean_little_s", "little_ratio", "dwell_median_s"),
        "queues": ("people_waiting", "people_waiting_p90", "stay_mean_little_s"),
        "queue_hours": ("people_waiting",),
        "capacity": ("people", "full_share", "surplus_people", "room_a_share"),
    }.items():
        rows = [row for row in shared[answer]["rows"] if row["area_id"] == "prayer"]
        assert rows, answer
        for row in rows:
            assert {name: row[name]["value"] for name in names} == dict.fromkeys(names), answer
    [beside] = [row for row in shared["queues"]["rows"] if row["area_id"] == "queue"]
    assert beside["people_waiting"]["value"] is not None


def three_all_week(monday: date) -> Iterator[dict[str, Any]]:
    """Yield frames of a week in which many people come one by one, and three pairs are too close in one hour."""

    def counts(day: int, hour: int) -> dict[w.Place, int]:
        return {FAR_QUEUE: 0, FAR_DOOR: 3 if (day, hour) == (1, 10) else 0, FAR_TILL: 0}

    for k, message in enumerate(w.messages(counts, monday=monday, is_alone=False)):
        ones = [
            w.person(f"{place[0]}-{k // 6}", place[0] + 1.5 * (k // 6 % 2), place[1]) for place in (FAR_QUEUE, FAR_TILL)
        ]
        yield {**message, "persons": [*message["persons"], *ones]}


def test_a_week_of_three_violations_told_their_number_and_the_time_too_close(tmp_path: Path) -> None:
    """Reasons said how many there were, and figures of other limits what the share of time too close is."""
    site = w.world(tmp_path / "shop", w.toml(areas=FAR), three_all_week(w.MONDAY))
    exact, shared = (report_json(of) for of in (site.with_settings(mask_below=0), site))
    assert exact["answers"]["violations"]["rows"][0]["n_violations"]["value"] == 3
    assert exact["answers"]["threshold_sensitivity"]["rows"], "the operator sees the share under each limit"
    assert shared["answers"]["violations"]["rows"][0]["n_violations"]["value"] is None
    for name in ("close_time", "threshold_sensitivity", "distances", "durations", "contacts", "clusters", "mixing"):
        for row in shared["answers"][name]["rows"]:
            assert [c for c in row.values() if isinstance(c, dict) and c["value"] is not None] == [], name
    assert re.findall(r"[^\"]*\b(?:has|of|the) 3\b[^\"]*", json.dumps(shared["answers"])) == []
