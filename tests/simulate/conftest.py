"""One simulated Saturday before and one after the display was moved, shared by these tests."""

from __future__ import annotations

from datetime import date

import pytest

from vsd_analytics.simulate.demo_project import opening
from vsd_analytics.simulate.people import SimulatedDay, simulate_day


def _saturday(day: date, *, moved: bool) -> SimulatedDay:
    opens, closes = opening(day)
    return simulate_day(opens, closes=closes, seed=1, interval_s=2.0, display_moved=moved)


@pytest.fixture(scope="session")
def before() -> SimulatedDay:
    return _saturday(date(2026, 11, 7), moved=False)


@pytest.fixture(scope="session")
def after() -> SimulatedDay:
    return _saturday(date(2026, 11, 14), moved=True)
