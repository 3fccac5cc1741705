"""Where the tracker cuts another share of ids, a change of violations has a wider range; time too close has not."""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from planted_changes import planted, site_of

from vsd_analytics.figures import close_time, periods, rates
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.stats.cut_share import MOST_SHIFT
from vsd_analytics.stats.estimates import ChangeEstimate

FIRST, SECOND = date(2026, 11, 2), date(2026, 11, 9)


def changes(root: Path) -> tuple[ChangeEstimate, ChangeEstimate]:
    with planted(site_of(root), first=FIRST, n_days=14) as warehouse:
        data = FloorHours(warehouse, floor=warehouse.site.floors[0])
        pair = TwoPeriods(*(Period(data, day, day + timedelta(days=6)) for day in (FIRST, SECOND)))
        place = close_time.close_time(pair.now, data.floor)
        return rates.violation_rate_change(pair, pair.now.whole), close_time.change_burden(pair, place)


def test_a_change_of_cut_ids_widens_counts_and_no_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before, burden_before = changes(tmp_path / "as-they-were")
    ends = np.full(7, 500.0)
    monkeypatch.setattr(periods, "cut_ids", lambda data, days: (ends * (0.02 if days[0] == FIRST else 0.2), ends))
    wide, burden = changes(tmp_path / "cut")
    assert before.lo is not None
    assert before.hi is not None
    assert (wide.lo, wide.hi) == (
        pytest.approx(before.lo / (1 + MOST_SHIFT)),
        pytest.approx(before.hi * (1 + MOST_SHIFT)),
    )
    assert wide.value == before.value
    assert (burden.lo, burden.hi) == (burden_before.lo, burden_before.hi)
