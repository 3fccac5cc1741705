"""What readers of footfall may know: no small count by any subtraction, in one page or two, nor by what is expected."""

from __future__ import annotations

import json
import tempfile
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from figures.test_footfall import HOURS, MONDAY, WEEK, answers, site, value, week_sum, weeks
from hypothesis import given, settings
from hypothesis import strategies as st

import vsd_analytics
from vsd_analytics.answer import Answer
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.figures.lines import line_answers
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.answers import audience_answers
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.crossings import evened_hours
from vsd_analytics.warehouse.warehouse import open_warehouse

BELOW = 5
Counts = dict[datetime, tuple[int, int]]
AFTER = "2026-11-20T12:00:00Z"


def is_small(n: float | None) -> bool:
    return n is not None and 0 < abs(n) < BELOW


def lines_of_week(root: Path, monday: date = MONDAY) -> dict[str, Answer]:
    project = load_site(root)
    with open_warehouse(project, monday, monday + timedelta(days=6)) as warehouse:
        period = Period(FloorHours(warehouse, floor=project.floors[0]), monday, monday + timedelta(days=6))
        return {answer.name: answer for answer in audience_answers(line_answers(period), project)}


def page(root: Path, now: str = AFTER) -> tuple[int, bytes]:
    """Return the exit code of the page of the week, and the page."""
    code = run(cli, ["-C", str(root), "--now", now, "--quiet", "lines", "--week", "2026-W46", "--page"])
    file = root / "reports" / "footfall-2026-W46.html"
    return code, file.read_bytes() if file.exists() else b""


def add_more(root: Path, counts: Counts) -> None:
    rows = [f"{hour:%Y-%m-%dT%H:%M},{a},{b}" for hour, (a, b) in counts.items()]
    (root / "more.csv").write_text("\n".join(["time,in,out", *rows]), encoding="utf-8")
    words = ["counts", "add", str(root / "more.csv"), "--line", "door", "--left", "in", "--right", "out"]
    assert run(cli, ["-C", str(root), *words, "--every", "1h", "--replace", "--yes"]) == 0


@pytest.mark.parametrize("days", range(1, 7))
def test_no_page_of_a_week_that_goes_on_leaves_so_no_two_pages_tell_what_a_day_added(
    days: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = site(tmp_path, weeks(n_weeks=13))
    assert page(root, f"2026-11-{9 + days:02}T12:00:00Z") == (2, b"")
    assert "E105" in capsys.readouterr().err


@pytest.mark.parametrize(("options", "is_said"), [((), True), (("--exact",), False)])
def test_readers_are_told_that_few_of_closed_hours_may_be_counted(
    options: tuple[str, ...], is_said: bool, tmp_path: Path
) -> None:
    root = site(tmp_path, weeks(n_weeks=13))
    words = ["-C", str(root), "--now", AFTER, "--quiet", "lines", "--week", "2026-W46", "--page", *options]
    assert run(cli, words) in (0, 1)
    (html,) = root.rglob("footfall-2026-W46*.html")
    assert ("may include a few crossings outside the open time" in html.read_text(encoding="utf-8")) is is_said


@pytest.mark.parametrize(("late", "leaves"), [((2, 0), False), ((3, 1), False), ((0, 0), True), ((30, 40), True)])
def test_counts_that_come_after_the_page_do_not_leave_where_they_are_few(
    late: tuple[int, int], leaves: bool, tmp_path: Path
) -> None:
    hour = datetime(2026, 11, 10, 9)
    counts = weeks(n_weeks=13)
    root = site(tmp_path, {h: n for h, n in counts.items() if h != hour})
    _, first = page(root)
    assert b"2,1" in first or b"2,2" in first
    add_more(root, {hour: late})
    (row,) = answers(root, is_exact=False)["footfall"].rows
    assert (value(row["n_open"]) is not None) is leaves
    (whole,) = lines_of_week(root)["lines"].rows
    assert value(whole["n_both"]) is not None, "crossings of vsd lines never left before"
    code, second = page(root)
    assert code == (0 if leaves else 1)
    if not leaves:
        (then,) = answers(root)["footfall"].rows
        assert f"{value(then['n_open']):,.0f}".encode() not in second


def test_days_of_a_counter_that_come_one_by_one_never_tell_one_of_few_people(tmp_path: Path) -> None:
    """The week is over; its counts come day by day, and a page is made after each."""
    counts = weeks(n_weeks=13)
    quiet = {h: (1, 0) if h.hour == 8 and h.date() == MONDAY + timedelta(days=4) else n for h, n in counts.items()}
    friday = MONDAY + timedelta(days=4)
    quiet = {h: n for h, n in quiet.items() if h.date() != friday or h.hour == 8}
    root = site(tmp_path, {h: n for h, n in quiet.items() if h.date() < MONDAY + timedelta(days=2)})
    seen: list[float] = []
    for day in range(2, 7):
        add_more(root, {h: n for h, n in quiet.items() if h.date() == MONDAY + timedelta(days=day)})
        (row,) = answers(root, is_exact=False)["footfall"].rows
        (whole,) = lines_of_week(root)["lines"].rows
        seen += [n for n in (value(row["n_open"]), value(whole["n_both"])) if n is not None]
    assert len(seen) > 4
    assert not any(is_small(a - b) for a in seen for b in seen)


def test_a_week_before_that_changed_a_little_is_told_by_no_change_range_or_expectation(tmp_path: Path) -> None:
    hour = datetime(2026, 11, 3, 9)
    counts = weeks(n_weeks=13)
    root = site(tmp_path, counts)
    before = answers(root, is_exact=False)
    n_in, n_out = counts[hour]
    add_more(root, {hour: (n_in + 2, n_out)})
    after = answers(root, is_exact=False)
    (row,) = after["footfall"].rows
    assert value(row["n_open"]) == week_sum(counts, MONDAY)
    assert [value(row[name]) for name in ("usual_lo", "usual_hi", "change_week", "change_year")] == [None] * 4
    assert row["beside_usual"] is None
    assert {value(day[name]) for day in after["footfall_next"].rows for name in ("n_expected", "n_busiest")} == {None}
    known = {r["week"]: value(r["n_open"]) for r in after["footfall_weeks"].rows}
    then = {r["week"]: value(r["n_open"]) for r in before["footfall_weeks"].rows}
    assert known == {**then, "2026-W45": None}


def test_people_in_closed_hours_are_not_told_by_all_less_those_of_open_hours(tmp_path: Path) -> None:
    """A few count with the week, and the week is still shown: nobody comes before a shop opens but some do."""
    counts = weeks(n_weeks=13)
    root = site(tmp_path, {**counts, datetime(2026, 11, 12, 6): (2, 1), datetime(2026, 11, 5, 6): (0, 1)})
    (row,) = answers(root, is_exact=False)["footfall"].rows
    (whole,) = lines_of_week(root)["lines"].rows
    assert value(row["n_open"]) == value(whole["n_both"]) == week_sum(counts, MONDAY) + 3
    assert value(row["per_open_h"]) == pytest.approx((week_sum(counts, MONDAY) + 3) / 28)
    before = week_sum(counts, MONDAY - WEEK) + 1
    assert value(row["change_week"]) == pytest.approx((week_sum(counts, MONDAY) + 3) / before - 1)
    history = [value(r["n_open"]) for r in answers(root, is_exact=False)["footfall_weeks"].rows]
    assert history[-2:] == [before, week_sum(counts, MONDAY) + 3]
    (exact,) = answers(root)["footfall"].rows
    assert value(exact["n_open"]) == week_sum(counts, MONDAY), "the operator sees the open hours alone"


@pytest.mark.parametrize("closed", [{}, {datetime(2026, 11, 12, 6): (2, 0)}, {datetime(2026, 11, 12, 6): (0, 1)}])
def test_a_way_in_that_three_people_leave_by_has_its_footfall_without_them(closed: Counts, tmp_path: Path) -> None:
    counts = {hour: (n_in, 0) for hour, (n_in, _) in weeks(n_weeks=13).items()}
    hour = datetime(2026, 11, 10, 9)
    root = site(tmp_path, {**counts, hour: (counts[hour][0], 2), **closed})
    (row,) = answers(root, is_exact=False)["footfall"].rows
    (whole,) = lines_of_week(root)["lines"].rows
    assert (value(whole["n_both"]), value(whole["n_to_right"])) == (None, None)
    assert value(row["n_open"]) == value(whole["n_to_left"])
    assert value(row["n_open"]) == week_sum(counts, MONDAY) + sum(n_in for n_in, _ in closed.values())
    (exact,) = answers(root)["footfall"].rows
    assert value(exact["n_open"]) == week_sum(counts, MONDAY) + 2


def test_the_few_of_closed_hours_change_nothing_that_is_expected_but_by_the_sum_of_their_week(tmp_path: Path) -> None:
    """Two worlds with the same sums of weeks, one with four people of each before it opens: as many are expected."""
    counts = {hour: (9 + n_in % 7, 0) for hour, (n_in, _) in weeks(n_weeks=13).items()}
    moved = {**counts}
    for monday in (datetime.combine(MONDAY - k * WEEK, datetime.min.time()) for k in range(13)):
        moved[monday + timedelta(hours=9)] = (counts[monday + timedelta(hours=9)][0] - 4, 0)
        moved[monday + timedelta(hours=6)] = (4, 0)
    sums = []
    for name, world in (("open", counts), ("closed", moved)):
        (tmp_path / name).mkdir()
        days = answers(site(tmp_path / name, world), is_exact=False)["footfall_next"].rows
        sums.append(sum(value(day["n_expected"]) or 0 for day in days))
    assert sums[0] > 300
    assert sums[1] == pytest.approx(sums[0], rel=4e-3), "open hours alone would be 1.2 % fewer"


@pytest.mark.parametrize("n_before", [(3, 0), (500, 2)])
def test_a_change_does_not_tell_the_few_people_of_the_week_before(n_before: tuple[int, int], tmp_path: Path) -> None:
    counts = weeks(n_weeks=13)
    before = [h for h in counts if MONDAY - WEEK <= h.date() < MONDAY]
    counts |= dict.fromkeys(before, (0, 0)) | {before[0]: n_before}
    (row,) = answers(site(tmp_path, counts), is_exact=False)["footfall"].rows
    n_now, change = value(row["n_open"]), value(row["change_week"])
    assert n_now is not None
    assert change is None or n_now / (1 + change) == pytest.approx(n_before[0]), "those to the other side do not count"
    assert (change is None) is (n_before[0] < BELOW)


def test_a_change_does_not_tell_the_few_people_of_an_hour_that_one_week_did_not_record(tmp_path: Path) -> None:
    counts = weeks(n_weeks=13)
    hour = datetime(2026, 11, 5, 9)
    kept = {**counts, hour: (2, 1)}
    del kept[hour + WEEK]
    root = site(tmp_path, kept)
    (exact,) = answers(root)["footfall"].rows
    (row,) = answers(root, is_exact=False)["footfall"].rows
    assert value(exact["change_week"]) is not None
    assert value(row["change_week"]) is None


def test_hours_of_few_people_are_not_told_by_what_is_expected_of_them(tmp_path: Path) -> None:
    """The site has many people in a week, but never more than four in an hour."""
    hours = list(weeks(n_weeks=13))
    root = site(tmp_path, {h: (1 + h.day % 3, h.hour % 2) for h in hours})
    found = answers(root, is_exact=False)
    exact = answers(root)
    assert value(found["footfall"].rows[0]["n_open"]) is not None
    assert any(is_small(value(row["n_busiest"])) for row in exact["footfall_next"].rows)
    assert not any(is_small(value(row["n_busiest"])) for row in found["footfall_next"].rows)
    assert {row["busiest_hour"] for row in found["footfall_next"].rows} == {None}


@pytest.mark.parametrize("language", ["en", "it"])
def test_two_worlds_that_differ_in_hours_of_few_people_have_the_same_page(language: str, tmp_path: Path) -> None:
    pages = []
    for k, split in enumerate(((4, 2), (1, 5))):
        counts = {h: (30 + h.day % 5, 20) for h in weeks(n_weeks=13)}
        for monday in (MONDAY - 3 * WEEK, MONDAY - WEEK, MONDAY):
            for hour, n in zip((8, 9), split, strict=True):
                counts[datetime.combine(monday, datetime.min.time()) + timedelta(hours=hour)] = (n, 0)
                counts[datetime.combine(monday, datetime.min.time()) + timedelta(days=1, hours=hour)] = (60 - n, 0)
        root = tmp_path / str(k)
        root.mkdir()
        site(root, counts)
        words = ["lines", "--week", "2026-W46", "--page", "--language", language]
        assert run(cli, ["-C", str(root), "--now", AFTER, "--quiet", *words]) == 0
        pages.append((root / "reports" / "footfall-2026-W46.html").read_bytes())
    assert pages[0] == pages[1]


LOW = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 3)), min_size=28, max_size=28)


@settings(max_examples=6, deadline=None)
@given(now=LOW, before=LOW, closed=st.integers(0, 6))
def test_no_small_number_is_told_by_any_answer_or_difference(
    now: list[tuple[int, int]], before: list[tuple[int, int]], closed: int
) -> None:
    counts = {hour: (n // 8, m // 8) for hour, (n, m) in weeks(n_weeks=7).items()}
    of = {k: [h for h in counts if MONDAY - k * WEEK <= h.date() < MONDAY - (k - 1) * WEEK] for k in (0, 1)}
    counts |= dict(zip(of[0], now, strict=True)) | dict(zip(of[1], before, strict=True))
    if closed:
        counts[datetime(2026, 11, 12, 6)] = (closed, 0)
    with tempfile.TemporaryDirectory() as folder:
        root = site(Path(folder), counts)
        (row,) = answers(root, is_exact=False)["footfall"].rows
        weekly = {r["week"]: value(r["n_open"]) for r in answers(root, is_exact=False)["footfall_weeks"].rows}
        coming = answers(root, is_exact=False)["footfall_next"].rows
        whole = {m: lines_of_week(root, m)["lines"].rows[0] for m in (MONDAY, MONDAY - WEEK)}
        told: list[float | None] = [*weekly.values(), value(row["n_open"])]
        told += [value(day[name]) for day in coming for name in ("n_expected", "n_busiest")]
        for monday, line in whole.items():
            n_open, n_both = weekly[f"{monday:%G-W%V}"], value(line["n_both"])
            told.append(None if n_open is None or n_both is None else n_both - n_open)
            ways = [value(line[name]) for name in ("n_to_left", "n_to_right")]
            if n_open is not None and (
                not closed or monday != MONDAY
            ):  # only then a side less the open hours is a side
                told += [n_open - n for n in ways if n is not None]
        if (change := value(row["change_week"])) is not None:
            told.append((value(row["n_open"]) or 0) / (1 + change))
        assert not any(is_small(n) for n in told), told


@given(
    st.lists(st.lists(st.integers(0, 9), min_size=12, max_size=12), min_size=1, max_size=3),
    st.integers(0, 11),
)
def test_hours_of_few_people_are_known_by_their_sum_alone(n: list[list[int]], unrecorded: int) -> None:
    mask = Mask(BELOW)
    counts, recorded_h = np.array(n, float), np.ones((len(n), 12))
    recorded_h[:, unrecorded], counts[:, unrecorded] = 0, 0
    evened = evened_hours(counts, recorded_h, mask=mask)
    for exact, told in zip(counts, evened, strict=True):
        few = (exact > 0) & (exact < BELOW)
        if np.isnan(told).any():
            assert np.isnan(told).all()
            assert few.sum() == (exact > 0).sum() or exact.sum() < BELOW
            continue
        assert told.sum() == pytest.approx(exact.sum())
        changed = ~np.isclose(exact, told) | few
        assert changed.sum() != 1
        assert not few.any() or exact[changed].sum() >= BELOW
        assert len(set(np.round(told[changed], 9))) <= 1
        assert ((exact == 0) == (told == 0)).all()


def test_the_json_of_a_report_holds_no_week_of_a_line_again_that_changed_a_little(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = site(tmp_path, weeks(n_weeks=13))

    def report() -> dict[str, Any]:
        capsys.readouterr()
        words = ["report", "--week", "2026-W46", "--format", "json", "--out", "-"]
        assert run(cli, ["-C", str(root), "--now", AFTER, "--quiet", *words]) == 0
        found: dict[str, Any] = json.loads(capsys.readouterr().out)["answers"]
        return found

    first = report()
    assert first["lines"]["rows"][0]["n_both"]["value"] is not None
    assert report() == first
    hour = datetime(2026, 11, 10, HOURS[0])
    n_in, n_out = weeks(n_weeks=13)[hour]
    add_more(root, {hour: (n_in + 1, n_out)})
    again = report()
    assert again["lines"]["rows"][0]["n_both"]["value"] is None
    assert "shared before" in again["lines"]["rows"][0]["n_both"]["reason"]
    assert {row["n_both"]["value"] for name in ("line_days", "line_hours") for row in again[name]["rows"]} == {None}


def test_a_notebook_remembers_nothing_for_it_is_the_operator_s(tmp_path: Path) -> None:
    root = site(tmp_path, weeks(n_weeks=2))
    assert len(vsd_analytics.open(root).week("2026-W46").lines) == 1
    assert not (root / "shared.jsonl").exists()
    lines_of_week(root)
    assert (root / "shared.jsonl").exists()
