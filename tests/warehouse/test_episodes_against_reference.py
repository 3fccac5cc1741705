"""Episodes against a plain reference, for any split of the same records; and what must not change them."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from warehouse.small_projects import HOUR, T0, Pair, Person, at, beats, make_site, open_days, put

from vsd_analytics.site.model import Camera

Episode = tuple[str, str, int, int, int, float]
Around = dict[int, tuple[int, np.ndarray]]


def reference(people: list[Person], *, gap_ms: int = 3000, interval_ms: int = 1000) -> list[Episode]:
    """Return pair, first and last record, number of records and seconds of every episode, written for reading only."""
    frames: dict[int, list[Person]] = {}
    for p in people:
        frames.setdefault(p.ts, []).append(p)
    near: dict[tuple[str, str], dict[int, int]] = {}
    for ts in sorted(frames):
        for p, q in combinations(sorted(frames[ts], key=lambda r: str(r.track)), 2):
            mm = int(np.hypot(p.x - q.x, p.y - q.y))
            if mm < 2300:
                near.setdefault((str(p.track), str(q.track)), {})[ts] = mm

    def split(instants: list[int]) -> list[list[int]]:
        runs = [[instants[0]]]
        for ts in instants[1:]:
            runs += [[]] if ts - runs[-1][-1] > gap_ms else []
            runs[-1].append(ts)
        return runs

    # of people who did not part, the runs closer than 2 m
    episodes: list[tuple[str, str, list[list[int]]]] = []
    for (a, b), mm_at in near.items():
        for stretch in split(list(mm_at)):
            close = [ts for ts in stretch if mm_at[ts] < 2000]
            episodes += [(a, b, split(close))] if close else []

    every = sorted(frames)
    places = {(p.ts, str(p.track)): (p.x, p.y) for p in people}

    def around(a: str, b: str, ts: int, step: int) -> Around:
        """Return the frames that tell of a run's end at `ts`, counted outwards: how far off, where b is seen from a."""
        found = {}
        for number, n_intervals in ((0, 0), (1, 2), (2, 2.5), (-1, 2)):
            at = every.index(ts) + number * step
            frame = every[at] if 0 <= at < len(every) else ts
            is_near = abs(frame - ts) <= n_intervals * interval_ms and (frame == ts) == (number == 0)
            if is_near and {(frame, a), (frame, b)} <= places.keys():
                found[number] = abs(frame - ts), np.subtract(places[frame, a], places[frame, b])
        return found

    def more_ms(a: str, b: str, ts: int, step: int) -> float:
        """Return how much longer they were close beyond a record, on their way to the frame before or after."""
        near = around(a, b, ts, step)
        if 1 not in near or np.hypot(*near[1][1]) < 2000:
            return interval_ms / 2
        (_, r0), (step_ms, r1) = near[0], near[1]
        speed = (r1 - r0) / step_ms
        v0 = (r1 - near[-1][1]) / (step_ms + near[-1][0]) if -1 in near else speed
        v1 = (near[2][1] - r0) / near[2][0] if 2 in near else speed
        middle = (r0 + r1) / 2 + step_ms * (v0 - v1) / 8
        low, high = 0.0, 1.0
        for _ in range(60):
            share = (low + high) / 2
            r = r0 + 2 * share * (middle - r0) if share < 0.5 else middle + (2 * share - 1) * (r1 - middle)
            low, high = (share, high) if np.hypot(*r) < 2000 else (low, share)
        return float(round(step_ms * low))

    def lasted_s(a: str, b: str, run: list[int]) -> float:
        return (run[-1] - run[0] + more_ms(a, b, run[0], -1) + more_ms(a, b, run[-1], 1)) / 1000

    return sorted(
        (a, b, runs[0][0], runs[-1][-1], sum(map(len, runs)), round(sum(lasted_s(a, b, run) for run in runs), 3))
        for a, b, runs in episodes
    )


def walk(rng: np.random.Generator, *, start: int, seconds: int, n_people: int = 5, step_ms: int = 1000) -> list[Person]:
    """Return people who wander about a small floor and are missed now and then, two frames in a row at most."""
    people = []
    was_seen = np.ones((2, n_people), dtype=np.bool_)
    xy = rng.integers(-2_500, 2_500, size=(n_people, 2))
    for k in range(seconds * 1000 // step_ms):
        xy = np.clip(xy + rng.integers(-700, 701, size=xy.shape), -3_000, 3_000)
        seen = (rng.random(n_people) < 0.8) | ~was_seen.any(axis=0)
        was_seen = np.stack([was_seen[1], seen])
        people += [
            Person(start + k * step_ms, f"t{i}", int(xy[i, 0]), int(xy[i, 1])) for i in range(n_people) if seen[i]
        ]
    return people


def found_episodes(folder: Path, first: str, last: str) -> list[Episode]:
    with open_days(make_site(folder), first, last) as warehouse:
        rows = warehouse.rows("select * from episodes")
    assert [r["is_violation"] for r in rows] == [r["duration_s"] >= 3 for r in rows]
    return sorted(
        (r["track_a"], r["track_b"], r["started_ms"], r["ended_ms"], r["n_records"], r["duration_s"]) for r in rows
    )


@given(
    seed=st.integers(0, 2**32 - 1),
    start=st.sampled_from(["2026-11-09 10:58:30", "2026-11-09 23:58:10", "2026-11-10 00:00", "2026-11-09 22:59:59"]),
    n_files=st.integers(1, 4),
)
@settings(max_examples=3, deadline=None)
def test_episodes_equal_the_reference_however_records_are_split(seed: int, start: str, n_files: int) -> None:
    rng = np.random.default_rng(seed)
    people = walk(rng, start=at(start), seconds=240)
    files = rng.integers(0, n_files, size=len(people))
    with TemporaryDirectory() as folder:
        site = make_site(Path(folder))
        for number in range(n_files):
            put(site, [p for p, f in zip(people, files, strict=True) if f == number])
        expected = reference(people)
        assert len(expected) > 5
        assert found_episodes(Path(folder), "2026-11-09", "2026-11-10") == expected


def test_an_episode_over_midnight_belongs_to_the_day_it_started(tmp_path: Path) -> None:
    start = at("2026-11-09 23:59:57")
    site = make_site(tmp_path)
    put(site, [Person(start + k * 1000, t, x, 0) for k in range(6) for t, x in (("a", 0), ("b", 1000))])
    with open_days(site, "2026-11-09", "2026-11-10") as warehouse:
        both = warehouse.rows("select local_date, n_violations from hours where n_violations > 0")
    with open_days(site, "2026-11-10") as warehouse:
        second = warehouse.rows("select count(*) as n from violations")
    with open_days(site, "2026-11-09") as warehouse:
        first = warehouse.rows("select duration_s from violations")
    assert [(r["local_date"].isoformat(), r["n_violations"]) for r in both] == [("2026-11-09", 1)]
    assert second == [{"n": 0}]
    assert first == [{"duration_s": 6.0}]


def figures_of(folder: Path) -> list[dict[str, object]]:
    with open_days(make_site(folder), "2026-11-09", "2026-11-10") as warehouse:
        hours = warehouse.rows(
            "select hour_start_ms, violation_records, violation_s, n_violations from hours where violation_records > 0"
        )
        return hours + warehouse.rows("select track_a, track_b, started_ms, duration_s from violations")


def sent_pairs(people: list[Person], *, is_swapped: bool) -> list[Pair]:
    frames: dict[int, list[Person]] = {}
    for p in people:
        frames.setdefault(p.ts, []).append(p)
    pairs = []
    for ts, group in frames.items():
        for p, q in combinations(group, 2):
            mm = int(np.hypot(p.x - q.x, p.y - q.y))
            if mm <= 2500:
                a, b = (q, p) if is_swapped else (p, q)
                pairs.append(Pair(ts, a.track, b.track, mm, persons=(int(a.track[1:]), int(b.track[1:]))))
    return pairs


def test_swapping_the_persons_of_sent_pairs_changes_nothing(tmp_path: Path) -> None:
    people = walk(np.random.default_rng(1), start=T0, seconds=200)
    for folder, is_swapped in (("plain", False), ("swapped", True)):
        put(make_site(tmp_path / folder), sent_pairs(people, is_swapped=is_swapped))
    plain = figures_of(tmp_path / "plain")
    assert plain
    assert figures_of(tmp_path / "swapped") == plain


def test_delivering_twice_changes_nothing(tmp_path: Path) -> None:
    people = walk(np.random.default_rng(2), start=T0, seconds=200)
    put(make_site(tmp_path / "once"), people)
    put(make_site(tmp_path / "twice"), people)
    put(make_site(tmp_path / "twice"), people[::-1])
    once = figures_of(tmp_path / "once")
    assert once
    assert figures_of(tmp_path / "twice") == once


def test_an_empty_night_adds_recorded_time_and_nothing_else(tmp_path: Path) -> None:
    """With a heartbeat on both sides: the night changes coverage upward only."""
    people = walk(np.random.default_rng(3), start=T0, seconds=200)
    day = [*people, *beats(T0, T0 + 200_000)]
    night = beats(T0 + 12 * HOUR, T0 + 12 * HOUR + 600_000, every=1000)
    put(make_site(tmp_path / "day"), day)
    put(make_site(tmp_path / "night"), [*day, *night])
    assert figures_of(tmp_path / "night") == figures_of(tmp_path / "day")
    recorded = []
    for folder in ("day", "night"):
        with open_days(make_site(tmp_path / folder)) as warehouse:
            recorded.append(warehouse.rows("select sum(recorded_s) as s, sum(person_records) as n from hours")[0])
    assert recorded[1]["s"] == recorded[0]["s"] + 600
    assert recorded[1]["n"] == recorded[0]["n"]


def shoppers(rng: np.random.Generator, *, seconds: int, step_ms: int, n_people: int = 30) -> list[Person]:
    """Return people who walk between places and stay at each for 15 to 60 s, as in a shop."""
    places = rng.uniform(0, 20, size=(20, 2))
    xy, speed = rng.uniform(0, 20, size=(n_people, 2)), rng.uniform(0.8, 1.4, size=n_people)
    goal, stays = places[rng.integers(0, 20, n_people)] + rng.normal(0, 0.8, (n_people, 2)), np.zeros(n_people)
    people = []
    for k in range(seconds * 1000 // step_ms):
        away = goal - xy
        far = np.hypot(*away.T)
        step = np.minimum(speed * step_ms / 1000, far)
        xy = xy + away / np.maximum(far, 1e-9)[:, None] * step[:, None]
        stays = np.where(far < 1e-6, stays - step_ms / 1000, stays)
        leaving = (far < 1e-6) & (stays <= 0)
        n = int(leaving.sum())
        goal[leaving] = places[rng.integers(0, 20, n)] + rng.normal(0, 0.8, (n, 2))
        stays[leaving] = rng.uniform(15, 60, n)
        mm = np.rint(xy * 1000).astype(int)
        people += [Person(T0 + k * step_ms, f"t{i}", int(x), int(y)) for i, (x, y) in enumerate(mm)]
    return people


@pytest.mark.parametrize(("every_ms", "thinned_ms"), [(200, 400), (400, 800), (400, 1200), (1000, 2000)])
def test_thinning_the_frames_of_a_walk_hardly_changes_violations(
    tmp_path: Path, every_ms: int, thinned_ms: int
) -> None:
    """Violations (3 s and more) within 2 %, whether 3 s is a whole number of frames or not."""
    fine = shoppers(np.random.default_rng(4), seconds=1200, step_ms=200)
    counts = {}
    for ms in (every_ms, thinned_ms):
        site = make_site(tmp_path / str(ms), cameras=[Camera("cam", "Cam", "ground", hz=1000 / ms)])
        put(site, [p for p in fine if (p.ts - T0) % ms == 0])
        with open_days(site) as warehouse:
            counts[ms] = warehouse.rows("select count(*) as n from violations")[0]["n"]
    assert counts[every_ms] > 1000
    assert abs(counts[thinned_ms] / counts[every_ms] - 1) <= 0.02
