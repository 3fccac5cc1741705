"""Single figures: they stand by themselves, in literal colours, the same bytes each time, and give nothing away."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from PIL import Image
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.errors import ReportError, UsageError
from vsd_analytics.report.draw.svg import RAMP_LIGHT
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.single_figures import FIGURES, figure_svg, map_svg, to_png
from vsd_analytics.report.pages.week import make_page

SVG = "{http://www.w3.org/2000/svg}"
ALL = {**weeks.ALL, **sections.MORE}


def texts(svg: str) -> str:
    return " ".join(e.text or "" for e in ElementTree.fromstring(svg).iter(f"{SVG}text"))


def figure_or_why(report: WeekReport, name: str) -> str | ReportError:
    try:
        return figure_svg(report, name)
    except ReportError as error:
        return error


def drawn() -> list[tuple[str, str]]:
    return [(week, name) for week in ALL for name in FIGURES]


@pytest.mark.parametrize(("week", "name"), drawn())
def test_every_figure_of_every_week_is_complete_alone_or_says_why_not(week: str, name: str) -> None:
    report = ALL[week]()
    svg = figure_or_why(report, name)
    if isinstance(svg, ReportError):
        assert svg.code == "E522"
        assert svg.fix
        return
    root = ElementTree.fromstring(svg)
    assert not [e for e in root.iter() if e.tag.removeprefix(SVG) in {"script", "style", "foreignObject", "a"}]
    ids = {e.get("id") for e in root.iter()}
    for element in root.iter():
        assert element.get("class") is None, ElementTree.tostring(element)[:120]
        for key, value in element.attrib.items():
            bare = key.rpartition("}")[2]
            assert not bare.startswith("on")
            assert bare != "href" or value.startswith(("data:image/", "#"))
            assert set(re.findall(r"url\(#([^)]*)\)", value)) <= ids
    ground = root.find(f"{SVG}rect")
    assert ground is not None
    assert ground.get("fill") == "#fff"
    assert (ground.get("width"), ground.get("height")) == (root.get("width"), root.get("height"))
    page = make_page(report)
    said = re.sub(r"\s+", "", texts(svg) + " ".join(e.text or "" for e in root.iter(f"{SVG}title")))
    assert f"Week{report.week.number}" in said
    assert re.sub(r"\s+", "", page.distance) in said
    if name in page.titles:
        assert re.sub(r"\s+", "", page.titles[name]) in said


def test_the_normal_week_draws_them_all() -> None:
    for name in FIGURES:
        figure_svg(sections.MORE["complete"](), name)


def test_a_figure_nobody_knows_and_one_without_anything_to_draw() -> None:
    with pytest.raises(UsageError, match="no figure"):
        figure_svg(weeks.normal(), "who")
    with pytest.raises(ReportError) as caught:
        figure_svg(weeks.ALL["no_data"](), "where")
    assert caught.value.code == "E522"
    assert map_svg(weeks.ALL["no_data"]()) is None


def test_the_timetable_has_the_pages_numbers_and_no_other() -> None:
    report = weeks.normal()
    page = make_page(report)
    found = texts(figure_svg(report, "when"))
    cells = [c.text for row in page.table.rows for c in row.cells if c.text]
    assert "<5" in cells
    words = found.split()
    for text in cells:
        assert text in words, text
    numbers = [w for w in words if re.fullmatch(r"[\d,]+", w)]
    hidden = [c for c in report.when.cells if c.is_masked]
    assert hidden
    assert len(numbers) < 2 * len(cells)


def test_names_from_data_are_text() -> None:
    svg = figure_svg(weeks.hostile(), "changed")
    assert "<script" not in svg
    assert weeks.HOSTILE[0][:8] in texts(svg)


def test_the_png_is_the_drawing_on_white_and_the_same_each_time() -> None:
    svg = figure_svg(weeks.normal(), "when")
    data = to_png(svg, width_px=800)
    assert to_png(svg, width_px=800) == data
    with Image.open(io.BytesIO(data)) as image:
        pixels = image.convert("RGB")
    assert pixels.width == 800
    assert pixels.getpixel((1, 1)) == pixels.getpixel((798, pixels.height - 2)) == (255, 255, 255)
    seen = {colour for _, colour in pixels.getcolors(1 << 20) or []}
    used = {
        c.style[1] for row in make_page(weeks.normal()).table.rows for c in row.cells if re.match(r"b[1-5]", c.style)
    }
    for step in used:
        hexes = RAMP_LIGHT[int(step) - 1]
        assert tuple(int(hexes[i : i + 2], 16) for i in (1, 3, 5)) in seen, step


def test_heat_on_a_picture_lets_the_picture_through() -> None:
    report = weeks.ALL["always_open_picture"]()
    assert 'fill-opacity=".66"' in figure_svg(report, "where")
    assert 'fill-opacity=".66"' not in figure_svg(weeks.normal(), "where")


def test_the_mails_map_is_lettered_for_a_phone() -> None:
    bare = map_svg(weeks.normal())
    assert bare is not None
    sizes = {float(v) for v in re.findall(r'<text[^>]*font-size="([\d.]+)"', bare)}
    assert min(sizes) >= 20
    assert "Week" not in texts(bare)


def test_site_units_reach_the_figure() -> None:
    report = weeks.normal()
    feet = replace(report, rules=replace(report.rules, distance_m=1.8288, distance_unit="ft"))
    assert "6 ft" in texts(figure_svg(feet, "data"))
    assert "2 m" not in texts(figure_svg(feet, "data"))
