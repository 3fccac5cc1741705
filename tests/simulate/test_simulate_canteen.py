"""The made-up canteen: the change in its waiting line does what is planted, and nothing else."""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest

from vsd_analytics.config.project import load_site
from vsd_analytics.simulate.canteen import AREAS, DEPTH_M, WIDTH_M, CanteenDay, canteen_day
from vsd_analytics.simulate.canteen_project import write_canteen_project

DAYS = [date(2026, 11, 9) + timedelta(days=k) for k in range(2)]


def close_s(day: CanteenDay, area_id: str) -> int:
    """Return person-seconds in an area closer than 2 m to somebody, by every distance of every frame."""
    x0, y0, x1, y1 = AREAS[area_id][1]
    total = 0
    for frame in np.unique(day.frame):
        x, y = (values[day.frame == frame] for values in (day.x_m, day.y_m))
        apart = np.hypot(x[:, None] - x, y[:, None] - y) + np.eye(len(x)) * 9
        total += 3 * int(((apart < 2).any(axis=1) & (x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1)).sum())
    return total


@pytest.fixture(scope="module")
def both() -> list[tuple[CanteenDay, CanteenDay]]:
    return [(canteen_day(d, seed=4, is_marked=False), canteen_day(d, seed=4, is_marked=True)) for d in DAYS]


def test_marked_places_part_the_line_and_leave_the_rest_as_it_was(both: list[tuple[CanteenDay, CanteenDay]]) -> None:
    before, after = ({a: sum(close_s(pair[k], a) for pair in both) for a in AREAS} for k in (0, 1))
    assert after["till"] < 0.25 * before["till"]
    for area_id in ("counter", "trays", "water"):
        assert before[area_id] > 2000
        assert after[area_id] == pytest.approx(before[area_id], rel=0.02)


def test_the_same_people_come_at_the_same_times_and_stay_on_the_floor(
    both: list[tuple[CanteenDay, CanteenDay]],
) -> None:
    for before, after in both:
        np.testing.assert_array_equal(before.person, after.person)
        np.testing.assert_array_equal(before.frame, after.frame)
        assert 0 < before.x_m.min() < before.x_m.max() < WIDTH_M
        assert 0 < before.y_m.min() < before.y_m.max() < DEPTH_M
        rows = np.stack([before.frame, before.person])
        assert np.unique(rows, axis=1).shape == rows.shape, "a person is once in a frame"


def test_a_project_of_the_same_seed_has_the_same_bytes(tmp_path: Path) -> None:
    made = [write_canteen_project(tmp_path / name, seed=2, weeks=1) for name in ("a", "b")]
    assert made[0] == made[1]
    assert made[0].n_messages == 5 * 2400
    for path in (p for p in (tmp_path / "a").rglob("*") if p.is_file()):
        assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes(), path
    assert [a.area_id for a in load_site(tmp_path / "a").areas] == list(AREAS)
