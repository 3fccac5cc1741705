"""The sentences over all floors, branch by branch."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta

import pytest
from forbidden_words import forbidden_in
from report import sample_weeks as weeks
from site_index import many_reports as many

from vsd_analytics.report.model import week as page_model
from vsd_analytics.report.pages.json_and_csv import to_json
from vsd_analytics.report.pages.story import finish
from vsd_analytics.site_index.floor_weeks import FloorWeeks, catalogue, standing
from vsd_analytics.site_index.read_reports import Entry, IndexedReport, read_report_json
from vsd_analytics.site_index.summary import headline, in_words, lead, week_line
from vsd_analytics.wording import terms


@pytest.fixture
def floors(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., tuple[FloorWeeks, ...]]:
    def made(*kinds: str, back: int = 0) -> tuple[FloorWeeks, ...]:
        """Return floors called A, B, ... of which each amounts to the kind given, some weeks before the last."""
        folder = tmp_path_factory.mktemp("floors")
        entries = []
        for k, kind in enumerate(kinds):
            name = chr(ord("A") + k)
            report = week(kind, address=(f"s{k // 2}", f"Site {k // 2 + 1}", name.lower(), f"Floor {name}"), back=back)
            if kind == "absent":
                report = week(
                    "same", address=(f"s{k // 2}", f"Site {k // 2 + 1}", name.lower(), f"Floor {name}"), back=9
                )
            entries.append(Entry(project="p", stem=report.week.iso, report=indexed(report, folder), links={}))
        return catalogue(entries).floors

    return made


def indexed(report: page_model.WeekReport, folder) -> IndexedReport:  # type: ignore[no-untyped-def]
    path = folder / f"{report.week.iso}.json"
    path.write_bytes(to_json(report))
    return read_report_json(path)


def week(kind: str, **more) -> page_model.WeekReport:  # type: ignore[no-untyped-def]
    match kind:
        case "fall":
            return many.report(value=121.3, change=-0.14, **more)
        case "rise":
            return many.report(value=121.3, change=0.2, **more)
        case "same" | "absent":
            return many.report(value=121.3, change=0.01, **more)
        case "little":
            return many.report(value=121.3, **more)
        case "none":
            return many.report(weeks.empty, **more)
        case _:
            return many.report(getattr(weeks, kind), **more)


@pytest.mark.parametrize(
    ("kinds", "expected"),
    [
        ("fall same same same", "One floor changed clearly; three did not"),
        ("fall rise same", "Two floors changed clearly; one did not"),
        ("rise same no_data", "One floor changed clearly; one did not; one cannot be compared"),
        ("fall too_incomplete", "One floor changed clearly; one cannot be compared"),
        ("fall rise", "Both floors changed clearly this week"),
        ("fall fall fall", "All three floors changed clearly this week"),
        ("same same", "No floor changed clearly this week"),
        ("same none", "No floor changed clearly this week"),
        ("same first_week little", "No floor changed clearly; two cannot be compared"),
        ("same settings_changed", "No floor changed clearly; one cannot be compared"),
        ("none none", "No violations were recorded on any floor"),
        ("first_week settings_changed", "No floor can be compared with the week before"),
        ("too_incomplete no_data", "No floor can be compared with the week before"),
        ("no_data no_data", "No floor has data for this week"),
        ("fall absent", "One floor changed clearly; one cannot be compared"),
        ("exposure_unknown same", "One floor changed clearly; one did not"),
    ],
)
def test_headline(floors: Callable[..., tuple[FloorWeeks, ...]], kinds: str, expected: str) -> None:
    said = headline(floors(*kinds.split()), many.LAST)
    assert said == expected
    assert terms.n_words(said) <= 15
    assert forbidden_in(said) == []


def test_one_floor_has_the_headline_of_its_report(floors: Callable[..., tuple[FloorWeeks, ...]]) -> None:
    (floor,) = floors("no_data")
    twin = floor.report(many.LAST)
    assert twin is not None
    assert headline((floor,), many.LAST) == twin.story.headline == "We have no data for week 46"


@pytest.mark.parametrize(
    ("kind", "found"),
    [
        *(("fall", "fall"), ("rise", "rise"), ("same", "same"), ("none", "none"), ("little", "not_compared")),
        *(("first_week", "not_compared"), ("settings_changed", "not_compared"), ("too_incomplete", "incomplete")),
        *(("no_data", "no_data"), ("not_over", "not_compared")),
    ],
)
def test_standing(floors: Callable[..., tuple[FloorWeeks, ...]], kind: str, found: str) -> None:
    assert standing(floors(kind)[0].report(many.LAST)) == found


def text(spans: tuple[page_model.Span, ...]) -> str:
    return "".join(s.text for s in spans)


def test_lead_names_what_changed_and_what_lacks_data(floors: Callable[..., tuple[FloorWeeks, ...]]) -> None:
    said = text(lead(floors("fall", "same", "no_data", "too_incomplete", "absent"), many.LAST))
    assert said == (
        "Five floors at three sites. Site 1, Floor A: 14% fewer violations in an open hour (likely between 10% and 18% "
        "fewer). No data from Site 2, Floor C. Too incomplete to compare: Site 2, Floor D. No report for this week: "
        "Site 3, Floor E."
    )
    assert forbidden_in(said) == []


def test_lead_counts_what_it_does_not_name(floors: Callable[..., tuple[FloorWeeks, ...]]) -> None:
    said = text(lead(floors(*["rise"] * 5, *["no_data"] * 5), many.LAST))
    assert said.count("20% more violations") == 3
    assert "Two more changed clearly." in said
    assert said.endswith("No data from Site 3, Floor F; Site 4, Floor G; Site 4, Floor H; and two more.")


@pytest.mark.parametrize("kind", ["fall", "same", "first_week", "too_incomplete", "no_data", "settings_changed"])
def test_one_floor_has_the_lead_of_its_report(floors: Callable[..., tuple[FloorWeeks, ...]], kind: str) -> None:
    story = finish(week(kind)).story
    assert story is not None
    assert text(lead(floors(kind), many.LAST)) == text(story.lead) != ""


@pytest.mark.parametrize(
    ("kinds", "expected"),
    [
        ("same same", "No clear change on any floor"),
        ("same first_week", "No clear change on any floor"),
        ("fall same", "Site 1, Floor A: clear fall, \u221214%"),
        ("same rise", "Site 1, Floor B: clear rise, +20%"),
        ("same no_data", "Site 1, Floor B: no data"),
        ("same too_incomplete", "Site 1, Floor B: 38% of open hours recorded"),
        ("none none", "No violations were recorded on any floor"),
        ("first_week first_week", "Nothing could be compared"),
        (
            "fall fall fall fall no_data",
            "Site 1, Floor A: clear fall, \u221214%; Site 1, Floor B: clear fall, \u221214%; "
            "Site 2, Floor C: clear fall, \u221214%; and two more",
        ),
    ],
)
def test_line_of_an_earlier_week(floors: Callable[..., tuple[FloorWeeks, ...]], kinds: str, expected: str) -> None:
    said = week_line(floors(*kinds.split(), back=2), many.LAST - timedelta(weeks=2))
    assert said == expected
    assert forbidden_in(said) == []


def test_a_week_nobody_reported_has_no_line(floors: Callable[..., tuple[FloorWeeks, ...]]) -> None:
    assert week_line(floors("same", "same"), many.LAST - timedelta(weeks=4)) == ""


def test_numbers_are_words_up_to_twelve() -> None:
    assert [in_words(n) for n in (0, 1, 12, 13, 1234)] == ["no", "one", "twelve", "13", "1,234"]
