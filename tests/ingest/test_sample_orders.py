"""Frames, tracks and windows of a source's first records are those of a plain loop over the records."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from statistics import median

import numpy as np
import pytest
from walks import project

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.checks.check_case import Case
from vsd_analytics.ingest.checks.check_table import warnings_of
from vsd_analytics.ingest.checks.sample import LIFE_STEPS, Sample, sample_of
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch
from vsd_analytics.ingest.reading.raw import raw_table

Row = tuple[str, str | None, int, float, float]


def sample(rows: list[Row]) -> Sample:
    camera, track, ts_ms, x_m, y_m = (list(column) for column in zip(*rows, strict=True))
    columns = {"camera": camera, "track": track, "ts_ms": ts_ms, "x_m": x_m, "y_m": y_m}
    table = raw_table("observations", **columns, person=np.zeros(len(rows), dtype=int), quality="metric", line=0)
    return sample_of([RawBatch({"observations": table})], is_whole=True)


def random_rows(seed: int) -> list[Row]:
    random = np.random.default_rng(seed)
    track = [None, "1", "2", "3"]
    return [
        (
            "ab"[random.integers(2)],
            track[random.integers(4)],
            int(random.choice([0, 100, 200, 300, 90_000, 90_100])),
            float(random.integers(2)),
            float(random.choice([0.0, np.nan])),
        )
        for _ in range(40)
    ]


def whats(folder: Path, rows: list[Row]) -> str:
    case = Case(load_site(project(folder / "project")), IngestOptions(), sample(rows), None)
    return "; ".join(d.what for d in warnings_of(case))


@pytest.mark.parametrize("seed", range(20))
def test_frames_and_tracks_are_those_of_a_loop(seed: int) -> None:
    rows = random_rows(seed)
    frames = sorted({(r[0] != rows[0][0], r[2]) for r in rows})  # cameras in the order of the file
    ways = defaultdict(list)
    for camera, track, ts_ms, *_ in rows:
        if track is not None:
            ways[camera, track].append(ts_ms)
    steps_ms = [b - a for times in ways.values() for a, b in pairwise(sorted(times))]
    seen = sample(rows)
    assert seen.frame_no.tolist() == [frames.index((r[0] != rows[0][0], r[2])) for r in rows]
    assert seen.interval_s() == median(b[1] - a[1] for a, b in pairwise(frames) if a[0] == b[0]) / 1000
    lives = []
    for times in map(sorted, ways.values()):
        lives.append([times[0], times[0]])
        for before, after in pairwise(times):
            if after - before > LIFE_STEPS * median(steps_ms):
                lives.append([after, after])
            lives[-1][1] = after
    assert sorted(seen.lives_s()) == sorted((last - first) / 1000 for first, last in lives)
    assert seen.tracked.usual_ms == median(steps_ms)
    n_lives = len(ways) + sum(step > LIFE_STEPS * median(steps_ms) for step in steps_ms)
    assert seen.tracked.is_begun.sum() == n_lives


def test_the_interval_of_frames_is_within_one_camera() -> None:
    assert (
        sample([(c, None, ms, 0.0, 0.0) for c, ms in (("a", 0), ("b", 0), ("a", 100), ("b", 700))]).interval_s() == 0.4
    )


@pytest.mark.parametrize("seed", range(20))
def test_second_sightings_have_the_key_of_another_record_and_another_place(seed: int) -> None:
    rows = [(*r[:4], str(r[4])) for r in random_rows(seed) if r[1] is not None]  # NaN is the same place as NaN
    assert sample(random_rows(seed)).n_second == len(set(rows)) - len({r[:3] for r in rows}) > 0


@pytest.mark.parametrize("track", ["1", None])
def test_a_record_that_is_written_twice_is_one_person(tmp_path: Path, track: str | None) -> None:
    rows = [("a", track, 1000 * i, 0.2 * i, 1.0) for i in range(60)]
    assert "within 20 cm" not in whats(tmp_path, [*rows, *rows])


def test_people_in_one_place_are_seen_whatever_their_ids_are(tmp_path: Path) -> None:
    rows: list[Row] = [("a", track, 1000 * i, 0.2 * i, 1.0) for i in range(60) for track in ("1", "2")]
    assert "100% of the people would be within 20 cm" in whats(tmp_path, rows)


@pytest.mark.parametrize(("gap", "is_doubted"), [(0, True), (1, False)])
def test_numbers_of_a_frame_have_no_gap(tmp_path: Path, gap: int, is_doubted: bool) -> None:
    rows: list[Row] = [
        ("a", str(n if n == 0 else n + gap), 1000 * i, 3.0 * n, 0.1 * i) for i in range(40) for n in range(3 + i % 2)
    ]
    assert ("in nearly each frame the ids are 0, 1" in whats(tmp_path, rows)) is is_doubted
