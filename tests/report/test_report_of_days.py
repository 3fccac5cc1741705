"""The report of other days than a week (`vsd report --range`): its numbers, what it compares, its words and files."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import date, timedelta
from pathlib import Path
from unittest.mock import ANY

import pytest
from report import ingested_worlds as w

from vsd_analytics.cli import cli, run
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.figures_by_id import figures_by_id
from vsd_analytics.report.pages.json_and_csv import from_json, to_csv, to_json
from vsd_analytics.report.pages.mail import make_mail
from vsd_analytics.report.pages.story import days_report, week_report
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.resources import LANGUAGES
from vsd_analytics.site.model import Site
from vsd_analytics.site_index.read_reports import find_reports
from vsd_analytics.wording.languages import speaking

HOURS, OPENING = (9, 10), '{ mon-sun = "09:00-10:00" }'
WEEKS = 4
WEDNESDAY = w.MONDAY + timedelta(days=2)
SUNDAY = w.MONDAY + timedelta(days=6)
Vsd = Callable[..., tuple[int, str]]
OF_WEEK = re.compile(
    r"\b(?:week|settimana) \d|\b(?:this|last|next) week\b|(?:questa|prossima) settimana|settimana scorsa"
)


def counts(week: int) -> w.Counts:
    return lambda day, hour: {w.QUEUE: 30 + 2 * ((day + week) % 3), w.DOOR: (40 if week < 2 else 20) + day % 4}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    first = w.MONDAY - timedelta(weeks=WEEKS - 1)
    streams = [w.messages(counts(k), monday=first + timedelta(weeks=k), hours=HOURS) for k in range(WEEKS)]
    made = w.world(tmp_path_factory.mktemp("days"), w.toml(opening=OPENING), *streams)
    return made.with_settings(mask_below=0)  # such pages are the operator's


@pytest.fixture(scope="module")
def week(site: Site) -> WeekReport:
    return week_report(site, w.MONDAY)


@pytest.fixture(scope="module")
def day(site: Site) -> WeekReport:
    return days_report(site, WEDNESDAY, WEDNESDAY)


@pytest.fixture(scope="module")
def fortnight(site: Site) -> WeekReport:
    return days_report(site, w.BEFORE, SUNDAY)


def test_seven_days_from_a_monday_have_the_numbers_of_their_week(site: Site, week: WeekReport) -> None:
    days = days_report(site, w.MONDAY, SUNDAY)
    for name in (
        "state",
        "level",
        "areas",
        "when",
        "coverage",
        "busiest_spot",
        "busiest_hour",
        "change_maps",
        "causes",
    ):
        assert getattr(days, name) == getattr(week, name), name
    assert (days.week.is_week, week.week.is_week) == (False, True)
    of_days, of_week = figures_by_id(days), figures_by_id(week)
    assert of_days.keys() >= {"M0", "M6", "M17"}
    assert of_days == {k: of_week[k] for k in of_days}


def test_a_day_is_counted_and_compared_with_nothing(day: WeekReport) -> None:
    assert day.level.violations == sum(counts(WEEKS - 1)(2, 9).values())
    assert (day.previous, day.level.violation_rate.verdict, day.level.violation_rate.previous) == (None, None, None)
    assert day.level.violation_rate.lo is None, "one day has no likely range"
    assert {c.day for c in day.when.cells} == {WEDNESDAY}
    assert "compared with nothing" in render_html(day)


def test_whole_weeks_of_days_are_compared_with_as_many_days_before(fortnight: WeekReport) -> None:
    fall = [sum(sum(counts(k)(d, 9).values()) for k in pair for d in range(7)) for pair in ((0, 1), (2, 3))]
    assert fortnight.previous is not None
    assert (fortnight.previous.monday, fortnight.previous.sunday) == (
        w.BEFORE - timedelta(days=14), w.BEFORE - timedelta(days=1),
    )  # fmt: skip
    assert fortnight.level.violation_rate.change == pytest.approx(fall[1] / fall[0] - 1)
    assert len({c.day for c in fortnight.when.cells}) == 14
    page = render_html(fortnight)
    assert "2–15 Nov" in page
    assert "19 Oct – 1 Nov" in page
    assert page.count('<table class="tt">') == 2, "seven days fit beside each other"


def test_ten_days_have_other_days_of_the_week_before_them(site: Site) -> None:
    found = days_report(site, SUNDAY - timedelta(days=9), SUNDAY)
    assert (found.previous, found.level.violation_rate.change, found.change_maps) == (None, None, None)


def test_sections_that_need_weeks_are_left_out(fortnight: WeekReport) -> None:
    assert (fortnight.trend, fortnight.outlook, fortnight.spots, fortnight.unusual) == (None, None, None, None)
    assert (fortnight.change_effects, fortnight.logged_changes) == ((), ())
    assert fortnight.story is not None
    assert fortnight.story.question == ""
    page = render_html(fortnight)
    assert [name for name in ("trend", "next", "spots") if f'id="{name}"' in page] == []
    assert 'class="ask"' not in page


@pytest.mark.parametrize(
    ("first", "last", "language"),
    [(WEDNESDAY, WEDNESDAY, LANGUAGES[0]), (w.MONDAY, WEDNESDAY, LANGUAGES[1]), (w.BEFORE, SUNDAY, LANGUAGES[0])],
)
def test_no_sentence_of_page_mail_or_json_speaks_of_a_week(site: Site, first: date, last: date, language: str) -> None:
    with speaking(language):
        report = days_report(site, first, last)
    mail = make_mail(report).get_body(("plain",))
    assert mail is not None
    page = re.sub(r"<style>.*?</style>", "", render_html(report), flags=re.DOTALL)
    for text in (page, mail.get_content(), str(report.story)):
        assert OF_WEEK.findall(text) == []


def test_the_json_twin_gives_the_same_page(fortnight: WeekReport) -> None:
    assert render_html(from_json(to_json(fortnight))) == render_html(fortnight)


def test_tables_name_the_days(day: WeekReport) -> None:
    assert f",{WEDNESDAY}," in to_csv(day)["areas.csv"]


@pytest.fixture
def vsd(site: Site, capsys: pytest.CaptureFixture[str]) -> Vsd:
    """Return a function that runs `vsd report` in the project and returns exit code and what it said."""

    def call(*words: str) -> tuple[int, str]:
        code = run(cli, ["-C", str(site.root), "report", *words])
        out, err = capsys.readouterr()
        return code, out + err

    return call


def test_the_command_writes_files_named_by_their_days(vsd: Vsd, site: Site, tmp_path: Path) -> None:
    span = f"{w.BEFORE}..{SUNDAY}"
    assert vsd("--range", span, "--out", str(tmp_path)) == (2, ANY), "such a page is the operator's"
    code, _ = vsd("--exact", "--range", span, "--format", "html,json,csv", "--out", str(tmp_path), "--mail")
    assert code == 0
    stem = f"{w.BEFORE}--{SUNDAY}"
    names = [f"{stem}{end}" for end in ("-areas.csv", "-hotspots.csv", "-hours.csv", ".eml", ".html", ".json")]
    assert sorted(p.name for p in tmp_path.iterdir()) == names
    assert not (site.root / "questions.jsonl").exists(), "it asks nothing"


def test_the_index_of_weeks_does_not_list_other_days(week: WeekReport, day: WeekReport, tmp_path: Path) -> None:
    (tmp_path / "2026-W46.json").write_bytes(to_json(week))
    (tmp_path / "2026-11-11.json").write_bytes(to_json(day))
    found = find_reports(tmp_path, project="shop", hides=False)  # of a site that hides nothing
    assert ([e.stem for e in found.entries], found.problems) == (["2026-W46"], ())


def test_a_range_of_one_week_is_that_weeks_report(vsd: Vsd, tmp_path: Path) -> None:
    assert vsd("--range", f"{w.MONDAY}..{SUNDAY}", "--out", str(tmp_path))[0] == 0
    assert [p.name for p in tmp_path.iterdir()] == ["2026-W46.html"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--week", "last", "--range", "2026-11-09"), "both say which days"),
        (("--range", "2026-11-15..2026-11-09"), "not a range of days"),
        (("--range", "2026-10-01..2026-11-09"), "40 days are too many"),
    ],
)
def test_a_range_that_cannot_be_reported_is_refused(vsd: Vsd, words: tuple[str, ...], said: str) -> None:
    code, output = vsd(*words)
    assert (code, said in output) == (2, True), output
