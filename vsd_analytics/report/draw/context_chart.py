"""Days of a series of what else happened: bars from zero for sums, a line for means; unknown days are gaps.

Weeks are set apart by lines with their numbers below, as on the chart of weeks; days of the report's week are orange.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import date
from itertools import pairwise
from typing import Final

from markupsafe import Markup

from vsd_analytics.report.draw.svg import BAR, INK, MUTED, RULE, chart_text, drawing, el
from vsd_analytics.report.draw.trend_chart import NARROW, WARM, WIDE
from vsd_analytics.wording import format as fmt

_Scale = Callable[[float], float]
HEIGHT: Final = 132
LEFT: Final = 54
RIGHT: Final = 10
TOP: Final = 10
BOTTOM: Final = 24
EVERY_SECOND: Final = 6
"""From so many weeks on, a narrow drawing has every second number."""


@dataclass(frozen=True, slots=True)
class SeriesDay:
    """One day of a series; None is unknown."""

    day: date
    value: float | None


def context_chart(days: Sequence[SeriesDay], *, is_sum: bool, since: date, width: int, label: str) -> Markup:
    """Draw the days of a series.

    Args:
        days: The days, whole weeks from a Monday on.
        is_sum: Values add up: bars from zero.
        since: First day of the report's week.
        width: Width of the drawing; text is as large in each.
        label: Text alternative.
    """
    values = [d.value for d in days if d.value is not None and math.isfinite(d.value)]
    low, high = (min([0.0, *values]), max([0.0, *values])) if is_sum else (min(values), max(values))
    if high == low:
        high, low = high + 1, low - (0 if is_sum else 1)
    span = width - LEFT - RIGHT
    step = span / len(days)

    def x(k: float) -> float:
        return LEFT + k * step

    def y(value: float) -> float:
        return HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - TOP - BOTTOM)

    parts = [_level(value, y(value), width) for value in dict.fromkeys((low, high))]
    n_weeks = len(days) // 7
    every = 2 if width == NARROW and n_weeks > EVERY_SECOND else 1
    for k in range(n_weeks):
        at = round(x(7 * k), 1)
        parts.append(el("line", class_="ax", stroke=RULE, x1=at, x2=at, y1=TOP, y2=HEIGHT - BOTTOM))
        if (n_weeks - 1 - k) % every == 0:
            parts.append(chart_text(str(days[7 * k].day.isocalendar().week), x(7 * k + 3.5), HEIGHT - 7))
    parts += _bars(days, x, y, since=since, step=step) if is_sum else _line(days, x, y, since=since)
    return drawing(parts, (width, HEIGHT), class_="tr wide" if width == WIDE else "tr nar", label=label)


def _level(value: float, y: float, width: int) -> Markup:
    style, stroke = ("zero", INK) if value == 0 else ("ax", RULE)
    line = el("line", class_=style, stroke=stroke, x1=LEFT, x2=width - RIGHT, y1=round(y), y2=round(y))
    return line + chart_text(fmt.number(value), LEFT - 8, y + 4, anchor="end")


def _bars(days: Sequence[SeriesDay], x: _Scale, y: _Scale, *, since: date, step: float) -> list[Markup]:
    parts = []
    for k, day in enumerate(days):
        if day.value is None:
            continue
        top, bottom = sorted((y(day.value), y(0.0)))
        size = {"x": round(x(k) + 0.15 * step, 1), "y": round(top, 1), "width": round(0.7 * step, 1)}
        is_now = day.day >= since
        style, fill = ("tn", WARM) if is_now else ("tl", BAR)
        parts.append(el("rect", class_=style, fill=fill, **size, height=round(max(bottom - top, 1.0), 1)))
    return parts


def _line(days: Sequence[SeriesDay], x: _Scale, y: _Scale, *, since: date) -> list[Markup]:
    parts = []
    points = [None if d.value is None else (round(x(k + 0.5), 1), round(y(d.value), 1)) for k, d in enumerate(days)]
    for (a, _), (b, day) in pairwise(zip(points, days, strict=True)):
        if a is not None and b is not None:
            ends = {"x1": a[0], "x2": b[0], "y1": a[1], "y2": b[1]}
            stroke = INK if day.day > since else MUTED
            parts.append(el("line", class_="tl", stroke=stroke, stroke_width=1.6, **ends))
    for point, day in zip(points, days, strict=True):
        if point is not None and day.day >= since:
            parts.append(el("circle", class_="tn", fill=WARM, cx=point[0], cy=point[1], r=2.4))
    return parts
