"""The weeks as dots with whiskers from zero, over their usual range, logged changes marked; and as a small line.

Weeks are never joined over a gap, nor over a week whose cameras differ from this one's: such a week is a hollow,
dashed dot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, time, timedelta
from itertools import pairwise
from typing import Final, Literal

from markupsafe import Markup

from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import Trend, TrendMark, TrendWeek, Usual
from vsd_analytics.report.draw.svg import ACCENT, BAND, HATCH, INK, MUTED, RULE, WHITE, Look, chart_text, drawing, el
from vsd_analytics.wording import format as fmt

Measure = Literal["violation_rate", "close"]
WIDE: Final = 720
NARROW: Final = 356
"""Two drawings of one chart, so that its letters keep their size on a phone."""
HEIGHT: Final = 190
LEFT: Final = 46
RIGHT: Final = 62
TOP: Final = 30
BOTTOM: Final = 26
WHISKER_MAX: Final = 1.6
"""Whiskers are cut at so many times the greatest figure, with an arrow."""
TEXT_GAP: Final = 15
"""Least distance of two lines of text."""
WARM: Final = "#e76f3f"


@dataclass(frozen=True, slots=True)
class _Axes:
    """Where weeks and values lie."""

    width: int
    n: int
    top: float

    def x(self, position: float) -> float:
        """Return the x of a week by its place, 0 for the first."""
        span = self.width - LEFT - RIGHT
        inset = min(span / 2, max(14.0, span / (2 * self.n)))
        return LEFT + inset + (position / max(1, self.n - 1)) * (span - 2 * inset)

    def y(self, value: float) -> float:
        """Return the y of a value."""
        return HEIGHT - BOTTOM - value / self.top * (HEIGHT - TOP - BOTTOM)


def chart(trend: Trend, measure: Measure, *, width: int, label: str) -> Markup:
    """Draw one measure of the weeks.

    Args:
        trend: The weeks and marks.
        measure: How often, or the share of time too close.
        width: Width of the drawing; text is as large in each.
        label: Text alternative.
    """
    weeks = trend.weeks
    values = [known(w, measure) for w in weeks]
    target = (
        trend.target_violation_rate.value
        if measure == "violation_rate" and trend.target_violation_rate is not None
        else None
    )
    most = max((e.value or 0.0 for e in values if e is not None), default=0.0)
    ends = [min(e.hi or 0.0, WHISKER_MAX * most) for e in values if e is not None]
    highest = max([most, target or 0.0, *ends]) or 1.0
    step = _step(highest)
    n_steps = max(1, math.ceil(highest / step - 1e-9))
    axes = _Axes(width, len(weeks), step * n_steps)
    usual = trend.usual_violation_rate if measure == "violation_rate" else trend.usual_close
    parts = [] if usual is None else [_usual(axes, usual)]
    parts += [_grid(axes, step * k, measure) for k in range(n_steps + 1)]
    parts += [] if target is None else _target(axes, target, beside=values[-1])
    parts += _week_labels(axes, weeks)
    parts += [_gap(axes, i) for i, e in enumerate(values) if e is None]
    parts += _marks(axes, weeks, trend.marks)
    parts += _line(axes, [None if w.missing else e for w, e in zip(weeks, values, strict=True)])
    parts += _dots(axes, values, measure, is_other=[bool(w.missing) for w in weeks])
    return drawing(parts, (width, HEIGHT), class_="tr wide" if width == WIDE else "tr nar", label=label)


def spark(trend: Trend | None, measure: Measure) -> Markup:
    """Draw the weeks as a small line from zero, broken at gaps, the last one a dot; empty under three figures."""
    values = [None if w.missing else known(w, measure) for w in trend.weeks] if trend is not None else []
    if sum(e is not None for e in values) < 3 or values[-1] is None:
        return Markup("")
    top = max(e.value or 0.0 for e in values if e is not None) or 1.0
    points = [
        None if e is None else (4 + 130 * i / (len(values) - 1), 24 - 20 * (e.value or 0.0) / top)
        for i, e in enumerate(values)
    ]
    path, is_down = "", False
    for point, after in zip(points, [*points[1:], None], strict=True):
        if point is not None:
            path += f"{'L' if is_down else 'M'}{point[0]:.0f} {point[1]:.0f}"
            path += "h0" if not is_down and after is None else ""  # a week between gaps is a point
        is_down = point is not None
    x, y = points[-1] or (0.0, 0.0)
    line = el("path", class_="tl", fill="none", stroke=MUTED, stroke_width=1.6, stroke_linecap="round", d=path)
    dot = el("circle", class_="tn", fill=WARM, cx=round(x), cy=round(y), r=3.4)
    return el("svg", line + dot, class_="spark", viewBox="0 0 140 28", aria_hidden="true")


def known(week: TrendWeek, measure: Measure) -> Estimate | None:
    """Return what a week measured of violations or of time too close; None where it has no value."""
    estimate = week.violation_rate if measure == "violation_rate" else week.close
    return estimate if estimate is not None and estimate.value is not None else None


def _step(top: float) -> float:
    """Return a round step that makes two to five of the axis."""
    size = 10.0 ** math.floor(math.log10(top))
    return next(f * size for f in (0.2, 0.5, 1.0, 2.0, 5.0) if top / (f * size) <= 4.5)


def _usual(axes: _Axes, usual: Usual) -> Markup:
    """Draw the usual range as a band behind the weeks."""
    top, bottom = axes.y(min(usual.hi, axes.top)), axes.y(min(usual.lo, axes.top))
    size = {"x": LEFT, "y": round(top, 1), "width": axes.width - LEFT - RIGHT, "height": round(bottom - top, 1)}
    return el("rect", class_="tu", fill=BAND, **size)


def _target(axes: _Axes, value: float, *, beside: Estimate | None) -> list[Markup]:
    """Draw the target as a dashed line, with its value at the right end, clear of that of the last week."""
    y = round(axes.y(value), 1)
    gap = TEXT_GAP if beside is None else y - axes.y(beside.value or 0.0)
    down = 0.0 if abs(gap) >= TEXT_GAP else TEXT_GAP - gap if gap >= 0 else -TEXT_GAP - gap
    ends = {"x1": LEFT, "x2": axes.width - RIGHT + 6, "y1": y, "y2": y}
    line = el("line", class_="tt1", stroke=ACCENT, stroke_width=1.6, stroke_dasharray="7 4", **ends)
    x, look = axes.width - RIGHT + 13, {"anchor": "start", "class_": "tt2", "fill": ACCENT}
    return [line, chart_text(fmt.number(value), x, y + 5 + down, **look)]


def _grid(axes: _Axes, value: float, measure: Measure) -> Markup:
    y = round(axes.y(value))
    style, stroke = ("zero", INK) if value == 0 else ("ax", RULE)
    line = el("line", class_=style, stroke=stroke, x1=LEFT, x2=axes.width - RIGHT, y1=y, y2=y)
    plain = fmt.number(value) if value >= 10 or value == 0 else fmt.plain(value)
    return line + chart_text(plain if measure == "violation_rate" else f"{value:.0%}", LEFT - 8, y + 4, anchor="end")


def _week_labels(axes: _Axes, weeks: Sequence[TrendWeek]) -> list[Markup]:
    every = 2 if axes.width == NARROW and len(weeks) > 6 else 1
    last = len(weeks) - 1
    return [chart_text(str(w.number), axes.x(i), HEIGHT - 7) for i, w in enumerate(weeks) if (last - i) % every == 0]


def _gap(axes: _Axes, i: int) -> Markup:
    x = axes.x(i)
    size = {"x": round(x - 7), "y": TOP, "width": 14, "height": HEIGHT - TOP - BOTTOM}
    return el("rect", class_="tg", fill="url(#hat)", stroke=HATCH, stroke_width=0.5, **size)


def _marks(axes: _Axes, weeks: Sequence[TrendWeek], marks: Sequence[TrendMark]) -> list[Markup]:
    """Draw logged changes where they lie in their week: at Monday half a week before its dot."""
    parts: list[Markup] = []
    taken: list[float] = []
    for mark in marks:
        since = (mark.at.replace(tzinfo=None) - _noon(weeks[0])).total_seconds() / timedelta(weeks=1).total_seconds()
        at = axes.x(since)
        x = round(at)
        row = sum(abs(x - t) < 13 for t in taken)
        taken.append(x)
        line = {"x1": x, "x2": x, "y1": TOP - 8, "y2": HEIGHT - BOTTOM}
        parts.append(el("line", class_="tm", stroke=INK, stroke_width=1.2, stroke_dasharray="3 3", **line))
        parts.append(chart_text(mark.label, x + 11 * row, TOP - 14, class_="tv"))
    return parts


def _noon(week: TrendWeek) -> datetime:
    """Return the local middle of a week, the place of its dot."""
    return datetime.combine(week.monday, time()) + timedelta(days=3.5)


def _line(axes: _Axes, values: Sequence[Estimate | None]) -> list[Markup]:
    parts = []
    for i, (a, b) in enumerate(pairwise(values)):
        if a is not None and b is not None:
            ends = {"x1": round(axes.x(i)), "x2": round(axes.x(i + 1))}
            heights = {"y1": round(axes.y(a.value or 0.0), 1), "y2": round(axes.y(b.value or 0.0), 1)}
            parts.append(el("line", class_="tl", stroke=MUTED, stroke_width=1.4, **ends, **heights))
    return parts


def _dots(
    axes: _Axes, values: Sequence[Estimate | None], measure: Measure, *, is_other: Sequence[bool]
) -> list[Markup]:
    """Draw each week's figure; hollow and dashed where its cameras are other ones (`is_other`)."""
    parts = []
    for i, e in enumerate(values):
        if e is None:
            continue
        x, y, is_last = round(axes.x(i)), axes.y(e.value or 0.0), i == len(values) - 1
        if e.lo is not None and e.hi is not None:
            high = min(e.hi, axes.top)
            ends = {"x1": x, "x2": x, "y1": round(axes.y(e.lo), 1), "y2": round(axes.y(high), 1)}
            parts.append(el("line", class_="tw", stroke=INK, stroke_width=2, **ends))
            if e.hi > axes.top:
                parts.append(el("path", class_="tn", fill=INK, d=f"M{x - 4} {TOP + 6}l4-7 4 7z"))
        style, fill, r = ("tn", WARM, 5.5) if is_last else ("td", WHITE, 4.5)
        ring: Look = {"stroke": INK, "stroke_width": 1.6, "stroke_dasharray": "2 2" if is_other[i] else None}
        parts.append(el("circle", class_=style, fill=fill, **ring, cx=x, cy=round(y, 1), r=r))
        if is_last:
            label = fmt.number(e.value) if measure == "violation_rate" else fmt.percent(e.value)
            parts.append(chart_text(label, x + 13, y + 5, anchor="start", class_="tv", font_weight="700"))
    return parts
