"""`vsd planner` as a user runs it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.site.model import Site


@pytest.fixture
def vsd(shop: Site, capsys: pytest.CaptureFixture[str]):
    def call(*arguments: str) -> tuple[int, str, str]:
        code = run(cli, ["-C", str(shop.root), "--quiet", "planner", *arguments])
        told = capsys.readouterr()
        return code, told.out, told.err

    return call


def test_a_page_is_written_and_its_figures_are_reported(vsd, tmp_path: Path) -> None:
    code, out, _ = vsd("--week", "2026-W46", "--out", str(tmp_path), "--json")
    assert code == 0
    (told,) = json.loads(out)["planners"]
    page = Path(told["path"])
    assert page == tmp_path / "2026-W46-planner.html"
    assert page.stat().st_size == told["bytes"]
    assert told["before"] == "2026-W45"
    assert [p["id"] for p in told["places"]] == ["floor", "area:queue", "area:door", "rest"]
    assert told["places"][0]["violation_rate"]["verdict"] == "cannot_tell"
    assert told["places"][0]["close_time_share"]["value"] > 0
    assert (told["weeks"], told["changes"]) == (2, []), "no change is logged"
    assert vsd("--week", "2026-W46", "--out", "-")[1] == page.read_text(encoding="utf-8")


def test_any_week_may_be_compared_with_it(vsd, tmp_path: Path) -> None:
    code, out, _ = vsd("--week", "2026-W46", "--before", "2026-W43", "--out", str(tmp_path), "--json")
    assert code == 0
    assert json.loads(out)["planners"][0]["before"] == "2026-W43"
    assert "Week 43" in (tmp_path / "2026-W46-planner.html").read_text(encoding="utf-8")


def test_a_page_holds_at_most_twelve_weeks(vsd) -> None:
    assert vsd("--weeks", "13")[0] == 2


def test_a_week_without_records_has_a_page_that_says_so(vsd, tmp_path: Path) -> None:
    code, out, _ = vsd("--exact", "--week", "2026-W48", "--before", "2026-W47", "--out", str(tmp_path), "--json")
    assert code == 0
    (told,) = json.loads(out)["planners"]
    assert told["before"] is None
    assert told["why_not_compared"] == "nothing of the other week is stored"
    assert told["places"][0]["violation_rate"]["value"] is None


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--week", "2026-W46", "--before", "2026-W46"), "not compared with itself"),
        (("--floor", "attic"), "no floor has the id"),
        (("--week", "soon"), "is not a week"),
        (("--out", "-", "--json"), "one page for each floor"),
    ],
)
def test_mistakes_are_reported_in_words(vsd, arguments: tuple[str, ...], word: str) -> None:
    code, out, err = vsd(*arguments)
    assert code == 2
    assert word in out + err
