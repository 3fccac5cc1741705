"""One figure of the page by itself, for a slide or a mail: SVG with literal colours, and PNG drawn from it.

Each figure carries what it needs away from the page: its finding as title, its unit, a legend, and a line that says
what it was made from. Colours are those of the light page. The PNG needs no browser, and its letters come from the font
that matplotlib brings, so that it looks the same on every machine.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Final

from markupsafe import Markup

from vsd_analytics.errors import ReportError, UsageError
from vsd_analytics.report.draw import single_charts
from vsd_analytics.report.draw.single_charts import Drawing, legend, text, wrapped
from vsd_analytics.report.draw.svg import INK, MUTED, WHITE, el, hatch_pattern
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.spoken import in_its_words
from vsd_analytics.report.pages.week import Page, make_page
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

WIDTH: Final = 1000
PAD: Final = 32
INNER: Final = WIDTH - 2 * PAD
FONTS: Final = "Arial, Helvetica, 'Liberation Sans', 'DejaVu Sans', sans-serif"
PNG_WIDTH_PX: Final = 2000
_LETTERS: Final = 28
_CLASS: Final = re.compile(r' class="([^"]*)"')
_VIEW: Final = re.compile(r'viewBox="[-\d.]+ [-\d.]+ ([\d.]+) ([\d.]+)"')
_HALO: Final = f' paint-order="stroke" stroke="{WHITE}" stroke-width="4" stroke-linejoin="round"'
_LITERAL: Final = {
    "halo": _HALO,
    "cmt": f' font-weight="600"{_HALO}',
    "cm": f' stroke="{WHITE}" stroke-width="2"',
    "paper": ' style="mix-blend-mode:multiply"',
}
_ON_PICTURE: Final = dict.fromkeys(
    ("c1", "c2", "c3", "c4", "c5"), ' fill-opacity=".66" stroke="#fff" stroke-width="1.4"'
)


@in_its_words
def figure_svg(report: WeekReport, name: str) -> str:
    """Return one figure as a complete SVG file.

    Args:
        report: The finished week.
        name: One of `FIGURES`.

    Raises:
        UsageError: E101, there is no figure of this name.
        ReportError: E522, the week has nothing to draw in it.
    """
    draw = FIGURES.get(name)
    if draw is None:
        raise UsageError(f"there is no figure {name!r}", fix=f"--figure {'|'.join(FIGURES)}")
    page = make_page(report)
    drawing = draw(page)
    if drawing is None:
        raise ReportError(
            f"week {report.week.number} has nothing to draw in the figure {name!r}",
            code="E522",
            why=page.why_not_compared if name == "changed" else "its section is not on the page either",
            fix=f"vsd report --week {report.week.iso} shows what the week has",
        )
    return _framed(page, drawing)


@in_its_words
def map_svg(report: WeekReport) -> str | None:
    """Return the first map of the week without a legend, lettered for a phone; None when the week has no map."""
    page = make_page(report)
    drawing = _map(page, index=0, is_bare=True)
    if drawing is None:
        return None
    return _svg(drawing.body, width=INNER, height=drawing.height, label=drawing.title, margin=4)


def to_png(svg: str, *, width_px: int = PNG_WIDTH_PX) -> bytes:
    """Return a drawing as PNG on white.

    Letters the font of `FONTS` does not have are taken from the machine's fonts.

    Args:
        svg: A drawing of this module.
        width_px: Width of the picture.
    """
    import matplotlib as mpl
    import resvg_py

    fonts = Path(mpl.get_data_path()) / "fonts" / "ttf"
    family = "DejaVu Sans"
    drawn = svg.replace(f'font-family="{FONTS}"', f'font-family="{family}"')
    return bytes(
        resvg_py.svg_to_bytes(
            svg_string=drawn,
            width=width_px,
            background="#ffffff",
            font_files=[str(fonts / "DejaVuSans.ttf"), str(fonts / "DejaVuSans-Bold.ttf")],
            font_family=family,
            sans_serif_family=family,
        )
    )


def literal(drawing: str) -> Markup:
    """Return a drawing of the page without classes: the page's style is written into attributes."""
    is_picture = 'class="map-pic"' in drawing
    known = _LITERAL | (_ON_PICTURE if is_picture else {})

    def said(match: re.Match[str]) -> str:
        return "".join(known.get(word, "") for word in match[1].split())

    return Markup(_CLASS.sub(said, str(drawing)))


def _framed(page: Page, drawing: Drawing) -> str:
    """Set title, unit and source around a drawing."""
    y, parts = 26.0, []
    for line in wrapped(drawing.title, width=INNER, size=25):
        y += 31
        parts.append(text(line, 0, y - 26, size=25, weight=700))
    for line in wrapped(drawing.unit, width=INNER, size=16):
        y += 23
        parts.append(text(line, 0, y - 25, size=16, fill=MUTED))
    top = y - 4
    parts.append(el("g", drawing.body, transform=f"translate(0 {top:.0f})"))
    y = top + drawing.height + 18
    for note in (*drawing.notes, _source(page)):
        for line in wrapped(note, width=INNER, size=13):
            y += 19
            parts.append(text(line, 0, y - 6, size=13, fill=MUTED))
        y += 5
    return _svg(Markup("").join(parts), width=INNER, height=y, label=f"{drawing.title}. {drawing.unit}", margin=PAD)


def _source(page: Page) -> str:
    report = page.report
    source = say(
        "figure.source",
        site=report.site.name,
        floor=report.site.floor_name,
        week=report.week.number,
        first=page.span[0],
        last=page.span[1],
        share=fmt.percent(report.coverage.share),
        distance=page.distance,
        time=fmt.seconds(report.rules.episode_min_s),
        version=report.provenance.version,
    )
    return say("figure.made_up", source=source) if report.provenance.is_made_up else source


def _svg(body: Markup, *, width: float, height: float, label: str, margin: float) -> str:
    whole_w, whole_h = width + 2 * margin, round(height + 2 * margin)
    defs = el("defs", hatch_pattern())
    ground = el("rect", fill=WHITE, width=whole_w, height=whole_h)
    inner = el("g", body, transform=f"translate({margin:g} {margin:g})")
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{whole_w:g}" height="{whole_h:g}" '
        f'viewBox="0 0 {whole_w:g} {whole_h:g}" role="img" aria-label="{escape(label)}" '
        f'font-family="{FONTS}" fill="{INK}">'
    )
    return f"{head}<title>{escape(label)}</title>{defs}{ground}{inner}</svg>\n"


def _where(page: Page) -> Drawing | None:
    drawn = [d for i in range(len(page.maps)) if (d := _map(page, index=i)) is not None]
    if not drawn:
        return None
    body, y = Markup(""), 0.0
    for i, each in enumerate(drawn):
        if len(drawn) > 1:
            y += 26
            body += text(page.maps[i].shown.title, 0, y - 6, size=16, weight=700)
        body += el("g", each.body, transform=f"translate(0 {y:.0f})")
        y += each.height + 14
    return Drawing(
        title=page.titles["where"],
        unit=say("where.sub", week=page.report.week.number),
        body=body,
        height=y - 14,
    )


def _map(page: Page, *, index: int, is_bare: bool = False) -> Drawing | None:
    if not page.maps:
        return None
    shown, drawing = page.maps[index].shown, page.maps[index].drawing
    size = _VIEW.search(drawing)
    if size is None:
        raise AssertionError("a map has a viewBox")
    height = min(INNER * float(size[2]) / float(size[1]), 1.2 * INNER)
    title = f"{page.titles['where']}. {say('where.sub', week=page.report.week.number)}"
    dotted = say("where.dotted", what=page.too_uncertain) if shown.uncertain else ""
    key = legend(page.heat_legend, page.not_recorded if shown.unseen else "", dotted)
    top = 0.0 if is_bare else key.height
    place = f'<svg y="{top:g}" width="{INNER}" height="{height:.0f}" '
    lettered = _large(str(drawing)) if is_bare else str(drawing)
    body = Markup(str(literal(lettered)).replace("<svg ", place, 1))
    return Drawing(title=title, unit="", body=body if is_bare else key.body + body, height=top + height)


def _large(drawing: str) -> str:
    """Return a map with the letters and marks of the page on a phone; names that do not fit then are left out."""
    drawing = re.sub(r'<text class="(?:pt halo x|pt x fn|cmt)".*?</text>', "", drawing)
    drawing = re.sub(r'(<text class="pt[^"]*"[^>]* font-size=")15"', rf'\g<1>{_LETTERS}"', drawing)
    drawing = re.sub(r'(<text class="mkt"[^>]* font-size=")19"', rf'\g<1>{_LETTERS}"', drawing)
    return re.sub(r'(<circle class="[^"]*\bmb"[^>]* r=")1[78]"', r'\g<1>25"', drawing)


FIGURES: Final[dict[str, Callable[[Page], Drawing | None]]] = {
    "where": _where,
    "when": lambda page: single_charts.when(page, width=INNER),
    "changed": lambda page: single_charts.changed(page, width=INNER),
    "weeks": lambda page: single_charts.weeks(page, width=INNER),
    "data": lambda page: single_charts.data(page, width=INNER),
}
