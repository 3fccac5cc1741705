"""Others too close at once, room around people, and others met in a day: against a plain recount of every frame."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from warehouse.small_projects import DAY, HOUR, T0, Pair, Person, beats, make_site, open_days, put

from vsd_analytics.answer import Reason
from vsd_analytics.figures.neighbours import others_met, room_around, three_or_more
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.room_levels import LEVELS, level_of
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import Warehouse

FIRST, LAST = date(2026, 11, 9), date(2026, 11, 14)
DAYS = [T0 + k * DAY for k in range(6)]
SIDE_MM = 6000


def crowd(start: int, *, n_people: int, seconds: int, seed: int) -> list[Person]:
    """Return people who wander about a floor of 6 m by 6 m, all with ids of their own."""
    rng = np.random.default_rng(seed)
    xy = rng.integers(0, SIDE_MM, size=(n_people, 2))
    rows = []
    for s in range(seconds):
        xy = np.clip(xy + rng.integers(-400, 401, size=xy.shape), 0, SIDE_MM)
        rows += [Person(start + s * 1000, f"{seed}-{i}", int(x), int(y)) for i, (x, y) in enumerate(xy)]
    return rows


@pytest.fixture(scope="module")
def people() -> list[Person]:
    return [
        row
        for k, day in enumerate(DAYS)
        for row in crowd(day, n_people=6 + 3 * k, seconds=120, seed=k)  # ever more crowded
    ]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, people: list[Person]) -> Site:
    site = make_site(tmp_path_factory.mktemp("crowds"), min_exposure_h=0.1)
    put(site, [*people, *(beat for day in DAYS for beat in beats(day, day + HOUR))])
    return site


def period_of(warehouse: Warehouse) -> Period:
    return Period(FloorHours(warehouse, floor=warehouse.site.floors[0]), FIRST, LAST)


def frames_of(people: list[Person]) -> list[list[Person]]:
    frames = defaultdict(list)
    for row in people:
        frames[row.ts].append(row)
    return list(frames.values())


def others(row: Person, frame: list[Person], *, within_mm: int = 2000) -> list[str]:
    return [
        str(q.track)
        for q in frame
        if q is not row and (q.x - row.x) ** 2 + (q.y - row.y) ** 2 < within_mm**2  # type: ignore[operator]
    ]


def test_time_with_three_or_more_others_is_that_of_a_recount(site: Site, people: list[Person]) -> None:
    n = [len(others(row, frame)) for frame in frames_of(people) for row in frame]
    with open_days(site, "2026-11-09", "2026-11-14") as warehouse:
        found = three_or_more(period_of(warehouse))
    crowded = sum(k >= 3 for k in n)
    assert 0.2 < crowded / len(n) < 0.95
    assert found.value == pytest.approx(crowded / len(n), rel=1e-9)
    assert found.exposure_h == pytest.approx(len(n) / 3600, rel=1e-9)
    assert found.lo is not None
    assert found.hi is not None
    assert found.lo < crowded / len(n) < found.hi


def test_room_is_people_in_the_disc_over_its_area_and_levels_add_up(site: Site, people: list[Person]) -> None:
    limits = [0.0, 1 / 3.25, 1 / 2.32, 1 / 1.39, 1 / 0.93, 1 / 0.46, math.inf]  # Fruin's, in rounded metres
    time: Counter[str] = Counter()
    for frame in frames_of(people):
        for row in frame:
            density = (1 + len(others(row, frame))) / (math.pi * 2.0**2)
            time[LEVELS[sum(density > limit for limit in limits[1:])]] += 1
    with open_days(site, "2026-11-09", "2026-11-14") as warehouse:
        found = room_around(period_of(warehouse))
    assert {r.level: r.share.value for r in found} == pytest.approx(
        {level: time[level] / time.total() for level in LEVELS}, rel=1e-9, abs=1e-12
    )
    assert sum(r.share.value or 0 for r in found) == pytest.approx(1.0)
    assert len([level for level in LEVELS if time[level]]) >= 4
    assert [r.density_to for r in found][:-1] == pytest.approx(limits[1:-1], rel=0.01)
    assert found[-1].density_to is None


def test_a_limit_between_two_levels_belongs_to_the_roomier_one() -> None:
    edge = 1 / (35 * 0.3048**2)
    assert (level_of(edge * (1 - 1e-9)), level_of(edge * (1 + 1e-9))) == (0, 1)
    assert level_of(100.0) == 5


def test_a_disc_that_one_person_crowds_gives_no_room(tmp_path: Path) -> None:
    site = make_site(tmp_path, distance_m=1.0)
    put(site, [*crowd(T0, n_people=4, seconds=20, seed=1), *beats(T0, T0 + HOUR)])
    with open_days(site) as warehouse:
        found = room_around(period_of(warehouse))
    assert {r.share.state for r in found} == {"not_measurable"}
    assert {r.share.value for r in found} == {None}
    assert found[0].share.reason == Reason("room.small_disc", least=math.sqrt(35 * 0.3048**2 / math.pi))


def test_without_positions_there_is_no_share_of_time(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [Pair(T0 + s * 1000, "a", "b", 1500) for s in range(3600)])
    with open_days(site) as warehouse:
        period = period_of(warehouse)
        assert three_or_more(period).value is None
        assert three_or_more(period).state == "not_measurable"
        assert room_around(period)[0].share.state == "not_measurable"


def test_time_sealed_without_numbers_of_others_is_missing_not_zero(site: Site) -> None:
    with open_days(site, "2026-11-09", "2026-11-14", uses_days=False) as warehouse:
        warehouse.materialise("neighbour_hours")
        warehouse.con.execute("delete from neighbour_hours where local_date = date '2026-11-14'")
        period = period_of(warehouse)
        assert three_or_more(period).state == "not_measurable"
        assert {r.share.value for r in room_around(period)} == {None}


def test_others_met_are_different_people_of_the_day_however_often(site: Site, people: list[Person]) -> None:
    met: dict[str, set[str]] = {}
    for frame in frames_of(people):
        for row in frame:
            met.setdefault(str(row.track), set()).update(others(row, frame))
    numbers = [len(found) for found in met.values()]
    with open_days(site, "2026-11-09", "2026-11-14") as warehouse:
        rows = warehouse.rows("select track_id, n_met from met_days")
        found = others_met(warehouse, ["cam"], first=FIRST, last=LAST)
        nobody = others_met(warehouse, [], first=FIRST, last=LAST)
    assert {r["track_id"]: r["n_met"] for r in rows} == {track: len(of) for track, of in met.items()}
    assert [q.value for q in found.met.quantiles] == [
        np.quantile(numbers, q, method="inverted_cdf") for q in (0.5, 0.9)
    ]
    assert found.met.n == len(met)
    assert nobody.met.state == "not_enough_data"
    assert nobody.long_share.value is None


def test_a_quarter_of_an_hour_is_with_one_and_the_same_person_on_one_day(tmp_path: Path) -> None:
    """a is near b for 16 minutes in two parts; c is near d and e in turn, 8 minutes each; f is near g on two days."""
    site = make_site(tmp_path)

    def near(first: str, second: str, start: int, minutes: int, x: int) -> list[Person]:
        instants = range(start, start + minutes * 60_000, 1000)
        return [Person(ts, t, x + k * 1000, 0) for ts in instants for k, t in enumerate((first, second))]

    put(
        site,
        [
            *near("a", "b", T0, 8, 0),
            *near("a", "b", T0 + 30 * 60_000, 8, 0),
            *near("c", "d", T0, 8, 20_000),
            *near("c", "e", T0 + 10 * 60_000, 8, 20_000),
            *near("f", "g", T0, 8, 40_000),
            *near("f", "g", T0 + DAY, 8, 40_000),
        ],
    )
    with open_days(site, "2026-11-09", "2026-11-10") as warehouse:
        found = others_met(warehouse, ["cam"], first=FIRST, last=date(2026, 11, 10))
    assert (found.long_share.n, found.long_share.of) == (2, 9)  # a, b of a to g, and f, g of the second day
    assert found.long_share.value == pytest.approx(2 / 9)
