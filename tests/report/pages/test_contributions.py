"""What each area adds to the floor's change: rows that add up, the same numbers wherever they are."""

from __future__ import annotations

from dataclasses import replace

import pytest
from report import sample_weeks as weeks

from vsd_analytics.figures.week.model_map import ChangeMaps
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.contributions import MAX_PARTS, contributions
from vsd_analytics.report.pages.map_figures import map_figures
from vsd_analytics.report.words import format as fmt


def with_differences(*differences: float | None) -> WeekReport:
    report = weeks.normal()
    areas = tuple(replace(a, difference=d) for a, d in zip(report.areas, differences, strict=True))
    return replace(report, areas=areas)


def test_the_rows_lead_from_the_week_before_to_this_one() -> None:
    found = contributions(with_differences(2.0, -20.0, 0.5, -0.2, -2.0))
    assert found is not None
    first, *parts, last = found.rows
    assert (first.value, last.value) == ("141", "121")
    assert [p.value for p in parts] == ["−20", "+2.0", "−2.0", "+0.5", "−0.2"]
    assert found.title == "Where the change lies"


def test_a_difference_that_is_not_clear_may_be_normal_variation() -> None:
    report = with_differences(2.0, -20.0, 0.5, -0.2, -2.0)
    often = replace(report.level.often, verdict="cannot_tell")
    found = contributions(replace(report, level=replace(report.level, often=often)))
    assert found is not None
    assert "may be normal variation" in found.title


def test_a_hidden_part_hides_the_others_as_they_would_tell_it() -> None:
    assert contributions(with_differences(2.0, None, 0.5, -0.2, -2.0)) is None


@pytest.mark.parametrize("week", [weeks.first_week, weeks.no_data, weeks.empty, weeks.settings_changed])
def test_a_week_that_is_not_compared_has_none(week) -> None:  # type: ignore[no-untyped-def]
    assert contributions(week()) is None


def test_many_areas_share_their_last_row_and_still_add_up() -> None:
    report = with_differences(2.0, -20.0, 0.5, -0.2, -2.0)
    area = report.areas[0]
    more = tuple(replace(area, area_id=f"x{k}", name=f"Place {k}", difference=0.1 * k) for k in range(6))
    found = contributions(replace(report, areas=(*report.areas, *more)))
    assert found is not None
    assert len(found.rows) == MAX_PARTS + 2
    assert found.rows[-2].name == "Other areas"
    assert found.rows[-1].value == fmt.number((report.level.often.previous or 0.0) - 19.7 + 1.5)


def test_the_table_behind_the_maps_has_the_same_numbers() -> None:
    maps = ChangeMaps(before=(), now=(), fewer=(), more=(), steps=(1.0, 3.0), hours_compared=301.0, places=())
    report = replace(with_differences(2.0, -20.0, 0.5, -0.2, -2.0), change_maps=maps)
    found, figure = contributions(report), map_figures(report).change
    assert found is not None
    assert figure is not None
    assert dict(figure.rows) == {row.name: row.value for row in found.rows if not row.is_total}
