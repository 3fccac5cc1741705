"""An experiment is planned from the area's own weeks, stored with what it predicts, and scored after the change."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from planted_changes import AREAS, area, planted, site_of

from vsd_analytics.config.plans import FILE, Plan, add_plan, read_plans
from vsd_analytics.errors import InputError, UsageError
from vsd_analytics.figures.before_after import before_after
from vsd_analytics.figures.experiments import ExperimentPlan, plan_experiment, score, stored_plan

FIRST = date(2026, 8, 31)
PLAN = Plan(
    made=date(2026, 11, 22), area="queue", effect=-0.3, power=0.8, first=FIRST, last=date(2026, 11, 22),
    weeks_before=12, weeks_after=4, power_then=0.83, theta_lo=0.6, theta_hi=0.8, compared_with=("door", "aisle"),
)  # fmt: skip


def planned(root: Path, *, effect: float = -0.3, site: Any = None, weeks: int = 12, **options: Any) -> ExperimentPlan:
    with planted(site or site_of(root), **{"first": FIRST, "n_days": 7 * weeks, **options}) as warehouse:
        return plan_experiment(warehouse, "queue", effect=effect)


def log(root: Path, day: int, area_id: str = "queue") -> None:
    at = f"{FIRST + timedelta(days=day)}T07:00:00+00:00"
    (root / "log.jsonl").write_text(json.dumps({"at": at, "text": "moved it", "area": area_id}) + "\n")


def test_a_plan_says_how_many_weeks_and_which_areas_serve(tmp_path: Path) -> None:
    found = planned(tmp_path)
    assert (found.state, found.reason) == ("ok", None)
    assert found.variation is not None
    assert len(found.variation.log_ratios) == 12
    assert found.variation.sd**2 == pytest.approx(found.variation.sd_days**2 + found.variation.sd_weeks**2)
    way = found.choices[0]
    assert (way.weeks_before, way.weeks_to_wait) == (12, 0)
    assert way.weeks_after is not None
    assert way.weeks_after <= 3, "280 violations a week see 30 % soon"
    assert way.power >= 0.8
    assert {c.area_id for c in found.comparison} == {"door", "aisle", "fruit", "bakery", "back"}
    assert all(c.sd_apart is not None and c.correlation is not None for c in found.comparison)
    spreads = [c.sd_apart for c in found.comparison]
    assert spreads == sorted(spreads)
    json.dumps(asdict(found), default=str)


def test_a_smaller_effect_needs_longer(tmp_path: Path) -> None:
    large, small = (planned(tmp_path, effect=e).choices[0].weeks_after for e in (-0.4, -0.12))
    assert large is not None
    assert small is None or small > large


def test_an_area_that_shares_the_sites_ups_and_downs_serves_best(tmp_path: Path) -> None:
    wild = [1.0, 3.0, 0.5, 2.0, 0.3, 1.5, 4.0, 0.8, 2.5, 0.4, 1.2, 3.5]
    found = planned(tmp_path, rate=lambda a, d: wild[d // 7] if a == "fruit" else 1.0)
    assert found.comparison[-1].area_id == "fruit"


def test_near_and_changed_areas_do_not_serve(tmp_path: Path) -> None:
    log(tmp_path, 40, "door")
    found = planned(tmp_path, site=site_of(tmp_path, areas=(*AREAS[:4], area("near", 8.0))))
    left_out = dict(found.areas_left_out)
    assert left_out["near"].code == "logged_change.near"
    assert left_out["door"].code == "logged_change.changed_too"


def test_weeks_before_an_earlier_change_of_the_area_do_not_count(tmp_path: Path) -> None:
    log(tmp_path, 40)
    found = planned(tmp_path)
    assert found.variation is not None
    assert len(found.variation.log_ratios) == 6


def test_too_few_weeks_and_no_areas_have_their_reason(tmp_path: Path) -> None:
    few = planned(tmp_path, weeks=3)
    assert few.reason is not None
    assert few.reason.code == "logged_change.reference_weeks"
    calm = planned(tmp_path, rate=lambda area_id, day: float(area_id != "queue" or day >= 70))
    assert calm.reason is not None
    assert (calm.reason.code, calm.reason.values["has"]) == ("logged_change.counted_weeks", 2)
    alone = planned(tmp_path, site=site_of(tmp_path, areas=AREAS[:1]))
    assert alone.reason is not None
    assert alone.reason.code == "logged_change.no_comparison"
    assert stored_plan(few, made=FIRST) is None
    with (
        pytest.raises(UsageError, match="no area"),
        planted(site_of(tmp_path), first=FIRST, n_days=7) as warehouse,
    ):
        plan_experiment(warehouse, "cellar", effect=-0.3)


def test_plans_are_read_as_they_were_written_and_one_plan_is_stored_once(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    assert read_plans(site) == ()
    assert add_plan(site, PLAN)
    assert not add_plan(site, PLAN)
    other = replace(PLAN, effect=-0.15, weeks_after=None)
    assert add_plan(site, other)
    assert read_plans(site) == (PLAN, other)


def test_a_damaged_line_is_refused_with_its_number_and_nothing_is_lost(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    add_plan(site, PLAN)
    path = tmp_path / FILE
    before = path.read_bytes() + b'{"made": "yesterday"}\n'
    path.write_bytes(before)
    for call in (lambda: read_plans(site), lambda: add_plan(site, PLAN)):
        with pytest.raises(InputError, match=r"line 2 of plans\.jsonl"):
            call()
    assert path.read_bytes() == before


def test_a_plan_is_scored_by_the_running_verdict_of_the_change(tmp_path: Path) -> None:
    change = 12 * 7 + 1
    log(tmp_path, change)
    rate = lambda a, d: 0.7 if a == "queue" and d >= change else 1.0  # noqa: E731
    with planted(site_of(tmp_path), first=FIRST, n_days=change + 3 + 35, rate=rate) as warehouse:
        found = before_after(warehouse, 1)
    day = FIRST + timedelta(days=change)
    scored = score(found, (replace(PLAN, area="door"), PLAN), zone_day=day)
    assert scored is not None
    assert scored.plan == PLAN
    assert scored.theta == pytest.approx(0.7, rel=0.12)
    assert (scored.is_inside, scored.is_clear, scored.is_due, scored.n_weeks) == (True, True, True, 5)
    assert score(found, (replace(PLAN, made=day + timedelta(days=1)),), zone_day=day) is None, "made after the change"
