"""The funnel: each floor by how well it is known (to the right) and how far from usual it lies (up or down).

Its limits open to the left, where days and weeks of a floor tell little, and never close: floors differ a little for
reasons of their own. A hollow, hatched point lost too much of its recording to be judged.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from markupsafe import Markup

from vsd_analytics.report.draw.svg import BAND, HATCH, INK, MUTED, RULE, chart_text, drawing, el
from vsd_analytics.stats.quantiles import z_quantile
from vsd_analytics.wording import format as fmt

PointKind = Literal["usual", "differs", "gaps"]
WIDE: Final = 720
NARROW: Final = 356
"""Two drawings of one chart, so that its letters keep their size on a phone."""
HEIGHT: Final = 330
LEFT: Final = 62
RIGHT: Final = 16
TOP: Final = 14
BOTTOM: Final = 50
WARM: Final = "#e76f3f"
INNER: Final = 0.95
OUTER: Final = 0.998
Y_TICKS: Final = (0.25, 1 / 3, 0.5, 2 / 3, 0.8, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0)
X_TICKS: Final = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
LINE: Final = 16
"""Least distance of two lines of text."""
LETTER: Final = 7.2
STEPS: Final = 48


@dataclass(frozen=True, slots=True, kw_only=True)
class FunnelPoint:
    """One floor.

    Attributes:
        name: What it is called where it is hovered over.
        text: Words beside its point; empty for most.
        ratio: Time too close over that of a usual floor.
        reach: Factor to each end of its own 95 % range, above 1.
        kind: How it is drawn.
    """

    name: str
    text: str
    ratio: float
    reach: float
    kind: PointKind


@dataclass(frozen=True, slots=True)
class _Plane:
    """Where log ratios and log reaches lie."""

    width: int
    reach: tuple[float, float]
    top: float

    def x(self, log_reach: float) -> float:
        """Return the x of a reach; half the reach is always as far to the right."""
        wide, small = (math.log(r) for r in self.reach)
        return LEFT + (wide - math.log(log_reach)) / (wide - small) * (self.width - LEFT - RIGHT)

    def y(self, log_ratio: float) -> float:
        """Return the y of a log ratio."""
        middle = (TOP + HEIGHT - BOTTOM) / 2
        return middle - log_ratio / self.top * (HEIGHT - TOP - BOTTOM) / 2


def funnel_chart(points: Sequence[FunnelPoint], *, usual_sd: float, title: str, width: int, label: str) -> Markup:
    """Draw the funnel.

    Args:
        points: At least one.
        usual_sd: Usual standard deviation between floors, log scale.
        title: Title of the axis below.
        width: Width of the drawing; text is as large in each.
        label: Text alternative.
    """
    reaches = [math.log(p.reach) for p in points]
    wide, small = max(reaches) * 1.25, min(reaches) / 1.25
    if wide < 4 * small:
        middle = math.sqrt(wide * small)
        wide, small = 2 * middle, middle / 2
    top = max([math.log(1.6), *(1.15 * abs(math.log(p.ratio)) for p in points)])
    plane = _Plane(width, (wide, small), top)
    parts = [_band(plane, usual_sd), *_grid(plane), *_limits(plane, usual_sd)]
    parts += [_dot(plane, p) for p in sorted(points, key=lambda p: p.kind == "differs")]
    parts += _labels(plane, points)
    parts.append(chart_text(title, (LEFT + width - RIGHT) / 2, HEIGHT - 8))
    return drawing(parts, (width, HEIGHT), class_="tr fun wide" if width == WIDE else "tr fun nar", label=label)


def _curve(plane: _Plane, usual_sd: float, confidence: float) -> list[tuple[float, float]]:
    """Return x and the log ratio of a limit from left to right."""
    wide, small = plane.reach
    reaches = (wide * (small / wide) ** (k / STEPS) for k in range(STEPS + 1))
    z, z_reach = z_quantile(confidence=confidence), z_quantile(confidence=INNER)
    return [(plane.x(r), z * math.hypot(r / z_reach, usual_sd)) for r in reaches]


def _band(plane: _Plane, usual_sd: float) -> Markup:
    upper = [(x, min(y, plane.top)) for x, y in _curve(plane, usual_sd, INNER)]
    around = [*upper, *((x, -y) for x, y in reversed(upper))]
    return el("path", class_="tu", fill=BAND, d=f"M{_path((x, plane.y(y)) for x, y in around)}z")


def _limits(plane: _Plane, usual_sd: float) -> list[Markup]:
    """Draw both limits on both sides, as far as they lie in the drawing."""
    parts = []
    for confidence, dash in ((INNER, "2 3"), (OUTER, None)):
        inside = [(x, y) for x, y in _curve(plane, usual_sd, confidence) if y <= plane.top]
        parts += [
            el("path", class_="tl", fill="none", stroke=MUTED, stroke_width=1.3, stroke_dasharray=dash,
               d=f"M{_path((x, plane.y(side * y)) for x, y in inside)}")
            for side in (1, -1)
            if len(inside) > 1
        ]  # fmt: skip
    return parts


def _grid(plane: _Plane) -> list[Markup]:
    parts = []
    for tick in (t for t in Y_TICKS if abs(math.log(t)) <= plane.top):
        y = round(plane.y(math.log(tick)))
        look = {"class_": "zero", "stroke": INK} if tick == 1 else {"class_": "ax", "stroke": RULE}
        parts.append(el("line", **look, x1=LEFT, x2=plane.width - RIGHT, y1=y, y2=y))
        parts.append(chart_text(fmt.signed(tick - 1), LEFT - 8, y + 4, anchor="end"))
    for share in X_TICKS:
        log_reach = math.log1p(share)
        if plane.reach[1] <= log_reach <= plane.reach[0]:
            x = round(plane.x(log_reach))
            ends = {"x1": x, "x2": x, "y1": HEIGHT - BOTTOM, "y2": HEIGHT - BOTTOM + 5}
            parts.append(el("line", class_="tl", stroke=MUTED, **ends))
            parts.append(chart_text(fmt.percent(share), x, HEIGHT - BOTTOM + 19))
    return parts


def _dot(plane: _Plane, point: FunnelPoint) -> Markup:
    at = {"cx": round(plane.x(math.log(point.reach)), 1), "cy": round(plane.y(math.log(point.ratio)), 1)}
    title = el("title", point.name)
    match point.kind:
        case "differs":
            return el("circle", title, class_="tn", fill=WARM, stroke=INK, stroke_width=1.6, r=6.5, **at)
        case "gaps":
            return el("circle", title, class_="tg", fill="url(#hat)", stroke=HATCH, stroke_dasharray="2 2", r=6.5, **at)
        case "usual":
            return el("circle", title, class_="fu", fill=MUTED, stroke="none", r=4.5, **at)


def _labels(plane: _Plane, points: Iterable[FunnelPoint]) -> list[Markup]:
    """Write beside its point what is to be said of it, on the side with more room, lines apart from each other."""
    parts: list[Markup] = []
    taken: list[tuple[float, float, float]] = []
    for point in sorted((p for p in points if p.text), key=lambda p: -p.ratio):
        x, y = plane.x(math.log(point.reach)), plane.y(math.log(point.ratio)) + 5
        is_right = x > plane.width / 2
        n_letters = max(4, int(((x - LEFT if is_right else plane.width - RIGHT - x) - 14) / LETTER))
        text = point.text if len(point.text) <= n_letters else f"{point.text[: n_letters - 1]}\u2026"
        beside, wide = x + (-12 if is_right else 12), len(text) * LETTER
        start, end = (beside - wide, beside) if is_right else (beside, beside + wide)
        while any(abs(y - other) < LINE and start < b and a < end for a, b, other in taken):
            y += LINE
        taken.append((start, end, y))
        class_ = "tv" if point.kind == "differs" else "axt"
        parts.append(chart_text(text, beside, y, anchor="end" if is_right else "start", class_=class_))
    return parts


def _path(points: Iterable[tuple[float, float]]) -> str:
    return "L".join(f"{x:.0f} {y:.1f}" for x, y in points)
