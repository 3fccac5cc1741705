"""Pages, mails, tables and HTTP answers are renderings of the JSON file: made from it alone, they have the same bytes.

So the solver (`hidden_counts`) reads the JSON file, and no other rendering of a report needs a reader of its own.
"""

from __future__ import annotations

import re

import pytest
from privacy import test_leaks
from report import ingested_worlds as w

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.json_and_csv import figures_json, from_json, to_csv, to_json
from vsd_analytics.report.pages.mail import as_bytes, make_mail
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.week import render_html


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> WeekReport:
    config = w.toml(areas=test_leaks.PRAYER)
    site = w.world(tmp_path_factory.mktemp("renderings") / "shop", config, w.messages(test_leaks.few_by_day))
    found = week_report(site, w.MONDAY)
    assert any(area.is_masked for area in found.areas), "else nothing is hidden"
    return found


def mail(report: WeekReport) -> bytes:
    return as_bytes(make_mail(report, sender="site@example.org", to=["manager@example.org"]))


def test_the_page_the_mail_the_tables_and_the_answers_of_http_are_made_of_the_json_file_alone(
    report: WeekReport,
) -> None:
    read = from_json(to_json(report))
    for render in (mail, to_csv, figures_json, to_json):
        assert render(read) == render(report), render.__name__
    assert numbers(render_html(report)) <= numbers(render_html(read))


def numbers(page: str) -> set[str]:
    return set(re.findall(r"\d+(?:[.,]\d+)*", page))
