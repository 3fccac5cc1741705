"""Flow in the report, on its page and on the command line, of one week of planted walkers."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from figures.walkers_between_areas import HOSTILE, week_of_walkers
from report import ingested_worlds as w

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.figures.walks import is_directed
from vsd_analytics.report.pages.json_and_csv import figures_json
from vsd_analytics.report.pages.week import render_html


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a project with a week of walkers: two routes, a rare one, every tenth person lost."""
    return week_of_walkers(tmp_path_factory.mktemp("flow"))


def vsd(root: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", "--quiet", "flow", *arguments])
    out, err = capsys.readouterr()
    assert "Traceback" not in out + err
    return code, out, err


def test_the_report_has_the_planted_flow_and_the_page_draws_it(shop: Path) -> None:
    report = w.report(load_site(shop))
    figures: dict[str, Any] = figures_json(report)
    of_door = {r["to_area_ids"]: r for r in figures["M37"]["rows"] if r["area_id"] == "door"}
    assert of_door["bread"]["lo"] < 0.6 < of_door["bread"]["hi"]
    assert of_door.keys() == {"bread", "wine till"}, "two people are no line of their own"
    assert sum(r["value"] for r in of_door.values()) == pytest.approx(1.0)
    assert all(r["fits_arrivals"] for r in of_door.values())
    routes = {r["route_area_ids"]: r["value"] for r in figures["M38"]["rows"]}
    assert list(routes) == ["door bread till door", "others"], (
        "the other way is joined by the rare one, so that it is not told"
    )
    assert routes["door bread till door"] == pytest.approx(0.6, abs=0.1)
    corridor = [r for r in figures["M42"]["rows"] if r["y_m"] == 3.5]
    assert {r["ways"] for r in corridor} == {"both"}
    assert all(abs(r["value"]) < 1 and r["denominator"] >= 5 for r in corridor)
    page = render_html(report)
    figure = page[page.index("Which way people walk and go next") :]
    assert "Between areas" in figure
    assert len(re.findall(r'class="vs"', figure)) >= 3
    assert HOSTILE not in page
    assert "&lt;b&gt;Bread" in page


def test_the_command_prints_matrix_and_routes_in_three_formats(shop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, text, _ = vsd(shop, capsys, "--week", "2026-W46")
    assert code == 0
    assert "Door > <b>Bread</b> > Till > Door" in text
    assert re.search(r"^Door +40 \([^)]*\) +\d\.\d% \(", text, re.MULTILINE), "who leaves, and who is lost"
    code, out, _ = vsd(shop, capsys, "--week", "2026-W46", "--format", "json")
    answers = json.loads(out)["answers"]
    door, to = answers["flow_areas"]["rows"][0], [r for r in answers["flow"]["rows"] if r["area_id"] == "door"]
    assert [row["to_area_ids"] for row in to] == ["bread", "wine till"]
    assert door["fits_arrivals"] is True
    assert door["leave_per_open_h"]["value"] == pytest.approx(40, rel=0.01)
    code, out, _ = vsd(shop, capsys, "--week", "2026-W46", "--format", "csv")
    rows = list(csv.DictReader(io.StringIO(out)))
    assert [r["to_area_ids"] for r in rows if r["area_id"] == "door"] == ["bread", "wine till"]
    assert float(rows[0]["next_area_share"]) == pytest.approx(to[0]["next_area_share"]["value"], abs=1e-4)


def test_a_week_without_records_is_unknown_and_names_the_camera(shop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, text, _ = vsd(shop, capsys, "--exact", "--week", "2026-W47")
    assert code == 1
    assert "nothing was recorded by cam:" in text


def test_without_areas_that_ask_the_command_says_how(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    w.world(tmp_path, w.toml(), w.messages(w.steady({w.QUEUE: 1}), days=(0,)))
    code, _, err = vsd(tmp_path, capsys)
    assert code == 2
    assert "E101" in err
    assert "visits = true" in err


def test_of_cells_whose_people_walk_anywhere_one_in_a_hundred_has_a_direction() -> None:
    rng = np.random.default_rng(1)
    for n in (5, 12, 60):
        angles = rng.uniform(0, 2 * np.pi, (20_000, n))
        length = np.hypot(np.cos(angles).mean(axis=1), np.sin(angles).mean(axis=1))
        assert np.mean([is_directed(float(r), n) for r in length]) <= 0.0125
    assert is_directed(0.97, 5)
    assert not is_directed(0.29, 10_000)
