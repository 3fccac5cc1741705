"""The numbers of a report: one definition, nothing missing taken for zero, nothing small to be worked out."""

from __future__ import annotations

import csv
import io
import itertools
import json
import re
from collections.abc import Iterator
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from report import ingested_worlds as w
from report.pages.test_report_numbers import strangers

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.figures_by_id import figures_by_id
from vsd_analytics.report.pages.json_and_csv import figures_json, to_csv, to_json
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site.model import Site
from vsd_analytics.wording.reasons import reason_text

TWO = ("cam-1", "cam-2")


def busy(day: int, hour: int) -> dict[w.Place, int]:
    return {w.QUEUE: 30 + 3 * (day % 3) + hour % 2, w.DOOR: 12 + day % 4, w.AISLE: 9 + (day * 5) % 4}


def total(counts: w.Counts, hours: range = range(9, 12)) -> int:
    return sum(sum(counts(d, h).values()) for d in range(7) for h in hours)


# one definition -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def two_cameras(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Two cameras side by side, one of them down from Thursday 10:00 to Friday 11:00, two weeks."""
    lost = [(w.rome(3, 10), w.rome(4, 11))]
    aside = {w.DOOR: 8, (9.0, 9.0): 4}
    streams = [
        w.messages(busy, monday=w.BEFORE),
        w.messages(busy),
        w.messages(w.steady(aside), monday=w.BEFORE, camera="cam-2"),
        w.messages(w.steady(aside), camera="cam-2", lost=lost),
    ]
    return w.world(tmp_path_factory.mktemp("two"), w.toml(cameras=TWO), *streams)


@pytest.fixture(scope="module")
def of_two(two_cameras: Site) -> WeekReport:
    """Return the report of the week with the outage."""
    return w.report(two_cameras)


def test_rates_of_areas_add_up_to_the_floors(of_two: WeekReport) -> None:
    report = of_two
    for attribute in ("value", "previous"):
        parts = [getattr(a.violation_rate, attribute) for a in report.areas]
        assert sum(parts) == pytest.approx(getattr(report.level.violation_rate, attribute), rel=1e-12)
    assert sum(a.counted or 0 for a in report.areas) == report.level.violations == figures_by_id(report)["M8"].value
    assert sum(a.exposure_h or 0 for a in report.areas) == pytest.approx(report.level.exposure_h)
    assert sum(a.share or 0 for a in report.areas) == pytest.approx(1)


def test_one_rate_on_page_in_json_by_command_and_in_python(
    two_cameras: Site, of_two: WeekReport, capsys: pytest.CaptureFixture[str]
) -> None:
    report = of_two
    by_hand = total(busy) / 21 + 12
    assert report.level.violation_rate.value == pytest.approx(by_hand)
    assert figures_json(report)["M0"]["value"] == pytest.approx(by_hand, rel=1e-6)
    page = render_html(report)
    assert f'<span>{by_hand:.0f}</span> <span class="unit">violations per open hour' in page
    arguments = ["-C", str(two_cameras.root), "hours", "--week", "2026-W46", "--by", "camera", "--json"]
    assert run(cli, arguments) == 0
    rows = json.loads(capsys.readouterr().out)["hours"]
    rate = 0.0
    for camera in TWO:
        own = [r for r in rows if r["camera_id"] == camera and r["open_s"] and r["recorded_s"] >= r["open_s"] / 2]
        rate += sum(r["n_violations"] for r in own) / (sum(r["recorded_s"] for r in own) / 3600)
    assert rate == pytest.approx(by_hand)
    tables = {name: list(csv.DictReader(io.StringIO(t))) for name, t in to_csv(report).items()}
    assert sum(float(r["per_open_hour"]) for r in tables["areas.csv"]) == pytest.approx(by_hand, rel=1e-5)


def test_counts_are_those_of_plain_sql_over_the_store(two_cameras: Site, of_two: WeekReport) -> None:
    """Pairs closer than 2 m, joined to episodes by plain window functions over the stored positions."""
    import duckdb

    glob = str(two_cameras.root / "store" / "observations" / "**" / "*.parquet")
    n = (
        duckdb.connect()
        .execute(
            "with o as (select camera_id, epoch_ms(ts) as ms, track_id, x_mm, y_mm from read_parquet($glob) "
            "where ts >= timestamptz '2026-11-09 00:00+01' and ts < timestamptz '2026-11-16 00:00+01'), "
            "p as (select a.camera_id, a.ms, a.track_id as ta, b.track_id as tb from o as a join o as b on "
            "a.camera_id = b.camera_id and a.ms = b.ms and a.track_id < b.track_id "
            "where (a.x_mm - b.x_mm) ** 2 + (a.y_mm - b.y_mm) ** 2 < 2000 ** 2), "
            "s as (select coalesce(ms - lag(ms) over w > 25000, true) as begins from p "
            "window w as (partition by camera_id, ta, tb order by ms)) select count(*) from s where begins",
            {"glob": glob},
        )
        .fetchall()[0][0]
    )
    assert of_two.level.violations == n


def test_a_camera_that_hardly_counts_an_area_does_not_make_it_incomplete(of_two: WeekReport) -> None:
    rows = {a.area_id: a for a in of_two.areas}
    assert rows["queue"].cameras == ("cam-1",)
    assert rows["queue"].recorded_share == 1
    assert rows["door"].cameras == ("cam-1", "cam-2")
    assert 0.85 < (rows["door"].recorded_share or 0) < 0.95


# missing is never zero ------------------------------------------------------------------------------------------------


def test_a_planted_outage_is_hatched_and_moves_no_rate(tmp_path: Path) -> None:
    all_lost = [(w.rome(1, 11), w.rome(1, 12))]
    low = [(w.rome(6, 9), w.rome(6, 9, 35))]
    one_lost = [(w.rome(3, 10), w.rome(4, 10))]
    before = [list(w.messages(busy, monday=w.BEFORE, camera=c)) for c in TWO]
    whole = w.world(tmp_path / "a", w.toml(cameras=TWO), *before, *(w.messages(busy, camera=c) for c in TWO))
    holed = w.world(
        tmp_path / "b",
        w.toml(cameras=TWO),
        *before,
        w.messages(busy, lost=all_lost + low),
        w.messages(busy, camera="cam-2", lost=all_lost + low + one_lost),
    )
    truth, report = w.report(whole), w.report(holed)
    cells = {(c.day.weekday(), c.hour): c for c in report.when.cells}
    assert (cells[1, 11].state, cells[1, 11].violations, cells[1, 11].scaled) == ("no_data", None, None)
    assert cells[6, 9].state == "low_data"
    assert [(cells[k].state, cells[k].cameras_down) for k in ((3, 10), (3, 11), (4, 9))] == [("partial", 1)] * 3
    assert cells[4, 10].state == "full"
    page = render_html(report)
    assert page.count('<td class="hatch">') == 1
    assert len(re.findall(r'<td class="b\d low">', page)) == 1
    assert len(re.findall(r'<td class="b\d part">', page)) == 3
    assert truth.level.violation_rate.verdict == report.level.violation_rate.verdict == "cannot_tell"
    pairs = zip(
        [truth.level.violation_rate, *(a.violation_rate for a in truth.areas)],
        [report.level.violation_rate, *by_id(report, truth)],
        strict=True,
    )
    for whole_week, holed_week in pairs:
        assert holed_week.lo is not None
        assert holed_week.hi is not None
        assert holed_week.lo <= (whole_week.value or 0) <= holed_week.hi
    assert truth.level.encounter_rate.value == pytest.approx(report.level.encounter_rate.value, rel=0.03)
    detected = [line for line in report.log if line.kind == "detected"]
    assert [line.at for line in detected] == [w.rome(3, 10)]


def by_id(report: WeekReport, other: WeekReport) -> list[Any]:
    rows = {a.area_id: a.violation_rate for a in report.areas}
    return [rows[a.area_id] for a in other.areas]


def test_averages_are_of_full_hours_only(of_two: WeekReport) -> None:
    report = of_two
    full = [c for c in report.when.cells if c.state == "full"]
    for mean in report.when.day_means:
        own = [c.violations or 0 for c in full if c.day == mean.day]
        assert mean.hours == len(own)
        assert mean.value == pytest.approx(sum(own) / len(own))
    assert report.busiest_hour is not None
    assert report.busiest_hour.violations == max(c.violations or 0 for c in full)


@pytest.mark.parametrize(
    ("monday", "n_hours", "labels"),
    [(date(2026, 10, 19), 169, [1, 2, 2, 3]), (date(2026, 3, 23), 167, [1, 3])],
    ids=["clocks set back", "clocks set forward"],
)
def test_weeks_with_a_change_of_the_clocks_have_all_their_hours(
    tmp_path: Path, monday: date, n_hours: int, labels: list[int]
) -> None:
    config = w.toml(opening='{ mon-sun = "00:00-24:00" }')
    start = monday + timedelta(days=5)
    stream = list(w.messages(w.steady({w.QUEUE: 6}), monday=start, hours=(0, 48), days=[0]))
    report = w.report(w.world(tmp_path, config, stream), monday)
    assert len(report.when.cells) == n_hours
    sunday = [c for c in report.when.cells if c.day == monday + timedelta(days=6)]
    assert [c.hour for c in sunday if 1 <= c.hour <= 3] == labels
    starts = [c.start for c in report.when.cells]
    gaps = {(b.timestamp() - a.timestamp()) for a, b in itertools.pairwise(starts)}
    assert gaps == {3600.0}
    assert [c.violations for c in sunday if c.hour in (1, 2)] == [6] * (len(labels) - 1)
    assert report.coverage.open_h == n_hours
    table = render_html(report).split('<table class="tt">')[1].split("</table>")[0]
    assert table.count("for the second time") == labels.count(2) // 2
    rows = list(csv.DictReader(io.StringIO(to_csv(report)["hours.csv"])))
    assert len({r["start"] for r in rows}) == n_hours


# small counts ---------------------------------------------------------------------------------------------------------


def leaves(value: Any) -> Iterator[float]:
    match value:
        case bool() | None | str():
            return
        case dict():
            for item in value.values():
                yield from leaves(item)
        case list():
            for item in value:
                yield from leaves(item)
        case _:
            yield float(value)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> WeekReport:
    """A door with three violations, two hours with one each, the week before with one at the door."""

    def now(day: int, hour: int) -> dict[w.Place, int]:
        if (day, hour) in {(2, 9), (4, 10)}:
            return {w.QUEUE: 1}
        return {w.QUEUE: 20 + day % 3, w.DOOR: 1 if (day, hour) in {(0, 9), (3, 9), (5, 11)} else 0, w.AISLE: 7}

    def before(day: int, hour: int) -> dict[w.Place, int]:
        return {w.QUEUE: 20 + (day * 2) % 3, w.DOOR: int((day, hour) == (1, 9)), w.AISLE: 7}

    log = [{"at": "2026-11-12T09:30:00+01:00", "text": "Rope moved", "area": "door"}]
    streams = w.messages(before, monday=w.BEFORE), w.messages(now)
    return w.report(w.world(tmp_path_factory.mktemp("small"), w.toml(), *streams, log=log))


def test_a_small_area_and_one_other_are_held_back(small: WeekReport) -> None:
    rows = {a.area_id: a for a in small.areas}
    assert rows["door"].is_masked
    assert rows[None].is_held_back
    assert not rows["queue"].is_masked
    for row in (rows["door"], rows[None]):
        assert (
            row.counted,
            row.share,
            row.violation_rate.value,
            row.violation_rate.previous,
            row.violation_rate.change,
        ) == (None,) * 5
        assert row.encounter_rate is not None
        assert row.encounter_rate.value is None
    assert rows["queue"].counted == sum(20 + d % 3 for d in range(7)) * 3 - (22 + 21) + 2
    assert rows["queue"].violation_rate.previous is not None


def test_the_floor_less_its_areas_does_not_tell_the_small_one(small: WeekReport) -> None:
    shown = sum(a.counted for a in small.areas if a.counted is not None)
    assert small.level.violations is not None
    assert small.level.violations - shown >= 5 + 1 + 1
    known_before = sum(a.violation_rate.previous for a in small.areas if a.violation_rate.previous is not None)
    assert (small.level.violation_rate.previous or 0) - known_before > 7 / 21


def test_small_hours_cannot_be_worked_out_from_means_or_totals(small: WeekReport) -> None:
    cells = small.when.cells
    masked = {(c.day.weekday(), c.hour) for c in cells if c.is_masked}
    assert masked == {(2, 9), (4, 10)}
    held = [c for c in cells if c.is_held_back]
    assert held
    assert {c.violations for c in cells if c.is_masked or c.is_held_back} == {None}
    for mean in small.when.day_means:
        shown = [
            2.5 if c.is_masked else float(c.violations or 0) for c in cells if c.day == mean.day and not c.is_held_back
        ]
        assert mean.value == pytest.approx(sum(shown) / len(shown))
        assert mean.hours == len(shown)
    assert small.busiest_hour is not None
    assert small.busiest_hour.violations == max(c.violations or 0 for c in cells)


def test_a_log_entry_tells_no_small_count(small: WeekReport) -> None:
    (line,) = small.log
    assert line.moved_after is None


def test_no_small_count_is_printed_anywhere(small: WeekReport) -> None:
    page = render_html(small)
    table = page.split('<table class="tt">')[1].split("</table>")[0]
    assert not {"1", "2", "3", "4"} & set(re.findall(r">([^<>]*)<", table))
    assert "&lt;5" in table
    assert "…" in table
    assert "count &lt;5 as 2.5" in page
    hours_csv = list(csv.DictReader(io.StringIO(to_csv(small)["hours.csv"])))
    assert {r["state"] for r in hours_csv if r["violations"] == ""} == {"masked", "held_back"}
    areas_csv = list(csv.DictReader(io.StringIO(to_csv(small)["areas.csv"])))
    assert [(r["area"], r["state"]) for r in areas_csv if r["counted"] == ""] == [("door", "masked"), ("", "held_back")]
    twin = json.loads(to_json(small))
    for part in (twin["areas"], figures_json(small)["M15"], twin["when"]["cells"], twin["log"]):
        for row in part if isinstance(part, list) else part["rows"]:
            row.pop("hour", None), row.pop("fold", None), row.pop("cameras_down", None), row.pop("rank", None)
            assert set(leaves(row)) & {n / k for n in (1.0, 2.0, 3.0, 4.0) for k in (1, 21)} <= {1.0}  # shares of 1


def test_every_number_of_a_page_with_small_counts_is_in_its_json_file(small: WeekReport) -> None:
    assert strangers(small, render_html(small)) == set()


def test_a_week_of_few_violations_tells_only_that(tmp_path: Path) -> None:
    def few(day: int, hour: int) -> dict[w.Place, int]:
        return {w.QUEUE: 1} if (day, hour) in {(0, 9), (3, 9), (5, 11)} else {}

    report = w.report(w.world(tmp_path, w.toml(), w.messages(few)))
    level = report.level
    assert (level.violation_rate.value, level.encounter_rate.value, level.violations) == (None, None, None)
    assert reason_text(level.violation_rate.reason) == "fewer than 5 violations were counted"
    assert figures_by_id(report)["M0"].value is figures_by_id(report)["M8"].value is None
    assert figures_by_id(report)["M0"].state == "not_enough_data"
    assert report.busiest_hour is None
    assert {c.violations for c in report.when.cells} == {0, None}
    assert [m.bands for m in report.maps] == [()]
    page = render_html(report)
    assert "Very few violations in week 46" in page
    twin = json.loads(to_json(report))
    for part in (twin["level"], twin["answers"], figures_json(report)):
        assert 3 / 21 not in {round(v, 6) for v in leaves(part)}


def test_an_area_whose_only_camera_was_down_has_no_count_rather_than_zero(tmp_path: Path) -> None:
    queue, door = w.steady({w.QUEUE: 20}), w.steady({w.DOOR: 20})
    site = w.world(
        tmp_path,
        w.toml(cameras=TWO),
        w.messages(queue, monday=w.BEFORE),
        w.messages(door, monday=w.BEFORE, camera="cam-2"),
        w.messages(queue),
    )
    report = w.report(site)
    rows = {a.area_id: a for a in report.areas}
    assert rows["queue"].counted == 20 * 21
    assert (rows["door"].counted, rows["door"].exposure_h, rows["door"].violation_rate.value) == (None, None, None)
    assert re.search(r"<th scope=\"row\">Door</th><td class=\"n\">–</td>", render_html(report))
    twin = {a["area_id"]: a for a in json.loads(to_json(report))["areas"]}
    assert (twin["door"]["counted"], twin["door"]["exposure_h"]) == (None, None)


def test_a_week_before_of_few_violations_is_neither_shown_nor_worked_out(tmp_path: Path) -> None:
    def few(day: int, hour: int) -> dict[w.Place, int]:
        return {w.QUEUE: 1} if (day, hour) in {(0, 9), (3, 9), (5, 11)} else {}

    site = w.world(tmp_path, w.toml(), w.messages(few, monday=w.BEFORE), w.messages(busy))
    report = w.report(site)
    queue = next(a for a in report.areas if a.area_id == "queue")
    for told in (report.level.violation_rate, queue.violation_rate):
        assert told.value is not None
        assert (told.previous, told.change) == (None, None)
        assert reason_text(told.reason) == "fewer than 5 violations were counted in the week before"
    twin = json.loads(to_json(report))
    assert 3 / 21 not in {round(v, 6) for v in leaves(twin)}


def test_a_patch_of_floor_with_few_violations_stays_blank_on_the_map(tmp_path: Path) -> None:
    """One recorded hour: three violations at one place would reach the first colour."""

    def now(day: int, hour: int) -> dict[w.Place, int]:
        return {w.QUEUE: 40, w.DOOR: 3}

    config = w.toml(more="[rule]\n") + "[report]\nmin_coverage = 0.0\n"
    site = w.world(tmp_path, config, w.messages(now, days=[0], hours=(9, 10)))
    (drawn,) = w.report(site).maps
    xs = [x for band in drawn.bands for polygon in band.polygons for x, _ in polygon[0]]
    assert drawn.bands
    assert max(xs) < w.DOOR[0] - 1
