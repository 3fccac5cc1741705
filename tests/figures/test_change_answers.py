"""What a logged change did, as tables: what is known is given, what is not says why."""

from __future__ import annotations

from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import pytest
from report import ingested_worlds as w

from vsd_analytics.answer import Answer, Answers, Reason, value_of
from vsd_analytics.config.plans import Plan
from vsd_analytics.config.project import load_site
from vsd_analytics.figures.before_after import BeforeAfterFigure, EffectRoutes
from vsd_analytics.figures.change_answers import change_answers
from vsd_analytics.figures.experiments import PlanScore
from vsd_analytics.figures.plan_answers import plans_answer
from vsd_analytics.stats.before_after import BeforeAfter
from vsd_analytics.stats.running_verdict import RunningVerdict

PLAN = Plan(
    made=date(2026, 10, 1), area="queue", effect=-0.2, power=0.8, first=date(2026, 8, 3), last=date(2026, 9, 27),
    weeks_before=8, weeks_after=None, power_then=0.7, theta_lo=0.7, theta_hi=0.9, compared_with=("door",),
)  # fmt: skip


def burden(**options: Any) -> BeforeAfter:
    counts = {"n_before": 90.0, "n_after": 70.0, "exposure_before_h": 40.0, "exposure_after_h": 40.0}
    return BeforeAfter(
        0.8, 0.7, 0.9, 0.06, 19.0, 0.78, 0.98, **counts, days_before=20, days_after=20, n_areas=2,
        day_lo=0.72, day_hi=0.88, verdict="clear_fall", state="ok", **options,
    )  # fmt: skip


def change(**options: Any) -> BeforeAfterFigure:
    at = datetime(2026, 10, 12, 7, tzinfo=UTC)
    given = {"state": "ok", "reason": None, "design": "beside"} | options
    return BeforeAfterFigure(1, at, "moved the queue", "queue", "Queue", **given)


@pytest.fixture
def answers(tmp_path: Path) -> Any:
    (tmp_path / "vsd.toml").write_text(w.toml(), encoding="utf-8")
    site = load_site(tmp_path)

    def made(found: BeforeAfterFigure, scored: PlanScore | None = None) -> Answers:
        return Answers(change_answers(found, scored, site, inputs=""))

    return made


def test_each_range_behind_an_effect_is_of_that_effect_or_says_why_there_is_none(answers: Any) -> None:
    [row] = answers(change(burden=burden()))["change_effects"].rows
    by_day = value_of(row, "by_day")
    assert (by_day.value, by_day.lo, by_day.hi) == pytest.approx((-0.2, -0.28, -0.12))
    for name, code in (("by_placebo", "no_placebo"), ("by_week", "no_week"), ("shrunken_change", "not_shrunken")):
        missing = value_of(row, name)
        assert (missing.value, missing.reason) == (None, Reason(f"logged_change.{code}"))


def test_doubts_of_an_effect_are_notes(answers: Any) -> None:
    doubt = Reason("logged_change.other_change", day="2026-10-20")
    told = answers(change(burden=burden(), is_credible=False, doubts=(doubt,)))
    [row] = told["change_effects"].rows
    assert value_of(row, "effect_change").value == pytest.approx(-0.2)
    assert (None, Reason("logged_change.doubt", why=doubt)) in told["logged_change"].notes


def test_a_change_without_result_says_why_in_each_table(answers: Any) -> None:
    why = Reason("logged_change.week_after", days=6)
    told = answers(change(state="not_enough_data", reason=why, is_credible=False))
    without: list[Answer] = [
        told[name] for name in ("change_effects", "change_so_far", "change_parts", "change_places")
    ]
    assert {(answer.nothing, answer.state, len(answer.rows)) for answer in without} == {(why, "not_enough_data", 0)}
    assert told["logged_change"].rows[0]["is_credible"] is None


def test_where_no_effect_is_excluded_yet_the_running_verdict_says_so(answers: Any) -> None:
    so_far = RunningVerdict(0.9, None, None, 1.5, (1.5,), None, 6, 1, "cannot_tell", "ok", None)
    [row] = answers(change(burden=burden(), running=so_far))["change_so_far"].rows
    effect = value_of(row, "so_far_change")
    assert (effect.value, effect.lo, effect.reason) == (pytest.approx(-0.1), None, Reason("logged_change.any_effect"))
    assert row["so_far_verdict"] == "cannot_tell"


def test_parts_of_an_effect_add_up_to_it(answers: Any) -> None:
    told = answers(change(burden=burden(), routes=EffectRoutes(people=0.05, closeness=-0.25)))
    parts = [value_of(row, "part_change").value for row in told["change_parts"].where(whole="area")]
    assert sum(p for p in parts if p is not None) == pytest.approx(-0.2)


def test_a_plan_is_scored_beside_what_it_predicted(answers: Any) -> None:
    scored = PlanScore(PLAN, 0.85, is_inside=True, n_weeks=3, is_due=False, is_clear=False)
    [row] = answers(change(), scored)["plan_score"].rows
    planned, measured = value_of(row, "planned_change"), value_of(row, "measured_change")
    assert (planned.value, planned.lo, planned.hi) == pytest.approx((-0.2, -0.3, -0.1))
    assert measured.value == pytest.approx(-0.15)


def test_a_stored_plan_that_never_gets_clear_says_so(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text(w.toml(), encoding="utf-8")
    [row] = plans_answer([PLAN], load_site(tmp_path), today=date(2026, 10, 1)).rows
    assert value_of(row, "weeks_after").reason == Reason("logged_change.never_clear")
