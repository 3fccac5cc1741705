"""What is in a folder of reports: JSON files are read, all else is named, and nothing stops the others."""

from __future__ import annotations

import json
import os
from datetime import date
from pathlib import Path
from random import Random
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from report import sample_weeks as weeks
from site_index import many_reports as many

from vsd_analytics.errors import VsdError
from vsd_analytics.report.pages.json_and_csv import json_schema, to_json
from vsd_analytics.site_index import read_reports
from vsd_analytics.site_index.floor_weeks import catalogue
from vsd_analytics.site_index.page import render_index
from vsd_analytics.site_index.read_reports import find_reports, kind_of, read_report_json


def codes(folder: Path) -> list[tuple[str, str]]:
    shelf = find_reports(folder / "reports", project="shop")
    return [(p.code, Path(p.where.file).name if p.where else "") for p in shelf.problems]


def changed(data: bytes, path: str, value: Any) -> bytes:
    twin = json.loads(data)
    *way, last = path.split(".")
    inner = twin
    for step in way:
        inner = inner[step]
    inner[last] = value
    return json.dumps(twin).encode()


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    for back in range(3):
        many.write(tmp_path, many.report(back=back))
    return tmp_path


def test_weeks_are_read_with_their_links(shop: Path) -> None:
    (shop / "reports" / "2026-W46.pdf").write_bytes(b"%PDF")
    shelf = find_reports(shop / "reports", project="shop", prefix="shop/")
    assert [e.stem for e in shelf.entries] == ["2026-W44", "2026-W45", "2026-W46"]
    assert [e.monday for e in shelf.entries] == [date(2026, 10, 26), date(2026, 11, 2), date(2026, 11, 9)]
    assert shelf.entries[2].links == {
        "report": "shop/2026-W46.html",
        "pdf": "shop/2026-W46.pdf",
        "json": "shop/2026-W46.json",
    }
    assert shelf.problems == ()


@pytest.mark.parametrize("name", list(weeks.ALL))
def test_what_the_index_takes_from_a_json_file_is_what_the_report_says(tmp_path: Path, name: str) -> None:
    report = weeks.ALL[name]()
    data = to_json(report)
    jsonschema.Draft202012Validator(json_schema()).validate(json.loads(data))
    twin = read_report_json(many.write(tmp_path, report))
    said = json.loads(data)
    assert twin.state == report.state
    assert twin.level.violation_rate.value == said["level"]["violation_rate"]["value"]
    assert twin.coverage.share == said["coverage"]["share"]
    assert twin.story.headline == said["story"]["headline"]


def test_a_later_addition_to_the_schema_is_no_reason_to_refuse(shop: Path) -> None:
    path = shop / "reports" / "2026-W46.json"
    path.write_bytes(changed(changed(path.read_bytes(), "weather", {"rain_mm": 3}), "coverage.sensors", [1]))
    assert codes(shop) == []


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", "W510"),
        (b'{"schema": "vsd.report.week/1", "site"', "W510"),
        (b'{"schema": "vsd.report.week/1"}', "W510"),
        (b"\xff\xfe{}", "W510"),
        (b"[" * 100_000, "W510"),
        (b"[]", "W511"),
        (b"null", "W511"),
        (b'{"type": "FeatureCollection"}', "W511"),
        (b'{"schema": 1}', "W511"),
        (b'{"schema": "vsd.report.week/0"}', "W511"),
        (b'{"schema": "vsd.report.weekly/1"}', "W511"),
        (b'{"schema": "vsd.report.week/3"}', "W512"),
    ],
)
def test_a_file_that_is_no_json_file_is_named_and_the_others_go_on(shop: Path, data: bytes, code: str) -> None:
    (shop / "reports" / "2026-W43.json").write_bytes(data)
    assert codes(shop) == [(code, "2026-W43.json")]
    assert len(find_reports(shop / "reports", project="shop").entries) == 3


@pytest.mark.parametrize(
    ("path", "value", "code"),
    [
        ("week.iso", "2026-W40", "W510"),
        ("week.monday", "2026-11-10", "W510"),
        ("week.monday", "0001-01-01", "W510"),
        ("week.year", 2025, "W510"),
        ("state", "fine", "W510"),
        ("coverage.share", "much", "W510"),
        ("level.violation_rate.verdict", "<b>", "W510"),
        ("story", None, "W510"),
        ("generated_at", "2026-11-16T06:00:00", "W510"),
    ],
)
def test_a_json_file_that_contradicts_itself_is_damaged(shop: Path, path: str, value: Any, code: str) -> None:
    file = shop / "reports" / "2026-W46.json"
    file.write_bytes(changed(file.read_bytes(), path, value))
    assert codes(shop) == [(code, "2026-W46.json")]
    entry = next(e for e in find_reports(shop / "reports", project="shop").entries if e.stem == "2026-W46")
    assert (entry.report, entry.links) == (None, {"report": "2026-W46.html"}), "its page is still there"


@pytest.mark.parametrize("stem", ["2026-W40", "2026-W46-first", "copy of 2026-W46", "2026-W46-UP", "2026-W60", "a"])
def test_a_json_file_under_another_name_is_foreign(shop: Path, stem: str) -> None:
    reports = shop / "reports"
    (reports / f"{stem}.json").write_bytes((reports / "2026-W46.json").read_bytes())
    assert codes(shop) == [("W511", f"{stem}.json")]


def test_a_json_file_may_name_its_floor(shop: Path) -> None:
    reports = shop / "reports"
    (reports / "2026-W46.json").rename(reports / "2026-W46-ground.json")
    (reports / "2026-W46.html").rename(reports / "2026-W46-ground.html")
    assert codes(shop) == []


def test_a_page_without_its_json_file_is_listed_without_figures_and_named(shop: Path) -> None:
    (shop / "reports" / "2026-W45.json").unlink()
    assert codes(shop) == [("W513", "2026-W45.html")]
    entry = find_reports(shop / "reports", project="shop").entries[1]
    assert (entry.stem, entry.report, entry.links) == ("2026-W45", None, {"report": "2026-W45.html"})


def test_other_files_links_and_pipes_are_left_alone(shop: Path, tmp_path: Path) -> None:
    reports = shop / "reports"
    secret = tmp_path / "secret.json"
    secret.write_text("{}")
    for name in ("index.html", "2026-W46-planner.html", "2026-W46-hours.csv", "notes.txt", "2026-W60.html", "W46.html"):
        (reports / name).write_text("x")
    (reports / "2026-W40.json").symlink_to(secret)
    (reports / "2026-W41.html").symlink_to(secret)
    (reports / "2026-W42.json").mkdir()
    os.mkfifo(reports / "2026-W43.json")
    assert codes(shop) == []
    shelf = find_reports(reports, project="shop")
    assert [e.stem for e in shelf.entries] == ["2026-W44", "2026-W45", "2026-W46"]
    assert [list(e.links) for e in shelf.entries] == [["report", "json"]] * 2 + [["report", "json", "planner"]]


def test_a_huge_file_is_not_read(shop: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(read_reports, "MAX_BYTES", 1000)
    assert {code for code, _ in codes(shop)} == {"W511"}


def test_no_folder_is_an_empty_shelf(tmp_path: Path) -> None:
    assert find_reports(tmp_path / "reports", project="shop") == read_reports.FoundReports()


def test_texts_carry_no_control_characters(shop: Path) -> None:
    path = shop / "reports" / "2026-W46.json"
    path.write_bytes(changed(path.read_bytes(), "site.name", "a\u202eb\x1b[31m"))
    assert read_report_json(path).site.name == "a\ufffdb\ufffd[31m"


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("2026-W46.html", "report"),
        ("2026-W46-ground.pdf", "pdf"),
        ("2026-W53.json", "json"),
        ("2025-W53.json", None),
        ("2026-W46-ground-planner.html", "planner"),
        ("2026-W46-planner.html", "planner"),
        ("planner.html", None),
        ("2026-W46.svg", None),
        ("index.html", None),
        ("2026-W46-.html", None),
        ("2026-W46-a/b.html", None),
        ("../2026-W46.html", None),
        ('2026-W46-".html', None),
        ("2026-W46.html\n", None),
    ],
)
def test_kinds_of_files_by_name(name: str, kind: str | None) -> None:
    assert kind_of(name) == kind


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_json_file_with_any_part_spoilt_is_read_or_refused_in_words(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    draw = Random(seed)
    value = json.loads(TWIN)
    inner: Any = value
    while isinstance(inner, dict | list) and inner and draw.random() < 0.85:
        key = draw.choice(list(inner)) if isinstance(inner, dict) else draw.randrange(len(inner))
        holder, inner = inner, inner[key]
    if inner is value:
        key, holder = draw.choice(list(value)), value
    holder[key] = draw.choice([None, "", -1, 1e308, [], {}, "\u202e<b>", 2**70, True, "9999-12-31"])
    path = tmp_path_factory.mktemp("spoilt") / "2026-W46.json"
    path.write_text(json.dumps(value))
    refused = None
    try:
        twin = read_report_json(path)
    except VsdError as error:
        refused = error
    if refused is None:
        render_index(catalogue([read_reports.Entry(project="p", stem="2026-W46", report=twin, links={})]))
    else:
        assert refused.code in ("W510", "W511", "W512")
        assert refused.why
        assert refused.fix


TWIN = to_json(many.report())
