"""`vsd whatif` on real recordings: widths that were left out, and people shifted in time (tables in docs/whatif.md)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.realdata.prove_whatif import EXIT_LINE, EXITS, companions, corridor, refusals, scenes
from vsd_analytics.site.layout import DoorEdit
from vsd_analytics.whatif.closeness import n_close
from vsd_analytics.whatif.doors import predicted_seconds
from vsd_analytics.whatif.retiming import SHIFTS_S, Meetings, halves, shifted, step_aside

pytestmark = pytest.mark.realdata


def test_narrower_exits_are_predicted_within_a_tenth_and_wider_ones_refused(realdata: Callable[[str], Path]) -> None:
    root = realdata("hermes").parent
    for old, old_m in EXITS:
        for new, new_m in EXITS:
            if old[:3] != new[:3] or old == new:
                continue
            found = predicted_seconds(corridor(root, old), DoorEdit("", EXIT_LINE, "exit", old_m, new_m), within_m=1.0)
            if new_m > old_m:
                assert found.refusal is not None
                assert found.refusal.code == "whatif.wider"
                continue
            truth = predicted_seconds(corridor(root, new), DoorEdit("", EXIT_LINE, "exit", new_m, 0.5), within_m=1.0)
            assert found.value == pytest.approx(truth.traffic.close_s_per_person, rel=0.1)


def test_a_corridor_with_people_both_ways_or_without_a_queue_is_refused(
    realdata: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    refusals(realdata("hermes").parent)
    told = capsys.readouterr().out
    assert "whatif.both_ways" in told
    assert "whatif.no_queue" in told


def test_people_shifted_in_time_come_as_close_as_they_did(realdata: Callable[[str], Path]) -> None:
    name, records, _ = next(scenes(realdata("atc").parent))
    assert name.startswith("shopping centre")
    for within_m, most in ((1.0, 0.05), (2.0, 0.03)):
        learned = halves(records)
        aside = step_aside(records, learned, within_m=within_m)
        recorded = n_close(records.frames, records.x_m, records.y_m, within_m=within_m) > 0
        with_company = companions(records, within_m)
        after, before = 0, 0
        for shift_s in SHIFTS_S:
            layer = shifted(records, ~learned, shift_s)
            meets = Meetings(records, layer, within_m=within_m)
            after += int((meets.is_close(aside.strength) | with_company[layer.rows]).sum())
            before += int(recorded[layer.rows].sum())
        assert after / before == pytest.approx(1, abs=most), within_m
        assert np.isfinite(aside.strength)
