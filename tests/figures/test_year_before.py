"""The same week a year before: over the hours of both, with its gaps, other definitions, holidays and small counts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from report import ingested_worlds as w

from vsd_analytics.answer import Answer
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site.calendar import Calendar, Event
from vsd_analytics.site.model import Site

BEFORE = w.MONDAY - timedelta(weeks=52)


def weeks(then: int, now: int, **options: Any) -> Iterator[dict[str, Any]]:
    """Yield the frames of both weeks, with so many violations an hour."""
    yield from w.messages(w.steady({w.QUEUE: then}), monday=BEFORE, **options)
    yield from w.messages(w.steady({w.QUEUE: now}))


def site_of(folder: Path, *streams: Any, **settings: Any) -> Site:
    made = w.world(folder, w.toml(), *streams)
    return replace(made, settings=made.settings.with_values(settings))


def year(site: Site) -> Answer | None:
    return w.report(site).answers.get("year_before")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return a project with a week of 20 violations an hour, and one of 30 a year before."""
    return site_of(tmp_path_factory.mktemp("year") / "shop", weeks(30, 20))


def test_the_change_is_that_over_the_hours_of_both_weeks(site: Site) -> None:
    found = year(site)
    assert found is not None
    [row] = found.rows
    assert row["week_before"] == "2025-W46"
    assert row["violation_rate_before"].value == pytest.approx(30)
    assert row["violation_rate_change"].value == pytest.approx(20 / 30 - 1)
    assert row["violation_rate_change"].lo < row["violation_rate_change"].value < row["violation_rate_change"].hi + 1e-9
    assert row["people_change"].value is not None
    page = render_html(w.report(site))
    assert "Week 46, 2025, a year before: 30 violations per open hour; now −33%" in page
    assert "un anno prima: 30 violazioni per ora di apertura" in render_html(w.report(replace(site, language="it")))


def test_a_week_that_was_recorded_too_little_says_so(tmp_path: Path) -> None:
    site = site_of(tmp_path / "shop", weeks(30, 20, days=range(2)))
    found = year(site)
    assert found is not None
    value = found.rows[0]["violation_rate_before"]
    assert (value.value, value.reason.code) == (None, "compare.coverage")
    assert "Week 46, 2025, a year before, cannot be compared" in render_html(w.report(site))
    exact = year(replace(site, settings=site.settings.with_values({"mask_below": 0})))
    assert exact is not None
    assert [exact.rows[0][name].value for name in ("n_before", "n_now")] == [None, None], "not compared is not zero"


def test_a_week_of_another_engine_is_not_compared(tmp_path: Path) -> None:
    before = w.messages(w.steady({w.QUEUE: 30}), monday=BEFORE, engine="acme 0.9")
    found = year(site_of(tmp_path / "shop", before, w.messages(w.steady({w.QUEUE: 20}))))
    assert found is not None
    assert found.rows[0]["violation_rate_change"].reason.code == "compare.engine"


def test_without_a_year_there_is_no_answer_and_no_word(tmp_path: Path) -> None:
    site = site_of(tmp_path / "shop", w.messages(w.steady({w.QUEUE: 20})))
    assert year(site) is None
    assert "a year before" not in render_html(w.report(site))


def test_a_small_count_a_year_before_is_hidden(tmp_path: Path) -> None:
    few = w.messages(lambda day, hour: {w.QUEUE: 1 if (day, hour) == (0, 9) else 0}, monday=BEFORE)
    world = site_of(tmp_path / "shop", few, w.messages(w.steady({w.QUEUE: 20})))
    found, exact = year(world), year(replace(world, settings=world.settings.with_values({"mask_below": 0})))
    assert found is not None
    assert exact is not None
    assert found.rows[0]["violation_rate_before"].value is None
    assert exact.rows[0]["violation_rate_before"].value == pytest.approx(1 / 21)


def test_events_of_one_of_the_weeks_are_named(site: Site) -> None:
    event = Event("Fair <1>", date(2025, 11, 12), date(2025, 11, 13))
    with_event = replace(site, calendar=Calendar(None, None, events=(event,)))
    found = year(with_event)
    assert found is not None
    assert found.rows[0]["special_days"] == ("Fair <1>",)
    assert "In one of the two weeks only: Fair &lt;1&gt;" in render_html(w.report(with_event))
