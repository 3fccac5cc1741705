"""What each area adds to the floor's change: rows that add up, the same numbers wherever they are."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from report import sample_weeks as weeks

from vsd_analytics.figures.week.model_map import ChangeMaps
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.contributions import MAX_PARTS, contributions
from vsd_analytics.report.pages.map_figures import map_figures
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.wording import format as fmt


def with_differences(*differences: float | None) -> WeekReport:
    report = weeks.normal()
    areas = tuple(replace(a, difference=d) for a, d in zip(report.areas, differences, strict=True))
    return replace(report, areas=areas)


def test_the_rows_lead_from_the_week_before_to_this_one() -> None:
    found = contributions(with_differences(2.0, -20.0, 0.5, -0.2, -2.0))
    assert found is not None
    first, *parts, last = found.rows
    assert (first.value, last.value) == ("141", "121")
    assert [p.value for p in parts] == ["−20", "+2", "−2", "0", "0"]
    assert found.title == "Where the change lies"
    assert found.is_clear


def unclear(report: WeekReport) -> WeekReport:
    """Return the week with no clear change anywhere: every range lies across zero."""
    vague = {"verdict": "cannot_tell", "change": -0.1, "change_lo": -0.3, "change_hi": 0.2, "reason": None}
    areas = tuple(replace(a, is_masked=False, violation_rate=replace(a.violation_rate, **vague)) for a in report.areas)
    level = replace(report.level, violation_rate=replace(report.level.violation_rate, **vague))
    return replace(report, areas=areas, level=level, story=None)


def test_a_difference_that_may_be_chance_is_folded_below_the_areas_and_a_clear_one_is_not() -> None:
    week = with_differences(2.0, -20.0, 0.5, -0.2, -2.0)
    clear, vague = render_html(week), render_html(unclear(week))
    assert "<summary>Where the difference lies</summary>" not in clear
    assert clear.index("Where the change lies</h3>") < clear.index('<caption class="vh">Change in violations')
    title = vague.index("Where the difference lies; it may be normal variation</h3>")
    fold = vague.index("<summary>Where the difference lies</summary>")
    assert vague.index("No area clearly changed") < fold < title < vague.index("</details>", fold)
    assert "A bar across zero may be normal variation." in vague


def test_where_no_area_clearly_changed_the_floor_alone_says_it_in_words() -> None:
    clear, vague = render_html(weeks.normal()), render_html(unclear(weeks.normal()))
    word = '<span class="word same">No clear change<small>'
    assert clear.count(word) > 1, "beside a clear change each area says that it is none"
    assert vague.count(word) == 1
    assert vague.count('<span class="word same">−30% to +20%<small></small>') == len(weeks.normal().areas)


@pytest.mark.parametrize("seed", range(40))
def test_the_printed_parts_add_up_to_the_printed_difference(seed: int) -> None:
    rng = np.random.default_rng(seed)
    report = weeks.normal()
    differences = rng.normal(0, 10 ** rng.uniform(-1.5, 1.5), len(report.areas))
    before = float(abs(differences).sum() * rng.uniform(1.01, 9))
    violation_rate = replace(report.level.violation_rate, previous=before, value=before + float(differences.sum()))
    report = replace(
        with_differences(*map(float, differences)), level=replace(report.level, violation_rate=violation_rate)
    )
    found = contributions(report)
    assert found is not None
    first, *parts, last = [float(row.value.replace(fmt.MINUS, "-").replace(",", "")) for row in found.rows]
    assert first + sum(parts) == pytest.approx(last, abs=1e-9)
    assert len({len(row.value.partition(".")[2]) for row in found.rows if row.value != "0"}) == 1
    unit = 10.0 ** -len(found.rows[0].value.partition(".")[2])
    true = {a.name: a.difference for a in report.areas}
    assert all(abs(printed - true[row.name]) < unit for printed, row in zip(parts, found.parts, strict=True))


def test_an_area_that_no_camera_recorded_is_named_without_a_number() -> None:
    report = with_differences(2.0, -20.0, 0.5, None, -2.0)
    silent = replace(report.areas[3], counted=None, is_masked=False, is_held_back=False)
    found = contributions(replace(report, areas=(*report.areas[:3], silent, report.areas[4])))
    assert found is not None
    assert (found.parts[-1].name, found.parts[-1].value, found.parts[-1].bar) == (silent.name, "–", "not recorded")


def test_the_rest_that_hides_what_neighbours_saw_of_an_unseen_area_takes_up_both() -> None:
    report = with_differences(2.0, -20.0, 0.5, None, None)
    silent = replace(report.areas[3], counted=None, is_masked=False, is_held_back=False)
    found = contributions(replace(report, areas=(*report.areas[:3], silent, report.areas[4])))
    assert found is not None
    assert [p.name for p in found.parts[-2:]] == [report.areas[4].name, silent.name]
    violation_rate = report.level.violation_rate
    total = round((violation_rate.previous or 0) * (1 + (violation_rate.change or 0))) - round(
        violation_rate.previous or 0
    )
    assert sum(int(p.value.replace(fmt.MINUS, "-")) for p in found.parts[:-1]) == total


def test_areas_too_small_to_print_share_a_row_that_makes_up_the_rest() -> None:
    report = with_differences(None, -20.0, 0.5, None, -2.0)
    small = tuple(replace(a, counted=None, is_masked=True) if a.difference is None else a for a in report.areas)
    found = contributions(replace(report, areas=small))
    assert found is not None
    violation_rate = report.level.violation_rate
    assert found.parts[-1].name == f"{small[0].name} and {small[3].name}, too small to print"
    total = round((violation_rate.previous or 0) * (1 + (violation_rate.change or 0))) - round(
        violation_rate.previous or 0
    )
    assert sum(int(p.value.replace(fmt.MINUS, "-")) for p in found.parts) == total


def test_a_difference_that_is_not_clear_may_be_normal_variation() -> None:
    report = with_differences(2.0, -20.0, 0.5, -0.2, -2.0)
    violation_rate = replace(report.level.violation_rate, verdict="cannot_tell")
    found = contributions(replace(report, level=replace(report.level, violation_rate=violation_rate)))
    assert found is not None
    assert "may be normal variation" in found.title


def test_one_hidden_part_hides_the_others_as_they_would_tell_it() -> None:
    report = with_differences(2.0, None, 0.5, -0.2, -2.0)
    small = replace(report.areas[1], counted=None, is_masked=True)
    assert contributions(replace(report, areas=(report.areas[0], small, *report.areas[2:]))) is None


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
    assert found.rows[-1].value == fmt.number((report.level.violation_rate.previous or 0.0) - 19.7 + 1.5)
    assert sum(int(p.value.replace(fmt.MINUS, "-")) for p in found.parts) == 123 - 141


def test_the_table_behind_the_maps_has_the_same_numbers() -> None:
    maps = ChangeMaps(before=(), now=(), fewer=(), more=(), steps=(1.0, 3.0), hours_compared=301.0, places=())
    report = replace(with_differences(2.0, -20.0, 0.5, -0.2, -2.0), change_maps=maps)
    found, figure = contributions(report), map_figures(report).change
    assert found is not None
    assert figure is not None
    assert dict(figure.rows) == {row.name: row.value for row in found.parts}


def test_the_plan_has_the_number_of_every_drawn_area() -> None:
    maps = ChangeMaps(before=(), now=(), fewer=(), more=(), steps=(1.0, 3.0), hours_compared=301.0, places=())
    report = replace(with_differences(2.0, -20.0, 0.5, -0.2, -2.0), change_maps=maps)
    found, figure = contributions(report), map_figures(report).change
    assert found is not None
    assert figure is not None
    drawn = re.findall(r'<text class="cn halo"[^>]*>([^<]+)</text>', figure.panels[2].drawing)
    places = {a.area_id for a in report.maps[0].areas}
    assert sorted(drawn) == sorted(p.value for p in found.parts if p.area_id in places)
    assert len(drawn) == 4
