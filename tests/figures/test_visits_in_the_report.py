"""Visits in the report and on the command line: small counts, engines without ids, and cameras that were silent."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from report import ingested_worlds as w

import vsd_analytics
from vsd_analytics.answer import VALUES, Answer, Cell, HoldsFor, Value, value_of
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.figures.share.answers import share
from vsd_analytics.figures.visits import COLUMNS, SUMS
from vsd_analytics.report.pages.json_and_csv import figures_json
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.wording.reasons import reason_text

ASKING = w.toml().replace('name = "Queue"', 'name = "Queue"\nvisits = true\ndoor = true')
HOURLY = {w.QUEUE: 20, w.DOOR: 12}


def figures(site: Any) -> dict[str, Any]:
    found: dict[str, Any] = figures_json(w.report(site))
    return found


def test_the_report_has_the_planted_visits_and_the_page_names_their_area(tmp_path: Path) -> None:
    report = w.report(w.world(tmp_path, ASKING, w.messages(w.steady(HOURLY))))
    found = figures_json(report)
    (row,) = found["M35"]["rows"]
    assert (row["area_id"], row["name"], row["column"]) == ("queue", "Queue", "visits_per_open_h")
    assert row["value"] == pytest.approx(40, rel=1e-3)  # twenty pairs an hour
    assert {r["column"]: r["value"] for r in found["M36"]["rows"]}["dwell_median_s"] == pytest.approx(w.CLOSE_S)
    page = render_html(report)
    assert "Visits of Queue" in page
    assert "How long visits of Queue last: median stay" in page


def test_a_report_that_nobody_asked_for_visits_has_none(tmp_path: Path) -> None:
    report = w.report(w.world(tmp_path, w.toml(), w.messages(w.steady(HOURLY))))
    assert not {"M35", "M36"} & set(figures_json(report))
    assert "Visits of" not in render_html(report)


def test_few_visits_are_held_back_and_no_reason_tells_how_many(tmp_path: Path) -> None:
    few = lambda day, hour: {w.QUEUE: 1} if day < 2 and hour == 10 else {w.DOOR: 20}  # noqa: E731
    found = figures(w.world(tmp_path, ASKING, w.messages(few)))
    table = vsd_analytics.open(tmp_path).week("2026-W46").visits.df()
    assert table["area_id"].tolist() == ["queue"]
    for column in ("visits_per_open_h", "dwell_median_s", "dwell_p90_s", "long_share", "dwell_mean_s", "n_visits"):
        assert table[column].isna().all(), column
    for metric in ("M35", "M36"):
        assert found[metric]["state"] == "not_enough_data"
        assert found[metric]["reason"] == "fewer than 5 were counted"
        assert found[metric]["rows"] is None


def test_without_track_ids_visits_are_unknown_and_not_zero(tmp_path: Path) -> None:
    def nameless(track: str, x: float, y: float) -> dict[str, Any]:
        return {"x_m": x, "y_m": y}

    found = figures(w.world(tmp_path, ASKING, w.messages(w.steady(HOURLY), say=nameless)))
    for metric in ("M35", "M36"):
        assert found[metric]["state"] != "ok"
        assert found[metric]["reason"] == "the engine sends no track ids"


def test_an_area_where_nobody_was_ever_seen_is_unknown(tmp_path: Path) -> None:
    found = figures(w.world(tmp_path, ASKING, w.messages(w.steady({w.DOOR: 12}))))
    assert found["M35"]["reason"] == "no camera counted anybody there"


@pytest.mark.parametrize(("n_long", "is_shown"), [(4, False), (5, True), (36, False), (35, True)])
def test_a_share_of_long_visits_hides_small_counts_on_either_side(n_long: int, is_shown: bool) -> None:
    shared = share([of_area(n_visits=40, n_cut=0, n_long=n_long)], below=5)["visits"]
    (row,) = shared.rows
    assert (value_of(row, "long_share").value is not None) is is_shown
    assert (value_of(row, "long_share").lo is not None) is is_shown
    assert value_of(row, "dwell_median_s").value is not None


def test_few_visits_leave_nothing_and_whoever_was_lost_is_the_operator_s() -> None:
    (row,) = share([of_area(n_visits=4, n_cut=1, n_long=0)], below=5)["visits"].rows
    cells = {name: cell for name, cell in row.items() if isinstance(cell, Value)}
    assert {name for name, cell in cells.items() if cell.value is not None} == {"recorded_share"}
    assert "4" not in " ".join(reason_text(cell.reason) for cell in cells.values())
    (row,) = share([of_area(n_visits=40, n_cut=4, n_long=0)], below=5)["visits"].rows
    assert value_of(row, "n_visits").value == 40
    assert not {"n_cut", "n_followed", "n_long", "n_short", "n_began_inside"} & row.keys()


def of_area(*, n_visits: int, n_cut: int, n_long: int) -> Answer:
    """Return the answer of one area with made-up numbers."""
    counts = {"n_visits": n_visits, "n_followed": n_visits - n_cut, "n_cut": n_cut, "n_long": n_long,
              "n_short": n_visits - n_long, "n_began_inside": 3}  # fmt: skip
    cells: dict[str, Cell] = {
        c.name: Value(float(counts.get(c.name, 0.5)), 0.4, 0.6) if c.kind in VALUES else None for c in COLUMNS
    }
    place = HoldsFor("shop", "ground", date(2026, 11, 9), date(2026, 11, 15))
    return Answer("visits", COLUMNS, ({**cells, "floor_id": "ground", "area_id": "a"},), place, SUMS)


def vsd(root: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", "--quiet", "visits", *arguments])
    out, err = capsys.readouterr()
    assert "Traceback" not in out + err
    return code, out, err


def test_the_command_names_a_camera_that_was_silent_all_week(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toml = w.toml(cameras=("cam-1", "cam-2")).replace('name = "Queue"', 'name = "Queue"\nvisits = true\ndoor = true')
    both = [*w.messages(w.steady(HOURLY)), *w.messages(w.steady(HOURLY), camera="cam-2", monday=w.BEFORE)]
    w.world(tmp_path, toml, both)
    code, out, _ = vsd(tmp_path, capsys, "--week", "2026-W46")
    assert code == 0
    assert "nothing was recorded by cam-2" in out
    assert "40 (" in out
    code, out, _ = vsd(tmp_path, capsys, "--week", "2026-W46", "--json")
    (area,) = json.loads(out)["answers"]["visits"]["rows"]
    assert area["silent_cameras"] == ["cam-2"]
    assert area["visits_per_open_h"]["value"] == pytest.approx(40, rel=1e-3)
    assert area["recorded_share"]["value"] == pytest.approx(0.5, abs=0.01)


def test_the_command_says_how_to_ask_for_visits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    w.world(tmp_path, w.toml(), w.messages(w.steady(HOURLY)))
    code, _, err = vsd(tmp_path, capsys)
    assert code == 2
    assert "E101" in err
    assert "visits = true" in err


def test_hostile_names_of_areas_stay_text(tmp_path: Path) -> None:
    hostile = "<script>alert(1)</script>{{ 7*7 }}"
    site = w.world(tmp_path, ASKING.replace('name = "Queue"', f'name = "{hostile}"'), w.messages(w.steady(HOURLY)))
    page = render_html(w.report(site))
    assert "<script>alert" not in page
    assert "Visits of &lt;script&gt;" in page
