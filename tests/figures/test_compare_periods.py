"""Two periods side by side: equal days, equal hours, and a reason wherever nothing can be said."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from planted_changes import planted, site_of

from vsd_analytics.answer import Reason
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.comparable import pair_days
from vsd_analytics.figures.compare import Comparison, compare, days_needed
from vsd_analytics.site.model import Floor
from vsd_analytics.wording.reasons import reason_text

FIRST = date(2026, 11, 2)
A, B = (FIRST, FIRST + timedelta(days=6)), (FIRST + timedelta(days=7), FIRST + timedelta(days=13))
PLANTED = ("rate", "people", "recorded", "camera_of", "calibrations", "day_sd", "around")


def compared(root: Path, *, a: Any = A, b: Any = B, site: Any = None, n_days: int = 14, **options: Any) -> Comparison:
    made = {k: options.pop(k) for k in PLANTED if k in options}
    with planted(site or site_of(root), first=FIRST, n_days=n_days, **made) as warehouse:
        return compare(warehouse, a, b, **options)


def days(first: date, n: int) -> Sequence[date]:
    return [first + timedelta(days=i) for i in range(n)]


@given(st.dates(date(2026, 1, 1), date(2026, 12, 1)), st.integers(1, 40), st.integers(0, 60), st.integers(1, 40))
def test_days_are_paired_by_weekday_in_order_and_each_once(first: date, n: int, gap: int, m: int) -> None:
    before, now = days(first, n), days(first + timedelta(days=n + gap), m)
    pairs = pair_days(before, now)
    assert all(a.weekday() == b.weekday() for a, b in pairs)
    for k in (0, 1):
        one = [pair[k] for pair in pairs]
        assert len(set(one)) == len(one)
    for weekday in range(7):
        of = [[d for d in side if d.weekday() == weekday] for side in (before, now)]
        least = min(map(len, of))
        assert [p for p in pairs if p[1].weekday() == weekday] == list(zip(of[0][:least], of[1][:least], strict=True))


def test_more_people_at_equal_risk_is_reported_as_people(tmp_path: Path) -> None:
    found = compared(tmp_path, people=lambda area, d: 40.0 if d < 7 else 80.0, rate=lambda area, d: 2.0)
    assert found.state == "ok"
    whole = found.places[0]
    assert whole.kind == "floor"
    assert whole.split.violation_rate.verdict == "clear_rise"
    assert whole.split.people.value == pytest.approx(2.0, rel=0.1)
    assert whole.split.encounter_rate.verdict == "cannot_tell"
    assert whole.split.people_share == pytest.approx(1.0, abs=0.3)
    assert [p.kind for p in found.places] == ["floor", *["area"] * 6, "rest"]
    # each planted violation is 40 person-seconds, so time changes as violations do
    assert whole.burden.value == pytest.approx(whole.split.violation_rate.value)
    assert whole.close_time_share.value == pytest.approx(whole.split.encounter_rate.value)
    assert whole.encounter_rate_b.value is not None
    assert whole.close_time_share_b.value == pytest.approx(whole.encounter_rate_b.value * 40 / 3600)
    json.dumps(asdict(found), default=str)


def test_only_the_areas_asked_for(tmp_path: Path) -> None:
    found = compared(tmp_path, area_ids=("door", "queue"), rate=lambda a, d: 3.0 if a == "door" and d >= 7 else 1.0)
    assert [p.area_id for p in found.places] == [None, "door", "queue"]
    assert found.places[1].split.encounter_rate.value == pytest.approx(3.0, rel=0.15)
    assert found.places[2].split.encounter_rate.verdict == "cannot_tell"


def test_days_without_a_partner_are_named(tmp_path: Path) -> None:
    found = compared(tmp_path, n_days=17, b=(B[0], B[1] + timedelta(days=3)))
    assert found.n_pairs == 7
    assert found.days_left_out == tuple(days(B[1] + timedelta(days=1), 3))


def test_ranges_that_start_on_different_weekdays_are_matched(tmp_path: Path) -> None:
    later = (B[0] + timedelta(days=2), B[1] + timedelta(days=2))
    busy = {4, 5}
    found = compared(
        tmp_path,
        n_days=16,
        b=later,
        rate=lambda a, d: 5.0 if (FIRST + timedelta(days=d)).weekday() in busy else 1.0,
        day_sd=0.02,
    )
    assert found.n_pairs == 7
    change = found.places[0].split.violation_rate
    assert change.verdict == "cannot_tell", "without history nobody knows how weeks differ"
    assert change.hi is not None
    assert change.hi < 1.4, "a busy weekday is no noise"


@pytest.mark.parametrize("period", [0, 1])
def test_below_the_least_coverage_nothing_is_compared(tmp_path: Path, period: int) -> None:
    found = compared(tmp_path, recorded=lambda camera, d: 0.0 if d // 7 == period and d % 7 < 3 else 1.0)
    assert (found.state, found.places) == ("not_enough_data", ())
    assert found.reason is not None
    assert "recorded 57% of the open hours" in reason_text(found.reason)
    assert [round(p.coverage or 0, 2) for p in (found.a, found.b)].count(0.57) == 1


def test_hours_missing_in_one_period_are_not_taken_from_the_other(tmp_path: Path) -> None:
    found = compared(tmp_path, recorded=lambda camera, d: 0.0 if d in (2, 10) else 1.0, day_sd=0.02)
    assert found.state == "ok"
    assert found.hours_compared == 5.0
    change = found.places[0].split.violation_rate
    assert change.n_days == 5
    assert change.value == pytest.approx(1.0, abs=0.2)


def test_other_calibrations_are_refused(tmp_path: Path) -> None:
    used = [("cam", d, "aaaaaaaa" if d < 9 else "bbbbbbbb") for d in range(14)]
    found = compared(tmp_path, calibrations=used)
    assert (found.state, found.places) == ("not_measurable", ())
    assert found.reason is not None
    assert reason_text(found.reason).startswith("recalibrated between the periods: cam")


def test_a_recalibrated_camera_is_left_out_and_named(tmp_path: Path) -> None:
    used = [("cam-2", d, "aaaaaaaa" if d < 9 else "bbbbbbbb") for d in range(14)]
    found = compared(
        tmp_path,
        site=site_of(tmp_path, cameras=("cam", "cam-2")),
        calibrations=used,
        camera_of=lambda a: "cam-2" if a == "door" else "cam",
        rate=lambda a, d: 9.0 if a == "door" and d >= 7 else 1.0,
    )
    assert found.state == "ok"
    assert found.cameras_left_out == {"cam-2": Reason("compare.calibrated_on", day="2026-11-11")}
    assert found.places[0].split.violation_rate.verdict == "cannot_tell"


def test_periods_with_common_days_and_unknown_places_are_answered(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="days in common"):
        compared(tmp_path, b=(A[1], B[1]))
    with pytest.raises(UsageError, match="no area 'cellar'"):
        compared(tmp_path, area_ids=("cellar",))
    with pytest.raises(UsageError, match="which floor"):
        compared(tmp_path, floor_id="roof")
    site = site_of(tmp_path)
    object.__setattr__(site, "floors", (*site.floors, Floor("roof", "Roof")))
    with pytest.raises(UsageError, match="which floor"):
        compared(tmp_path, site=site)


def test_periods_may_come_in_either_order(tmp_path: Path) -> None:
    there, back = (compared(tmp_path, a=a, b=b, rate=lambda x, d: 1.0 + d / 7) for a, b in ((A, B), (B, A)))
    one, other = there.places[0].split.violation_rate.value, back.places[0].split.violation_rate.value
    assert one is not None
    assert other == pytest.approx(1 / one)


def test_history_before_both_periods_is_loaded(tmp_path: Path) -> None:
    assert days_needed(site_of(tmp_path), A, B) == (A[0] - timedelta(weeks=12), B[1])
