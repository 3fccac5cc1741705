"""Value per visit and person-hour, and violations at an equal value: of planted series, in every output."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from report import ingested_worlds as w

import vsd_analytics as vsd
from vsd_analytics.answer import Answers
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.context_file import ContextColumns
from vsd_analytics.config.context_series import Adds, add_context, remove_context
from vsd_analytics.config.project import load_site
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.json_and_csv import figures_json
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site.model import Site

N_WEEKS = 10
FIRST = w.MONDAY - timedelta(weeks=N_WEEKS - 1)
NOW = datetime(2026, 11, 20, 12, tzinfo=UTC)
SHIFT = (0.0, 0.3, -0.3, 0.1, -0.4, 0.5, -0.2)
HOURS = (9, 10)
PER_VISIT = 0.5


def z_of(day: date) -> float:
    """Return the logarithm of a day's footfall: it rises in the last week, and differs from day to day."""
    week, weekday = divmod((day - FIRST).days, 7)
    return SHIFT[(weekday + 3 * week) % 7] + (0.2 if day >= w.MONDAY else 0.0)


def violations(day: date) -> int:
    """Return violations of each hour: proportional to footfall."""
    return round(20 * math.exp(z_of(day)))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return a project of ten weeks, two hours a day, with violations at the door and the series of them."""
    text = w.toml(opening='{ mon-sun = "09:00-11:00" }').replace(
        'id = "door"\n', 'id = "door"\nvisits = true\ndoor = true\n'
    )
    streams = [
        w.messages(
            lambda d, hour, monday=monday: {w.DOOR: violations(monday + timedelta(days=d))},
            monday=monday,
            hours=(9, 11),
        )
        for monday in (FIRST + timedelta(weeks=k) for k in range(N_WEEKS))
    ]
    made = w.world(tmp_path_factory.mktemp("context") / "shop", text, *streams)
    days = [FIRST + timedelta(days=k) for k in range(7 * N_WEEKS)]
    add(made, "footfall", {f"{day}": 100 * math.exp(z_of(day)) for day in days}, every="1d")
    add(made, "tickets", {f"{d}T{h:02}:00": PER_VISIT * 2 * violations(d) for d in days for h in HOURS}, every="1h")
    add(made, "temperature", {f"{day}": 12.0 + (k * k * 3 % 11) for k, day in enumerate(days)}, every="1d", adds="mean")
    return made


def add(site: Site, name: str, values: dict[str, float], *, every: str, adds: Adds = "sum", unit: str = "1") -> None:
    file = site.root / f"{name}.csv"
    file.write_text("time,value\n" + "".join(f"{t},{v}\n" for t, v in values.items()), encoding="utf-8")
    columns = ContextColumns("time", "value", "end", every, site.zone)
    add_context(site, file, columns, name=name, at=NOW, unit=unit, adds=adds)


def answers(site: Site, **settings: Any) -> Answers:
    other = replace(site, settings=site.settings.with_values({"mask_below": 0, **settings}))
    return week_report(other, w.MONDAY, has_context=True).answers


@pytest.fixture(scope="module")
def report(site: Site) -> WeekReport:
    """Return the report of the last week, with every count."""
    other = replace(site, settings=site.settings.with_values({"mask_below": 0}))
    return week_report(other, w.MONDAY, has_context=True)


def test_a_value_per_visit_is_that_of_the_same_hours(report: WeekReport) -> None:
    found = report.answers["context_conversion"]
    value = found.value("value_per_visit", series="tickets", area_id="door")
    assert value.value == pytest.approx(PER_VISIT)
    assert value.lo is not None
    assert found.value("known_share", series="tickets", area_id="door").value == 1.0
    assert {row["series"] for row in found.rows} == {"tickets", "footfall"}, "what is averaged is not divided by visits"


def test_a_value_per_person_hour_is_over_the_person_hours_of_the_page(report: WeekReport) -> None:
    found = report.answers
    n_tickets = sum(2 * 2 * PER_VISIT * violations(w.MONDAY + timedelta(days=k)) for k in range(7))
    person_h = found["people"].rows[0]["person_h"].value
    assert found["context_value"].value("value_per_person_h", series="tickets").value == pytest.approx(
        n_tickets / person_h
    )


def test_a_rise_that_the_series_makes_is_none_at_an_equal_value(report: WeekReport) -> None:
    found = report.answers["context_change"]
    plain, equal = (found.value(f"{name}_change", series="footfall") for name in ("violation_rate", "equal_value"))
    assert plain.value == pytest.approx(math.expm1(0.2), abs=0.02)
    assert equal.value == pytest.approx(0.0, abs=0.02)
    step = found.value("step_change", series="footfall")
    assert step.value == pytest.approx(0.1, abs=0.005)
    assert step.lo is not None
    assert step.hi is not None
    assert step.lo < step.value < step.hi
    usual, there = (found.value(f"{name}_hi", series="footfall").value for name in ("usual", "equal_value_usual"))
    rate = found.value("violation_rate", series="footfall").value
    assert usual < rate < there, "the week lies above its usual range, and within that at its footfall"


def test_m0_and_its_usual_range_are_those_of_the_page(report: WeekReport) -> None:
    assert report.trend is not None
    usual = report.trend.usual_violation_rate
    assert usual is not None
    row = next(report.answers["context_change"].where(series="temperature"))
    assert (row["usual_lo"].value, row["usual_hi"].value) == pytest.approx((usual.lo, usual.hi))
    assert row["series_change"].value is None, "degrees have no percent: their zero is somebody's choice"
    assert row["series_difference"].value is not None
    assert row["violation_rate"].value == report.level.violation_rate.value
    assert row["violation_rate_change"].value == report.level.violation_rate.change
    assert row["violation_rate_verdict"] == report.level.violation_rate.verdict


def test_a_day_without_a_value_is_refused_not_guessed(site: Site, tmp_path: Path) -> None:
    days = [FIRST + timedelta(days=k) for k in range(7 * N_WEEKS) if k != 7 * N_WEEKS - 3]
    add(site, "gap", {f"{day}": 100 * math.exp(z_of(day)) for day in days}, every="1d")
    try:
        found = answers(site)["context_change"].value("equal_value_change", series="gap")
        assert found.value is None
        assert found.reason is not None
        assert (found.reason.code, found.reason.values["n"]) == ("context.incomplete", 13)
    finally:
        remove_context(site, "gap", at=NOW)


def test_a_value_per_visit_that_would_tell_the_few_visits_of_other_hours_is_hidden(site: Site) -> None:
    visits = {f"{day}T{h:02}:00": 9.0 for day in (w.MONDAY + timedelta(days=k) for k in range(7)) for h in HOURS}
    del visits[f"{w.MONDAY + timedelta(days=6)}T10:00"]
    add(site, "almost", visits, every="1h")
    try:
        n_left_out = 2 * violations(w.MONDAY + timedelta(days=6))
        shown, hidden = (
            answers(site, mask_below=below)["context_conversion"].value(
                "value_per_visit", series="almost", area_id="door"
            )
            for below in (n_left_out, n_left_out + 1)
        )
        assert shown.value is not None
        assert hidden.value is None
    finally:
        remove_context(site, "almost", at=NOW)


def test_reports_have_no_series_unless_the_site_asks(site: Site) -> None:
    plain = week_report(site, w.MONDAY)
    assert not [a.name for a in plain.answers if a.name.startswith("context")]
    assert "M52" not in figures_json(plain)
    assert 'id="context"' not in render_html(plain)


def test_command_and_python_give_the_numbers_of_the_report(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    of_report = week_report(site, w.MONDAY, has_context=True).answers["context_change"]
    wanted = [of_report.value("equal_value_change", series=s).value for s in ("footfall", "temperature", "tickets")]
    arguments = ["-C", str(site.root), "--now", NOW.isoformat(), "--quiet", "context", "figures"]
    assert run(cli, [*arguments, "--week", "2026-W46", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["answers"]["context_change"]["rows"]
    assert [row["equal_value_change"]["value"] for row in rows] == pytest.approx(wanted, rel=1e-3)
    table = vsd.open(site.root).week("2026-W46").context_figures()
    assert table["equal_value_change"] == pytest.approx(wanted)
    assert run(cli, [*arguments, "--week", "2026-W46"]) == 0
    assert "change at an equal value" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("language", "title", "refused"),
    [("en", "What else happened", "hardly differs"), ("it", "Che cos’altro è successo", "cambia appena")],
)
def test_the_page_shows_the_series_where_the_site_asks(site: Site, language: str, title: str, refused: str) -> None:
    asking = replace(site, language=language, settings=site.settings.with_values({"show_context": True}))
    add(
        site,
        f"flat_{language}",
        {f"{FIRST + timedelta(days=k)}": 7.0 for k in range(7 * N_WEEKS)},
        every="1d",
        unit="<b>EUR</b>",
    )
    try:
        report = week_report(asking, w.MONDAY)
    finally:
        remove_context(site, f"flat_{language}", at=NOW)
    assert "M52" in figures_json(report)
    page = render_html(report)
    begins = page.index('<section class="sec" id="context"')
    section = page[begins : page.index("</section>", begins)]
    assert title in section
    assert refused in section
    assert section.count("<svg") == 8, "four series, each drawn for wide and narrow screens"
    assert f"Flat {language}, &lt;b&gt;EUR&lt;/b&gt;" in section
    assert len(re.sub(r"<svg.*?</svg>|<[^>]*>", " ", section, flags=re.DOTALL).split()) < 250


def test_days_of_a_series_are_in_the_json_file_with_gaps(site: Site) -> None:
    days = [FIRST + timedelta(days=k) for k in range(7 * N_WEEKS) if k != 3]
    add(site, "holes", {f"{day}": 5.0 for day in days}, every="1d")
    try:
        found = answers(site)["context_days"]
    finally:
        remove_context(site, "holes", at=NOW)
    values = [row["series_value"].value for row in found.where(series="holes")]
    assert values == [None if k == 3 else 5.0 for k in range(70)]


def test_without_a_series_the_command_says_how_to_add_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "vsd.toml").write_text(w.toml(), encoding="utf-8")
    load_site(tmp_path)
    assert run(cli, ["-C", str(tmp_path), "context", "figures"]) == 2
    assert "vsd context add sales.csv" in capsys.readouterr().err
