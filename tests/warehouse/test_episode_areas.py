"""An episode counts for the area with most of its person-time in violation: against a plain count over records."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from warehouse.small_projects import Person, at, beats, make_site, open_days, put
from warehouse.test_episodes_against_reference import reference, walk

from vsd_analytics.site.model import Area, Site

START = at("2026-11-09 10:57")
BOXES = {"middle": (-1000, -1000, 1500, 1500), "west": (-3500, -3500, -1000, 3500)}
"""Floor millimetres; their borders are borders of cells. What lies in neither is the rest of the floor."""


def site_of(root: Path) -> Site:
    areas = tuple(
        Area(name, name, "ground", tuple((x / 1000, y / 1000) for x, y in ((a, b), (c, b), (c, d), (a, d))))
        for name, (a, b, c, d) in BOXES.items()
    )
    return replace(make_site(root), areas=areas)


def area_of(x: float, y: float) -> str | None:
    return next((n for n, (a, b, c, d) in BOXES.items() if a <= x < c and b <= y < d), None)


def most_time(people: list[Person]) -> tuple[dict[tuple[str, str, int], str | None], int, int]:
    """Return the area of every episode, how many differ from that of the middle, and how many had equal times."""
    places = {(p.ts, str(p.track)): (int(p.x or 0), int(p.y or 0)) for p in people}
    instants = sorted({p.ts for p in people})
    lasts = dict(zip(instants, [*np.diff(instants).tolist(), 1000], strict=True))
    found: dict[tuple[str, str, int], str | None] = {}
    moved = equal = 0
    for a, b, first, last, n_records, _ in reference(people):
        near = [
            (ts, places[ts, a], places[ts, b])
            for ts in instants
            if first <= ts <= last
            and {(ts, a), (ts, b)} <= places.keys()
            and sum((p - q) ** 2 for p, q in zip(places[ts, a], places[ts, b], strict=True)) < 2000**2
        ]
        assert len(near) == n_records
        times: Counter[str | None] = Counter()
        for ts, *both in near:
            for place in both:
                times[area_of(*place)] += lasts[ts] if lasts[ts] <= 2000 else 1000
        middle = area_of(*(np.mean([p[k] + q[k] for _, p, q in near]) / 2 for k in (0, 1)))
        best = [area for area, time in times.items() if time == max(times.values())]
        equal += len(best) > 1
        named = sorted(area for area in best if area is not None)
        found[a, b, first] = middle if middle in best else named[0] if named else None
        moved += found[a, b, first] != middle
    return found, moved, equal


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_episode_counts_where_most_of_its_persons_time_is(tmp_path: Path, seed: int) -> None:
    """Over the turn of an hour, with frames in which one of the two was missed."""
    people = walk(np.random.default_rng(seed), start=START, seconds=360)
    expected, moved, equal = most_time(people)
    site = site_of(tmp_path)
    put(site, people)
    with open_days(site) as warehouse:
        rows = warehouse.rows("select * from episode_areas")
    assert {(r["track_a"], r["track_b"], r["started_ms"]): r["area_id"] for r in rows} == expected
    assert len(rows) == len(expected)
    assert moved > 0
    assert equal > 0


@pytest.mark.parametrize(
    ("places", "area", "share"),
    [
        # six seconds together in the west, four on the rest of the floor, where the middle of all lies
        ([((-2200, 2000), (-1200, 2000))] * 6 + [((2500, 2000), (3500, 2000))] * 4, "west", 0.6),
        # one on either side of a corner of the middle, which the point between them lies in
        ([((1700, 900), (900, 1700))] * 10, None, 1.0),
        # nothing of it lies in an area
        ([((2500, 2000), (3500, 2000))] * 10, None, None),
    ],
)
def test_an_episode_may_lie_elsewhere_than_its_middle(
    places: list[tuple[tuple[int, int], tuple[int, int]]], area: str | None, share: float | None, tmp_path: Path
) -> None:
    site = site_of(tmp_path)
    both = [zip("ab", of_frame, strict=True) for of_frame in places]
    people = [Person(START + 1000 * k, track, *xy) for k, pairs in enumerate(both) for track, xy in pairs]
    put(site, people)
    with open_days(site) as warehouse:
        assert warehouse.rows("select area_id, share from episode_areas") == [{"area_id": area, "share": share}]


def test_areas_and_the_rest_of_the_floor_add_up_to_the_floor(tmp_path: Path) -> None:
    people = walk(np.random.default_rng(4), start=START, seconds=360)
    site = site_of(tmp_path)
    put(site, [*people, *beats(START, START + 360_000)])
    with open_days(site) as warehouse:
        by_area = warehouse.rows("select area_id, sum(n_violations_open)::bigint as n from area_hours group by all")
        (floor,) = warehouse.rows("select sum(n_violations)::bigint as n from hours")
        of_violations = warehouse.rows("select area_id, count(*) as n from violations group by all")
    assert {r["area_id"] for r in by_area} == {*BOXES, None}
    assert sum(r["n"] for r in by_area) == floor["n"] > 20
    assert {(r["area_id"], r["n"]) for r in by_area} == {(r["area_id"], r["n"]) for r in of_violations}


def test_hours_sealed_without_cells_count_by_the_middle(tmp_path: Path) -> None:
    """As an older version sealed them."""
    site = site_of(tmp_path)
    # a stays west, b in the middle: equal times, and the middle of the two is in the middle
    put(site, [Person(START + k * 1000, t, x, 0) for k in range(10) for t, x in (("a", -1200), ("b", 400))])
    with open_days(site, uses_days=False) as warehouse:
        warehouse.materialise("episode_cells")
        assert warehouse.rows("select area_id, share from episode_areas") == [{"area_id": "middle", "share": 0.5}]
    with open_days(site, uses_days=False) as warehouse:
        warehouse.materialise("episode_cells")
        warehouse.con.execute("delete from episode_cells")
        assert warehouse.rows("select area_id, share from episode_areas") == [{"area_id": "middle", "share": None}]
