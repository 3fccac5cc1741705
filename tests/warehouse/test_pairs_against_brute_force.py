"""Derived pairs, person-time in violation and heatmaps, against numpy."""

from __future__ import annotations

from collections import Counter
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from warehouse.small_projects import HOUR, T0, Person, make_site, open_days, put

from vsd_analytics.figures import operator_counts
from vsd_analytics.site.model import Camera
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.build import build

CAMERAS = tuple(Camera(c, c, "ground", hz=1.0) for c in ("cam", "cam-2"))


def brute(people: list[Person], *, within_mm: int) -> Counter[tuple[str, int, tuple[int, int], tuple[int, int], int]]:
    """Return camera, instant, both positions (lesser first) and floored distance of every pair within a distance."""
    frames: dict[tuple[str, int], list[Person]] = {}
    for p in people:
        frames.setdefault((p.camera, p.ts), []).append(p)
    found: Counter[tuple[str, int, tuple[int, int], tuple[int, int], int]] = Counter()
    for (camera, ts), group in frames.items():
        for p, q in combinations(group, 2):
            square = (p.x - q.x) ** 2 + (p.y - q.y) ** 2
            if square <= within_mm**2:
                a, b = sorted([(p.x, p.y), (q.x, q.y)])
                found[camera, ts, a, b, int(np.floor(np.sqrt(np.float64(square))))] += 1
    return found


def stored(folder: Path) -> Counter[tuple[str, int, tuple[int, int], tuple[int, int], int]]:
    with open_days(make_site(folder, cameras=CAMERAS)) as warehouse:
        rows = warehouse.rows("select * from pairs")
    return Counter(
        (
            r["camera_id"],
            r["ts_ms"],
            *sorted([(r["x_a_mm"], r["y_a_mm"]), (r["x_b_mm"], r["y_b_mm"])]),
            r["distance_mm"],
        )
        for r in rows
    )


@st.composite
def crowds(draw: st.DrawFn) -> list[Person]:
    """Up to 60 people per camera and instant, on coarse grids so that distances of exactly 2 and 2.5 m are frequent."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    people: list[Person] = []
    for camera in ("cam", "cam-2"):
        for frame in range(draw(st.integers(1, 3))):
            n = draw(st.integers(0, 60))
            step = draw(st.sampled_from([1, 250, 500]))
            span = draw(st.sampled_from([3_000, 12_000]))
            xy = rng.integers(-span, span, size=(n, 2)) // step * step
            has_ids = draw(st.booleans())
            if not has_ids:  # without ids two records of one place are one record
                xy = np.unique(xy, axis=0)
            people += [
                Person(T0 + frame * 1000, f"t{i}" if has_ids else None, int(x), int(y), camera)
                for i, (x, y) in enumerate(xy)
            ]
    return people


@given(people=crowds())
@settings(max_examples=5, deadline=None)
def test_pairs_equal_brute_force(people: list[Person]) -> None:
    with TemporaryDirectory() as folder:
        put(make_site(Path(folder), cameras=CAMERAS), people)
        if people:
            assert stored(Path(folder)) == brute(people, within_mm=2500)


def test_a_thousand_people_in_one_frame_equal_brute_force(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    people = [
        Person(T0, f"t{i}", int(x), int(y)) for i, (x, y) in enumerate(rng.integers(-15_000, 15_000, size=(1000, 2)))
    ]
    put(make_site(tmp_path, cameras=CAMERAS), people)
    expected = brute(people, within_mm=2500)
    assert len(expected) > 8_000
    assert stored(tmp_path) == expected


def test_frames_of_40_and_41_people_are_measured_alike(tmp_path: Path) -> None:
    """At 40 people the way of comparing changes."""
    rng = np.random.default_rng(8)
    people = [
        Person(T0 + second * 1000, f"t{i}", int(x), int(y))
        for second, n in enumerate((39, 40, 41, 42))
        for i, (x, y) in enumerate(rng.integers(-4_000, 4_000, size=(n, 2)))
    ]
    put(make_site(tmp_path, cameras=CAMERAS), people)
    assert stored(tmp_path) == brute(people, within_mm=2500)


@pytest.mark.parametrize("has_ids", [True, False])
def test_violation_time_and_heatmaps_equal_brute_force(tmp_path: Path, has_ids: bool) -> None:
    rng = np.random.default_rng(9)
    people: list[Person] = []
    for second in range(50):
        xy = np.unique(rng.integers(-4_000, 4_000, size=(12, 2)), axis=0)
        people += [
            Person(T0 + second * 1000, f"t{i}" if has_ids else None, int(x), int(y)) for i, (x, y) in enumerate(xy)
        ]
    site = make_site(tmp_path)
    put(site, people)
    close = brute(people, within_mm=10_000)
    close = Counter({k: n for k, n in close.items() if k[4] < 2000})
    in_violation = {(ts, xy) for _, ts, a, b, _ in close for xy in (a, b)}
    with open_days(site, heat_cell_m=0.5) as warehouse:
        hour = warehouse.frame("select * from hours where person_records is not null").iloc[0]
        midpoints = operator_counts.heatmap(warehouse, at="midpoint")
        persons = operator_counts.heatmap(warehouse, at="person")
    assert hour["person_records"] == len(people)
    assert hour["exposure_s"] == len(people)
    assert hour["violation_records"] == sum(close.values()) > 100
    assert hour["violation_s"] == len(in_violation)
    expected = Counter(((a[0] + b[0]) // 1000, (a[1] + b[1]) // 1000) for _, _, a, b, _ in close.elements())
    assert {(r.cx, r.cy): r.records for r in midpoints.itertuples() if r.records} == expected
    standing = Counter((x // 500, y // 500) for _, (x, y) in in_violation)
    assert {(r.cx, r.cy): r.records for r in persons.itertuples() if r.records} == standing
    assert persons["exposure_s"].sum() == len(people)


def test_memory_stays_bounded_in_crowds(tmp_path: Path) -> None:
    """60 frames of 1,000 people: 30 million pairs if each is compared with each, some millions by squares."""
    import resource
    import sys

    unit = 1024**2 if sys.platform == "darwin" else 1024
    rng = np.random.default_rng(10)
    site = make_site(tmp_path)
    for second in range(60):
        put(
            site,
            [
                Person(T0 + second * 1000, f"t{i}", int(x), int(y))
                for i, (x, y) in enumerate(rng.integers(-25_000, 25_000, size=(1000, 2)))
            ],
            fold=False,
        )
    Store(site.root / "store", site_id=site.site_id).fold()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    build(site, first_hour=T0 // HOUR, last_hour=T0 // HOUR)
    grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / unit
    with open_days(site) as warehouse:
        n_pairs = warehouse.rows("select count(*) as n from pairs")[0]["n"]
    assert n_pairs > 200_000
    assert grown_mb < 400
