"""What happens over the weeks of a long demo: planted where it says, and written into its files and its truth."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from datetime import date, datetime, timedelta
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import pytest

from vsd_analytics.simulate import demo_project as demo
from vsd_analytics.simulate.demo_project import simulate_week, write_demo_project
from vsd_analytics.simulate.history import GROWTH, MIN_WEEKS, ShopHistory, shop_history
from vsd_analytics.simulate.people import SimulatedDay
from vsd_analytics.simulate.shop import SHOP_AFTER, SHOP_BEFORE
from vsd_analytics.simulate.truth import DemoTruth

CAMERAS = ("cam-1", "cam-2")
LAST = date(2026, 11, 9)


def history(weeks: int) -> ShopHistory | None:
    mondays = [LAST - timedelta(weeks=k) for k in reversed(range(weeks))]
    return shop_history(mondays, cameras=CAMERAS, timezone="Europe/Rome")


def known(weeks: int = 12) -> ShopHistory:
    found = history(weeks)
    assert found is not None
    return found


def test_short_demos_have_none() -> None:
    assert [history(n) is None for n in (1, 2, MIN_WEEKS - 1, MIN_WEEKS)] == [True, True, True, False]


@pytest.mark.parametrize("weeks", [MIN_WEEKS, 12, 104])
def test_everything_happens_within_the_weeks_and_out_of_the_way_of_the_rest(weeks: int) -> None:
    past = known(weeks)
    first = LAST - timedelta(weeks=weeks - 1)
    assert past.moved_at.date() == LAST - timedelta(weeks=4)
    assert past.idle.at.date() == LAST - timedelta(weeks=1)
    (lost,) = past.gaps
    week_of_loss, week_of_closing = (d - timedelta(days=d.weekday()) for d in (lost.start.date(), past.closed[0]))
    assert week_of_loss <= lost.end.date() < week_of_loss + timedelta(weeks=1)
    assert first < week_of_loss < week_of_closing < past.moved_at.date()
    assert LAST - week_of_loss < timedelta(weeks=10), "an index of ten weeks shows it"
    assert len(past.closed) == 1
    assert {e.area_id for e in past.log} == {None, past.idle.area_id}


def test_there_are_more_people_every_week_and_as_many_as_ever_in_the_last() -> None:
    past = known()
    busy = [past.busy(LAST - timedelta(weeks=k)) for k in reversed(range(12))]
    assert busy[-1] == 1.0
    assert all(b - a == pytest.approx(GROWTH) for a, b in pairwise(busy))
    for day in range(7):
        assert past.busy(LAST + timedelta(days=day)) == 1.0
        assert past.busy(LAST + timedelta(days=day - 7)) == busy[-2]


def test_a_closed_day_has_no_people_and_a_busier_week_has_more() -> None:
    past = known()
    monday = past.closed[0] - timedelta(days=past.closed[0].weekday())
    quiet = list(simulate_week(monday, seed=1, interval_s=60.0, moved_at=past.moved_at, past=past))
    usual = list(simulate_week(monday, seed=1, interval_s=60.0, moved_at=past.moved_at))
    assert [d.day for d in usual if d.day not in {q.day for q in quiet}] == list(past.closed)
    n_quiet = sum(len(d.entered_ms) for d in quiet)
    n_usual = sum(len(d.entered_ms) for d in usual if d.day not in past.closed)
    assert 0.88 < n_quiet / n_usual < 1.0


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, DemoTruth]]:
    def first_days(monday: date, **rest: Any) -> Iterator[SimulatedDay]:
        return islice(simulate_week(monday, **(rest | {"interval_s": 15.0})), 3)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo, "simulate_week", first_days)
        folder = tmp_path_factory.mktemp("history") / "shop"
        yield folder, write_demo_project(folder, seed=1, weeks=MIN_WEEKS)


def test_project_and_truth_tell_the_history(project: tuple[Path, DemoTruth]) -> None:
    folder, truth = project
    past = known(MIN_WEEKS)
    assert DemoTruth.read(folder / "truth.json") == truth
    assert truth.redesign.at == past.moved_at
    assert truth.redesign.effect is not None
    assert truth.redesign.effect < 0.6
    assert truth.idle is not None
    assert truth.idle.at == past.idle.at
    assert truth.idle.effect is not None
    assert 0.75 < truth.idle.effect < 1.33
    assert truth.closed == past.closed
    assert [(g.start, g.end) for g in truth.lost] == [(g.start, g.end) for g in past.gaps]
    assert set(truth.lost[0].cameras) == set(truth.missing.cameras)
    assert len(set(truth.frame_interval_s)) == 1, "a change of the frame interval would look like one of the shop"
    site = tomllib.loads((folder / "vsd.toml").read_text())["site"]
    assert site["closed"] == [d.isoformat() for d in past.closed]


def test_log_is_in_order_and_holds_both_changes(project: tuple[Path, DemoTruth]) -> None:
    folder, truth = project
    entries = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    at = [datetime.fromisoformat(e["at"]) for e in entries]
    assert at == sorted(at)
    assert truth.idle is not None
    for planted in (truth.redesign, truth.idle):
        assert [e["text"] for e in entries if e["area"] == planted.area_id] == [planted.text]
    assert len(entries) == 5


def test_nothing_is_written_of_lost_times_and_closed_days(project: tuple[Path, DemoTruth]) -> None:
    folder, truth = project
    days = {p.name.split("_")[1][:10] for p in (folder / "engine").iterdir()}
    assert not days & {d.isoformat() for d in truth.closed}
    (lost,) = truth.lost
    sizes = {d: (folder / "engine" / f"cam-1_{d}.jsonl.zst").stat().st_size for d in sorted(days)}
    day = lost.start.date()
    assert sizes[day.isoformat()] < 0.5 * sizes[(day - timedelta(days=1)).isoformat()]
    assert sizes[(day + timedelta(days=1)).isoformat()] < 100


def test_the_display_is_in_its_new_place_from_the_move_on() -> None:
    past = known()
    for weeks_before, shop in ((5, SHOP_BEFORE), (4, SHOP_AFTER)):
        monday = LAST - timedelta(weeks=weeks_before)
        day = next(simulate_week(monday, seed=1, interval_s=60.0, moved_at=past.moved_at, past=past))
        assert day.shop is shop
