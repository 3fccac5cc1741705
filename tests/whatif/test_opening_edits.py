"""Other opening hours: who came in the hours that close, and what their coming at another time does."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from tests.whatif.walkers import walkers
from vsd_analytics.site.layout import OpeningEdit, Spans
from vsd_analytics.whatif.floor_records import FloorRecords
from vsd_analytics.whatif.opening_edits import OpeningEffect, opening_effect

MONDAY = datetime(2026, 11, 2, tzinfo=UTC).timestamp()
OPEN: tuple[Spans, ...] = (((540, 720),),) * 7
SHORTER: tuple[Spans, ...] = (((540, 660),),) * 7


def day_of_walkers(seed: int = 1, n: int = 500) -> FloorRecords:
    """Return people who walk through a hall between 9:00 and 12:00."""
    rng = np.random.default_rng(seed)
    starts = MONDAY + np.floor(rng.uniform(540 * 60, 719 * 60, n))
    ways = [((0.0, y), (20.0, y + 0.5), t) for y, t in zip(rng.uniform(0, 6, n), starts, strict=True)]
    records = walkers(*ways)
    return replace(records, day=np.full(records.day.size, date(2026, 11, 2).toordinal()))


def effect(opening: tuple[Spans, ...], share: float | None) -> OpeningEffect:
    return opening_effect(day_of_walkers(), OpeningEdit(opening, share), OPEN, zone=ZoneInfo("UTC"), within_m=2.0)


def test_the_same_hours_change_nothing() -> None:
    found = effect(OPEN, None)
    assert (found.n_closed, found.refusal) == (0, None)
    assert found.change is not None
    assert (found.change.lo, found.change.hi) == (0, 0)


def test_who_comes_beside_the_others_makes_open_hours_fuller_and_who_stays_away_does_not() -> None:
    nobody, half, everybody = (effect(SHORTER, share).change for share in (0.0, 0.5, 1.0))
    assert nobody is not None
    assert half is not None
    assert everybody is not None
    assert nobody.value == pytest.approx(0.0, abs=0.15)  # as many people in each hour that stays open
    assert nobody.value < half.value < everybody.value
    assert everybody.lo > 0


def test_the_hours_of_days_without_records_count_for_nothing() -> None:
    """Only Monday was recorded: that the other days close an hour earlier, or two, is no part of its rate."""
    other_days = (SHORTER[0], *(((540, 600),),) * 6)
    one, two = effect(SHORTER, 0.0).change, effect(other_days, 0.0).change
    assert one == two


@pytest.mark.parametrize(
    ("opening", "share", "why"),
    [
        (SHORTER, None, "whatif.no_share"),
        ((((540, 780),),) * 7, 0.5, "whatif.longer_hours"),
        (((), *OPEN[1:]), 0.5, "whatif.closed_day"),
    ],
)
def test_what_is_not_known_is_refused(opening: tuple[Spans, ...], share: float | None, why: str) -> None:
    found = effect(opening, share)
    assert (found.change, found.refusal and found.refusal.code) == (None, why)
