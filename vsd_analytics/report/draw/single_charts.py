"""The page's tables as drawings: the timetable, what changed, data recorded. Same rows, literal colours."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from vsd_analytics.report.draw.svg import BAR, BAR_WIDTH, FEWER, HATCH, INK, MORE, MUTED, RAMP_LIGHT, RULE, WHITE, el
from vsd_analytics.report.draw.trend_chart import HEIGHT, WIDE
from vsd_analytics.report.pages.change_rows import ChangeRow
from vsd_analytics.report.pages.tables import Cell, Step
from vsd_analytics.report.pages.week import Page
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

LINE: Final = 1.4
_CLASS: Final = re.compile(r' class="[^"]*"')
CHAR_EM: Final = 0.62
"""Width of a letter, in ems: of DejaVu Sans, the widest of the fonts a figure is drawn in."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """The inside of a figure.

    Attributes:
        title: Its finding.
        unit: What is drawn, in which unit.
        body: SVG from (0, 0) down.
        height: Of the body, in SVG units.
        notes: How to read it.
    """

    title: str
    unit: str
    body: Markup
    height: float
    notes: tuple[str, ...] = ()


def text(
    words: str, x: float, y: float, *, size: float = 15, fill: str = INK, weight: int = 400, anchor: str = "start"
) -> Markup:
    """Draw one line of text, with its base line at y."""
    return el(
        "text",
        words,
        x=round(x, 1),
        y=round(y, 1),
        font_size=size,
        fill=fill,
        font_weight=None if weight == 400 else weight,
        text_anchor=None if anchor == "start" else anchor,
    )


def wrapped(words: str, *, width: float, size: float) -> list[str]:
    """Return a text as lines that fit a width; words longer than a line are cut."""
    room = max(4, int(width / (CHAR_EM * size)))
    lines: list[str] = []
    for word in words.split():
        pieces = [word[i : i + room] for i in range(0, len(word), room)]
        for piece in pieces:
            if lines and len(lines[-1]) + 1 + len(piece) <= room:
                lines[-1] += f" {piece}"
            else:
                lines.append(piece)
    return lines


def cut(words: str, *, width: float, size: float, n_lines: int = 1) -> list[str]:
    """Return at most `n_lines` lines of a text; three dots end what was left out."""
    lines = wrapped(words, width=width, size=size)
    if len(lines) <= n_lines:
        return lines
    return [*lines[: n_lines - 1], lines[n_lines - 1][:-1].rstrip() + "…"]


def legend(steps: tuple[Step, ...], hatch: str = "", closed: str = "") -> Drawing:
    """Draw the steps of a ramp side by side, then what hatching and dashes (or, on a map, dots) mean."""
    slot, parts = 78, []
    for i, step in enumerate(steps):
        parts.append(el("rect", fill=RAMP_LIGHT[min(i, 4)], stroke=BAR, x=i * slot, width=slot, height=12))
        parts.append(text(step.text, (i + 0.5) * slot, 29, size=13, fill=MUTED, anchor="middle"))
    x = len(steps) * slot + 22.0
    if hatch:
        parts.append(el("rect", fill="url(#hat)", stroke=HATCH, x=x, width=24, height=12))
        parts.append(text(hatch, x + 32, 11, size=13, fill=MUTED))
        x += 32 + CHAR_EM * 13 * len(hatch) + 18
    if closed:
        parts.append(text(closed, x, 11, size=13, fill=MUTED))
    return Drawing(title="", unit="", body=Markup("").join(parts), height=44)


def when(page: Page, *, width: float) -> Drawing | None:
    """Draw the timetable: hours down, days across, the number in each cell; None when no hour is shown."""
    table, report = page.table, page.report
    if "when" not in page.shown or not table.rows:
        return None
    key = legend(
        page.hour_legend,
        say("when.no_data") if "hatch" in table.used else "",
        "  ".join(say(f"when.{key}") for key, style in (("closed", "cl"), ("not_over", "to")) if style in table.used),
    )
    left, mean_w, row_h = 78.0, 104.0 if table.has_means else 0.0, 34
    slot = (width - left - mean_w) / 7
    top = key.height + 26
    parts = [key.body]
    for d, day in enumerate(table.days):
        parts.append(
            text(
                f"{fmt.day_short(day)} {day.day}",
                left + (d + 0.5) * slot,
                top - 9,
                size=14,
                fill=MUTED,
                weight=700,
                anchor="middle",
            )
        )
    if table.has_means:
        parts.append(text(say("when.average"), width - mean_w + 14, top - 9, size=14, fill=MUTED, weight=700))
    for r, row in enumerate(table.rows):
        y = top + r * row_h
        label = f"{row.label}–{row.until}" if row.until else f"{row.label}:00{'*' if row.is_second else ''}"
        parts.append(text(label, left - 14, y + 21, size=14, fill=MUTED, weight=700, anchor="end"))
        for d, cell in enumerate(row.cells):
            parts.append(_cell(cell, left + d * slot + 1, y + 1, slot - 2, row_h - 2))
        if row.mean is not None:
            x = width - mean_w + 14
            bar = placed(row.bar, x=x, y=y + 11, width=36, height=12)
            parts += [bar, text(fmt.number(row.mean), x + 44, y + 22, size=14, fill=MUTED)]
    bottom = top + len(table.rows) * row_h
    if table.has_means:
        parts.append(el("path", d=f"M0 {bottom + 5:.0f}h{width:.0f}", stroke=RULE, stroke_width=2, fill="none"))
        parts.append(text(say("when.average"), left - 14, bottom + 27, size=14, fill=MUTED, weight=700, anchor="end"))
        parts += [
            text(fmt.number(m), left + (d + 0.5) * slot, bottom + 27, size=14, fill=MUTED, anchor="middle")
            for d, m in enumerate(table.day_means)
        ]
        bottom += 34
    return Drawing(
        title=page.titles["when"],
        unit=say("when.sub", week=report.week.number),
        body=Markup("").join(parts),
        height=bottom,
        notes=_when_notes(page),
    )


def _when_notes(page: Page) -> tuple[str, ...]:
    rules, used = page.report.rules, page.table.used
    masked = fmt.masked(rules.mask_below)
    notes = []
    if "part" in used:
        notes.append(say("when.dashed_down" if page.down else "when.dashed", cameras=page.down))
    if "low" in used:
        notes.append(say("when.dotted", share=fmt.percent(rules.partial_hour_share)))
    if page.masked_hours:
        notes.append(say("when.masked", masked=masked))
    if page.held_hours:
        notes.append(say("when.held"))
    if page.table.has_means:
        key = "when.averages_masked" if page.masked_hours else "when.averages"
        notes.append(say(key, masked=masked, middle=fmt.number(page.mask_middle)))
    if page.second:
        notes.append(say("when.twice"))
    return (" ".join(notes),) if notes else ()


def _cell(cell: Cell, x: float, y: float, width: float, height: float) -> Markup:
    words = set(cell.style.split())
    step = next((int(w[1]) for w in sorted(words) if len(w) == 2 and w[0] == "b" and w[1].isdigit()), None)
    fill = WHITE if not step else RAMP_LIGHT[step - 1]
    dashes = "5 3" if "part" in words else "2 3" if "low" in words else None
    ink = WHITE if step == 5 else MUTED if words & {"cl", "hb"} else INK
    place = {"x": round(x, 1), "y": round(y, 1), "width": round(width, 1), "height": round(height, 1)}
    label = text(cell.text, x + width / 2, y + height / 2 + 5, size=14.5, fill=ink, anchor="middle")
    if "hatch" in words:
        return el("rect", fill="url(#hat)", stroke=RULE, **place)
    if words & {"cl", "nx"}:
        return label
    if dashes:
        return el("rect", fill=fill, stroke=ink, stroke_width=1.8, stroke_dasharray=dashes, **place) + label
    return el("rect", fill=fill, stroke=RULE if not step or "hb" in words else "none", **place) + label


def changed(page: Page, *, width: float) -> Drawing | None:
    """Draw each area's change with its interval and a zero line; None when nothing is compared."""
    report = page.report
    if not page.is_compared or report.previous is None:
        return None
    x_before, x_now, x_bar, x_words = 300.0, 390.0, 420.0, 420.0 + BAR_WIDTH + 24
    parts = [
        text(say("changed.area"), 0, 18, size=14, fill=MUTED, weight=700),
        text(
            say("changed.week", week=report.previous.number),
            x_before,
            18,
            size=14,
            fill=MUTED,
            weight=700,
            anchor="end",
        ),
        text(say("changed.week", week=report.week.number), x_now, 18, size=14, fill=MUTED, weight=700, anchor="end"),
        text(say("changed.in_words"), x_words, 18, size=14, fill=MUTED, weight=700),
        placed(page.axis, x=x_bar, y=5, width=BAR_WIDTH, height=16),
        _rule(28, width),
    ]
    y = 28.0
    for row in page.changes:
        y0, y = y, y + 58
        parts += _change(row, y0, x_before=x_before, x_now=x_now, x_bar=x_bar, x_words=x_words, width=width)
        parts.append(_rule(y, width))
    return Drawing(
        title=page.titles["changed"],
        unit=say("changed.sub", before=report.previous.number, confidence=fmt.percent(report.rules.confidence)),
        body=Markup("").join(parts),
        height=y,
        notes=(
            say("changed.read"),
            say("changed.against", week=report.week.number, before=report.previous.number),
        ),
    )


def _change(
    row: ChangeRow, y: float, *, x_before: float, x_now: float, x_bar: float, x_words: float, width: float
) -> list[Markup]:
    names = cut(row.name, width=x_before - 80, size=15, n_lines=2)
    first = y + (34 if len(names) == 1 else 25)
    bold = 700 if row.is_total else 400
    colour = {"good": FEWER, "bad": MORE}.get(row.direction, MUTED)
    parts = [text(n, 0, first + 20 * i, weight=700) for i, n in enumerate(names)]
    parts.append(text(row.previous, x_before, y + 34, anchor="end", weight=bold))
    parts.append(text(row.value, x_now, y + 34, anchor="end", weight=bold))
    parts.append(placed(row.bar, x=x_bar, y=y + 14, width=BAR_WIDTH, height=30))
    room = width - x_words
    [words] = cut(row.words, width=room, size=14) or [""]
    parts.append(text(words, x_words, y + 25, size=14, fill=colour, weight=700 if row.direction != "same" else 400))
    details = cut(row.detail, width=room, size=12.5, n_lines=2)
    parts += [text(d, x_words, y + 42 + 13 * i, size=12.5, fill=MUTED) for i, d in enumerate(details)]
    return parts


def data(page: Page, *, width: float) -> Drawing | None:
    """Draw what each camera recorded, day by day; None when the site has no camera."""
    report = page.report
    if not page.strips:
        return None
    left, week_w, row_h = 190.0, 76.0, 52.0
    slot = (width - left - week_w) / 7
    days = [d.day for d in page.strips[0].camera.days]
    parts = [text(say("data.camera"), 0, 16, size=14, fill=MUTED, weight=700), _rule(26, width)]
    for d, day in enumerate(days):
        label = f"{fmt.day_short(day)} {day.day}"
        parts.append(text(label, left + (d + 0.5) * slot, 16, size=14, fill=MUTED, weight=700, anchor="middle"))
    parts.append(text(say("data.week"), width, 16, size=14, fill=MUTED, weight=700, anchor="end"))
    y = 26.0
    for row in page.strips:
        [name] = cut(row.camera.name, width=left - 12, size=15) or [""]
        parts.append(text(name, 0, y + 31, weight=700))
        for d, (day_, drawing) in enumerate(zip(row.camera.days, row.strips, strict=True)):
            x = left + d * slot + 7
            parts.append(placed(drawing, x=x, y=y + 10, width=slot - 14, height=13))
            label = fmt.percent_short(day_.share) if day_.share is not None else say("when.cell_closed")
            parts.append(text(label, x + (slot - 14) / 2, y + 40, size=13, fill=MUTED, anchor="middle"))
        parts.append(text(fmt.percent_short(row.camera.share), width, y + 31, weight=700, anchor="end"))
        y += row_h
        parts.append(_rule(y, width))
    return Drawing(
        title=page.titles["data"],
        unit=say("data.sub_inferred" if report.coverage.is_inferred else "data.sub"),
        body=Markup("").join(parts),
        height=y,
        notes=(say("figure.strips"),),
    )


def weeks(page: Page, *, width: float) -> Drawing | None:
    """Draw the last weeks, how often and how risky, with what was logged; None with fewer than two figures."""
    view = page.trend
    if view is None or not view.panels:
        return None
    parts, y = [], 0.0
    height = width * HEIGHT / WIDE
    for panel in view.panels:
        for line in wrapped(panel.title, width=width, size=17):
            parts.append(text(line, 0, y + 18, size=17, weight=700))
            y += 23
        parts.append(text(panel.sub, 0, y + 14, size=14, fill=MUTED))
        parts.append(placed(panel.wide, x=0, y=y + 24, width=width, height=height))
        y += 24 + height + 18
    notes = [say("trend.read"), *([say("trend.read_gap")] if view.has_gaps else [])]
    marks = [say("figure.mark", letter=letter, at=at, text=words) for letter, at, words in view.marks]
    return Drawing(
        title=view.heading,
        unit=say("mail.span", week=page.report.week.number, first=page.span[0], last=page.span[1]),
        body=Markup("").join(parts),
        height=y - 18,
        notes=(" ".join(notes), *marks),
    )


def placed(drawing: Markup, *, x: float, y: float, width: float, height: float) -> Markup:
    """Return a small drawing of the page at a place, without classes: its colours are attributes already."""
    at = f'<svg x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" '
    return Markup(_CLASS.sub("", str(drawing)).replace("<svg ", at, 1))


def _rule(y: float, width: float) -> Markup:
    return el("path", d=f"M0 {y:.0f}h{width:.0f}", stroke=RULE, stroke_width=LINE, fill="none")
