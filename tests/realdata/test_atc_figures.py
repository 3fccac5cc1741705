"""All figures of a real morning; the table is in docs/methods/atc.md (prove_atc.py)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from prove_atc import FILES, counted, figures_of_week, table

pytestmark = pytest.mark.realdata


def test_three_hours_of_a_shopping_centre_tell_what_they_can_and_refuse_the_rest(
    realdata: Callable[[str], Path], tmp_path: Path
) -> None:
    for name in FILES:
        realdata(f"atc/{name}")
    folder = realdata("atc")
    realdata("truth_dev.json")
    figures = figures_of_week(tmp_path, folder)
    refused = {metric for metric, figure in figures.items() if figure["state"] != "ok"}
    assert refused == {"M12", "M13", "M14", "M20", "M24", "M25", "M27", "M28", "M34"}
    assert all(figures[metric]["reason"] for metric in refused)
    assert figures["M4"]["value"] == 3_199
    assert figures["M6"]["value"] == pytest.approx(49_605 / 113_396, abs=0.002)
    assert figures["M6"]["rows"][1]["value"] < figures["M6"]["value"]
    crowding = next(row for row in figures["M23"]["rows"] if row["what"] == "crowding")
    assert crowding["value"] == pytest.approx(921_306 / 3600, rel=0.005)
    assert figures["M3"]["value"] == pytest.approx(113_396 / 3600, rel=0.005)
    assert figures["M8"]["value"] > 2_000
    for metric in ("M0", "M7", "M5", "M6"):
        assert figures[metric]["lo"] is None  # one day has no interval
        assert "at least 5 recorded days" in figures[metric]["reason"]
    made = table(figures, counted(folder))
    assert made.count("\n") == 36
    assert "None" not in made
