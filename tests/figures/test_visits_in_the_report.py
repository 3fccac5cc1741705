"""Visits in the report and on the command line: small counts, engines without ids, and cameras that were silent."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from report import ingested_worlds as w
from vsd_analytics.figures.catalogue.visit_figures import _long_share

import vsd_analytics
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.cli.visits import _as_dict
from vsd_analytics.figures.rates import NOT_RECORDED
from vsd_analytics.figures.visits import AreaVisits
from vsd_analytics.report.pages.json_and_csv import to_json
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site.model import Area
from vsd_analytics.stats.dwell import dwell

ASKING = w.toml().replace('name = "Queue"', 'name = "Queue"\nvisits = true\ndoor = true')
HOURLY = {w.QUEUE: 20, w.DOOR: 12}


def figures(site: Any) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(to_json(w.report(site)))["figures"]
    return found


def test_the_report_has_the_planted_visits_and_the_page_names_their_area(tmp_path: Path) -> None:
    report = w.report(w.world(tmp_path, ASKING, w.messages(w.steady(HOURLY))))
    found = json.loads(to_json(report))["figures"]
    (row,) = found["M35"]["rows"]
    assert row["area"] == "queue"
    assert row["value"] == pytest.approx(40, rel=1e-3)  # twenty pairs an hour
    assert {r["what"]: r["value"] for r in found["M36"]["rows"]}["median"] == pytest.approx(w.CLOSE_S)
    page = render_html(report)
    assert "Visits of Queue" in page
    assert "How long visits of Queue last: median" in page


def test_a_report_that_nobody_asked_for_visits_has_none(tmp_path: Path) -> None:
    report = w.report(w.world(tmp_path, w.toml(), w.messages(w.steady(HOURLY))))
    assert not {"M35", "M36"} & set(json.loads(to_json(report))["figures"])
    assert "Visits of" not in render_html(report)


def test_few_visits_are_held_back_and_no_reason_tells_how_many(tmp_path: Path) -> None:
    few = lambda day, hour: {w.QUEUE: 1} if day < 2 and hour == 10 else {w.DOOR: 20}  # noqa: E731
    found = figures(w.world(tmp_path, ASKING, w.messages(few)))
    table = vsd_analytics.open(tmp_path).week("2026-W46").visits.df()
    assert table["what"].tolist() == ["visits", "median dwell", "90 % dwell", "long visits"]
    assert table["value"].isna().all()
    for metric in ("M35", "M36"):
        assert found[metric]["state"] == "not_enough_data"
        assert found[metric]["reason"] == "fewer than 5 visits were seen"
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
    seconds = np.r_[np.full(40 - n_long, 10.0), np.full(n_long, 300.0)]
    found = dwell(seconds, np.zeros(40, bool), np.arange(40) % 7, person_s=np.full(7, 500.0), long_s=120.0)
    of = AreaVisits(Area("a", "A", "ground", ()), NOT_RECORDED, found, 120.0, 0, 1.0, ())
    asked: Any = SimpleNamespace(below=5, small=lambda *counts: any(0 < n < 5 for n in counts))
    row = _long_share(asked, of)
    assert (row["value"] is not None) is is_shown
    assert (row["lo"] is not None) is is_shown
    assert (_as_dict(of, 5)["long_share"]["value"] is not None) is is_shown


def test_the_json_output_of_the_command_hides_few_visits_and_whoever_was_lost_among_them() -> None:
    def printed(n: int, n_cut: int) -> dict[str, Any]:
        cut = np.arange(n) < n_cut
        found = dwell(np.full(n, 60.0), cut, np.arange(n) % 7, person_s=np.full(7, 500.0), long_s=120.0)
        return _as_dict(AreaVisits(Area("a", "A", "ground", ()), NOT_RECORDED, found, 120.0, 3, 1.0, ()), 5)

    few = printed(4, 1)
    assert (few["n_visits"], few["n_cut"], few["n_began_inside"], few["little"]) == (None, None, None, None)
    assert "4" not in str(few["reason"])
    assert [printed(n, n_cut)["n_cut"] for n, n_cut in ((40, 4), (40, 5), (40, 36), (40, 0))] == [None, 5, None, 0]


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
    (area,) = json.loads(out)["areas"]
    assert area["silent_cameras"] == ["cam-2"]
    assert area["visits_per_open_h"]["value"] == pytest.approx(40, rel=1e-3)
    assert area["recorded_share"] == pytest.approx(0.5, abs=0.01)


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
