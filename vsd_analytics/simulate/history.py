"""The history of the made-up shop over eight weeks or more, for figures that need many weeks.

The number of people grows from week to week. The display moves four weeks before the last week. One week before it, a
change is logged that has no effect. An early week is mostly lost, and the shop is closed on one day.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta
from typing import Final
from zoneinfo import ZoneInfo

from vsd_analytics.simulate.truth import PlantedGap

MIN_WEEKS: Final = 8
"""Shorter demos have no history: the display moves before the last week, and nothing else happens."""
GROWTH: Final = 0.009
"""How many more people there are from week to week; violations grow about twice as fast."""
IDLE_AREA, IDLE_TEXT = "aisle-2-end", "New floor stickers at the end of aisle 2"


@dataclass(frozen=True, slots=True)
class PlantedChange:
    """A line of the change log.

    Attributes:
        at: Local instant.
        text: What was changed.
        area_id: Area it concerns; None = the whole floor.
    """

    at: datetime
    text: str
    area_id: str | None


@dataclass(frozen=True, slots=True)
class ShopHistory:
    """What happens in the weeks.

    Attributes:
        last_monday: First day of the last week.
        moved_at: When the display was moved, before the shop opened.
        idle: The change that has no effect.
        gaps: Times from which no message arrived, before the last week.
        closed: Local dates on which the shop stayed closed.
        log: Log entries except that of the move.
    """

    last_monday: date
    moved_at: datetime
    idle: PlantedChange
    gaps: tuple[PlantedGap, ...]
    closed: tuple[date, ...]
    log: tuple[PlantedChange, ...]

    def busy(self, day: date) -> float:
        """Return the factor on the number of people on a day: 1 in the last week, `GROWTH` less each week before."""
        weeks_before = (self.last_monday - day + timedelta(days=6)).days // 7
        return 1.0 - GROWTH * max(0, weeks_before)


def shop_history(mondays: Sequence[date], *, cameras: tuple[str, ...], timezone: str) -> ShopHistory | None:
    """Return what happens in these weeks; None for fewer than eight.

    Args:
        mondays: First days of the weeks, in order.
        cameras: All cameras of the shop.
        timezone: IANA zone of the shop.
    """
    if len(mondays) < MIN_WEEKS:
        return None

    def at(weeks_before_last: int, weekday: int, hour: int, minute: int = 0) -> datetime:
        day = mondays[-1] + timedelta(days=weekday - 7 * weeks_before_last)
        return datetime.combine(day, time(hour, minute), ZoneInfo(timezone))

    first = len(mondays) - 1
    early = min(first - 1, 8)  # within the ten weeks that an index shows
    lost = PlantedGap(cameras, at(early, 1, 11), at(early, 6, 18, 15))
    closed = at(min(6, first - 2), 2, 0)
    idle = PlantedChange(at(1, 0, 7), IDLE_TEXT, IDLE_AREA)
    log = (
        PlantedChange(lost.start, "The computer of the cameras broke down; replaced on Sunday evening.", None),
        PlantedChange(closed, "Closed: local holiday.", None),
        idle,
    )
    return ShopHistory(mondays[-1], at(4, 0, 6, 30), idle, (lost,), (closed.date(),), log)
