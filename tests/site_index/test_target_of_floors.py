"""The target of a floor is named with its figure: on the page, in the mail, and in the index with a line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from report import model_classes as m
from report import sample_sections as sections
from site_index import many_reports as many

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.key_figures import tiles
from vsd_analytics.report.pages.mail import make_mail
from vsd_analytics.site_index.collect_reports import gather, sources_of
from vsd_analytics.site_index.floor_weeks import catalogue
from vsd_analytics.site_index.page import render_index


def with_target(position: str | None) -> WeekReport:
    report = sections.twelve_weeks()
    assert report.trend is not None
    target = None if position is None else m.Target(value=120, position=position)
    return replace(report, trend=replace(report.trend, target_violation_rate=target))


@pytest.mark.parametrize(
    ("position", "said"),
    [
        ("above", "Above the target of 120"),
        ("below", "Below the target of 120"),
        ("near", "Target: under 120; whether this week is, is not clear"),
        (None, ""),
    ],
)
def test_the_target_is_named_with_the_figure_everywhere(tmp_path: Path, position: str | None, said: str) -> None:
    report = with_target(position)
    many.write(tmp_path / "shop", report)
    index = render_index(catalogue(gather(sources_of([tmp_path / "shop"]), tmp_path).entries))
    body = make_mail(report).get_body(("plain",))
    assert body is not None
    texts = [tiles(report)[0].note, " ".join(body.get_content().split()), index]
    for text in texts:
        assert (said in text) if said else "arget" not in text.replace("target=", "")
    assert ('class="tt1"' in index) is (position is not None)
