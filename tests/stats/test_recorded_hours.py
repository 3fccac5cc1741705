"""Weights of recorded hours against sums by hand."""

from __future__ import annotations

import numpy as np
import pytest

from vsd_analytics.stats.recorded_hours import recorded_hours

HOURS = np.tile([9, 10, 11], 4)
WEEKDAY = np.repeat([0, 1, 0, 1], 3)
LEVEL = {9: 1.0, 10: 2.0, 11: 9.0}


def test_hours_recorded_on_some_days_stand_for_the_same_hour_of_others() -> None:
    known = np.ones(12, dtype=bool)
    known[[2, 8, 11]] = False  # 11:00 on both Mondays and on the second Tuesday
    found = recorded_hours(WEEKDAY, HOURS, np.full(12, 3600.0), known)
    level = np.array([LEVEL[h] for h in HOURS.tolist()])
    assert (found.weight * level).sum() / found.weight.sum() == pytest.approx(4.0)
    assert level[known].mean() == pytest.approx(21 / 9), "what a plain mean would give"
    assert found.weight[5] == pytest.approx(4 * found.weight[0]), "one Tuesday stands for four days"
    assert found.weight.sum() == pytest.approx(9), "recorded time keeps its sum"
    assert found.covers_all


def test_all_hours_recorded_count_once_and_hours_never_recorded_are_named() -> None:
    open_s = np.where(HOURS == 9, 900.0, 3600.0)
    assert recorded_hours(WEEKDAY, HOURS, open_s, np.ones(12)).weight.tolist() == [1.0] * 12
    found = recorded_hours(WEEKDAY, HOURS, open_s, HOURS != 11)
    assert found.unknown_hours == (11,)
    assert found.unknown_share == pytest.approx(3600 / 8100)
    assert not found.covers_all
    assert recorded_hours(WEEKDAY, HOURS, np.zeros(12), np.ones(12)).unknown_share == 0.0
