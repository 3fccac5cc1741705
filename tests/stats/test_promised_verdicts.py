"""What is promised of verdicts and levels, in worlds whose days and weeks differ as stated (docs/statistics.md).

The bars are the promised ones. 800 sites a case know a share of 5 % to 1.5 points; the seeds are fixed.
"""

from __future__ import annotations

import numpy as np
import pytest
from day_worlds import FLOORS, LEVELS, WEEKDAYS_OFFICE, Variation, World
from prove_verdicts import CLEAR, encounter_rate, held, per_open_h, verdicts

pytestmark = pytest.mark.simulation
SITES = 800


def clear(world: World, *, history: int, effect: float = 1.0, figure: object = per_open_h) -> float:
    found = verdicts(world, SITES, seed=11, history=history, effect=effect, figure=figure)
    return float(np.mean([change.verdict in CLEAR for change in found]))


@pytest.mark.parametrize("name", FLOORS)
def test_a_floor_in_which_nothing_changes_gets_a_clear_verdict_in_at_most_6_percent_of_weeks(name: str) -> None:
    assert clear(FLOORS[name], history=12) <= 0.06


@pytest.mark.parametrize("history", [0, 1, 2, 4, 8])
@pytest.mark.parametrize("name", ["days correlated .3, week sd .10", "museum"])
def test_the_restless_floors_do_so_too_in_their_first_weeks(name: str, history: int) -> None:
    assert clear(FLOORS[name], history=history) <= 0.06


@pytest.mark.parametrize("history", [0, 12])
def test_violations_per_person_hour_give_as_few_false_verdicts(history: int) -> None:
    assert clear(FLOORS["museum"], history=history, figure=encounter_rate) <= 0.06


def test_an_office_finds_a_fall_of_30_percent_in_one_week() -> None:
    assert clear(FLOORS["office"], history=12, effect=0.7) >= 0.85
    assert clear(FLOORS["office"], history=4, effect=0.7) >= 0.85
    # without history the prior alone must allow for weeks that differ: measured .61 (63 % in docs/statistics.md)
    assert clear(FLOORS["office"], history=0, effect=0.7) >= 0.55


def test_eight_weeks_of_history_find_a_fall_of_14_percent_in_a_calm_busy_place() -> None:
    assert clear(World(Variation(day_sd=0.05)), history=8, effect=0.86) >= 0.85
    # five open days leave a wider interval: measured .82
    assert clear(World(Variation(day_sd=0.05), weekdays=WEEKDAYS_OFFICE), history=8, effect=0.86) >= 0.80


@pytest.mark.parametrize("name", LEVELS)
def test_levels_hold_the_truth_when_days_in_a_row_resemble_each_other(name: str) -> None:
    world = LEVELS[name]
    share = float(np.mean(held(world, 1000, seed=12)))
    if world.variation.correlation > 0.3:
        assert share >= 0.88
    else:
        assert 0.93 <= share <= 0.98
