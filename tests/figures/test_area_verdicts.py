"""Areas are judged together on how often and on time too close; other changes are families of their own."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date, timedelta
from pathlib import Path

import pytest
from planted_changes import AREAS, planted, site_of

from vsd_analytics.figures import close_time, rates
from vsd_analytics.figures.area_verdicts import AreaChanges, area_changes
from vsd_analytics.figures.compare import compare
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.stats.family import judge_family

FIRST = date(2026, 8, 31)
WEEKS = 12
A, B = ((FIRST + timedelta(weeks=WEEKS + k), FIRST + timedelta(weeks=WEEKS + k, days=6)) for k in (0, 1))
LAST = 7 * (WEEKS + 1)
Changes = dict[str | None, AreaChanges]


def judged(
    root: Path, rate: Callable[[str, int], float], *, day_sd: float = 0.05, seed: int = 1
) -> tuple[Changes, ...]:
    """Return the changes of the areas as judged together, and each by itself."""
    with planted(site_of(root), first=FIRST, n_days=7 * (WEEKS + 2), rate=rate, day_sd=day_sd, seed=seed) as warehouse:
        data = FloorHours(warehouse, floor=warehouse.site.floors[0])
        pair = TwoPeriods(Period(data, *A), Period(data, *B))
        alone: Changes = {}
        for area in AREAS:
            near, place = close_time.close_time(pair.now, area), pair.now.area(area.area_id)
            alone[area.area_id] = AreaChanges(
                rates.violation_rate_change(pair, place),
                close_time.change_close_time_share(pair, near),
                rates.encounter_rate_change(pair, place),
                close_time.change_burden(pair, near),
            )
        return dict(area_changes(pair)), alone


def test_a_great_fall_of_one_area_is_clear_in_every_figure(tmp_path: Path) -> None:
    together, _ = judged(tmp_path, lambda area, d: 1.0 if area == "door" and d >= LAST else 4.0)
    door = together["door"]
    assert {c.verdict for c in (door.violation_rate, door.close, door.encounter_rate, door.burden)} == {"clear_fall"}
    others = [c for key, c in together.items() if key not in ("door", None)]
    assert {c.close.verdict for c in others} <= {"about_same", "cannot_tell"}


@pytest.mark.parametrize("seed", range(1, 5))
def test_ratios_and_intervals_stay_each_areas_own(tmp_path: Path, seed: int) -> None:
    together, alone = judged(tmp_path, lambda area, d: 3.0, seed=seed)
    for key, own in alone.items():
        found = together[key]
        for name in ("violation_rate", "close", "encounter_rate", "burden"):
            a, b = getattr(found, name), getattr(own, name)
            assert (a.value, a.lo, a.hi) == (b.value, b.lo, b.hi)


def test_the_claims_of_a_week_are_one_family_and_the_rest_are_their_own(tmp_path: Path) -> None:
    """What is clear by itself may not be among twelve, and the q-values are those of all of them."""
    rate = lambda area, d: 2.6 if area in ("door", "aisle") and d >= LAST else 4.0  # noqa: E731
    n_lost = 0
    for seed in range(6):
        root = tmp_path / str(seed)
        root.mkdir()
        with planted(site_of(root), first=FIRST, n_days=7 * (WEEKS + 2), rate=rate, day_sd=0.1, seed=seed) as warehouse:
            data = FloorHours(warehouse, floor=warehouse.site.floors[0])
            pair = TwoPeriods(Period(data, *A), Period(data, *B))
            found = area_changes(pair)
            floor = close_time.close_time(pair.now, data.floor)
            of_floor = {
                "violation_rate": rates.violation_rate_change(pair, pair.now.whole),
                "close": close_time.change_close_time_share(pair, floor),
                "encounter_rate": rates.encounter_rate_change(pair, pair.now.whole),
                "burden": close_time.change_burden(pair, floor),
            }
            places = [*AREAS, None]
            own = {
                "violation_rate": [rates.violation_rate_change(pair, pair.now.area(a and a.area_id)) for a in places],
                "close": [close_time.change_close_time_share(pair, close_time.close_time(pair.now, a)) for a in places],
                "encounter_rate": [rates.encounter_rate_change(pair, pair.now.area(a and a.area_id)) for a in places],
                "burden": [close_time.change_burden(pair, close_time.close_time(pair.now, a)) for a in places],
            }
        claims = judge_family([(of_floor[name], own[name]) for name in ("violation_rate", "close")])
        expected = {"violation_rate": claims[0], "close": claims[1]}
        expected |= {name: judge_family([(of_floor[name], own[name])])[0] for name in ("encounter_rate", "burden")}
        for name, verdicts in expected.items():
            assert [getattr(found[a and a.area_id], name).verdict for a in places] == [v.verdict for v in verdicts]
            n_lost += sum(
                c.verdict.startswith("clear") and v.verdict == "cannot_tell"
                for c, v in zip(own[name], verdicts, strict=True)
            )
    assert n_lost > 0, "some change is clear by itself and not in its family"


def test_an_areas_verdict_does_not_depend_on_the_areas_asked_for(tmp_path: Path) -> None:
    rate = lambda area, d: 2.6 if area in ("door", "aisle") and d >= LAST else 4.0  # noqa: E731
    with planted(site_of(tmp_path), first=FIRST, n_days=7 * (WEEKS + 2), rate=rate, day_sd=0.1) as warehouse:
        every = {p.area_id: p for p in compare(warehouse, A, B).places if p.kind == "area"}
        (_, door) = compare(warehouse, A, B, area_ids=("door",)).places
    assert door.close_time_share == every["door"].close_time_share
    assert door.burden == every["door"].burden
