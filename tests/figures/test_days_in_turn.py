"""Days with and without a change in turn: laid out by a seed, stored, and read once they are over."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from planted_changes import AREAS, planted, site_of

from vsd_analytics.config.plans import Plan, add_plan, read_plans
from vsd_analytics.errors import InputError, UsageError
from vsd_analytics.figures.switchback import (
    SwitchbackFigure,
    SwitchbackPlan,
    plan_switchback,
    stored_switchback,
    switchback,
    switchback_days,
)
from vsd_analytics.figures.switchback_answers import switchback_answer, switchback_plan_answers
from vsd_analytics.site.calendar import Calendar, Event
from vsd_analytics.site.model import Site

FIRST = date(2026, 8, 31)
START = FIRST + timedelta(weeks=12)


def planned(
    site: Site, *, weeks_known: int = 12, effect: float = -0.3, world: Any = None, **options: Any
) -> SwitchbackPlan:
    with planted(site, first=FIRST, n_days=7 * weeks_known, **(world or {})) as warehouse:
        return plan_switchback(warehouse, "queue", effect=effect, start=START, **options)


def stored(site: Site, **options: Any) -> Plan:
    made = stored_switchback(planned(site, **{"weeks": 4, **options}), made=START - timedelta(days=1))
    assert made is not None
    assert add_plan(site, made)
    return made


def read(site: Site, *, effect: float = 1.0, n_days: int = 28, **world: Any) -> SwitchbackFigure:
    """Return what the days of plan 1 show where the queue has `effect` on the days with the change."""
    in_turn = read_plans(site)[0].in_turn
    assert in_turn is not None
    is_with = {(day - START).days for day, _ in in_turn.pairs}
    rate = lambda a, d: effect if a == "queue" and d in is_with else 1.0  # noqa: E731
    with planted(site, first=START, n_days=n_days, **{"rate": rate, **world}) as warehouse:
        return switchback(warehouse, 1)


def codes(found: SwitchbackFigure) -> list[str]:
    return [caution.code for caution in found.cautions]


def test_each_weekday_of_two_weeks_has_one_day_with_and_one_without(tmp_path: Path) -> None:
    found = planned(site_of(tmp_path), weeks=8)
    assert found.state == "ok"
    assert found.in_turn is not None
    assert (found.weeks, len(found.in_turn.pairs)) == (8, 28)
    assert len({day for pair in found.in_turn.pairs for day in pair}) == 56
    for one, other in found.in_turn.pairs:
        assert abs(one - other) == timedelta(weeks=1)
        assert (min(one, other) - START).days // 7 % 2 == 0
    assert 5 < sum(one < other for one, other in found.in_turn.pairs) < 23, "coins, not one week and then the other"


def test_a_seed_gives_the_same_days_and_another_seed_others(tmp_path: Path) -> None:
    one, again, other = (planned(site_of(tmp_path), weeks=4, seed=seed) for seed in (1, 1, 2))
    assert one == again
    assert one.in_turn is not None
    assert other.in_turn is not None
    assert one.in_turn.pairs != other.in_turn.pairs
    assert one.foreseen == other.foreseen


def test_the_calendar_begins_on_a_monday_and_closed_days_and_their_partners_are_left_out(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    opening = (*site.opening[:6], ()) if site.opening else None
    closed = START + timedelta(days=9)  # the second Wednesday
    with planted(site, first=FIRST, n_days=84) as warehouse:
        warehouse.site = replace(site, opening=opening, closed=frozenset({closed}))
        found = plan_switchback(warehouse, "queue", effect=-0.3, start=START - timedelta(days=3), weeks=4)
    assert found.in_turn is not None
    days = {day for pair in found.in_turn.pairs for day in pair}
    assert min(days) == START
    assert len(days) == 4 * 6 - 2
    assert not {closed, closed - timedelta(weeks=1)} & days
    assert all(day.weekday() < 6 for day in days)


def test_the_fewest_weeks_with_the_power_are_taken_or_it_is_said_that_no_weeks_will_do(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    found = planned(site, effect=-0.12)
    assert found.weeks is not None
    assert found.weeks > 2
    assert found.foreseen is not None
    assert found.foreseen.power >= 0.8
    fewer = planned(site, effect=-0.12, weeks=found.weeks - 2)
    assert fewer.foreseen is not None
    assert fewer.foreseen.power < 0.8
    never = planned(site, effect=-0.02, weeks_max=4)
    assert never.reason is not None
    assert (never.state, never.reason.code, never.in_turn) == ("not_enough_data", "switchback.never", None)
    assert stored_switchback(never, made=START) is None


def test_too_few_weeks_odd_weeks_and_unknown_areas_are_refused(tmp_path: Path) -> None:
    few = planned(site_of(tmp_path), weeks_known=3)
    assert few.reason is not None
    assert few.reason.code == "logged_change.reference_weeks"
    for weeks in (3, 0, 28):
        with pytest.raises(UsageError, match="even number"):
            planned(site_of(tmp_path), weeks=weeks)


def test_a_planted_fall_is_found_and_none_where_nothing_changed(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    made = stored(site)
    assert read_plans(site) == (made,), "read as it was written"
    found = read(site, effect=0.6)
    assert found.effect is not None
    assert found.effect.value == pytest.approx(0.6, rel=0.15)
    assert (found.effect.verdict, found.effect.n_pairs, found.effect.is_exact) == ("clear_fall", 14, True)
    assert set(found.comparison) == {"door", "aisle", "fruit", "bakery", "back"}
    assert codes(found) == ["switchback.holds_if"]
    same = read(site)
    assert same.effect is not None
    assert same.effect.verdict in ("cannot_tell", "about_same")


def test_days_that_are_not_over_are_not_read(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    stored(site)
    found = read(site, effect=0.3, n_days=27)
    assert found.reason is not None
    assert (found.effect, found.reason.code) == (None, "switchback.running")


def test_a_day_that_was_not_recorded_leaves_with_its_partner(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    stored(site)
    found = read(site, effect=0.6, recorded=lambda camera, day: 0.0 if day in (2, 12) else 1.0)
    assert found.effect is not None
    assert found.effect.n_pairs == 12
    assert "switchback.not_recorded" in codes(found)
    few = read(site, recorded=lambda camera, day: 0.0 if day < 9 or day == 20 else 1.0)
    assert few.reason is not None
    assert (few.state, few.reason.code, few.reason.values["has"]) == ("not_enough_data", "switchback.few_days", 12)


def test_an_area_without_comparison_is_read_by_itself_and_says_so(tmp_path: Path) -> None:
    site = site_of(tmp_path, areas=AREAS[:1])
    stored(site)
    found = read(site, effect=0.5)
    assert found.effect is not None
    assert found.effect.verdict == "clear_fall"
    assert (found.comparison, "switchback.alone" in codes(found)) == ((), True)


def test_a_comparison_area_that_changed_meanwhile_is_left_out(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    stored(site)
    entry = {"at": f"{START + timedelta(days=5)}T07:00:00+00:00", "text": "moved it", "area": "door"}
    (tmp_path / "log.jsonl").write_text(json.dumps(entry) + "\n")
    assert "door" not in read(site).comparison


def test_events_and_other_changes_on_these_days_are_cautions(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    stored(site)
    entries = [
        {"at": f"{START + timedelta(days=3)}T07:00:00+00:00", "text": "new shelf", "area": "queue"},
        {"at": f"{START + timedelta(days=4)}T07:00:00+00:00", "text": "new hours"},
        {"at": f"{START - timedelta(days=4)}T07:00:00+00:00", "text": "before", "area": "queue"},
    ]
    (tmp_path / "log.jsonl").write_text("".join(json.dumps(e) + "\n" for e in entries))
    fair = Event("Fair", START + timedelta(days=1), START + timedelta(days=2))
    found = read(replace(site, calendar=Calendar(events=(fair,))))
    assert codes(found) == [
        "switchback.holds_if", "switchback.event", "logged_change.other_change", "logged_change.site_wide",
    ]  # fmt: skip


def test_days_without_a_violation_are_read_by_totals_and_say_so(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    stored(site)
    found = read(site, rate=lambda a, d: 0.0 if (a, d) == ("queue", 6) else 1.0)
    assert found.effect is not None
    assert found.effect.is_by_totals
    assert "switchback.by_totals" in codes(found)


def test_a_plan_for_good_has_no_days_in_turn_and_one_in_turn_is_not_scored_as_one_for_good(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    made = stored(site)
    add_plan(site, replace(made, in_turn=None))
    with pytest.raises(UsageError, match="plan 2 has no days in turn"):
        switchback_days(site, 2)
    with pytest.raises(UsageError, match="no plan 3"):
        switchback_days(site, 3)
    assert switchback_days(site, 1) == (START, START + timedelta(days=27))


def test_the_answers_hold_the_days_the_power_and_the_effect(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    found = planned(site, weeks=4)
    plan, weeks = switchback_plan_answers(found, site, days=(FIRST, START), inputs="")
    assert [row["week_first"] for row in weeks.rows] == [START + timedelta(weeks=k) for k in range(4)]
    assert sum(cell == "with" for row in weeks.rows for cell in row.values()) == 14
    assert "switchback.power" in [reason.code for _, reason in plan.notes]
    none, no_weeks = switchback_plan_answers(
        planned(site, effect=-0.02, weeks_max=4), site, days=(FIRST, START), inputs=""
    )
    assert none.value("power_then", area_id="queue").value is not None, "how far it is from enough"
    assert none.value("measured_then", area_id="queue").value is None
    assert no_weeks.nothing is not None
    stored(site)
    answer = switchback_answer(read(site, effect=0.6), site, inputs="")
    change = answer.value("in_turn_change", number=1)
    assert change.value is not None
    assert change.lo is not None
    assert change.hi is not None
    assert change.lo < change.value < change.hi < 0
    waiting = switchback_answer(read(site, n_days=20), site, inputs="")
    assert waiting.value("in_turn_change", number=1).reason is not None


@pytest.mark.parametrize(
    ("pairs", "why"),
    [
        ([], "no days in turn"),
        ([["2026-11-23", "2026-11-30"], ["2026-11-30", "2026-12-07"]], "twice"),
        ([["2026-11-23", "2026-11-24"]], "a week apart"),
    ],
)
def test_a_calendar_that_was_edited_by_hand_is_refused_with_its_line(
    tmp_path: Path, pairs: list[list[str]], why: str
) -> None:
    site = site_of(tmp_path, areas=AREAS)
    stored(site)
    file = site.root / "plans.jsonl"
    plan = json.loads(file.read_text())
    plan["in_turn"]["pairs"] = pairs
    file.write_text(json.dumps(plan) + "\n")
    with pytest.raises(InputError, match=r"line 1 of plans\.jsonl") as caught:
        switchback_days(site, 1)
    assert caught.value.code == "E110"
    assert why in str(caught.value.why)
