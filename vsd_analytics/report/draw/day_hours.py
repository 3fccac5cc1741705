"""The open hours of yesterday, today and tomorrow: counts as bars, the usual range of each hour behind them."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from datetime import date
from itertools import groupby
from typing import Final

from markupsafe import Markup

from vsd_analytics.figures.today import TodayHour
from vsd_analytics.report.draw.floor_frame import text_width
from vsd_analytics.report.draw.svg import BAND, HATCH, INK, RECORDED, RULE, chart_text, drawing, el
from vsd_analytics.wording import format as fmt

WIDTH: Final = 300
HEIGHT: Final = 178
LEFT: Final = 34
TOP: Final = 26
BOTTOM: Final = 22
DAY_GAP: Final = 10
WARM: Final = "#e76f3f"
NAME_SIZE: Final = 14
"""Of the names of days, which are bold, so wider than `text_width` says for their 13 units."""


def day_hours(
    hours: Sequence[TodayHour], *, names: dict[date, str], unusual: Collection[tuple[date, int]], label: str
) -> Markup:
    """Draw the hours; an hour without data is hatched, and an hour to come has its range only.

    Args:
        hours: Open hours in order.
        names: What each day is called.
        unusual: Day and hour of bars that stand out.
        label: Text alternative.
    """
    by_day = [(day, list(group)) for day, group in groupby(hours, key=lambda h: h.day)]
    if not by_day:
        return Markup("")
    most = max([1.0, *(v for h in hours for v in (h.violations, h.hi) if v is not None)])
    step = _step(most)
    top = step * math.ceil(most / step)
    width = (WIDTH - LEFT - DAY_GAP * (len(by_day) - 1)) / len(hours)
    parts = [_grid(step * k, top=top) for k in range(round(top / step) + 1)]
    x: float = LEFT
    for day, open_hours in by_day:
        start = x
        for hour in open_hours:
            parts += _hour(hour, x=x, width=width, top=top, is_unusual=(hour.day, hour.hour) in unusual)
            x += width
        middle = min((start + x) / 2, WIDTH - text_width(names[day], NAME_SIZE) / 2)
        parts.append(chart_text(names[day], middle, 14, anchor="middle", class_="tv"))
        first, last = open_hours[0].hour, open_hours[-1].hour + 1
        parts.append(chart_text(f"{first:02d}", start, HEIGHT - 6, anchor="start"))
        parts.append(chart_text(f"{last:02d}", x, HEIGHT - 6, anchor="end"))
        x += DAY_GAP
    return drawing(parts, (WIDTH, HEIGHT), class_="dayh", label=label)


def _y(value: float, top: float) -> float:
    return HEIGHT - BOTTOM - value / top * (HEIGHT - TOP - BOTTOM)


def _step(most: float) -> float:
    """Return a round step that makes one to four of the axis."""
    size = 10.0 ** math.floor(math.log10(most))
    return next(f * size for f in (0.5, 1.0, 2.0, 5.0) if most / (f * size) <= 4)


def _grid(value: float, *, top: float) -> Markup:
    y = round(_y(value, top), 1)
    is_zero = value == 0
    ends = {"x1": LEFT, "x2": WIDTH, "y1": y, "y2": y}
    line = el("line", class_="zero" if is_zero else "ax", stroke=INK if is_zero else RULE, **ends)
    return line + chart_text(fmt.number(value), LEFT - 6, y + 4, anchor="end")


def _hour(hour: TodayHour, *, x: float, width: float, top: float, is_unusual: bool) -> list[Markup]:
    parts = []
    inner = {"x": round(x + 0.5, 1), "width": round(max(1.0, width - 1), 1)}
    if hour.is_over and hour.violations is None:
        size = {"y": TOP, "height": HEIGHT - TOP - BOTTOM}
        parts.append(el("rect", class_="tg", fill="url(#hat)", stroke=HATCH, stroke_width=0.5, **inner, **size))
    elif hour.lo is not None and hour.hi is not None:
        high, low = _y(hour.hi, top), _y(hour.lo, top)
        tall = round(max(1.0, low - high), 1)
        parts.append(el("rect", class_="tu", fill=BAND, y=round(high, 1), height=tall, **inner))
    if hour.violations is not None:
        y = _y(hour.violations, top)
        look = {"class_": "dhu", "fill": WARM} if is_unusual else {"class_": "dhc", "fill": RECORDED}
        bar = {"x": round(x + width * 0.22, 1), "width": round(width * 0.56, 1)}
        parts.append(el("rect", **look, **bar, y=round(y, 1), height=round(HEIGHT - BOTTOM - y, 1)))
    return parts
