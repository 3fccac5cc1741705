"""One definition of each rate: what the report says of a week, `vsd compare` says too."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from report import ingested_worlds as w

from vsd_analytics.answer import Answers, value_of
from vsd_analytics.figures.compare import compare, days_needed
from vsd_analytics.figures.compare_answers import compare_answers
from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate
from vsd_analytics.warehouse.warehouse import open_warehouse


def shown(level: RateEstimate, change: ChangeEstimate) -> dict[str, Any]:
    return {
        "value": level.value,
        "lo": level.lo,
        "hi": level.hi,
        "previous": change.rate_a,
        "change": change.change,
        "change_lo": change.change_lo,
        "change_hi": change.change_hi,
        "verdict": change.verdict.replace(" ", "_"),
    }


def test_report_and_compare_say_the_same(tmp_path: Path) -> None:
    def before(day: int, hour: int) -> Mapping[w.Place, int]:
        return {w.QUEUE: 20 + 3 * day, w.DOOR: 14 + day % 3}

    def now(day: int, hour: int) -> Mapping[w.Place, int]:
        return {w.QUEUE: 10 + 2 * day, w.DOOR: 13 + day % 4}

    lost = [(w.rome(2, 9), w.rome(2, 10))]
    streams = [
        w.messages(before, monday=w.BEFORE, hours=(9, 10)),
        w.messages(now, hours=(9, 10), lost=lost),
    ]
    site = w.world(tmp_path, w.toml(opening='{ mon-sun = "09:00-10:00" }'), *streams)
    report = w.report(site)
    assert report.state == "normal"
    a, b = ((m, m.fromordinal(m.toordinal() + 6)) for m in (w.BEFORE, w.MONDAY))
    with open_warehouse(site, *days_needed(site, a, b)) as warehouse:
        found = compare(warehouse, a, b)
        answers = Answers(compare_answers(found, site, rest="Rest", inputs=warehouse.inputs_digest))
    assert found.state == "ok"
    assert (found.a.coverage, found.b.coverage) == (1.0, pytest.approx(report.coverage.share))
    areas = {p.area_id: p for p in found.places if p.kind != "floor"}
    rows = [(report.level, found.places[0]), *((row, areas[row.area_id]) for row in report.areas)]
    assert len(rows) == 4
    for of_report, place in rows:
        pairs = (
            (of_report.violation_rate, shown(place.violation_rate_b, place.split.violation_rate)),
            (of_report.encounter_rate, shown(place.encounter_rate_b, place.split.encounter_rate)),
            *(
                [(of_report.close_time_share, shown(place.close_time_share_b, place.close_time_share))]
                if place.kind != "floor"
                else ()
            ),
        )
        for estimate, told in pairs:
            if estimate.change is not None:  # small counts are held back in the report alone
                assert {k: getattr(estimate, k) for k in told} == told
    told = answers["compared_places"].rows
    for of_report, row in [
        (report.level, told[0]),
        *((a, r) for a in report.areas for r in told[1:] if r["area_id"] == a.area_id),
    ]:
        level, change = (value_of(row, f"violations_per_open_h_{part}") for part in ("after", "change"))
        rate = of_report.violation_rate
        assert (rate.value, rate.lo, rate.hi) == (level.value, level.lo, level.hi)
        if rate.change is not None:
            assert (rate.change, rate.change_lo, rate.change_hi) == (change.value, change.lo, change.hi)
            assert rate.verdict == row["violations_per_open_h_verdict"]
    rest = next(row.close_time_share for row in report.areas if row.area_id is None)
    assert rest is not None
    compared = [
        row.close_time_share for row in report.areas if row.close_time_share and row.close_time_share.change is not None
    ]
    assert compared, "some area's time too close has a change"
    assert report.level.people.value == pytest.approx(found.places[0].split.people.rate_b)
    assert report.level.people.change == pytest.approx(found.places[0].split.people.change)
    assert report.level.violation_rate.verdict == "clear_fall"
