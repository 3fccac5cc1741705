"""A fixture in a corridor, before and after, by a formula of how people go around it that is none of the product's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from tests.whatif.walkers import walkers
from vsd_analytics.site.layout import FixtureEdit
from vsd_analytics.whatif.closeness import n_close
from vsd_analytics.whatif.fixture_edits import AROUND, AROUND_M, fixture_effect
from vsd_analytics.whatif.floor_records import FloorRecords

BOX = shapely.box(14.0, 1.4, 15.5, 2.6)
EDIT = FixtureEdit("stand", "Stand", None, tuple(BOX.exterior.coords[:-1]))


def corridor(seed: int, *, both_ways: bool) -> FloorRecords:
    """Return 400 people who walk along a corridor of 4 m, straight, in an hour."""
    rng = np.random.default_rng(seed)
    begins, lanes = np.sort(rng.uniform(0, 3600, 400)), rng.uniform(0.4, 3.6, 400)
    ends = [((0, y), (28, y)) if not both_ways or k % 3 else ((28, y), (0, y)) for k, y in enumerate(lanes)]
    return walkers(*((*end, float(round(begin))) for end, begin in zip(ends, begins, strict=True)))


def after(records: FloorRecords) -> FloorRecords:
    """Return where they walk around the stand: a bell-shaped way of 1.5 m on either side, to the nearer edge."""
    along = np.maximum(np.abs(records.x_m - 14.75) - 0.75, 0) / 1.5
    across = records.y_m - 2.0
    aside = np.maximum(0.6 + 0.35 - np.abs(across), 0) * np.exp(-(along**2) / 2)
    return replace(records, y_m=records.y_m + np.where(across >= 0, aside, -aside))


def close_s(records: FloorRecords) -> float:
    is_close = n_close(records.frames, records.x_m, records.y_m, within_m=2.0) > 0
    inside = shapely.contains_xy(BOX.buffer(AROUND_M), records.x_m, records.y_m)
    return float(records.weight_s[is_close & inside].sum())


@pytest.mark.parametrize("both_ways", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_the_range_holds_what_comes(seed: int, both_ways: bool) -> None:
    records = corridor(seed, both_ways=both_ways)
    effect = fixture_effect(records, EDIT, (), {}, {}, within_m=2.0, widths_m=(1.2,))
    [around] = effect.places
    assert around.place_id == AROUND
    assert around.recorded.total_close_s == pytest.approx(close_s(records))
    came = close_s(after(records)) / close_s(records) - 1
    assert around.change is not None
    assert around.change.lo <= came <= around.change.hi
    least = 2 * 1.645 * 0.2 * effect.n_touched / effect.n_near
    assert least < around.change.hi - around.change.lo < 1.0
    assert 0.3 < effect.n_touched / effect.n_near < 0.8
