"""`vsd report` end to end: the same bytes from the same records, hostile names, a JSON file that follows its schema."""

from __future__ import annotations

import html
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
from report import ingested_worlds as w

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.site.model import Site

HOSTILE = ("<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "</style><b>&amp;", "={{ 7*7 }}")
REPOSITORY = Path(__file__).resolve().parents[2]


def busy(day: int, hour: int) -> dict[w.Place, int]:
    return {w.QUEUE: 20 + day, w.DOOR: 12 + day % 4, w.AISLE: 9 + (day * 5) % 4}


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Site:
    streams = w.messages(busy, monday=w.BEFORE), w.messages(busy, lost=[(w.rome(2, 9), w.rome(2, 12))])
    site = w.world(tmp_path_factory.mktemp("shop"), w.toml(), *streams)
    w.report(site)
    return site


def vsd(folder: Path, *arguments: str, **environment: str) -> bytes:
    """Run the command line in its own process and return what it printed."""
    code = "from vsd_analytics.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "-C", str(folder), *arguments],
        capture_output=True,
        check=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), **environment},
    )
    return done.stdout


def test_bytes_depend_on_records_alone(shop: Site, tmp_path: Path) -> None:
    html, data = (("report", "--week", "2026-W46", "--format", kind, "--out", "-") for kind in ("html", "json"))
    here = vsd(shop.root, *html, TZ="UTC", LANG="C")
    assert vsd(shop.root, *html, TZ="Pacific/Auckland", LANG="de_DE.UTF-8", PYTHONHASHSEED="7") == here
    moved = tmp_path / "elsewhere"
    shutil.copytree(shop.root, moved, ignore=shutil.ignore_patterns("facts"))
    assert vsd(moved, *html, TZ="Pacific/Auckland") == here
    assert vsd(moved, *data) == vsd(shop.root, *data, TZ="Pacific/Auckland", PYTHONHASHSEED="7")


def test_now_changes_only_when_it_was_made_and_how_old_the_records_are(
    shop: Site, capsys: pytest.CaptureFixture[str]
) -> None:
    def page(*now: str) -> list[str]:
        assert run(cli, ["-C", str(shop.root), *now, "report", "--week", "2026-W46", "--out", "-"]) == 0
        return capsys.readouterr().out.splitlines()

    lines = zip(page(), page("--now", "2026-12-24T18:30+01:00"), strict=True)
    changed = [after for before, after in lines if before != after]
    privacy, made = changed
    assert "are past the 30 days set here" in privacy
    assert "As of Thursday 24 December 2026, 18:30 (Europe/Rome)" in made


def test_a_second_report_makes_no_fact_again(shop: Site) -> None:
    planned: list[int] = []
    week_report(shop, w.MONDAY, on_plan=planned.append)
    assert planned == [0]


def test_the_json_file_follows_the_published_schema(shop: Site, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, ["schema", "report"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert run(cli, ["-C", str(shop.root), "report", "--week", "2026-W46", "--json"]) == 0
    twin = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(schema).validate(twin)
    assert twin["week"]["iso"] == "2026-W46"
    held = {column["figure"] for answer in twin["answers"].values() for column in answer["columns"]} - {""}
    assert {"M0", "M1", "M2", "M3", "M6", "M7", "M8", "M15"} <= held
    assert twin["figures"].keys() == {"M16", "M17", "M18", "M19"}, "maps: each number stands in the file once"
    for key, figure in twin["figures"].items():
        assert figure["rows"] is not None or figure["state"] != "ok", key


def test_strict_tells_a_week_that_is_too_incomplete(shop: Site, tmp_path: Path) -> None:
    common = ["-C", str(shop.root), "--now", "2026-12-14", "report", "--out", str(tmp_path), "--strict", "--week"]
    assert run(cli, [*common, "2026-W46"]) == 0
    assert run(cli, [*common, "2026-W48"]) == 1
    assert (tmp_path / "2026-W48.html").exists()


def test_csv_is_three_files_and_not_for_standard_output(
    shop: Site, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["-C", str(shop.root), "report", "--week", "2026-W46", "--format", "csv", "--out"]
    assert run(cli, [*common, str(tmp_path)]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        f"2026-W46-{name}.csv" for name in ("areas", "hotspots", "hours")
    ]
    assert run(cli, [*common, "-"]) == 2
    assert "--out" in capsys.readouterr().err


def test_an_empty_store_says_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "vsd.toml").write_text(w.toml(), encoding="utf-8")
    assert run(cli, ["-C", str(tmp_path), "report"]) == 2
    said = capsys.readouterr().err
    assert "E301" in said
    assert "vsd ingest" in said


def test_hostile_names_are_words_on_the_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script, image, style, template = (json.dumps(text) for text in HOSTILE)
    config = w.toml(areas={}).replace('name = "Shop"', f"name = {script}").replace('"Ground floor"', image)
    config = config.replace('"Camera 1"', style)
    config += (
        f'[[area]]\nid = "queue"\nname = {template}\nfloor = "ground"\npolygon = [[1, 1], [5, 1], [5, 5], [1, 5]]\n'
    )
    log = [{"at": "2026-11-10T10:00:00+01:00", "text": HOSTILE[0] + HOSTILE[2], "area": "queue"}]
    streams = w.messages(busy, monday=w.BEFORE, engine=HOSTILE[1]), w.messages(busy, engine=HOSTILE[1])
    w.world(tmp_path, config, *streams, log=log)
    assert run(cli, ["-C", str(tmp_path), "report", "--week", "2026-W46", "--out", "-"]) == 0
    page = capsys.readouterr().out
    body = page.split("</style>", 1)[1]
    assert "<script" not in page
    assert "<img" not in page
    assert "</style" not in body
    assert "{{ 7*7 }}" in html.unescape(body)
    assert ">49<" not in body
    for text in HOSTILE:
        assert text in html.unescape(body), text
    assert not re.search(r"\son\w+\s*=", re.sub(r">[^<]*<|=\"[^\"]*\"", "", body))
    assert run(cli, ["-C", str(tmp_path), "report", "--week", "2026-W46", "--format", "csv"]) == 0
    assert "'={{ 7*7 }}" in (tmp_path / "reports" / "2026-W46-areas.csv").read_text(encoding="utf-8")
