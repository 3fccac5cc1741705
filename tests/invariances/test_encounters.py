"""A tracker that changes ids, doubles people or places them with an error makes no encounters (prove_encounters.py)."""

from __future__ import annotations

import numpy as np
import pytest
from invariances.encounter_worlds import cut, doubled, noisy, queue, thinned, walkers
from invariances.prove_encounters import counted


def test_ids_that_are_cut_or_doubled_change_no_count() -> None:
    rng = np.random.default_rng(3)
    people = noisy(thinned(walkers(rng, seconds=900, per_hour=240), every_ms=500), rng, sd_m=0.07, smooth_s=0.5)
    tracked = doubled(cut(people, rng, share=0.5), rng, share=0.06)
    assert len(np.unique(tracked.track)) > 1.4 * len(np.unique(people.track))
    true, found = (counted(seen, every_ms=500, distance_m=2.0)[0] for seen in (people, tracked))
    assert true > 60
    assert found == pytest.approx(true, rel=0.03)


def test_people_who_stand_at_the_distance_meet_once() -> None:
    """Each of 12 in a line stands 1 m behind the one before: no more violations of 1.0 m than of 1.5 m."""
    rng = np.random.default_rng(3)
    people = noisy(thinned(queue(rng, seconds=900), every_ms=500), rng, sd_m=0.07, smooth_s=0.5)
    at_the_distance, beyond = (counted(people, every_ms=500, distance_m=d)[0] for d in (1.0, 1.5))
    assert at_the_distance <= min(beyond, 2 * len(np.unique(people.track)))
