"""Inline SVG of the page: elements, paths, interval bars, bars of means, strips of recorded hours.

Each mark carries a class, which the page's style colours for light and dark, *and* a literal fill or stroke, so that
the drawing is right when copied out, mailed, or printed by engines whose CSS does not reach SVG. Coordinates are
integers; all text from data is escaped.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Final

from markupsafe import Markup, escape

from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_map import Point
from vsd_analytics.figures.week.model_recording import CameraDay
from vsd_analytics.wording import format as fmt

RAMP_LIGHT: Final = ("#fff4cf", "#ffd58e", "#ffa656", "#e76f3f", "#934444")
INK, MUTED, RULE, WHITE, HATCH, ACCENT = "#1b2430", "#525d68", "#ddd7ca", "#fff", "#8b8577", "#0f4c81"
FIXTURE, FIXTURE_EDGE, WALL = "#dcd7cc", "#a39d90", "#4a4f57"
CHANGE_LIGHT: Final = {"fewer": ("#b7d6ea", "#1f6f9f"), "more": ("#f3bd93", "#b8553f")}
Look = dict[str, str | float | None]
"""Attributes that several elements share."""
FEWER, MORE, BAR, RECORDED, BAND = "#1f6f9f", "#b8553f", "#a39d90", "#6793b0", "#e6e2d8"


def el(tag: str, content: str | Markup = "", /, **attributes: str | float | None) -> Markup:
    """Return one element; underscores in attribute names become hyphens, None leaves an attribute out."""
    attribute_text = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(_short(value))}"'
        for name, value in attributes.items()
        if value is not None
    )
    return Markup(f"<{tag}{attribute_text}>{escape(content)}</{tag}>" if content else f"<{tag}{attribute_text}/>")


def drawing(
    parts: Iterable[Markup], size: tuple[float, float], *, class_: str, label: str, corner: tuple[float, float] = (0, 0)
) -> Markup:
    """Return a drawing with a text alternative.

    Args:
        parts: Its elements.
        size: Its width and height, in SVG units.
        class_: Its class.
        label: Its text alternative.
        corner: Its upper left corner.
    """
    box = f"{corner[0]} {corner[1]} {size[0]} {size[1]}"
    return el("svg", Markup("").join(parts), class_=class_, viewBox=box, role="img", aria_label=label)


def centred(
    words: str, x: float, y: float, *, class_: str, fill: str, size: float, weight: int | None = None, turn: str = ""
) -> Markup:
    """Return a line of text around a point, turned by the transformation `turn`."""
    middle = {"text_anchor": "middle", "dominant_baseline": "central"}
    look: Look = {"class_": class_, "fill": fill, "font_size": size, "font_weight": weight}
    return el("text", words, **look, **middle, x=round(x), y=round(y), transform=turn or None)


def chart_text(
    text: str, x: float, y: float, *, anchor: str = "middle", class_: str = "axt", fill: str = MUTED, **more: str
) -> Markup:
    """Return a line of text of a chart with its base line at y; a value ("tv") is in ink."""
    ink = INK if class_ == "tv" else fill
    return el("text", text, class_=class_, fill=ink, font_size=13, text_anchor=anchor, x=round(x), y=round(y), **more)


def hatch_pattern(
    name: str = "hat", *, step: float = 6, stroke_width: float = 1.4, class_: str | None = None
) -> Markup:
    """Return the pattern of floor or hours without records: lines at 45 degrees, `step` SVG units apart."""
    line = el("line", class_=class_, stroke=HATCH, stroke_width=stroke_width, x1=0, y1=0, x2=0, y2=step)
    turn = {"patternUnits": "userSpaceOnUse", "patternTransform": "rotate(45)"}
    return el("pattern", line, id=name, width=step, height=step, **turn)


def _short(value: str | float) -> str:
    if isinstance(value, str):
        return value
    text = f"{value:.1f}".removesuffix(".0")
    return "0" if text == "-0" else text


def smooth_path(rings: Sequence[Sequence[Point]], *, sharp: Sequence[Sequence[bool]] | None = None) -> str:
    """Return closed rings as one path: quadratic curves through the midpoints of the edges, integers, relative.

    Args:
        rings: The rings.
        sharp: For each point of each ring, whether the path runs straight to it and on, as along a wall.
    """
    parts = []
    for number, ring in enumerate(rings):
        flags = sharp[number] if sharp is not None else [False] * len(ring)
        rounded = [((round(x), round(y)), is_sharp) for (x, y), is_sharp in zip(ring, flags, strict=True)]
        points = [(p, any(f for _, f in same)) for p, same in groupby(rounded, key=lambda item: item[0])]
        if len(points) > 1 and points[0][0] == points[-1][0]:
            points.pop()
        if len(points) < 3:
            continue
        parts.append(_curves(points))
    return "".join(parts)


def _curves(points: Sequence[tuple[tuple[int, int], bool]]) -> str:
    """Return one ring as a path; between two sharp points it has no midpoint."""
    after = [*points[1:], points[0]]
    middle = [
        b if is_a and is_b else ((a[0] + b[0]) // 2, (a[1] + b[1]) // 2)
        for (a, is_a), (b, is_b) in zip(points, after, strict=True)
    ]
    here = middle[-1]
    text, verb = f"M{here[0]} {here[1]}", ""
    for (control, is_sharp), target in zip(points, middle, strict=True):
        for ends in [[control], [target]] if is_sharp else [[control, target]]:
            if ends != [here]:
                wanted = "q" if len(ends) == 2 else "l"
                step = " ".join(f"{x - here[0]} {y - here[1]}" for x, y in ends)
                text += f"{wanted if wanted != verb else ' '}{step}"
                here, verb = ends[-1], wanted
    return text.replace(" -", "-") + "z"


def straight_path(rings: Iterable[Sequence[Point]]) -> str:
    """Return closed rings as one path of straight lines, integers."""
    return "".join("M" + "L".join(f"{round(x)} {round(y)}" for x, y in ring) + "z" for ring in rings if len(ring) >= 3)


BAR_WIDTH: Final = 268


def change_limit(estimates: Iterable[Estimate]) -> float:
    """Return the end of the axis that holds all intervals: 0.2, 0.4, 0.6, 0.8, 1 or 1.5, beyond which bars are cut."""
    ends = [abs(v) for e in estimates for v in (e.change, e.change_lo, e.change_hi) if v is not None]
    largest = min(max(ends, default=0.2), 1.5)
    return next(limit for limit in (0.2, 0.4, 0.6, 0.8, 1.0, 1.5) if largest <= limit)


def change_ticks(limit: float) -> tuple[float, ...]:
    """Return the labelled changes of an axis: zero and two on each side, but no fall of more than everything."""
    return tuple(t for t in (-limit, -limit / 2, 0.0, limit / 2, limit) if t >= -1)


def change_axis(limit: float) -> Markup:
    """Draw the labels above the interval bars."""
    look: Look = {"class_": "axt", "fill": MUTED, "font_size": 13.5, "text_anchor": "middle"}
    texts = Markup("").join(el("text", fmt.signed(t), **look, x=_bar_x(t, limit), y=12) for t in change_ticks(limit))
    return el("svg", texts, class_="axs", viewBox=f"0 0 {BAR_WIDTH} 16", aria_hidden="true")


def change_bar(estimate: Estimate, *, limit: float) -> Markup:
    """Draw the interval of a change as a bar with its estimate as a mark, on an axis with a zero line."""
    parts = [
        el("line", class_="ax", stroke=RULE, x1=_bar_x(t, limit), x2=_bar_x(t, limit), y1=0, y2=30)
        for t in change_ticks(limit)
        if t != 0
    ]
    parts.append(
        el("line", class_="zero", stroke=INK, stroke_width=1.6, x1=_bar_x(0, limit), x2=_bar_x(0, limit), y1=-4, y2=34)
    )
    if estimate.change_lo is not None and estimate.change_hi is not None:
        side, fill, opacity = {
            "clear_fall": ("ci g", FEWER, 0.62),
            "clear_rise": ("ci b", MORE, 0.62),
        }.get(estimate.verdict or "", ("ci", MUTED, 0.45))
        lo, hi = _bar_x(estimate.change_lo, limit), _bar_x(estimate.change_hi, limit)
        parts.append(
            el("rect", class_=side, fill=fill, fill_opacity=f"{opacity}", x=lo, width=max(hi - lo, 2), y=8, height=14)
        )
        if estimate.change_hi > limit:
            parts.append(el("path", class_=side, fill=fill, d=f"M{hi + 2:.0f} 8l7 7-7 7z"))
    if estimate.change is not None and abs(estimate.change) <= limit:
        x = _bar_x(estimate.change, limit)
        parts.append(el("line", class_="pe", stroke=INK, stroke_width=3, x1=x, x2=x, y1=5, y2=25))
    return el("svg", Markup("").join(parts), viewBox=f"0 0 {BAR_WIDTH} 30", aria_hidden="true")


def step_bar(start: float, end: float, *, top: float, is_total: bool) -> Markup:
    """Draw one row of a waterfall: a bar between two levels on an axis from 0 to `top`, which all rows share."""
    x0, x1 = sorted(round(level / top * BAR_WIDTH, 1) if top > 0 else 0.0 for level in (start, end))
    side, fill = ("bar", BAR) if is_total else ("ci g", FEWER) if end < start else ("ci b", MORE)
    bar = el("rect", class_=side, fill=fill, x=x0, width=max(round(x1 - x0, 1), 1.5), y=4, height=14)
    return el("svg", bar, viewBox=f"0 0 {BAR_WIDTH} 22", preserveAspectRatio="none", aria_hidden="true")


def _bar_x(change: float, limit: float) -> float:
    """Return the x of a change; the axis ends lie 20 units inside the drawing, where bars are cut."""
    middle = BAR_WIDTH / 2
    return round(middle + max(-1.08, min(1.08, change / limit)) * (middle - 22), 1)


def mean_bar(value: float | None, *, largest: float) -> Markup:
    """Draw a mean as a small bar from zero; an empty drawing when it is missing."""
    width = 0.0 if not value or largest <= 0 else 36 * value / largest
    bar = el("rect", class_="bar", fill=BAR, width=round(width, 1), height=12) if width else Markup("<g/>")
    return el("svg", bar, viewBox="0 0 36 12", preserveAspectRatio="none", aria_hidden="true")


def strip(day: CameraDay, *, first_hour: int, last_hour: int) -> Markup:
    """Draw a day's hours side by side: solid where recorded, hatched where open but not recorded, nothing when closed.

    Args:
        day: One camera, one day.
        first_hour: First local hour of the axis.
        last_hour: Last local hour of the axis, inclusive.
    """
    slot = 100 / (last_hour - first_hour + 1)
    open_runs: list[tuple[float, float]] = []
    on_runs: list[tuple[float, float]] = []
    for hour in range(first_hour, last_hour + 1):
        share = day.hourly_share[hour]
        if share is None:
            continue
        x = (hour - first_hour) * slot
        _extend(open_runs, x, x + slot)
        if share > 0:
            _extend(on_runs, x, x + slot * min(1.0, share))
    hatched: Look = {"class_": "off", "fill": "url(#hat)", "stroke": HATCH, "stroke_width": 0.7}
    filled: Look = {"class_": "on", "fill": RECORDED}
    parts = [
        el("rect", **look, x=round(a, 1), width=round(round(b, 1) - round(a, 1), 1), height=12)
        for look, runs in ((hatched, open_runs), (filled, on_runs))
        for a, b in runs
    ]
    bars = Markup("").join(parts) or Markup("<g/>")
    return el("svg", bars, viewBox="0 0 100 12", preserveAspectRatio="none", aria_hidden="true")


def _extend(runs: list[tuple[float, float]], start: float, end: float) -> None:
    if runs and abs(runs[-1][1] - start) < 1e-6:
        runs[-1] = (runs[-1][0], end)
    else:
        runs.append((start, end))
