"""Small rules of the page: what a plan hides, rows that say nothing, labels that stay on the map, names in order."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from report import model_classes as m
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.geometry.embedded_pictures import has_paper
from vsd_analytics.geometry.scale_bar import nice_metres
from vsd_analytics.report.draw.floor_plan import floor_map
from vsd_analytics.report.pages import figure_titles, tables
from vsd_analytics.report.pages import sections as pages
from vsd_analytics.report.pages.week import make_page, render_html
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.reasons import read_reason

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 960 640" width="96" height="64">{}</svg>'


@pytest.mark.parametrize(
    ("content", "is_paper"),
    [
        ('<rect width="960" height="640" fill="#fff"/><path d="M0 0"/>', True),
        ('<title>Plan</title><g><rect width="100%" height="100%"/></g>', True),
        ('<image width="960" height="640" href="data:image/png;base64,"/>', True),
        ('<rect width="960" height="640" fill="none" stroke="#000"/>', False),
        ('<rect width="300" height="640" fill="#fff"/>', False),
        ('<path d="M0 0H960V640H0z"/>', False),
        ("", False),
    ],
)
def test_only_a_plan_on_paper_is_multiplied_with_the_heat(tmp_path: Path, content: str, is_paper: bool) -> None:
    path = tmp_path / "plan.svg"
    path.write_text(SVG.format(content), encoding="utf-8")
    assert has_paper(path) is is_paper


def test_other_plans_are_made_transparent_and_have_no_paper(tmp_path: Path) -> None:
    assert not has_paper(tmp_path / "plan.png")


@pytest.mark.parametrize("width_m", [3, 8, 14, 24, 60, 140, 900])
def test_the_scale_bar_is_never_two_of_anything(width_m: float) -> None:
    length = nice_metres(width_m)
    assert f"{length:g}".strip("0.") in ("1", "5")
    assert width_m / 25 <= length <= width_m / 4


def test_hours_without_data_on_any_day_are_one_row() -> None:
    report = weeks.normal()
    cells = tuple(
        replace(c, state="no_data", violations=None, is_masked=False, scaled=None, share=0.0)
        if c.state != "closed" and 12 <= c.hour <= 15
        else c
        for c in report.when.cells
    )
    rows = make_page(replace(report, when=replace(report.when, cells=cells), story=None)).table.rows
    (blank,) = [r for r in rows if r.until]
    assert (blank.label, blank.until) == ("12", "15")
    assert {c.note for c in blank.cells} == {"no data"}
    assert [r.label for r in rows] == ["08", "09", "10", "11", "12", "16", "17", "18", "19", "20"]


def test_names_of_areas_outside_the_map_stay_off_it() -> None:
    areas = tuple(
        m.MapArea(area_id=name, name=name, ring=((x, 1.0), (x + 4, 1.0), (x + 4, 5.0), (x, 5.0)))
        for name, x in (("inside", 2.0), ("edge", -2.0), ("beyond", 30.0))
    )
    shown = m.FloorMap(kind="floor", title="Floor", extent=(0.0, 0.0, 12.0, 8.0), areas=areas, scale_bar_m=1.0)
    drawing = floor_map(shown, index=0, rules=m.Rules(distance_m=2.0), label="map")
    said = {name: float(x) for x, name in re.findall(r'<text[^>]* x="(-?\d+)"[^>]*>(\w+)</text>', drawing)}
    assert said.keys() <= {"inside", "edge"}
    assert min(said.values()) >= 0


def test_the_table_of_changes_names_the_greatest_change_first() -> None:
    report = weeks.normal()
    areas = tuple(
        replace(a, violation_rate=weeks.estimate(10.0, change))
        for a, change in zip(report.areas, (-0.2, -0.6), strict=False)
    )
    rest = m.AreaRow(area_id=None, name="Rest of the floor", violation_rate=weeks.estimate(50.0, -0.9))
    named = figure_titles.changed(replace(report, areas=(*areas, rest)))
    first, second = report.areas[1].name, report.areas[0].name
    assert named == f"The rest of the floor, {first} and {second} clearly changed"


def test_a_row_that_is_held_back_says_so() -> None:
    report = weeks.masked()
    held = Estimate(value=None, state="not_enough_data", verdict="too_little_data", reason=GIVES_AWAY)
    areas = (
        replace(report.areas[0], is_held_back=True, counted=None, share=None, violation_rate=held),
        *report.areas[1:],
    )
    page = render_html(replace(report, areas=areas, story=None))
    row = page.split('<table class="cmp"')[1].split("</tr>")[1]
    assert "Hidden" in row
    assert re.findall(r'<td role="cell" class="n"[^>]*>([^<]*)<', row) == ["–", "–"]
    assert "…: hidden" in page


def test_an_area_that_no_camera_recorded_says_so_and_not_that_few_were_counted() -> None:
    report = weeks.normal()
    few = Estimate(
        value=None,
        state="not_enough_data",
        verdict="too_little_data",
        reason=read_reason("fewer than 5 violations were counted in the week before"),
    )
    areas = (
        replace(report.areas[0], recorded_share=0.0, counted=None, share=None, violation_rate=few),
        *report.areas[1:],
    )
    row = render_html(replace(report, areas=areas, story=None)).split('<table class="cmp" role')[1].split("</tr>")[1]
    assert "nothing or too little was recorded" in row


@pytest.mark.parametrize(
    ("lo", "hi", "said"),
    [
        (-0.12, -0.004, "likely between under 1% and 12% fewer"),
        (-0.12, 0.0, "likely between 12% fewer and no change"),
        (-0.12, 0.3, "likely between 12% fewer and 30% more"),
        (-0.181, -0.179, "likely 18% fewer"),
        (-0.001, 0.001, "likely no change"),
    ],
)
def test_intervals_of_changes_in_words(lo: float, hi: float, said: str) -> None:
    assert fmt.likely_change(Estimate(value=1.0, change=(lo + hi) / 2, change_lo=lo, change_hi=hi)) == said


@pytest.mark.parametrize(
    ("text", "said"), [("Moved", "Moved."), ("Moved!", "Moved!"), (" Moved. ", "Moved."), ("", "")]
)
def test_log_entries_end_with_a_stop(text: str, said: str) -> None:
    assert fmt.ended(text) == said


def test_the_last_colour_of_the_timetable_says_how_far_it_goes() -> None:
    """200+ would hide whether the busiest hour has 210 or 1,363."""
    steps = (0.0, 50.0, 100.0, 150.0, 200.0)
    for highest, last in ((0.0, "200+"), (199.0, "200+"), (200.0, "200+"), (1363.0, "200\u20131,363")):
        texts = [step.text for step in tables.legend(steps, is_count=True, highest=highest)]
        assert texts == ["under 50", "50\u201399", "100\u2013149", "150\u2013199", last]
    report = weeks.normal()
    shown = max(c.violations for c in report.when.cells if c.violations is not None and c.state != "low_data")
    assert tables.highest_hour(report) >= shown


def test_two_weeks_have_no_chart() -> None:
    """A line between two dots looks like a trend; the table of weeks has the numbers."""
    report = sections.complete()
    assert report.trend is not None
    for n, n_charts in ((2, 0), (3, 2)):
        view = pages.trend(replace(report, trend=replace(report.trend, weeks=report.trend.weeks[-n:])))
        assert view is not None
        assert (len(view.panels), len(view.rows)) == (n_charts, n)
