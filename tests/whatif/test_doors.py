"""Another width of a way: the ratio where the rule was measured, and a refusal with its reason everywhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.whatif.walkers import walkers
from vsd_analytics.site.layout import DoorEdit
from vsd_analytics.whatif.doors import passages, predicted_seconds
from vsd_analytics.whatif.floor_records import FloorRecords

DOOR = DoorEdit("door", ((10.0, -1.0), (10.0, 1.0)), "exit", 2.0, 1.0)


def stream(n: int, *, apart_s: float, back: int = 0, speed: float = 0.5) -> FloorRecords:
    """Return people who walk through the door one after the other, of whom every `back`-th comes the other way."""
    ways = [
        ((15.0, 0.0), (0.0, 0.0), apart_s * k) if back and k % back == 0 else ((0.0, 0.0), (15.0, 0.0), apart_s * k)
        for k in range(n)
    ]
    return walkers(*ways, speed_m_per_s=speed)


def test_the_queue_at_an_exit_of_half_the_width_lasts_twice_as_long() -> None:
    found = predicted_seconds(stream(150, apart_s=1.0), DOOR, within_m=1.0)
    assert found.refusal is None
    assert found.value == pytest.approx(2 * found.traffic.close_s_per_person)
    assert found.value is not None
    assert (found.lo, found.hi) == pytest.approx((found.value / 1.21, found.value * 1.21))
    assert found.traffic.n_people == 150


def test_an_entrance_of_half_the_width_thins_the_way_behind_it() -> None:
    found = predicted_seconds(stream(150, apart_s=1.0), replace(DOOR, kind="entrance"), within_m=1.0)
    assert found.value == pytest.approx(found.traffic.close_s_per_person * 0.5**0.65)


@pytest.mark.parametrize(
    ("records", "door", "why"),
    [
        (stream(150, apart_s=1.0), replace(DOOR, new_width_m=3.0), "whatif.wider"),
        (stream(150, apart_s=1.0, back=5), DOOR, "whatif.both_ways"),
        (stream(150, apart_s=30.0), DOOR, "whatif.no_queue"),
        (stream(30, apart_s=1.0), DOOR, "whatif.few_people"),
    ],
)
def test_what_was_never_measured_is_refused(records: FloorRecords, door: DoorEdit, why: str) -> None:
    found = predicted_seconds(records, door, within_m=1.0)
    assert (found.value, found.refusal and found.refusal.code) == (None, why)


def test_passages_have_a_direction_and_end_with_the_line() -> None:
    records = walkers(((0, 0), (20, 0), 0), ((20, 0.5), (0, 0.5), 0), ((0, 3), (20, 3), 0))
    direction, rows = passages(records, DOOR.line)
    assert records.track[rows].tolist() == [0, 1]
    assert direction.tolist() == [1, -1]
    assert np.all(records.x_m[rows][direction > 0] <= 10)
