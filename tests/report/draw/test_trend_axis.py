"""The axis of the weeks: it holds every value, in a few round steps."""

from __future__ import annotations

import pytest

from vsd_analytics.report.draw.trend_chart import _step


@pytest.mark.parametrize("top", [0.0009, 0.04, 0.95, 1.0, 4.5, 9.0, 9.01, 9.99, 44.0, 95.0, 149.0, 999.0, 123_456.0])
def test_every_value_has_an_axis_of_two_to_five_round_steps(top: float) -> None:
    assert 1.5 < top / _step(top) <= 5
