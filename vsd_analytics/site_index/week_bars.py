"""The ten bars of a row: a floor's weeks side by side, each drawn by what is known of it.

A full bar is a figure; a dashed one a rough figure of a week too incomplete to compare; a hatched box is a week
without data, a dot a week without a report, a line on the ground a week without violations. Missing is never zero.
Heights share a scale within one row only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import date
from typing import Final, Literal

from markupsafe import Markup

from vsd_analytics.report.draw.svg import ACCENT, HATCH, INK, MUTED, drawing, el
from vsd_analytics.site_index.read_reports import IndexedReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

STEP, WIDTH, HEIGHT = 16, 12, 36
NOW: Final = "#e76f3f"
BarKind = Literal["full", "rough", "no_data", "absent", "zero", "unknown"]


def bar_kind(report: IndexedReport | None) -> BarKind:
    """Return how a week is drawn."""
    if report is None:
        return "absent"
    value = report.level.violation_rate.value
    if report.state == "no_data":
        return "no_data"
    if value is None or not math.isfinite(value) or value < 0:
        return "unknown"
    if report.state == "too_incomplete":
        return "rough"
    return "zero" if value == 0 else "full"


def said(report: IndexedReport | None) -> str:
    """Return a week's figure, or why there is none, for the table and for those who do not see the bars."""
    match bar_kind(report):
        case "absent":
            return say("index.no_report")
        case "no_data":
            return say("index.no_data")
        case "unknown":
            return say("index.no_figure")
        case "rough":
            return say("index.about", rate=fmt.number(report.level.violation_rate.value if report else None))
        case _:
            return fmt.number(report.level.violation_rate.value if report else None)


def bars(window: Sequence[tuple[date, IndexedReport | None]], *, label: str, target: float | None = None) -> Markup:
    """Draw the weeks of a row, the last one in the warm colour.

    Args:
        window: Monday and report, or None, of each week.
        label: What the drawing says in words.
        target: Figure to stay below, a dashed line; None = no target.
    """
    values = [
        t.level.violation_rate.value or 0.0 for _, t in window if t is not None and bar_kind(t) in ("full", "rough")
    ]
    largest = max([*values, target or 0.0]) or 1.0
    parts: list[Markup] = []
    for k, (_, report) in enumerate(window):
        x, is_now = k * STEP, k == len(window) - 1
        if report is not None and report.state == "settings_changed" and k:
            parts.append(el("line", class_="wkc", stroke=INK, x1=x - 2, x2=x - 2, y1=0, y2=HEIGHT))
        parts.append(_bar(report, x=x, largest=largest, is_now=is_now))
    if target is not None:
        y = round(HEIGHT - HEIGHT * target / largest, 1)
        ends = {"x1": 0, "x2": len(window) * STEP - 4, "y1": y, "y2": y}
        parts.append(el("line", class_="tt1", stroke=ACCENT, stroke_width=1.6, stroke_dasharray="7 4", **ends))
    ground = el("line", class_="wkg", stroke=MUTED, x1=0, x2=len(window) * STEP - 4, y1=HEIGHT + 0.5, y2=HEIGHT + 0.5)
    return drawing([ground, *parts], (len(window) * STEP - 4, HEIGHT + 1), class_="ix-bars", label=label)


def _bar(report: IndexedReport | None, *, x: float, largest: float, is_now: bool) -> Markup:
    kind = bar_kind(report)
    if kind == "absent" or report is None:
        return el("circle", class_="wkd", fill=MUTED, cx=x + WIDTH / 2, cy=HEIGHT - 3, r=1.5)
    if kind in ("no_data", "unknown"):
        fill = "url(#hat)" if kind == "no_data" else "none"
        return el(
            "rect",
            class_="wkx",
            fill=fill,
            stroke=HATCH,
            x=x + 0.5,
            y=0.5 if kind == "no_data" else HEIGHT - 11.5,
            width=WIDTH - 1,
            height=HEIGHT - 1 if kind == "no_data" else 11,
        )
    if kind == "zero":
        fill = NOW if is_now else HATCH
        return el("rect", class_="wkn" if is_now else "wkb", fill=fill, x=x, y=HEIGHT - 2, width=WIDTH, height=2)
    height = max(2.0, HEIGHT * (report.level.violation_rate.value or 0.0) / largest)
    place = {"x": x, "y": HEIGHT - height, "width": WIDTH, "height": height}
    if kind == "rough":
        inner = {"x": x + 0.5, "y": HEIGHT - height + 0.5, "width": WIDTH - 1, "height": height - 1}
        colour = NOW if is_now else MUTED
        return el(
            "rect", class_="wkr now" if is_now else "wkr", fill="none", stroke=colour, stroke_dasharray="2 2", **inner
        )
    return el("rect", class_="wkn" if is_now else "wkb", fill=NOW if is_now else HATCH, **place)
