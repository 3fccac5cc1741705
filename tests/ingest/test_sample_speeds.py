"""Speeds by which the look at a source's records sees a wrong unit: of each second, the first record in the file."""

from __future__ import annotations

import numpy as np
import pytest

from vsd_analytics.ingest.checks.sample import Sample, sample_of
from vsd_analytics.ingest.reading.adapter import RawBatch
from vsd_analytics.ingest.reading.raw import raw_table

TRACKS = [("a", "1", 1.0), ("a", "2", 2.0), ("b", "1", 4.0), ("b", None, 8.0)]
"""Camera, track, metres a second."""


def sample(rows: list[tuple[str, str | None, int, float]]) -> Sample:
    camera, track, ts_ms, x_m = zip(*rows, strict=True)
    columns = {"camera": list(camera), "track": list(track), "ts_ms": list(ts_ms), "x_m": list(x_m)}
    n = len(rows)
    table = raw_table(
        "observations", **columns, person=np.zeros(n, dtype=int), y_m=np.zeros(n), quality="metric", line=0
    )
    return sample_of([RawBatch({"observations": table})], is_whole=True)


def test_of_each_second_the_first_record_in_the_file_is_taken() -> None:
    rows = [
        ("a", "1", 400, 0.0),
        ("a", "1", 100, 5.0),
        ("a", "2", 200, 1.0),
        ("a", "1", 1500, 2.2),
        ("a", "1", 1100, 9.0),
    ]
    assert sample(rows).walked_m_s.tolist() == [pytest.approx(2.0)]


def test_each_camera_and_track_has_its_own_steps() -> None:
    rows = [(camera, track, 1000 * i, i * step) for i in range(3) for camera, track, step in TRACKS]
    assert sorted(sample(rows).walked_m_s.tolist()) == [1.0, 1.0, 2.0, 2.0, 4.0, 4.0]
    assert len(sample([("a", None, 0, 0.0), ("a", None, 1000, 1.0)]).walked_m_s) == 0
