"""Crossings of counting lines: an oracle person by person, hours apart as together, and only the lines' own facts."""

from __future__ import annotations

import math
import shutil
from collections import Counter
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from warehouse.small_projects import (
    HOUR,
    T0,
    Frame,
    Person,
    beats,
    build_hour_by_hour,
    fact_files,
    make_site,
    open_days,
    put,
)

from vsd_analytics.site.lines import Line
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.count_lines import part_rows

DOOR = Line("door", "Door", "ground", ((-1.0, 0.0), (1.0, 0.0)), "in", "out")
SLANT = Line("slant", "Slant", "ground", ((-2.0, 1.5), (2.5, -1.0)), "in", "out")
STEP = 500
MARGIN_MM = 250.0
HALF = ((-9.0, -9.0), (0.0, -9.0), (0.0, 9.0), (-9.0, 9.0))
OTHER_HALF = ((0.0, -9.0), (9.0, -9.0), (9.0, 9.0), (0.0, 9.0))


def site_of(root: Path, *lines: Line, cameras: list[Camera] | None = None) -> Site:
    return replace(make_site(root, cameras=cameras or [Camera("cam", "Cam", "ground", hz=2.0)]), lines=lines)


def oracle(path: list[tuple[int, int]], line: Line) -> tuple[int, int]:
    """Return how often one path crosses a line to its left and to its right: a walk with a memory of the last side."""
    (ax, ay), (bx, by) = ((1000 * x, 1000 * y) for x, y in line.points)
    length = math.hypot(bx - ax, by - ay)
    counts, last_side, net = {1: 0, -1: 0}, 0, 0
    before: tuple[float, float] | None = None
    for x, y in path:
        away = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / length
        along = ((bx - ax) * (x - ax) + (by - ay) * (y - ay)) / length
        if before is not None and (away >= 0) != (before[0] >= 0):
            share = before[0] / (before[0] - away)
            net += (1 if away >= 0 else -1) if 0 <= before[1] + share * (along - before[1]) < length else 0
        side = 1 if away >= MARGIN_MM else -1 if away <= -MARGIN_MM else 0
        if side:
            counts[side] += last_side not in (0, side) and net * side > 0
            last_side, net = side, 0
        before = away, along
    return counts[1], counts[-1]


def walk(rng: np.random.Generator, n: int) -> list[tuple[int, int]]:
    """Return a random walk near the lines, at most 0.9 m a step."""
    steps = rng.normal(0, 300, (n, 2)).clip(-600, 600)
    return [(int(x), int(y)) for x, y in (rng.uniform(-1500, 1500, 2) + np.cumsum(steps, axis=0)).round()]


def crossings(site: Site) -> Counter[tuple[str, str, bool]]:
    with open_days(site) as warehouse:
        rows = warehouse.rows("select line_id, track_id, is_to_left from line_crossings")
    return Counter((r["line_id"], r["track_id"], r["is_to_left"]) for r in rows)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=5, deadline=None)
def test_crossings_are_those_of_a_walk_along_each_path(tmp_path_factory: pytest.TempPathFactory, seed: int) -> None:
    rng = np.random.default_rng(seed)
    paths = {f"t{k}": walk(rng, 120) for k in range(12)}
    site = site_of(tmp_path_factory.mktemp("walks"), DOOR, SLANT)
    start = T0 + HOUR - 30_000  # over an hour's end
    put(site, [Person(start + i * STEP, t, x, y) for t, path in paths.items() for i, (x, y) in enumerate(path)])
    expected: Counter[tuple[str, str, bool]] = Counter()
    for line in (DOOR, SLANT):
        for track, path in paths.items():
            left, right = oracle(path, line)
            expected += Counter({(line.line_id, track, True): left, (line.line_id, track, False): right})
    assert expected.total() > 5
    assert crossings(site) == expected


def people_at_the_door(seed: int) -> list[Person]:
    """Return people around the end of an hour who stop at the door, are lost there, and have new ids."""
    rng = np.random.default_rng(seed)
    records = []
    for k in range(40):
        ts, y = T0 + HOUR + int(rng.integers(-500_000, 400_000)), -1500.0
        piece, x = 0, float(rng.uniform(-900, 900))
        while y < 1500:
            records.append(Person(ts, f"p{k}-{piece}", round(x), round(y)))
            stands = rng.random() < 0.05 and abs(y) < 400
            ts += int(rng.integers(1, 500)) * STEP if stands and rng.random() < 0.3 else STEP
            piece += rng.random() < 0.1
            y += 0 if stands else float(rng.normal(450, 250))
    return records


@pytest.mark.parametrize("seed", range(3))
def test_an_hour_has_the_crossings_that_it_has_beside_others(tmp_path: Path, seed: int) -> None:
    whole, apart = site_of(tmp_path / "whole", DOOR), site_of(tmp_path / "apart", DOOR)
    put(whole, [*people_at_the_door(seed), *beats(T0, T0 + 2 * HOUR, every=STEP)])
    shutil.copytree(whole.root / "store", apart.root / "store")
    build(whole)
    assert build_hour_by_hour(apart).n_built == 2
    assert fact_files(apart) == fact_files(whole)
    assert crossings(whole).total() > 20


def test_lost_boxes_and_new_ids_at_the_door_lose_nobody(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    records = [
        Person(T0 + k * 4000 + i * STEP, f"p{k}-{(i + k) // 5}", x_mm, -2000 + 300 * i)
        for k, x_mm in enumerate(rng.integers(-900, 900, 60).tolist())
        for i in range(16)
        if rng.random() > 0.07
    ]
    site = site_of(tmp_path, DOOR)
    put(site, [*records, *beats(T0, T0 + 300_000, every=STEP)])
    found = crossings(site)
    assert sum(n for (_, _, is_to_left), n in found.items() if is_to_left) == 60
    assert found.total() == 60


def test_a_crossing_in_two_views_is_counted_once(tmp_path: Path) -> None:
    cameras = [Camera("a", "A", "ground", hz=2.0, view=HALF), Camera("b", "B", "ground", hz=2.0, view=OTHER_HALF)]
    site = site_of(tmp_path, DOOR, cameras=cameras)
    records = [
        Person(T0 + k * 5000 + i * STEP, f"p{k}", x + shift, -1500 + 300 * i, camera)
        for k, x in enumerate(range(-800, 900, 100))
        for camera, shift in (("a", -120), ("b", 120))
        for i in range(11)
    ]
    put(site, records)
    assert crossings(site).total() == 17


def test_one_camera_counts_on_a_line_that_it_sees_all_of_and_others_share_it_by_place(tmp_path: Path) -> None:
    a, b = Camera("a", "A", "ground", view=HALF), Camera("b", "B", "ground", view=OTHER_HALF)
    wide = Camera("wide", "Wide", "ground", view=((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)))
    assert [row[4:] for row in part_rows(site_of(tmp_path, DOOR, cameras=[a, b]))] == [
        ("a", 0.0, 1000.0),
        ("b", 1000.0, 2000.0),
    ]
    assert [row[4:] for row in part_rows(site_of(tmp_path, DOOR, cameras=[a, b, wide]))] == [("wide", 0.0, 2000.0)]
    assert [row[4:] for row in part_rows(site_of(tmp_path, DOOR))] == [("cam", 0.0, 2000.0)]


def test_parts_begin_and_end_with_cameras_and_lines(tmp_path: Path) -> None:
    old = Camera("old", "Old", "ground", view=HALF, end_day=date(2026, 11, 9))
    new = Camera("new", "New", "ground", view=HALF, first_day=date(2026, 11, 9))
    line = replace(DOOR, first_day=date(2026, 11, 8), end_day=date(2026, 11, 10))
    rows = part_rows(site_of(tmp_path, line, cameras=[old, new]))
    day = 24 * HOUR
    assert [(row[4], row[1], row[2]) for row in rows] == [
        ("old", T0 - 32 * HOUR, T0 - 8 * HOUR),
        ("new", T0 - 8 * HOUR, T0 - 8 * HOUR + day),
    ]


def test_a_changed_line_makes_only_its_own_facts_stale(tmp_path: Path) -> None:
    site = site_of(tmp_path, DOOR)
    put(site, [*(Person(T0 + i * STEP, "a", 0, -1000 + 400 * i) for i in range(6)), *beats(T0, T0 + 9000)])
    build(site)
    assert build(site).n_built == 0
    moved = build(replace(site, lines=(replace(DOOR, points=((-1.0, 0.4), (1.0, 0.4))),)))
    assert dict(moved.reasons) == {"lines changed": 1}
    assert moved.facts == {"line_crossings": 1}
    renamed = build(replace(site, lines=(replace(DOOR, points=((-1.0, 0.4), (1.0, 0.4)), name="Gate", left="x"),)))
    assert renamed.n_built == 0


def test_a_line_that_begins_later_leaves_earlier_days_fresh(tmp_path: Path) -> None:
    site = site_of(tmp_path, DOOR)
    put(site, [Person(T0 + i * STEP, "a", 0, -1000 + 400 * i) for i in range(6)])
    put(site, [Frame(T0 + 48 * HOUR)])
    build(site)
    later = replace(site, lines=(DOOR, replace(SLANT, first_day=date(2026, 11, 11))))
    assert build(later).facts == {"line_crossings": 1}
