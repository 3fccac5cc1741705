"""The figures of a week: planted truth, what is held back, and what is refused with its reason."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from report import ingested_worlds as w

from vsd_analytics.answer import Answers, Reason, Value, value_of
from vsd_analytics.figures.catalogue import OF_CONTEXT, OF_LINES, OF_SPACE, OF_YEAR
from vsd_analytics.figures.coverage_answers import coverage_answers
from vsd_analytics.render.json_form import as_json
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.json_and_csv import figures_json
from vsd_analytics.warehouse.sqlfiles import figure_headers
from vsd_analytics.warehouse.warehouse import open_warehouse

Figures = Mapping[str, Mapping[str, Any]]
HOURLY = {w.QUEUE: 20, w.DOOR: 12, w.AISLE: 6}
N = 21 * sum(HOURLY.values())
"""Violations of a whole week: 3 open hours a day; each is two people for two frames."""
CLOSE_H = N * 2 * w.CLOSE_S / 3600
EXPOSURE_H = 21 + CLOSE_H
ENGINE = "[engine]\nprecision = 0.9\nrecall = 0.8\n"
STATES = ("ok", "not_enough_data", "not_measurable")


def figures_of(report: WeekReport) -> Figures:
    """Return the figures as the JSON file has them."""
    told: Figures = figures_json(report)
    return told


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> WeekReport:
    """Return a week recorded wholly, with one violation in three minutes and a stated engine."""
    site = w.world(tmp_path_factory.mktemp("whole"), w.toml(more=ENGINE), w.messages(w.steady(HOURLY)))
    return w.report(site)


@pytest.fixture(scope="module")
def told(whole: WeekReport) -> Figures:
    return figures_of(whole)


def values(figures: Figures, metric: str, key: str, column: str | None = None) -> dict[Any, Any]:
    """Return the values of a figure's rows, of one column or of all, by another entry of the rows."""
    rows = [row for row in figures[metric]["rows"] if column in (None, row["column"])]
    return {row[key]: row["value"] for row in rows}


def check(figures: Figures) -> None:
    """Hold every figure to the contract: all there that is asked for, plain, missing numbers null with a reason."""
    assert set(figures) == {f.metric for f in figure_headers()} - OF_SPACE - OF_LINES - OF_CONTEXT - OF_YEAR
    for metric, figure in figures.items():
        assert figure["state"] in STATES, metric
        assert figure["unit"], metric
        numbers = [figure[k] for k in ("value", "lo", "hi", "denominator")]
        assert all(v is None or math.isfinite(v) for v in numbers), metric
        if figure["state"] == "ok":
            assert figure["value"] is not None or figure["rows"] is not None, metric
        else:
            assert figure["reason"], metric
            assert figure["value"] is figure["lo"] is figure["hi"] is None, metric
        if figure["lo"] is not None and figure["hi"] is not None:
            assert figure["lo"] <= figure["value"] <= figure["hi"], metric
        for row in figure["rows"] or ():
            assert all(v is None or isinstance(v, str | int | float | list) for v in row.values()), metric
            assert row["value"] is not None or row["reason"], metric


def test_every_figure_of_the_table_is_in_the_json_and_the_reverse(told: Figures) -> None:
    check(told)


def test_what_was_planted_is_reported(told: Figures) -> None:
    assert told["M0"]["value"] == pytest.approx(N / 21, rel=1e-5)
    assert told["M1"]["value"] == pytest.approx(1.0, abs=1e-3)
    assert told["M3"]["value"] == pytest.approx(EXPOSURE_H, rel=1e-3)
    assert told["M5"]["value"] == pytest.approx(EXPOSURE_H / 21, rel=1e-3)
    assert told["M6"]["value"] == pytest.approx(CLOSE_H / EXPOSURE_H, rel=1e-3)
    assert told["M7"]["value"] == pytest.approx(N / EXPOSURE_H, rel=1e-3)
    assert told["M8"]["value"] == N
    assert told["M4"]["value"] == 2 * N + 7  # one of them is there all day, every day
    assert values(told, "M10", "column")["duration_median_s"] == w.CLOSE_S
    assert values(told, "M11", "from_m")[1.5] == 1
    assert values(told, "M21", "least")[2] == 1
    assert told["M22"]["value"] == 0
    assert told["M22"]["rows"] == []
    assert told["M30"]["value"] == pytest.approx(60 * CLOSE_H, rel=1e-3)  # everybody is a stranger
    assert values(told, "M30", "column")["close_min_per_stay"] == pytest.approx(60 * CLOSE_H / (2 * N + 7), rel=1e-3)
    assert values(told, "M31", "column") == {"met_median": 1, "met_p90": 1}
    assert told["M32"]["value"] == 0
    assert values(told, "M33", "level") == pytest.approx({"A": 1, **dict.fromkeys("BCDEF", 0)})
    share = pytest.approx(CLOSE_H / EXPOSURE_H, rel=1e-3)
    assert values(told, "M26", "distance_m") == dict.fromkeys((1.8, 2.0, 2.2), share)


def test_levels_of_people_have_the_interval_of_days(told: Figures) -> None:
    """Every day is alike here, so the interval is there and holds little else than the value."""
    for metric in ("M3", "M5", "M6"):
        figure = told[metric]
        assert figure["lo"] is not None, metric
        assert figure["hi"] - figure["lo"] < 0.05 * figure["value"], metric
    scale = told["M3"]["value"] / told["M5"]["value"]
    assert told["M3"]["hi"] == pytest.approx(told["M5"]["hi"] * scale, rel=1e-4)


def test_the_fullest_quarter_hour_is_reported_with_its_start(whole: WeekReport) -> None:
    [peak] = as_json(whole.answers["people"])["rows"]
    # twenty slots of 40 s begin at each hour; in each, two more people for every place that has violations left
    assert peak["fullest_people"]["value"] == pytest.approx(
        1 + 2 * w.CLOSE_S / 40 * (1 + 12 / 22.5 + 6 / 22.5), rel=0.1
    )
    assert peak["fullest_start"].startswith("2026-11-")
    assert peak["fullest_start"].endswith(":00:00+01:00")


def test_maps_sum_to_the_time_they_are_made_of(told: Figures) -> None:
    person_s, close_s = (sum(row["value"] for row in told[m]["rows"]) for m in ("M16", "M17"))
    assert person_s == pytest.approx(EXPOSURE_H * 3600 / 21, rel=1e-3)
    assert close_s == pytest.approx(CLOSE_H * 3600 / 21, rel=1e-3)
    assert told["M16"]["denominator"] == pytest.approx(21, rel=1e-3)
    alone = [row for row in told["M17"]["rows"] if (row["x_m"], row["y_m"]) == (15.5, 9.5)]
    assert [row["value"] for row in alone] == [0]
    assert max(row["value"] for row in told["M18"]["rows"]) <= 1
    assert told["M19"]["denominator"] > 0


def test_areas_are_ranked_and_those_at_the_border_say_so(whole: WeekReport, told: Figures) -> None:
    rows = [row for row in told["M15"]["rows"] if row["column"] == "violation_rate"]
    assert [(row["area_id"], row["rank"]) for row in rows] == [("queue", 1), ("door", 2), (None, None)]
    assert rows[0]["value"] == pytest.approx(20, rel=1e-3)
    of_first = [note["text"] for note in as_json(whole.answers["areas"])["notes"] if note["row"] == 0]
    assert "is unknown" in of_first[0]  # the camera has no view


def test_the_engines_stated_error_is_beside_the_sensitivity(told: Figures) -> None:
    assert "90% of the violation records it gives are true" in told["M26"]["note"]


def test_what_one_week_cannot_tell_is_refused_with_its_reason(told: Figures) -> None:
    for metric, why in {
        "M13": "3 of 4 weeks",
        "M14": "3 of 4 weeks",
        "M20": "hotspots need 14",
        "M24": "needs 4 earlier recorded weeks",
        "M25": "needs 4 recorded weeks",
        "M27": "the change log names no change",
        "M28": "needs 3 recorded weeks",
    }.items():
        assert told[metric]["state"] == "not_enough_data", metric
        assert why in told[metric]["reason"], metric


def test_no_track_id_leaves(whole: WeekReport, told: Figures) -> None:
    text = json.dumps(told)
    for word in ("track_a", "track_b", "track_id"):
        assert f'"{word}"' not in text


def test_a_week_recorded_too_little_ranks_nothing(tmp_path: Path) -> None:
    site = w.world(tmp_path, w.toml(), w.messages(w.steady(HOURLY), days=range(4)))
    report = w.report(site)
    told = figures_of(report)
    assert report.state == "too_incomplete"
    check(told)
    for metric in ("M14", "M20", "M24"):
        assert told[metric]["state"] == "not_enough_data"
        assert "of open hours was recorded; a ranking needs 60%" in told[metric]["reason"]
    assert {row["rank"] for row in told["M15"]["rows"]} == {None}
    assert list(values(told, "M15", "area_id")) == ["queue", "door", None]
    assert told["M22"]["rows"] == []


def test_small_counts_are_held_back_everywhere(tmp_path: Path) -> None:
    """Three violations in the week: nothing tells how many."""
    counts = lambda day, hour: {w.QUEUE: 1} if day < 3 and hour == 10 else {}  # noqa: E731
    report = w.report(w.world(tmp_path, w.toml(), w.messages(counts)))
    told = figures_of(report)
    check(told)
    for metric in ("M0", "M7", "M8", "M9", "M10", "M30", "M31", "M32", "M33", "M34"):
        assert told[metric]["state"] != "ok", metric
    for metric in ("M0", "M7", "M8", "M9", "M10"):
        assert told[metric]["state"] == "not_enough_data", metric
        assert "fewer than 5" in told[metric]["reason"], metric
    queue = next(report.answers["areas"].where(area_id="queue"))
    assert value_of(queue, "violation_rate").value is None
    assert told["M28"]["state"] == "not_enough_data"
    assert '"n": 3' not in json.dumps(told)


def test_without_positions_every_figure_of_exposure_and_place_says_so(tmp_path: Path) -> None:
    frames = []
    for frame in w.messages(w.steady(HOURLY), is_alone=False):
        ids = [p["id"] for p in frame.pop("persons")]
        frame["pairs"] = [{"a": a, "b": b, "distance_m": 1.5} for a, b in zip(ids[::2], ids[1::2], strict=True)]
        frames.append(frame)
    told = figures_of(w.report(w.world(tmp_path, w.toml(), frames)))
    check(told)
    for metric in ("M3", "M5", "M6", "M7", "M15", "M16", "M17", "M18", "M19", "M20", "M23", "M30", "M32", "M33"):
        assert told[metric]["state"] == "not_measurable", metric
        assert told[metric]["reason"] == "the engine sends no positions", metric
    assert told["M0"]["value"] == pytest.approx(N / 21, rel=1e-3)


def test_without_ids_time_and_maps_remain(tmp_path: Path) -> None:
    def nameless(track: str, x: float, y: float) -> dict[str, Any]:
        return {"x_m": x, "y_m": y}

    told = figures_of(w.report(w.world(tmp_path, w.toml(), w.messages(w.steady(HOURLY), say=nameless))))
    check(told)
    for metric in ("M0", "M7", "M8", "M9", "M10", "M12", "M20"):
        assert told[metric]["state"] == "not_measurable", metric
        assert "ids" in told[metric]["reason"], metric
    assert told["M6"]["value"] == pytest.approx(CLOSE_H / EXPOSURE_H, rel=1e-3)
    for metric in ("M30", "M31", "M34"):
        assert told[metric]["state"] != "ok", metric
    for metric in ("M3", "M5", "M11", "M16", "M17", "M18", "M26", "M32", "M33"):
        assert told[metric]["state"] == "ok", metric


def test_a_week_without_data_refuses_everything_but_its_outages(tmp_path: Path) -> None:
    site = w.world(tmp_path, w.toml(), w.messages(w.steady(HOURLY), monday=w.BEFORE))
    report = w.report(site)
    told = figures_of(report)
    check(told)
    first, last = report.coverage.outages[0].start, report.coverage.outages[-1].end
    assert (first.hour, last.hour) == (9, 12)  # the nights before and after are no missing time
    given = {metric for metric, figure in told.items() if figure["state"] == "ok"}
    assert given <= {"M1", "M2", "M29"}
    assert told["M1"]["value"] == 0
    assert sum(row["value"] for row in told["M2"]["rows"]) == pytest.approx(21, abs=0.1)
    [quality] = report.answers["recording"].rows
    nothing = Value.missing(Reason("recorded.nothing"))
    assert quality["lost_messages"] == quality["message_gaps"] == nothing, "a silent engine may number its messages"
    assert value_of(quality, "n_records").value == 0


def test_an_engine_without_numbers_is_named_where_it_sent_something(whole: WeekReport) -> None:
    [quality] = whole.answers["recording"].rows
    assert quality["lost_messages"] == Value.missing(Reason("engine.no_numbers"))


def test_the_coverage_of_a_week_without_data_does_not_say_that_the_engine_numbers_nothing(tmp_path: Path) -> None:
    site = w.world(tmp_path, w.toml(), w.messages(w.steady(HOURLY), monday=w.BEFORE))
    for monday, why in ((w.MONDAY, "recorded.nothing"), (w.BEFORE, "engine.no_numbers")):
        with open_warehouse(site, monday, monday + timedelta(days=6)) as warehouse:
            gaps = Answers(coverage_answers(warehouse))["message_gaps"]
        assert gaps.nothing == Reason(why)


@pytest.fixture(scope="module")
def sixth_week(tmp_path_factory: pytest.TempPathFactory) -> WeekReport:
    """Return the sixth of six weeks of one open hour a day: Saturdays are full, the door was changed after three."""
    mondays = [w.MONDAY - timedelta(weeks=k) for k in range(6)]

    def counts(monday: date) -> w.Counts:
        def of_day(day: int, hour: int) -> Mapping[w.Place, int]:
            after = monday > w.MONDAY - timedelta(weeks=3)
            many = 4 if monday == w.MONDAY and day == 2 else 1  # a Wednesday unlike the others
            return {
                w.QUEUE: (70 if day == 5 else 20 + day) * many,
                w.DOOR: 8 if after else 24,
                w.AISLE: 6 * many,
            }

        return of_day

    log = [{"at": f"{w.MONDAY - timedelta(weeks=3)}T12:00:00+01:00", "text": "Door mat moved", "area": "door"}]
    config = w.toml(opening='{ mon-sun = "09:00-10:00" }', more="[report]\nmin_exposure_h = 5\n")
    streams = [w.messages(counts(m), monday=m, hours=(9, 10)) for m in mondays]
    return w.report(w.world(tmp_path_factory.mktemp("six"), config, *streams, log=log))


@pytest.fixture(scope="module")
def sixth(sixth_week: WeekReport) -> Figures:
    return figures_of(sixth_week)


def test_six_weeks_tell_what_one_week_cannot(sixth: Figures) -> None:
    check(sixth)
    for metric in ("M13", "M14", "M20", "M24", "M25", "M28"):
        assert sixth[metric]["state"] == "ok", (metric, sixth[metric]["reason"])


def test_the_fullest_hour_of_the_week_is_the_first(sixth: Figures) -> None:
    first = next(row for row in sixth["M14"]["rows"] if row["by"] == "violation_rate" and row["rank"] == 1)
    assert (first["weekday"], first["local_hour"]) == ("Saturday", 9)
    profile = values(sixth, "M13", "weekday", "violation_rate")
    assert max(profile, key=lambda day: profile[day] or 0) == "Saturday"


def test_the_unusual_hour_is_reported_beside_the_usual_range(sixth: Figures) -> None:
    row = {row["column"]: row for row in sixth["M24"]["rows"]}
    assert {(r["local_date"], r["local_hour"]) for r in row.values()} == {(str(w.MONDAY + timedelta(days=2)), 9)}
    assert row["n_violations"]["value"] > row["usual"]["hi"] > row["usual"]["lo"]


def test_weeks_and_the_week_to_come_are_reported(sixth: Figures) -> None:
    weeks = [row for row in sixth["M28"]["rows"] if row["column"] == "violation_rate"]
    assert [row["state"] for row in weeks] == ["ok"] * 6
    assert sum(row["n_changes"] for row in weeks) == 1
    columns = [row["column"] for row in sixth["M25"]["rows"]]
    every = {name: columns.count(name) for name in columns}
    assert every == {"people": 7, "violation_rate": 7, "gathering_chance": 7}


def test_the_change_of_the_door_is_reported_with_what_it_rests_on(sixth_week: WeekReport) -> None:
    changes = sixth_week.answers["changes"]
    [row] = changes.rows
    assert (row["area_id"], row["entry"]) == ("door", 1)
    ratio = value_of(row, "encounter_rate_ratio")
    if ratio.value is None:
        assert ratio.reason is not None
    else:
        assert ratio.value < 0.7
        assert {k for k, _ in changes.notes} == {0}, "doubts, and what is taken for granted"
