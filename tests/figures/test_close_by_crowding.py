"""Time too close by crowding and day: against a recount of the frames, with small counts put together."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from report import ingested_worlds as w

from vsd_analytics.figures.close_by_crowding import EDGES, close_by_crowding, counted_floor_m2, runs
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.report.pages.figures_by_id import figures_by_id
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.wording.reasons import reason_text

VIEW = "view = [[0, 0], [20, 0], [20, 12], [0, 12]]\n"
FLOOR_100M2 = 2.4


def test_a_weeks_time_lies_in_the_class_of_crowding_that_its_frames_have(tmp_path: Path) -> None:
    def counts(day: int, hour: int) -> dict[w.Place, int]:
        if day == 2:
            return {w.QUEUE: 1 if hour == 10 else 0}
        return {w.QUEUE: 60, w.DOOR: 40} if hour == 11 else {w.QUEUE: 8}

    found = w.report(w.world(tmp_path, w.toml(camera=VIEW, areas={}), w.messages(counts)))
    seen = found.close_by_crowding
    assert seen is not None
    assert seen.state == "ok"
    days = [(d.first.day, d.last.day) for d in seen.days]
    assert days == [(9, 15)], "the other hours of its day would reveal a hidden hour"

    people: dict[str, list[int]] = {}
    for frame in w.messages(counts):
        people.setdefault(frame["ts"][:13], []).append(len(frame["persons"]))
    person_h = {hour: sum(n) * w.STEP_MS / 3.6e6 for hour, n in people.items()}
    few = [hour for hour in people if "-11T" in hour]
    together = [*few, "2026-11-10T10"]  # the time of few people in an hour is known only with that of the next one
    expected = np.zeros(len(EDGES) + 1)
    for hour, of in people.items():
        n = np.array(of)
        crowding = (n * (n - 1)).sum() / n.sum() / FLOOR_100M2
        part_h = sum(person_h[h] for h in together) / len(together) if hour in together else person_h[hour]
        expected[np.searchsorted(EDGES, crowding, side="right")] += part_h
    assert np.count_nonzero(expected) == 2
    assert np.sum([d.person_h for d in seen.days], axis=0) == pytest.approx(expected, rel=0.01)

    close_h = sum(d.close_h for d in seen.days)
    assert sum(c.close_h for c in seen.classes) == pytest.approx(close_h)
    assert close_h / expected.sum() == pytest.approx(figures_by_id(found)["M6"].value, rel=0.01)


def test_floor_that_two_cameras_see_counts_once_and_without_a_view_it_is_unknown(tmp_path: Path) -> None:
    config = w.toml(cameras=("cam-1", "cam-2"))
    for name, x0, x1 in (("1", 0, 12), ("2", 8, 20)):
        ring = [[x0, 0], [x1, 0], [x1, 12], [x0, 12]]
        config = config.replace(f'name = "Camera {name}"\n', f'name = "Camera {name}"\nview = {ring}\n')
    site = w.world(tmp_path, config, w.messages(w.steady({w.QUEUE: 5}), days=[0]))
    day = date(2026, 11, 9)
    with open_warehouse(site, day, day) as warehouse:
        data = FloorHours(warehouse, floor=site.floors[0])
        areas = counted_floor_m2(Period(data, day, day))
        data.cameras = [replace(c, view=None) for c in data.cameras]
        unknown = close_by_crowding(Period(data, day, day), why_hidden=None)
    assert areas.sum() == pytest.approx(240)
    assert areas.max() < 144
    assert (unknown.state, unknown.days, unknown.classes) == ("not_measurable", (), ())
    assert reason_text(unknown.reason) == "what some camera sees of the floor is unknown"


def test_runs_hold_everything_once_and_no_small_count() -> None:
    rng = np.random.default_rng(7)
    for _ in range(300):
        counts = rng.choice([0, 0, 1, 2, 4, 5, 9, 40], size=rng.integers(1, 10)).astype(float)
        positions = np.flatnonzero(rng.random(len(counts)) < 0.8)
        made = runs(positions, counts, mask=Mask(5))
        assert [p for run in made for p in run] == positions.tolist()
        total = counts[positions].sum()
        assert all(not 0 < counts[run].sum() < 5 for run in made) or 0 < total < 5
