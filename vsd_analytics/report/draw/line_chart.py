"""People across a counting line by day, a bar to either side. Hatched days were not recorded, dashed ones in part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Final

from markupsafe import Markup

from vsd_analytics.report.draw.svg import ACCENT, HATCH, INK, RULE, Look, chart_text, drawing, el
from vsd_analytics.report.draw.trend_chart import WARM, WIDE
from vsd_analytics.wording import format as fmt

HEIGHT: Final = 132
LEFT: Final = 54
RIGHT: Final = 4
TOP: Final = 10
BOTTOM: Final = 24
LABEL_WIDTH: Final = 40
"""Least distance of two names of days."""
_BARS: Final = (("tn", WARM), ("tt2", ACCENT))


@dataclass(frozen=True, slots=True)
class LineDay:
    """One day of a counting line.

    Attributes:
        day: Local day.
        n_left, n_right: Crossings to either side; None where unknown or hidden.
        n_both: Crossings of a counter that does not tell ways apart; None for all other lines.
        is_recorded: Something was recorded and can be counted: a number that is missing is hidden.
        is_whole: All opening hours were recorded in full.
    """

    day: date
    n_left: float | None
    n_right: float | None
    n_both: float | None
    is_recorded: bool
    is_whole: bool

    @property
    def bars(self) -> tuple[tuple[float | None, float, float, str, str], ...]:
        """Return number, place and width (shares of a day's width), style and colour of each bar."""
        if self.n_both is not None:
            return ((self.n_both, 0.2, 0.6, *_BARS[1]),)
        return (self.n_left, 0.14, 0.34, *_BARS[0]), (self.n_right, 0.52, 0.34, *_BARS[1])


def line_chart(days: Sequence[LineDay], *, width: int, label: str, is_weekly: bool = False) -> Markup:
    """Draw the days of a counting line; a number that is hidden is a dash.

    Args:
        days: The days, at least one with a number above zero.
        width: Width of the drawing; text is as large in each.
        label: Text alternative.
        is_weekly: Each is a week, named by its first day.
    """
    top = max(n for d in days for n, *_ in d.bars if n is not None)
    step = (width - LEFT - RIGHT) / len(days)
    base = HEIGHT - BOTTOM
    every = math.ceil(LABEL_WIDTH / step)
    parts = []
    for value, y, style, stroke in ((0.0, base, "zero", INK), (top, TOP, "ax", RULE)):
        parts.append(el("line", class_=style, stroke=stroke, x1=LEFT, x2=width - RIGHT, y1=y, y2=y))
        parts.append(chart_text(fmt.count(value), LEFT - 8, y + 4, anchor="end"))
    for k, day in enumerate(days):
        x = LEFT + k * step
        if not day.is_recorded and not day.is_whole:
            place = {"x": round(x + 0.1 * step, 1), "y": TOP, "width": round(0.8 * step, 1), "height": base - TOP}
            parts.append(el("rect", class_="hx", fill="url(#hat)", stroke=HATCH, **place))
        for n, at, share, style, fill in day.bars:
            if n:
                height = max((base - TOP) * n / top, 1.0)
                place = {"x": round(x + at * step, 1), "y": round(base - height, 1)}
                size = {"width": round(share * step, 1), "height": round(height, 1)}
                dashes: Look = {} if day.is_whole else {"stroke": INK, "stroke_width": 1.6, "stroke_dasharray": "4 3"}
                class_ = style if day.is_whole else f"{style} tw"
                parts.append(el("rect", class_=class_, fill=fill, **place, **size, **dashes))
            elif n is None and day.is_recorded:
                parts.append(chart_text(fmt.MISSING, x + (at + share / 2) * step, base - 4))
        if k % every == 0:
            parts.append(
                chart_text(
                    f"W{day.day:%V}" if is_weekly else _name(day.day, n_days=len(days)), x + step / 2, HEIGHT - 7
                )
            )
    return drawing(parts, (width, HEIGHT), class_="tr wide" if width == WIDE else "tr nar", label=label)


def _name(day: date, *, n_days: int) -> str:
    """Return the name of a day: Mon in a week, else 9.11."""
    return fmt.day_short(day) if n_days <= 7 else f"{day.day}.{day.month}."
