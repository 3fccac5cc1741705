"""The map of risk: a share of person-time, unknown where hardly anybody was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from planted_floors import LAST, SHAPE, planted, site_of

from vsd_analytics.analysis.floor_days import NO_POSITIONS
from vsd_analytics.analysis.maps import risk_map
from vsd_analytics.warehouse.warehouse import Warehouse

EVEN = np.ones(SHAPE)


def test_share_is_that_of_person_time_whatever_the_crowd(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    crowd = np.linspace(1, 20, SHAPE[1])[None, :] * EVEN
    with planted(site, lambda day: EVEN, n_days=7, cells_of=lambda hours: hours * crowd) as warehouse:
        found = risk_map(warehouse, floor=site.floors[0])
    assert found.grid is not None
    assert found.share is not None
    assert found.grid.cell_m == 0.5
    known = found.share[np.isfinite(found.share)]
    assert known.size
    assert known == pytest.approx(0.5)  # half of all person-time is planted in violation


def test_where_hardly_anybody_was_nothing_is_known(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    with planted(site, lambda day: EVEN, n_days=7, cells_of=lambda hours: hours * 1e-3) as warehouse:
        found = risk_map(warehouse, floor=site.floors[0])
    assert found.share is not None
    assert np.isnan(found.share).all()


def test_without_positions_there_is_no_map(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    with planted(site, lambda day: EVEN, n_days=7, knows=lambda what: what != "people") as warehouse:
        assert risk_map(warehouse, floor=site.floors[0]).reason == NO_POSITIONS
    with Warehouse(site, LAST, LAST) as warehouse:
        assert risk_map(warehouse, floor=site.floors[0]).reason == "nothing was recorded in opening hours"
