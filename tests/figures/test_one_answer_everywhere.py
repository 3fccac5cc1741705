"""Visits, flow, queues, capacity, crossings are the same numbers in commands, report, its file, Python and planner."""

from __future__ import annotations

import csv
import io
import json
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from figures.walkers_between_areas import week_of_walkers
from report import ingested_worlds as w

import vsd_analytics
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.planner.planner_data import planner_pages
from vsd_analytics.render.significant import significant
from vsd_analytics.report.pages.json_and_csv import figures_json, from_json, to_json

COMMANDS = {
    "visits": ("visits", "--json"),
    "queues": ("queue", "--json"),
    "queue_hours": ("queue", "--json"),
    "capacity": ("capacity", "--json"),
    **dict.fromkeys(("lines", "line_days", "line_hours", "line_peaks", "doors", "door_days"), ("lines", "--json")),
    "flow": ("flow", "--format", "json"),
    "flow_areas": ("flow", "--format", "json"),
    "flow_routes": ("flow", "--format", "json"),
    "flow_links": ("flow", "--format", "json"),
}


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = week_of_walkers(tmp_path_factory.mktemp("everywhere"))
    toml = root / "vsd.toml"
    asking = 'id = "till"\nqueue = true\nserved_in = "door"\ncapacity = 2\n'
    line = '[[line]]\nid = "corridor"\nname = "Corridor"\npoints = [[3, 0], [3, 4]]\ninside = "left"\n'
    line += '[doors]\nempty_at = "09:00"\n'
    toml.write_text(toml.read_text("utf-8").replace('id = "till"\n', asking) + line, encoding="utf-8")
    return root


@pytest.fixture(scope="module")
def twin(shop: Path) -> dict[str, Any]:
    answers: dict[str, Any] = json.loads(to_json(w.report(load_site(shop))))["answers"]
    return answers


def printed(
    root: Path, capsys: pytest.CaptureFixture[str], command: str, *arguments: str, week: str = "2026-W46"
) -> str:
    run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", "--quiet", command, "--week", week, *arguments])
    return capsys.readouterr().out


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_prints_the_rows_of_the_report(
    shop: Path, twin: dict[str, Any], capsys: pytest.CaptureFixture[str], name: str
) -> None:
    command, *arguments = COMMANDS[name]
    told = json.loads(printed(shop, capsys, command, *arguments))["answers"][name]
    assert told["rows"] == twin[name]["rows"]
    assert told["columns"] == twin[name]["columns"]


@pytest.mark.parametrize("name", ["visits", "queues", "queue_hours", "capacity", "lines", "flow", "flow_links"])
def test_python_has_the_values_of_the_report(shop: Path, twin: dict[str, Any], name: str) -> None:
    rows = getattr(vsd_analytics.open(shop).week("2026-W46"), name).arrow().to_pylist()
    flat = [
        {
            f"{column}{end}": cell[part]
            for column, cell in row.items()
            if isinstance(cell, dict)
            for part, end in (("value", ""), ("state", "_state"), ("reason", "_reason"))
        }
        for row in twin[name]["rows"]
    ]
    assert len(rows) == len(flat)
    for told, expected in zip(rows, flat, strict=True):
        rounded = {k: significant(v) if isinstance(v, float) else v for k, v in told.items()}
        assert {column: rounded[column] for column in expected} == expected


def test_csv_has_the_values_of_the_report(shop: Path, twin: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    rows = list(csv.DictReader(io.StringIO(printed(shop, capsys, "flow", "--format", "csv"))))
    shares = [row["next_area_share"]["value"] for row in twin["flow"]["rows"]]
    assert [float(row["next_area_share"]) if row["next_area_share"] else None for row in rows] == shares


def test_figures_by_catalogue_id_are_a_view_of_the_answers(shop: Path, twin: dict[str, Any]) -> None:
    figures = figures_json(w.report(load_site(shop)))
    for metric in ("M35", "M36", "M37", "M39", "M40", "M41", "M57"):
        rows = figures[metric]["rows"] or []
        for column in {row["column"] for row in rows}:
            tables = [
                t for t in twin.values() if any((c["name"], c["figure"]) == (column, metric) for c in t["columns"])
            ]
            values = [row[column]["value"] for table in tables for row in table["rows"]]
            viewed = [row["value"] for row in rows if row["column"] == column]
            assert sorted(map(str, viewed)) == sorted(map(str, values)), (metric, column)


def test_the_file_and_the_planner_hold_the_answers_of_the_report(shop: Path) -> None:
    site = load_site(shop)
    report = w.report(site)
    space = planner_pages(site, w.MONDAY)[0].space
    assert len(space) > 5
    assert [answer for answer in space if answer != report.answers[answer.name]] == []
    assert to_json(from_json(to_json(report))) == to_json(report)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_week_without_records_has_no_numbers_and_says_so(
    shop: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    command, *arguments = COMMANDS[name]
    answer = json.loads(printed(shop, capsys, command, "--exact", *arguments, week="2026-W47"))["answers"][name]
    cells = {c: cell for row in answer["rows"] for c, cell in row.items() if isinstance(cell, dict)}
    shares = {cells.pop("recorded_share", {"value": 0})["value"]}
    assert shares == {0}
    assert {(c, cell["value"]) for c, cell in cells.items()} == {(c, None) for c in cells}
    reasons = [cell["reason"] for cell in cells.values()] or [answer["nothing"]]
    assert [r for r in reasons if "nothing or too little was recorded" not in r] == []
    assert [n for n in answer["notes"] if "has 0" in n["text"]] == []


def test_the_report_of_a_week_without_records_claims_nothing_of_people(shop: Path) -> None:
    site = load_site(shop)
    answers = json.loads(to_json(w.report(site, w.MONDAY + timedelta(days=7))))["answers"]
    of_records = {"n_records", "n_track_records", "recorded_share", "recalibrated_cameras", "stretches_by_other_rules"}
    rows = [(n, row) for n, a in answers.items() if n != "outages" for row in a["rows"]]
    of_week = [(n, row) for n, row in rows if row.get("week", "2026-W47") == "2026-W47"]  # others are told of their own
    values = [(n, c, v) for n, row in of_week for c, v in row.items()]
    cells = [(n, c, v) for n, c, v in values if isinstance(v, dict) and c not in of_records]
    assert [(n, c) for n, c, cell in cells if cell["value"] is not None] == []
    said = [answer["nothing"] or "" for answer in answers.values()] + [cell["reason"] for _, _, cell in cells]
    assert [text for text in said if "nobody" in text or "no more" in text or "fewer" in text] == []
