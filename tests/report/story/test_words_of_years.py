"""The proof of a year's words reads pages rightly: a change that works is found, and quiet weeks say nothing."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "figures"))
sys.path.insert(0, str(Path(__file__).parents[2] / "stats"))

from change_worlds import OFFICE, draw
from planted_changes import site_of
from report.story.prove_words import AREAS, N_AREAS, REFERENCE, entries, monday, planted, report_of, said_of

pytestmark = pytest.mark.simulation

WATCHED = 9


@pytest.mark.parametrize(("effect", "said"), [(0.4, "works"), (1.0, None)])
def test_only_a_change_that_had_an_effect_is_said_to_work(tmp_path: Path, effect: float, said: str | None) -> None:
    world = OFFICE.but(n_areas=N_AREAS, weeks_before=REFERENCE, weeks_after=WATCHED, effect=effect)
    drawn = draw(world, 1, 3)
    log = [{"at": f"{monday(REFERENCE)}T07:00:00+00:00", "text": "Shelf moved", "area": "place-0"}]
    site = site_of(tmp_path, areas=AREAS)
    with planted(site, drawn.n[0], drawn.violation_h[0], drawn.exposure_h[0]) as warehouse:
        report = report_of(warehouse, REFERENCE + WATCHED - 1, log)
    assert said_of(report) == said
    assert [change.number for change in report.change_effects] == [1]


def test_a_week_knows_no_entry_of_a_later_day(tmp_path: Path) -> None:
    drawn = draw(OFFICE.but(n_areas=N_AREAS, weeks_before=REFERENCE, weeks_after=4), 1, 3)
    log = [
        {"at": f"{monday(REFERENCE + k)}T07:00:00+00:00", "text": "Shelf moved", "area": f"place-{k}"} for k in (0, 3)
    ]
    with planted(site_of(tmp_path, areas=AREAS), drawn.n[0], drawn.violation_h[0], drawn.exposure_h[0]) as warehouse:
        early, late = (report_of(warehouse, REFERENCE + k, log) for k in (1, 3))
    assert [change.number for change in early.change_effects] == [1]
    assert [change.number for change in late.change_effects] == [1, 2]
    assert early.level.violation_rate.value != late.level.violation_rate.value


def test_a_year_has_an_entry_in_each_month_at_different_places() -> None:
    log = entries(np.random.default_rng(1))
    assert len(log) == 12
    assert [entry["at"] for entry in log] == sorted(entry["at"] for entry in log)
    assert len({entry["area"] for entry in log}) > 3
