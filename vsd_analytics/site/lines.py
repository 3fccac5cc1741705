"""Counting lines: a line on the floor that people cross, such as a door."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from typing import Literal

from vsd_analytics.site.calendar import touches

Side = Literal["left", "right"]


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line on a floor; whoever goes from one side to the other between its two ends crosses it.

    Attributes:
        line_id: Identifier.
        name: Display name; free text, always escaped.
        floor_id: Its floor.
        points: Its two ends, floor metres; None = it is not drawn, which a line that a counter counts may be.
        left: Name of the side on the left hand of whoever walks from the first point to the second; free text.
        right: Name of the other side.
        inside: The side that is inside the floor, which makes the line a door of the floor; None = it is no door.
        first_day: First local day that counts for it; None = always was.
        end_day: Local day from which it counts no longer; None = still does.
        is_by_counter: A door counter counts it, whose sums `vsd counts add` stores; else cameras do.
    """

    line_id: str
    name: str
    floor_id: str
    points: tuple[tuple[float, float], tuple[float, float]] | None
    left: str
    right: str
    inside: Side | None = None
    first_day: date | None = None
    end_day: date | None = None
    is_by_counter: bool = False

    def is_there(self, first: date, last: date) -> bool:
        """Tell whether it is there on any local day from `first` to `last`."""
        return touches(self.first_day, self.end_day, first, last)
