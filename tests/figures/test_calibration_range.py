"""The share of time in violation if calibrations are off by what they state."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from figures.test_threshold_sensitivity import N_S, START, heartbeats, open_day, put, site_of

from vsd_analytics.answer import HoldsFor, Reason, value_of
from vsd_analytics.figures.catalogue import violations
from vsd_analytics.figures.catalogue.form import FigureInputs
from vsd_analytics.figures.catalogue.view import figure_of
from vsd_analytics.figures.sensitivity import threshold_sensitivity
from vsd_analytics.site.model import Calibration, Camera, Site

HOLDS = HoldsFor("shop", "ground", date(2026, 11, 9), date(2026, 11, 9))
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def calibrated(camera: Camera, *, error_m: float | None = None, sd_m: tuple[float, float] | None = None) -> Camera:
    """Return a camera whose calibration states an error: of a position, or of 2 m west and east of x = 6 m."""
    cells = () if sd_m is None else tuple((x + 0.5, y + 0.5, sd_m[x >= 6]) for x in range(20) for y in range(10))
    return replace(camera, calibrations=(Calibration(IDENTITY, None, "12345678", error_m, None, cells),))


@pytest.fixture
def pairs(tmp_path: Path) -> Site:
    """Return a site whose first camera sees pairs 1.5 to 2.4 m apart, west of x = 6 m."""
    rows = []
    for second in range(N_S):
        gap = 1500 + 900 * second // N_S
        for i, x in enumerate((1000, 1000 + gap)):
            rows.append(("cam-0", START + 1000 * second, i, f"t-{i}", x, 5000, "metric"))
    names = ("camera_id", "ts", "person", "track_id", "x_mm", "y_mm", "quality")
    site = site_of(tmp_path)
    put(site, observations=dict(zip(names, map(list, zip(*rows, strict=True)), strict=True)), frames=heartbeats())
    return site


def with_errors(site: Site, first: Camera) -> Site:
    return replace(site, cameras=(first, calibrated(site.cameras[1], error_m=0.01)))


def test_range_is_the_share_at_limits_moved_by_the_stated_error(pairs: Site) -> None:
    e = 0.05
    with open_day(with_errors(pairs, calibrated(pairs.cameras[0], sd_m=(2 * e, 9.0)))) as warehouse:
        found = threshold_sensitivity(warehouse)
    gaps = 1500 + 900 * np.arange(N_S) // N_S
    assert found.calibration is not None
    assert found.calibration.error["cam-0"] == pytest.approx(e)  # that where the pairs were, not that of the east
    assert found.calibration.lo == pytest.approx((gaps < 2000 * (1 - 1.96 * e)).mean(), abs=0.01)
    assert found.calibration.hi == pytest.approx((gaps < 2000 * (1 + 1.96 * e)).mean(), abs=0.01)
    assert found.points[1].share is not None
    assert found.calibration.lo < found.points[1].share < found.calibration.hi


def test_error_of_points_is_that_of_two_positions(pairs: Site) -> None:
    with open_day(with_errors(pairs, calibrated(pairs.cameras[0], error_m=0.07))) as warehouse:
        found = threshold_sensitivity(warehouse).calibration
    assert found is not None
    assert found.error["cam-0"] == pytest.approx(0.07 * 2**0.5 / 2)


def test_distances_that_are_not_stored_leave_the_upper_end_unknown(pairs: Site) -> None:
    with open_day(with_errors(pairs, calibrated(pairs.cameras[0], error_m=0.3))) as warehouse:
        found = threshold_sensitivity(warehouse).calibration
    assert found is not None
    assert found.hi is None
    assert found.lo == 0.0


def test_camera_whose_calibration_states_nothing_leaves_no_range_and_m26_as_it_was(pairs: Site) -> None:
    with open_day(pairs) as warehouse:
        plain = threshold_sensitivity(warehouse)
    with open_day(with_errors(pairs, calibrated(pairs.cameras[0], sd_m=(0.1, 0.1)))) as warehouse:
        stated = threshold_sensitivity(warehouse)
    with open_day(with_errors(pairs, calibrated(pairs.cameras[0]))) as warehouse:
        assert threshold_sensitivity(warehouse).calibration is None
    assert plain.calibration is None
    assert replace(stated, calibration=None) == plain


def test_row_of_the_legal_distance_has_the_range_in_the_json_file(pairs: Site) -> None:
    with open_day(with_errors(pairs, calibrated(pairs.cameras[0], error_m=0.07))) as warehouse:
        found = threshold_sensitivity(warehouse)
    assert found.calibration is not None
    hidden = SimpleNamespace(why_floor=None, why_untimed=None, untimed=frozenset())
    data = SimpleNamespace(floor=pairs.floors[0], site=pairs, this=SimpleNamespace(holds_for=HOLDS), hidden=hidden)
    inputs = FigureInputs(*cast(Any, (data, SimpleNamespace(sensitivity=found), None, None, (), None, True)))
    [answer] = violations.threshold_sensitivity(inputs)
    assert [row["calibration_lo"] for row in answer.rows] == [None, found.calibration.lo, None]
    legal = answer.rows[1]
    assert legal["calibration_lo"] < value_of(legal, "close_time_share").value < legal["calibration_hi"]  # type: ignore[operator]
    figure = figure_of("M26", [answer], unit=Reason("unit.share"))
    assert figure.value == value_of(legal, "close_time_share").value
    assert [row["calibration_hi"] for row in figure.rows or ()] == [None, found.calibration.hi, None]
