"""Violations of real street scenes do not depend on how often the engine looks: 2.5 or 0.83 frames a second."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from prove_atc import FILES
from prove_thinning import FPS, STEP, measure, shopping_centre

pytestmark = pytest.mark.realdata


def test_a_third_of_the_frames_counts_the_same_violations(realdata: Callable[[str], Path]) -> None:
    """At most 4 % per scene and phase, 1 % pooled. Of shorter episodes many are lost: that is why they do not count."""
    n_whole, n_thinned = 0.0, 0.0
    for scene in FPS:
        whole, thinned = measure(realdata(f"eth_ucy/{scene}").parent, scene)
        assert (whole.interval_ms, {t.interval_ms for t in thinned}) == (400, {1200})
        assert max(abs(t.n_violations / whole.n_violations - 1) for t in thinned) <= 0.04
        assert all(t.n_episodes < 0.95 * whole.n_episodes for t in thinned)
        n_whole += whole.n_violations
        n_thinned += sum(t.n_violations for t in thinned) / STEP
    assert abs(n_thinned / n_whole - 1) <= 0.01


def test_half_the_frames_of_a_shopping_centre_count_the_same_violations(realdata: Callable[[str], Path]) -> None:
    """Within 3 % in either phase, of some 2,600."""
    for name in FILES:
        realdata(f"atc/{name}")
    whole, thinned = shopping_centre(realdata("atc"), step=2)
    assert (whole.interval_ms, {t.interval_ms for t in thinned}) == (1000, {2000})
    assert max(abs(t.n_violations / whole.n_violations - 1) for t in thinned) <= 0.03
