"""`vsd site build --make` writes the reports that are missing, and never over a page that is there."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest
from report import ingested_worlds as w

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.asked_questions import read_asked
from vsd_analytics.config.project import load_site


def busy(day: int, hour: int) -> dict[w.Place, int]:
    return {w.QUEUE: 20 + day, w.DOOR: 12 + day % 4}


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    streams = [w.messages(busy, monday=monday, hours=(9, 10)) for monday in (w.BEFORE, w.MONDAY)]
    return w.world(tmp_path, w.toml(opening='{ mon-sun = "09:00-10:00" }'), *streams).root


def test_missing_reports_are_made_and_pages_that_are_there_stay(shop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    reports = shop / "reports"
    reports.mkdir()
    old = w.BEFORE - timedelta(weeks=3)
    gone = f"{old.isocalendar().year}-W{old.isocalendar().week:02d}"
    for week in ("2026-W45", gone):
        (reports / f"{week}.html").write_text("as it was")
    code = run(cli, ["-C", str(shop), "--quiet", "--now", "2026-12-01", "site", "build", "--make"])
    assert code == 1, "a page whose records are gone has no twin any more"
    assert capsys.readouterr().out.endswith("1 floor, 3 weeks, 3 reports\n")
    names = sorted(p.name for p in reports.iterdir())
    assert names == sorted(
        ["2026-W45.html", "2026-W45.json", "2026-W46.html", "2026-W46.json", f"{gone}.html", "index.html"]
    )
    assert (reports / "2026-W45.html").read_text() == (reports / f"{gone}.html").read_text() == "as it was"
    page = (reports / "index.html").read_text()
    assert "Page without figures" in page
    before = {p.name: p.stat().st_ino for p in reports.iterdir() if p.name != "index.html"}
    assert run(cli, ["-C", str(shop), "--quiet", "--now", "2026-12-01", "site", "build", "--make"]) == 1
    assert {p.name: p.stat().st_ino for p in reports.iterdir() if p.name != "index.html"} == before


def test_weeks_made_for_the_index_ask_each_a_question_that_can_be_answered(shop: Path) -> None:
    """The demo makes its pages in the same way: with memory, and with ids that `vsd log answer` knows."""
    assert run(cli, ["-C", str(shop), "--quiet", "--now", "2026-12-01", "site", "build", "--make"]) == 0
    asked = read_asked(load_site(shop))
    assert len(asked) == 2
    assert asked[1].text.startswith("Still open from week 45:")
    for one, week in zip(asked, ("2026-W45", "2026-W46"), strict=True):
        assert one.question_id in (shop / "reports" / f"{week}.html").read_text(encoding="utf-8")
    answer = ["log", "answer", asked[0].question_id, "tried", "--at", "2026-11-10"]
    assert run(cli, ["-C", str(shop), "--quiet", "--now", "2026-12-01", *answer]) == 0


def test_a_page_of_vsd_report_alone_gets_its_figures_if_the_records_still_give_it(
    shop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, twin = (shop / "reports" / f"2026-W46.{end}" for end in ("html", "json"))
    assert run(cli, ["-C", str(shop), "--quiet", "report", "--week", "2026-W46"]) == 0
    made = page.read_bytes()
    capsys.readouterr()
    assert run(cli, ["-C", str(shop), "site", "build"]) == 0
    told = capsys.readouterr()
    assert "2026-W46.json: the figures of 2026-W46.html" in told.err
    assert told.out.endswith("1 floor, 1 week, 1 report\n")
    assert page.read_bytes() == made

    twin.unlink()
    page.write_bytes(made + b"<!-- of other data -->")
    assert run(cli, ["-C", str(shop), "site", "build"]) == 1
    assert "W513" in capsys.readouterr().err
    assert not twin.exists()
