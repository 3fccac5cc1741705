"""From marts to answers: forecast, unusual hours, hours of the week, trend; and what they refuse."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from planted_hours import MONDAY, of, planted, site_of

from vsd_analytics.api.project import open_project
from vsd_analytics.cli import forecast as command
from vsd_analytics.cli import main
from vsd_analytics.config.change_log import add_entry
from vsd_analytics.errors import UsageError
from vsd_analytics.figures import forecast as forecasting
from vsd_analytics.figures import hour_of_week, trend
from vsd_analytics.figures.slots import load_slots, open_hours
from vsd_analytics.figures.unusual import unusual
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.stats.rates import violation_rate
from vsd_analytics.warehouse.stored_days import Extent
from vsd_analytics.warehouse.warehouse import Warehouse, open_warehouse
from vsd_analytics.wording.reasons import reason_text


def test_people_and_violations_of_next_week_are_forecast_hour_by_hour(tmp_path: Path) -> None:
    with planted(site_of(tmp_path)) as warehouse:
        made = forecasting.forecast(warehouse, MONDAY)
    assert (made.week, made.last_week, made.left_out) == ("2026-W47", "2026-W46", ())
    assert [r.value for r in made.people.rows] == pytest.approx([9.0] * 19)
    assert [r.value for r in made.violations.rows] == pytest.approx([30.0] * 19, rel=0.25)
    sunday = made.violations.rows[-1]
    assert (sunday.day, sunday.weekday, sunday.hour, sunday.open_h) == (date(2026, 11, 22), 6, 10, 0.5)
    assert made.people.score is not None
    assert made.people.score.wape == pytest.approx(0)
    assert made.violations.score is not None
    assert made.violations.score.n_hours == 19
    assert made.gatherings.state == "not_measurable"


def test_one_floor_has_its_own_forecast(tmp_path: Path) -> None:
    with planted(site_of(tmp_path)) as warehouse:
        made = forecasting.forecast(warehouse, MONDAY, floor_id="upper")
        with pytest.raises(UsageError, match="no floor"):
            forecasting.forecast(warehouse, MONDAY, floor_id="roof")
    assert [r.value for r in made.people.rows] == pytest.approx([3.0] * 19)


def test_a_camera_that_is_down_lowers_nothing(tmp_path: Path) -> None:
    def down(hours: pd.DataFrame) -> None:
        late = hours["local_date"].astype(str) >= "2026-11-02"
        hours.loc[late & of(hours, camera="cam-2"), "recorded_open_s"] = 0.0

    with planted(site_of(tmp_path), down) as warehouse:
        made = forecasting.forecast(warehouse, MONDAY)
        assert load_slots(warehouse, MONDAY, n_weeks=2).left_out == ("cam-2",)
    assert [r.value for r in made.people.rows] == pytest.approx([9.0] * 19)


def test_closed_days_are_not_trained_on_and_not_forecast(tmp_path: Path) -> None:
    site = site_of(tmp_path, closed=frozenset([date(2026, 11, 18), date(2026, 10, 27)]))
    with planted(site) as warehouse:
        made = forecasting.forecast(warehouse, MONDAY)
    assert made.closed == (date(2026, 11, 18),)
    assert date(2026, 11, 18) not in {r.day for r in made.people.rows}
    assert [r.value for r in made.people.rows] == pytest.approx([9.0] * 16)


def test_low_data_hours_are_not_trained_on(tmp_path: Path) -> None:
    def low(hours: pd.DataFrame) -> None:
        chosen = of(hours, hour=9) & (hours["local_date"].astype(str) >= "2026-09-28")
        hours.loc[chosen, "recorded_open_s"] *= 0.4
        hours.loc[chosen, "exposure_open_s"] *= 30

    with planted(site_of(tmp_path), low) as warehouse:
        made = forecasting.forecast(warehouse, MONDAY)
    assert {r.value is None for r in made.people.rows if r.hour == 9} == {False}
    assert [r.value for r in made.people.rows] == pytest.approx([9.0] * 19)


def test_three_weeks_are_refused(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), n_weeks=3) as warehouse:
        made, odd = forecasting.forecast(warehouse, MONDAY), unusual(warehouse, MONDAY)
    assert reason_text(made.people.reason) == "a forecast needs 4 recorded weeks, has 3"
    assert (made.people.state, made.people.rows, made.has_forecast) == ("not_enough_data", (), False)
    assert reason_text(odd.reason) == "a usual value needs 4 earlier recorded weeks, has 2"


def test_gatherings_are_reported_when_somebody_counts_them(tmp_path: Path) -> None:
    n, x_h = np.zeros((13, 168)), np.ones((13, 168))
    n[::2, 10] = 1
    with planted(site_of(tmp_path)) as warehouse:
        made = forecasting.forecast(warehouse, MONDAY, gatherings=(n, x_h))
    chances = {(r.weekday, r.hour): r.value for r in made.gatherings.rows}
    assert len(chances) == 19
    assert chances[0, 10] == max(v for v in chances.values() if v is not None)
    assert 0.1 < (chances[0, 10] or 0) < 0.6


def test_the_clocks_go_back_on_an_always_open_site(tmp_path: Path) -> None:
    """Sunday 02 of 25 October has two hours, of 29 March none: rates stay, no week is longer than 168 slots."""
    site = site_of(tmp_path, opening=None)
    with planted(site, n_weeks=6, monday=date(2026, 10, 26)) as warehouse:
        slots = load_slots(warehouse, date(2026, 10, 26), n_weeks=6)
        assert slots.open_h[4, 146] == 2
        assert slots.people.rate == pytest.approx(np.full((6, 168), 9.0))
    assert open_hours(site, date(2026, 3, 23))[146] == 0
    assert open_hours(site, date(2026, 3, 23)).sum() == 167


def test_a_planted_hour_is_unusual_and_a_missing_one_is_not(tmp_path: Path) -> None:
    def plant(hours: pd.DataFrame) -> None:
        hours.loc[of(hours, day=date(2026, 11, 11), hour=10), "n_violations_open"] *= 4
        hours.loc[of(hours, day=date(2026, 11, 12)), "recorded_open_s"] = 0.0

    with planted(site_of(tmp_path), plant) as warehouse:
        odd = unusual(warehouse, MONDAY)
    assert [(r.day, r.weekday, r.hour) for r in odd.rows] == [(date(2026, 11, 11), 2, 10)]
    assert odd.n_tested == 16
    assert odd.rows[0].ratio == pytest.approx(4, rel=0.4)
    assert odd.rows[0].hi < odd.rows[0].violations


def test_hours_of_the_week_and_their_peak(tmp_path: Path) -> None:
    def plant(hours: pd.DataFrame) -> None:
        hours.loc[of(hours, hour=11) & (hours["weekday"] == 6), "n_violations_open"] *= 5

    with planted(site_of(tmp_path), plant) as warehouse:
        made = hour_of_week.week_profile(warehouse, MONDAY)
    assert made.state == "ok"
    top = made.by_burden.top[0]
    assert (top.weekday, top.hour, made.by_burden.tied) == (5, 11, ())
    assert made.by_risk.top[0].value == pytest.approx(150 / 9, rel=0.15)
    row = next(r for r in made.rows if (r.weekday, r.hour) == (0, 9))
    assert (row.people, row.n_weeks, row.recorded_h) == (pytest.approx(9.0), 4, pytest.approx(4.0))
    assert row.burden == pytest.approx(30, rel=0.25)


def test_an_hour_recorded_in_two_of_four_weeks_is_unknown(tmp_path: Path) -> None:
    def lose(hours: pd.DataFrame) -> None:
        late = hours["local_date"].astype(str) >= "2026-11-02"
        hours.loc[late & of(hours, hour=9), "recorded_open_s"] = 0.0

    with planted(site_of(tmp_path), lose) as warehouse:
        made = hour_of_week.week_profile(warehouse, MONDAY)
    unknown = [r for r in made.rows if r.hour == 9]
    assert {(r.risk, r.people, r.state) for r in unknown} == {(None, None, "not_enough_data")}
    assert not any(p.hour == 9 for p in (*made.by_burden.top, *made.by_risk.top))


def test_the_trend_has_each_weeks_own_figure_gaps_and_marks(tmp_path: Path) -> None:
    def lose(hours: pd.DataFrame) -> None:
        hours.loc[hours["local_date"].astype(str).between("2026-10-26", "2026-11-01"), "recorded_open_s"] = 0.0

    site = site_of(tmp_path)
    add_entry(site, text="moved the shelf", at="2026-10-21T08:00")
    add_entry(site, text="long ago", at="2020-10-21T08:00")
    with planted(site, lose, n_weeks=17) as warehouse:
        made = trend.trend(warehouse, MONDAY)
        days = warehouse.frame(
            "select camera_no, local_date, sum(n_violations_open) as n, sum(recorded_open_s) / 3600 as x "
            "from camera_hours group by all order by camera_no, local_date"
        )
    assert [w.week for w in made.weeks] == [f"2026-W{n}" for n in range(35, 47)]
    gap = made.weeks[9]
    assert (gap.week, gap.violation_rate, gap.encounter_rate, reason_text(gap.reason)) == (
        "2026-W44",
        None,
        None,
        "nothing or too little was recorded",
    )
    assert [(m.text, f"{m.at:%G-W%V}") for m in made.marks] == [("moved the shelf", "2026-W43")]
    n, x = (days[c].fillna(0).to_numpy().reshape(2, -1) for c in ("n", "x"))
    past = np.arange(77, 112)[x[:, 77:112].any(axis=0)]
    own = violation_rate(
        n[:, 112:], x[:, 112:], weekday=np.arange(7), history_n=n[:, past], history_x_h=x[:, past],
        history_weekday=past % 7,
    )  # fmt: skip
    last = made.weeks[-1].violation_rate
    assert last is not None
    assert (last.value, last.lo, last.hi) == pytest.approx((own.value, own.lo, own.hi))


def test_a_trend_of_two_weeks_is_refused(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), n_weeks=2) as warehouse:
        made = trend.trend(warehouse, MONDAY)
    assert (len(made.weeks), made.state) == (2, "not_enough_data")
    assert reason_text(made.reason) == "a trend needs 3 recorded weeks, has 2"


def test_without_positions_people_are_not_measurable_and_violations_are(tmp_path: Path) -> None:
    def blind(hours: pd.DataFrame) -> None:
        hours["exposure_open_s"] = np.nan

    with planted(site_of(tmp_path), blind) as warehouse:
        made = forecasting.forecast(warehouse, MONDAY)
        profile = hour_of_week.week_profile(warehouse, MONDAY)
        levels = trend.trend(warehouse, MONDAY)
    assert (made.people.state, reason_text(made.people.reason)) == ("not_measurable", "the engine sends no positions")
    assert made.violations.state == "ok"
    assert (profile.state, profile.by_risk.state, profile.by_burden.state) == ("not_measurable", "not_measurable", "ok")
    assert reason_text(levels.encounter_rate_reason) == "the engine sends no positions"
    assert all(w.encounter_rate is None and w.violation_rate is not None for w in levels.weeks if w.state == "ok")


def test_a_week_starts_on_monday(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), n_weeks=2) as warehouse, pytest.raises(UsageError, match="not a Monday"):
        forecasting.forecast(warehouse, date(2026, 11, 10))


# --- the command ---


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "vsd.toml").write_text(
        '[site]\nid = "shop"\nname = "Shop"\ntimezone = "Europe/Rome"\nopening = { mon-sat = "09:00-12:00" }\n'
        'closed = ["2026-11-18"]\n[[floor]]\nid = "ground"\nname = "Ground"\n'
        '[[camera]]\nid = "cam-1"\nname = "One"\nfloor = "ground"\n',
        encoding="utf-8",
    )

    @contextmanager
    def opened(project: Any, *, week: str | None, days: str | None) -> Iterator[Warehouse]:
        assert days == "2026-08-17..2026-11-15"

        def plant(hours: pd.DataFrame) -> None:
            hours.loc[of(hours, day=date(2026, 11, 11), hour=10), "n_violations_open"] = 90

        with planted(project.site, plant) as warehouse:
            yield warehouse

    monkeypatch.setattr(command, "warehouse_of", opened)
    return tmp_path


def vsd(*arguments: str) -> int:
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    return int(stop.value.code or 0)


def test_the_command_prints_a_week_a_score_and_what_was_unusual(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vsd("-C", str(project), "forecast", "--week", "2026-W46") == 0
    text = capsys.readouterr().out
    assert text.startswith("Forecast, 2026-11-16 to 2026-11-22\n")
    assert "2026-11-18" not in text, "the shop is closed on that day"
    assert "6 (6 to 6)" in text
    assert "How good the last forecast was, 2026-11-09 to 2026-11-15\n" in text
    assert "people      2026-W46     18" in text
    assert "2026-11-11  10    90          2" in text


def test_json_has_the_same_and_no_nan(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vsd("-C", str(project), "forecast", "--week", "2026-W46", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    answers = told["answers"]
    assert answers["forecast"]["rows"][0]["people"]["value"] == 6
    assert "2026-11-18" not in {row["local_date"] for row in answers["forecast"]["rows"]}
    assert [row["n_hours"] for row in answers["forecast_score"]["rows"]] == [18, 18]
    assert answers["unusual_hours"]["rows"][0]["n_violations"]["value"] == 90
    assert vsd("-C", str(project), "forecast", "--week", "2026-W46", "--unusual", "--json") == 0
    assert list(json.loads(capsys.readouterr().out)["answers"]) == ["unusual_hours"]


def test_python_gives_the_rows_of_the_command(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    vsd("-C", str(project), "forecast", "--week", "2026-W46", "--json")
    rows = json.loads(capsys.readouterr().out)["answers"]["forecast"]["rows"]
    site = open_project(project)

    def plant(hours: pd.DataFrame) -> None:
        hours.loc[of(hours, day=date(2026, 11, 11), hour=10), "n_violations_open"] = 90

    last_day = date(2026, 11, 15)
    monkeypatch.setattr("vsd_analytics.api.project.stored_extent", lambda _: Extent(last_day, last_day))
    monkeypatch.setattr("vsd_analytics.api.project.open_warehouse", lambda *_: planted(site.site, plant))
    table = site.forecast()
    assert [(f"{row['local_date']}", row["local_hour"], row["people"], row["violation_rate_hi"]) for row in table] == [
        (row["local_date"], row["local_hour"], row["people"]["value"], pytest.approx(row["violation_rate"]["hi"]))
        for row in rows
    ]


def test_a_floor_that_is_not_there_is_reported(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vsd("-C", str(project), "forecast", "--week", "2026-W46", "--floor", "roof") == 2
    assert "no floor has the id 'roof'" in capsys.readouterr().err


# --- a real recording ---


@pytest.mark.realdata
def test_ten_days_of_an_office_are_refused_with_the_reason(realdata: Callable[[str], Path], tmp_path: Path) -> None:
    with zipfile.ZipFile(realdata("sociopatterns/workplace_InVS_tij.dat.zip")) as archive:
        told = [line.split()[:3] for line in archive.read("tij_InVS.dat").decode().splitlines()]
    monday = int(datetime(2013, 6, 24, tzinfo=UTC).timestamp())
    path = tmp_path / "contacts.csv"
    contacts = sorted({(int(t), *sorted((a, b))) for t, a, b in told})
    path.write_text("ts,track_a,track_b,distance_m\n" + "".join(f"{monday + t},{a},{b},1.0\n" for t, a, b in contacts))
    camera = Camera("office", "Office", "floor", hz=0.05)
    site = Site(
        "office", "Office", "Europe/Paris", tmp_path / "project", floors=(Floor("floor", "Floor"),), cameras=(camera,)
    )
    site = replace(site, settings=site.settings.with_values({"pseudonyms": False}))
    result = ingest(site, [path], IngestOptions(format="pairs"), now=datetime(2026, 11, 20, tzinfo=UTC))
    assert [s.error for s in result.sources] == [None]
    last = date(2013, 7, 1)
    with open_warehouse(site, date(2013, 6, 24), date(2013, 7, 7)) as warehouse:
        made, odd = forecasting.forecast(warehouse, last), unusual(warehouse, last)
        levels = trend.trend(warehouse, last)
    assert (made.violations.state, reason_text(made.violations.reason)) == (
        "not_enough_data",
        "a forecast needs 4 recorded weeks, has 2",
    )
    assert (made.people.state, reason_text(made.people.reason)) == ("not_measurable", "the engine sends no positions")
    assert reason_text(odd.reason) == "a usual value needs 4 earlier recorded weeks, has 1"
    assert levels.state == "not_enough_data"
