"""Footfall of counting lines (M60): sums worked out here, over hours that both weeks recorded, hidden where small."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report import ingested_worlds as w

import vsd_analytics as vsd
from vsd_analytics.answer import Answer, Value
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.footfall import footfall_answers
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.answers import audience_answers
from vsd_analytics.site.places import named_floors
from vsd_analytics.stats.usual import usual_range
from vsd_analytics.warehouse.warehouse import open_warehouse

MONDAY = date(2026, 11, 9)
WEEK = timedelta(weeks=1)
LINE = '[[line]]\nid = "door"\nname = "<b>Door</b>"\ncounted_by = "counter"\nleft = "Shop"\nright = "Street"\n'
HOURS = (8, 9, 10, 11)


def site(root: Path, counts: dict[datetime, tuple[int, int]], *, more: str = "") -> Path:
    """Make a shop that is open from 8 to 12 with one counter; counts of people in and out by hour."""
    text = w.toml(cameras=("cam",), opening='{ mon-sun = "08:00-12:00" }') + LINE + more
    (root / "vsd.toml").write_text(text, encoding="utf-8")
    file = root / "doors.csv"
    lines = [f"{hour:%Y-%m-%dT%H:%M},{n_in},{n_out}" for hour, (n_in, n_out) in counts.items()]
    file.write_text("\n".join(["time,in,out", *lines]), encoding="utf-8")
    words = ["counts", "add", str(file), "--line", "door", "--left", "in", "--right", "out", "--every", "1h"]
    assert run(cli, ["-C", str(root), *words]) == 0
    return root


def weeks(*, n_weeks: int, seed: int = 0, monday: date = MONDAY) -> dict[datetime, tuple[int, int]]:
    """Return counts of some weeks that end with the one from `monday`."""
    rng = np.random.default_rng(seed)
    first = monday - (n_weeks - 1) * WEEK
    hours = [
        datetime.combine(first + timedelta(days=d), datetime.min.time()) + timedelta(hours=h)
        for d in range(7 * n_weeks)
        for h in HOURS
    ]
    return {hour: (int(rng.poisson(40)), int(rng.poisson(40))) for hour in hours}


def answers(root: Path, *, is_exact: bool = True, monday: date = MONDAY) -> dict[str, Answer]:
    project = load_site(root)
    project = project.with_settings(mask_below=0) if is_exact else project
    with open_warehouse(project, monday - 12 * WEEK, monday + timedelta(days=6)) as warehouse:
        period = Period(FloorHours(warehouse, floor=project.floors[0]), monday, monday + timedelta(days=6))
        return {answer.name: answer for answer in audience_answers(footfall_answers(period), project)}


def value(cell: Any) -> float | None:
    assert isinstance(cell, Value)
    return cell.value


def week_sum(counts: dict[datetime, tuple[int, int]], monday: date) -> int:
    return sum(a + b for hour, (a, b) in counts.items() if monday <= hour.date() < monday + WEEK)


def test_a_week_its_usual_range_and_its_changes_are_those_of_the_sums(tmp_path: Path) -> None:
    counts = weeks(n_weeks=13)
    a_year_before = {hour - 52 * WEEK: (n // 2, m // 2) for hour, (n, m) in counts.items() if hour.date() >= MONDAY}
    (row,) = answers(site(tmp_path, {**a_year_before, **counts}))["footfall"].rows
    sums = [week_sum(counts, MONDAY - k * WEEK) for k in reversed(range(13))]
    usual = usual_range([n / 28 for n in sums[:-1]])
    assert usual is not None
    assert value(row["n_open"]) == sums[-1]
    assert value(row["per_open_h"]) == pytest.approx(sums[-1] / 28)
    assert [value(row["usual_lo"]), value(row["usual_hi"])] == pytest.approx([usual.lo, usual.hi])
    assert row["beside_usual"] == usual.position(sums[-1] / 28)
    assert value(row["change_week"]) == pytest.approx(sums[-1] / sums[-2] - 1)
    assert value(row["change_year"]) == pytest.approx(sums[-1] / week_sum(a_year_before, MONDAY - 52 * WEEK) - 1)


def test_an_outage_lowers_no_rate_and_changes_are_over_hours_that_both_weeks_recorded(tmp_path: Path) -> None:
    counts = weeks(n_weeks=13, seed=3)
    lost = datetime(2026, 11, 10, 9)
    kept = {hour: n for hour, n in counts.items() if hour != lost}
    (row,) = answers(site(tmp_path, kept))["footfall"].rows
    now, before = week_sum(kept, MONDAY), week_sum(kept, MONDAY - WEEK)
    assert value(row["per_open_h"]) == pytest.approx(now / 27)
    same_hour_before = sum(counts[lost - WEEK])
    assert value(row["change_week"]) == pytest.approx(now / (before - same_hour_before) - 1)
    assert (row["recorded_open_h"], row["open_h"]) == (27, 28)


def test_a_week_with_little_recorded_has_no_rate_and_says_why(tmp_path: Path) -> None:
    counts = weeks(n_weeks=6)
    kept = {hour: n for hour, n in counts.items() if hour.date() < MONDAY or hour.date().weekday() < 3}
    (row,) = answers(site(tmp_path, kept))["footfall"].rows
    assert value(row["per_open_h"]) is None
    assert row["beside_usual"] is None
    assert value(row["change_week"]) is None
    assert value(row["n_open"]) == week_sum(kept, MONDAY)
    weekly = answers(tmp_path)["footfall_weeks"].rows
    assert [value(each["per_open_h"]) is None for each in weekly] == [False] * 5 + [True]


def test_four_weeks_are_needed_for_what_is_usual_and_expected(tmp_path: Path) -> None:
    found = answers(site(tmp_path, weeks(n_weeks=3)))
    (row,) = found["footfall"].rows
    assert value(row["usual_lo"]) is None
    assert all(value(day["n_expected"]) is None for day in found["footfall_next"].rows)


def test_a_public_holiday_of_next_week_is_expected_like_a_sunday(tmp_path: Path) -> None:
    monday, holiday = date(2026, 11, 30), date(2026, 12, 8)
    drawn = weeks(n_weeks=13, monday=monday)
    counts = {h: (n * (1 if h.weekday() == 6 else 4), m) for h, (n, m) in drawn.items()}
    for more, is_special in (("", False), ('[calendar]\ncountry = "IT"\n', True)):
        folder = tmp_path / str(is_special)
        folder.mkdir()
        found = answers(site(folder, counts, more=more), monday=monday)["footfall_next"]
        expected = {row["local_date"]: value(row["n_expected"]) for row in found.rows}
        assert len(expected) == 7
        sunday = expected[monday + timedelta(days=13)]
        assert sunday is not None
        assert (expected[holiday] == sunday) is is_special
        assert bool(found.notes) is is_special


def test_few_people_of_one_direction_do_not_count_for_readers(tmp_path: Path) -> None:
    counts = {hour: (n, 0) for hour, (n, _) in weeks(n_weeks=13).items()}
    counts[datetime(2026, 11, 10, 9)] = (40, 2)
    root = site(tmp_path, counts)
    (row,) = answers(root, is_exact=False)["footfall"].rows
    assert value(row["n_open"]) == week_sum(counts, MONDAY) - 2
    assert "n_left" not in row
    alone = {hour: (n_in, 0) for hour, (n_in, _) in counts.items()}
    (tmp_path / "alone").mkdir()
    without = answers(site(tmp_path / "alone", alone), is_exact=False)
    assert answers(root, is_exact=False)["footfall_next"].rows == without["footfall_next"].rows
    (exact,) = answers(root)["footfall"].rows
    assert value(exact["n_open"]) == week_sum(counts, MONDAY)


def test_the_page_of_a_week_is_written_escaped_and_the_same_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = site(tmp_path, weeks(n_weeks=13))
    command = ["-C", str(root), "--now", "2026-11-20T12:00:00Z", "--quiet", "lines", "--week", "2026-W46", "--page"]
    assert run(cli, command) == 0
    page = root / "reports" / "footfall-2026-W46.html"
    first = page.read_bytes()
    assert b"<b>Door" not in first
    assert "&lt;b&gt;Door" in first.decode()
    assert "people crossed in the open time" in first.decode()
    assert run(cli, command) == 0
    assert page.read_bytes() == first
    capsys.readouterr()
    assert run(cli, [*command, "--json"]) == 2
    assert "vsd lines --week last --page" in capsys.readouterr().out
    assert run(cli, [*command[:-1], "--out", str(tmp_path)]) == 2


def test_reports_have_the_footfall_of_their_week(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = site(tmp_path, weeks(n_weeks=13))
    capsys.readouterr()
    words = ["report", "--week", "2026-W46", "--format", "json", "--out", "-"]
    assert run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", "--quiet", *words]) == 0
    (row,) = json.loads(capsys.readouterr().out)["answers"]["footfall"]["rows"]
    assert row["line_id"] == "door"
    assert row["n_open"]["value"] == week_sum(weeks(n_weeks=13), MONDAY)


@pytest.mark.parametrize("has_few", [False, True])
def test_python_has_the_footfall_of_the_json_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], has_few: bool
) -> None:
    counts = {hour: (n, 0 if has_few else m) for hour, (n, m) in weeks(n_weeks=9).items()}
    root = site(tmp_path, {**counts, datetime(2026, 11, 10, 9): (40, 2)})
    capsys.readouterr()
    words = ["--quiet", "report", "--week", "2026-W46", "--format", "json", "--out", "-"]
    assert run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", *words]) == 0
    shared = json.loads(capsys.readouterr().out)["answers"]
    week = vsd.open(root).week("2026-W46")
    for name in ("footfall", "footfall_weeks", "footfall_next"):
        found = list(getattr(week, name))
        assert found
        for row, of_file in zip(found, shared[name]["rows"], strict=True):
            for key, cell in of_file.items():
                if isinstance(cell, dict):
                    assert row[key] == (None if cell["value"] is None else pytest.approx(cell["value"], rel=1e-5)), key
                    assert (row[f"{key}_state"], row[f"{key}_reason"]) == (cell["state"], cell["reason"])
    assert len(week.sql("select * from footfall_weeks")) == len(week.footfall_weeks) > 1
    few_days = vsd.open(root).days("2026-11-09..2026-11-11").footfall
    assert (len(few_days), few_days.columns) == (0, week.footfall.columns)
    assert 'site.week("2026-W46")' in few_days.note


@pytest.mark.parametrize(
    "words", [["report"], ["today"], ["forecast"], ["planner"], ["export", "--duckdb", "x.duckdb"]]
)
def test_pages_of_cameras_are_refused_where_counters_count_alone_and_the_fix_works(
    tmp_path: Path, words: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    root = site(tmp_path, weeks(n_weeks=6))
    text = (root / "vsd.toml").read_text(encoding="utf-8")
    begin = text.index("[[camera]]")
    (root / "vsd.toml").write_text(text[:begin] + text[text.index("[[line]]") :], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    project = ["-C", str(root), "--now", "2026-11-16T12:00:00Z", "--quiet"]
    assert run(cli, [*project, *words]) == 2
    said = capsys.readouterr().err
    assert "no [[camera]] of vsd.toml looks at any floor" in said
    assert "fix: vsd lines --week last --page" in said
    assert run(cli, [*project, "lines", "--week", "last", "--page"]) == 0


def test_a_floor_without_a_camera_is_left_out_of_the_pages_of_the_others(tmp_path: Path) -> None:
    root = tmp_path
    (root / "vsd.toml").write_text(w.toml(cameras=("cam",)), encoding="utf-8")
    project = load_site(root)
    attic = replace(project.floors[0], floor_id="attic", name="Attic")
    assert named_floors(replace(project, floors=(*project.floors, attic)), None) == [project.floors[0].floor_id]
    with pytest.raises(UsageError, match="looks at floor 'attic'"):
        named_floors(replace(project, floors=(*project.floors, attic)), "attic")
