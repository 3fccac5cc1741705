"""The axis of changes: what its labels may say."""

from __future__ import annotations

import pytest

from vsd_analytics.report.draw.svg import change_axis, change_ticks


@pytest.mark.parametrize("limit", [0.4, 1.0, 1.5, 3.0])
def test_no_axis_names_a_fall_of_more_than_everything(limit: float) -> None:
    ticks = change_ticks(limit)
    assert min(ticks) >= -1
    assert {0.0, limit / 2, limit} <= set(ticks)
    assert "−150%" not in change_axis(limit)
