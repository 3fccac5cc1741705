"""Counting lines on real recordings (table in docs/lines.md): with true ids, and with boxes lost and ids cut."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from prove_lines import counted, disturbed, hermes, juelich, off, oxtown, truth, wildtrack, without_leaps

pytestmark = pytest.mark.realdata


@pytest.mark.parametrize("cut_s", [None, 10.0])
def test_everybody_in_a_crowded_corridor_is_counted(realdata: Callable[[str], Path], cut_s: float | None) -> None:
    folder = realdata("hermes").parent
    for recording in (next(hermes(folder)), juelich(folder)):
        records = list(disturbed(recording, lost=0.0 if cut_s is None else 0.07, cut_s=cut_s))
        assert counted(recording, records) == +truth(recording)


def test_a_street_and_a_square_are_counted_within_a_few_hundredths(realdata: Callable[[str], Path]) -> None:
    folder = realdata("oxtown").parent
    for whole in (oxtown(folder), *wildtrack(folder)):
        recording = without_leaps(whole)
        assert off(truth(recording), counted(recording, list(disturbed(recording, lost=0.0, cut_s=None)))) < 0.017
        assert off(truth(recording), counted(recording, list(disturbed(recording, lost=0.07, cut_s=10.0)))) < 0.05
