"""The target of a floor: a line in the chart of the weeks, and whether this week lies below it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from report import sample_sections as sections

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError
from vsd_analytics.figures.week.model_sections import Target
from vsd_analytics.figures.week.trend_weeks import _target
from vsd_analytics.report.draw.trend_chart import NARROW, WIDE, chart
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.week import render_html

CONFIG = """
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
[[floor]]
id = "ground"
name = "Ground floor"
target_per_open_h = {value}
[[camera]]
id = "cam-1"
name = "Entrance"
"""


def with_target(target: Target) -> WeekReport:
    report = sections.twelve_weeks()
    assert report.trend is not None
    return replace(report, trend=replace(report.trend, target_violation_rate=target))


def test_a_week_is_above_or_below_only_if_its_whole_interval_is() -> None:
    now = sections.twelve_weeks().level.violation_rate
    assert now.lo is not None
    assert now.hi is not None
    assert _target(now.lo - 1, now) == Target(value=now.lo - 1, position="above")
    assert _target(now.hi + 1, now) == Target(value=now.hi + 1, position="below")
    assert _target(now.value, now) == Target(value=now.value, position="near")


def test_without_an_interval_nothing_is_said_of_the_week() -> None:
    now = replace(sections.twelve_weeks().level.violation_rate, lo=None, hi=None)
    assert _target(120.0, now) == Target(value=120.0)
    assert _target(None, now) is None


@pytest.mark.parametrize(
    ("target", "sentence"),
    [
        (Target(value=1000.0, position="below"), "Dashed: the target, 1,000; this week is below it"),
        (Target(value=1.0, position="above"), "Dashed: the target, 1.0; this week is above it"),
        (
            Target(value=120.0, position="near"),
            "Dashed: the target, 120; its range does not say whether this week is below",
        ),
        (Target(value=120.0), "Violations per open hour. Dashed: the target, 120<"),
    ],
)
def test_the_page_says_where_the_week_lies(target: Target, sentence: str) -> None:
    assert sentence in render_html(with_target(target))


def test_without_a_target_there_is_no_line() -> None:
    assert "Dashed: the target" not in render_html(sections.twelve_weeks())


@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_the_axis_reaches_the_target_and_only_one_chart_has_it(width: int) -> None:
    trend = with_target(Target(value=1000.0, position="below")).trend
    assert trend is not None
    assert ">1,000</text>" in chart(trend, "violation_rate", width=width, label="")
    assert 'class="tt1"' not in chart(trend, "close", width=width, label="")


def test_the_target_is_read_from_its_floor_and_refused_when_it_is_no_rate(tmp_path: Path) -> None:
    path = tmp_path / "vsd.toml"
    path.write_text(CONFIG.format(value="120"), encoding="utf-8")
    assert load_site(tmp_path).floors[0].target_per_open_h == 120
    path.write_text(CONFIG.format(value="-3"), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_site(tmp_path)
    [problem] = caught.value.problems
    assert "target_per_open_h" in problem.what
