"""Queues and capacities in the report and on the command line: planted numbers, small counts, silent cameras."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from report import ingested_worlds as w

import vsd_analytics
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.figures.room_levels import IATA_LEVELS, iata_level_of
from vsd_analytics.report.pages.json_and_csv import figures_json
from vsd_analytics.report.pages.week import render_html

WAITING = {"M39", "M40", "M41"}
PAIRS = {w.QUEUE: 20}
"""Twenty pairs an hour stand in the queue for two frames of 20 s each."""


def asking(
    *, cameras: tuple[str, ...] = ("cam-1",), language: str = "en", name: str = "Queue", mask_below: int = 5
) -> str:
    """Return a vsd.toml whose queue leads to the door, with a capacity of one person."""
    queue = f'name = "{name}"\nqueue = true\nserved_in = "door"\ndoor = true\ncapacity = 1'
    toml = w.toml(cameras=cameras, more=f"[report]\nmask_below = {mask_below}").replace('name = "Queue"', queue)
    return toml.replace("[site]", f'[site]\nlanguage = "{language}"', 1)


def vsd(root: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", "--quiet", *arguments])
    out, err = capsys.readouterr()
    assert "Traceback" not in out + err
    return code, out, err


def values(figure: dict[str, Any], hour: int | None = None) -> dict[str, Any]:
    return {r["column"]: r["value"] for r in figure["rows"] if r.get("local_hour") == hour}


def test_report_page_and_commands_have_the_planted_people(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A pair of people for 40 s every 180 s: two people for two ninths of the time, so one more than the capacity."""
    site = w.world(tmp_path, asking(name="<b>Q</b>{{ 7*7 }}", mask_below=0), w.messages(w.steady(PAIRS)))
    report = w.report(site)
    found = figures_json(report)
    assert values(found["M39"])["people_waiting"] == pytest.approx(4 / 9, rel=1e-3)
    assert values(found["M39"], 10)["people_waiting"] == pytest.approx(4 / 9, rel=1e-3)
    assert values(found["M39"])["people_waiting_p90"] == 2
    use = values(found["M41"])
    for column in ("busy_share", "full_share", "over_share", "surplus_people"):
        assert use[column] == pytest.approx(2 / 9, rel=1e-3), column
    (median,) = (r for r in found["M40"]["rows"] if r["column"] == "wait_median_s" and "local_hour" not in r)
    assert (median["value"], median["reason"]) == (None, "needs at least 10 people who are served, has 0")
    page = render_html(report)
    assert "<b>Q</b>" not in page
    assert "&lt;b&gt;Q&lt;/b&gt;{{ 7*7 }}, capacity 1" in page
    assert "On average 0.44 people wait" in page
    code, out, _ = vsd(tmp_path, capsys, "queue", "--week", "2026-W46")
    assert code == 1, "no waiting time of a queue that has an end"
    assert re.search(r"^<b>Q</b>{{ 7\*7 }} +0\.44 .* 2 ", out, re.MULTILINE)
    assert re.search(r" 10:00 +0\.44 ", out)
    code, out, _ = vsd(tmp_path, capsys, "capacity", "--week", "2026-W46", "--json")
    (place,) = json.loads(out)["answers"]["capacity"]["rows"]
    assert code == 0
    assert place["over_share"]["value"] == pytest.approx(2 / 9, rel=1e-3)
    room_m2 = place["area_m2"] / 2
    level = "over_design" if room_m2 >= 1.2 else "optimum" if room_m2 >= 1.0 else "sub_optimum"
    shares = {name: place[f"iata_{name}_share"]["value"] for name in IATA_LEVELS}
    assert shares == {name: float(name == level) for name in IATA_LEVELS}, "two people share the queue all the time"


def test_levels_of_a_queue_are_of_queues_and_a_limit_belongs_to_the_roomier_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert [iata_level_of(1 / room) for room in (5.0, 1.2, 1.19, 1.0, 0.99, 0.2)] == [0, 0, 1, 1, 2, 2]
    toml = asking(mask_below=0).replace('queue = true\nserved_in = "door"\n', "")
    w.world(tmp_path, toml, w.messages(w.steady(PAIRS)))
    _, out, _ = vsd(tmp_path, capsys, "capacity", "--week", "2026-W46", "--json")
    (place,) = json.loads(out)["answers"]["capacity"]["rows"]
    assert place["room_a_share"]["value"] is not None
    for name in IATA_LEVELS:
        assert place[f"iata_{name}_share"]["value"] is None
        assert "queue = true" in place[f"iata_{name}_share"]["reason"]


def test_a_report_that_nobody_asked_has_neither_figures_nor_section(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = w.report(w.world(tmp_path, w.toml(), w.messages(w.steady(PAIRS), days=(0,))))
    assert not WAITING & set(figures_json(report))
    assert 'id="waiting"' not in render_html(report)
    for command, fix in (("queue", "queue = true"), ("capacity", "capacity = 40")):
        code, _, err = vsd(tmp_path, capsys, command)
        assert code == 2
        assert fix in err


def test_few_people_are_held_back_and_the_page_in_italian_says_so(tmp_path: Path) -> None:
    few = lambda day, hour: {w.QUEUE: 1} if day < 2 and hour == 10 else {w.DOOR: 20}  # noqa: E731
    report = w.report(w.world(tmp_path, asking(language="it"), w.messages(few, days=(0, 1, 2))))
    found = figures_json(report)
    for metric in ("M39", "M40"):
        assert found[metric]["state"] == "not_enough_data"
        assert found[metric]["reason"] == "fewer than 5 were counted"
    assert "Non si sa quante persone aspettano" in render_html(report)
    table = vsd_analytics.open(tmp_path).week("2026-W46").queues.df()
    assert table["people_waiting"].isna().all()
    by_hour = vsd_analytics.open(tmp_path).week("2026-W46").queue_hours.df()
    assert by_hour["people_waiting"].isna().all(), "no row of an hour tells that somebody came then"


@pytest.mark.parametrize("end", ['served_in = "door"', ""])
def test_the_table_of_queues_has_the_hours_of_the_report_and_holds_back_the_same_ones(tmp_path: Path, end: str) -> None:
    """Of the hours with enough people one goes with that of two: the week less all others would be their time."""

    def some(day: int, hour: int) -> dict[Any, int]:
        return {w.QUEUE: 1} if day == 0 and hour == 10 else {9: {w.QUEUE: 30}, 11: PAIRS}.get(hour, {w.DOOR: 20})

    report = w.report(w.world(tmp_path, asking().replace('served_in = "door"', end), w.messages(some, days=(0, 1))))
    found = figures_json(report)["M39"]
    printed = {r.get("local_hour"): r["value"] for r in found["rows"] if r["column"] == "people_waiting"}
    week = vsd_analytics.open(tmp_path).week("2026-W46")
    hours, (whole,) = week.queue_hours.df(), week.queues.df()["people_waiting"].tolist()
    rows = zip(hours["local_hour"], hours["people_waiting"], strict=True)
    shown = {None: whole, **{hour: None if pd.isna(value) else value for hour, value in rows}}
    assert shown == pytest.approx(printed, abs=1e-6)
    assert shown[None] > 0
    assert shown[10] is None
    assert shown[11] is None
    assert shown[9] == pytest.approx(6 / 9, rel=1e-3)


def test_the_command_gives_no_small_count_of_people_who_wait(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Version 1.1.0 printed that two people came in an hour."""
    few = lambda day, hour: {w.QUEUE: 1} if day == 0 and hour == 10 else PAIRS if hour == 11 else {w.DOOR: 20}  # noqa: E731
    w.world(tmp_path, asking(), w.messages(few, days=(0, 1)))
    found = {}
    for option in ((), ("--exact",)):
        _, out, _ = vsd(tmp_path, capsys, "queue", "--week", "2026-W46", "--json", *option)
        rows = json.loads(out)["answers"]["queue_hours"]["rows"]
        [found[option]] = [row for row in rows if row["local_hour"] == 10]
    assert found["--exact",]["n_entered"]["value"] == 2
    assert not [name for name in found[()] if name.startswith("n_")]
    assert found[()]["people_waiting"]["value"] is None


def test_a_forecast_of_people_waiting_is_for_the_operator(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    w.world(tmp_path, asking(), w.messages(lambda day, hour: PAIRS, days=(0, 1)))
    code, out, err = vsd(tmp_path, capsys, "queue", "--week", "2026-W46", "--forecast")
    assert (code, out) == (2, "")
    assert "error[E105]" in err
    (fix,) = re.findall(r"fix: vsd (queue .*)", err)
    code, out, _ = vsd(tmp_path, capsys, *fix.split(), "--week", "2026-W46", "--json")
    assert "queue_forecast" in json.loads(out)["answers"]


def test_a_week_in_which_one_of_two_cameras_was_silent_is_unknown_and_names_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    days = (0, 1)
    both = [
        *w.messages(w.steady(PAIRS), days=days),
        *w.messages(w.steady(PAIRS), camera="cam-2", monday=w.BEFORE, days=days),
    ]
    w.world(tmp_path, asking(cameras=("cam-1", "cam-2")), both)
    code, out, _ = vsd(tmp_path, capsys, "queue", "--week", "2026-W46", "--json")
    (area,) = json.loads(out)["answers"]["queues"]["rows"]
    assert code == 1
    assert area["people_waiting"]["value"] is None
    assert area["silent_cameras"] == ["cam-2"]
    assert area["recorded_share"]["value"] == 0.0
    code, out, _ = vsd(tmp_path, capsys, "capacity", "--week", "2026-W46")
    assert code == 1
    assert "nothing was recorded by cam-2" in out
