"""A frame with more persons or pairs than a camera can see goes to quarantine as a whole, whatever way it comes."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.checks.crowds import Crowds
from vsd_analytics.ingest.intake.pipeline import IngestResult, ingest
from vsd_analytics.ingest.intake.replay import replay
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.ingest.reading.raw import raw_table
from vsd_analytics.live.batches import ReceivedMessage
from vsd_analytics.live.decode import Preparer
from vsd_analytics.settings import DEFAULTS

NOW = datetime(2026, 11, 10, tzinfo=UTC)
SITE = """
[site]
id = "hall"
name = "Hall"
timezone = "UTC"
[[floor]]
id = "ground"
name = "Ground"
[[camera]]
id = "cam"
name = "Camera"
[ingest]
persons_max = {persons_max}
pairs_max = {pairs_max}
"""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return configured(tmp_path)


def configured(root: Path, *, persons_max: int = 3, pairs_max: int = 2) -> Path:
    (root / "vsd.toml").write_text(SITE.format(persons_max=persons_max, pairs_max=pairs_max))
    return root


def message(second: int, n: int, *, n_pairs: int | None = None) -> bytes:
    told: dict[str, Any] = {"v": 1, "camera": "cam", "ts": f"2026-11-09T10:00:{second:02d}Z"}
    told["persons"] = [{"id": str(i), "x_m": float(i), "y_m": 0.0} for i in range(n)]
    if n_pairs is not None:
        told["pairs"] = [{"a": "0", "b": str(i + 1), "distance_m": 1.0} for i in range(n_pairs)]
    return json.dumps(told).encode()


def rows(ts_ms: int, *tracks: str) -> pa.Table:
    n = len(tracks)
    table = raw_table("observations", track=list(tracks), ts_ms=[ts_ms] * n, person=0, quality="metric", line=[1] * n)
    return table.append_column("camera_id", pa.array(["cam"] * n))


def read(root: Path, name: str, text: str | bytes, **options: Any) -> IngestResult:
    (root / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return ingest(load_site(root), [root / name], IngestOptions(**options), now=NOW)


def told(result: IngestResult) -> tuple[dict[str, int], dict[str, int]]:
    (source,) = result.sources
    assert source.error is None
    return dict(source.n_records), dict(source.n_rejected)


def test_a_crowded_message_is_one_entry_and_those_beside_it_are_stored(root: Path) -> None:
    lines = b"\n".join([message(0, 3), message(1, 4), message(2, 0)])
    assert told(read(root, "a.jsonl", lines)) == ({"observations": 3, "frames": 2}, {"too-many": 1})


def test_a_message_with_too_many_pairs_is_quarantined(root: Path) -> None:
    lines = b"\n".join([message(0, 3, n_pairs=2), message(1, 3, n_pairs=3)])
    assert told(read(root, "a.jsonl", lines)) == ({"observations": 3, "pairs": 2, "frames": 1}, {"too-many": 1})


def test_a_crowded_message_is_stored_by_a_replay_once_the_limit_is_raised(root: Path) -> None:
    read(root, "a.jsonl", message(1, 4))
    configured(root, persons_max=4)
    assert dict(replay(load_site(root), now=NOW).n_records) == {"observations": 4, "frames": 1}


def test_a_crowded_live_message_does_not_stop_the_others(root: Path) -> None:
    preparer = Preparer(load_site(root), now=NOW)
    payloads = [message(0, 3), message(1, 4), message(2, 1, n_pairs=3)]
    got = preparer.prepare(
        [ReceivedMessage("t", p, len(p)) for p in payloads], now=datetime(2026, 11, 9, 10, 1, tzinfo=UTC)
    )
    assert [r.reason for r in got.rejected] == ["too-many", "too-many"]
    assert {n: t.num_rows for n, t in got.tables.items()} == {"observations": 3, "frames": 1}


def test_a_crowded_frame_of_a_table_is_quarantined_with_all_its_rows(root: Path) -> None:
    rows = [f"2026-11-09T10:00:{s:02d}Z,t{i},{i}.0,0.0" for s, n in ((0, 3), (1, 5), (2, 1)) for i in range(n)]
    result = read(root, "a.csv", "\n".join(["ts,track_id,x_m,y_m", *rows, ""]))
    assert told(result) == ({"observations": 4}, {"too-many": 5})


def test_a_frame_cut_between_two_batches_is_counted_as_one() -> None:
    crowds = Crowds(persons_max=3, pairs_max=2)
    batches = [rows(0, "a", "b"), rows(1, "a", "b"), rows(1, "b", "c"), rows(1, "d", "e"), rows(2, "a")]
    found = [crowds.check("observations")[2](batch).to_pylist() for batch in batches]
    assert found == [[False] * 2, [False] * 2, [False] * 2, [True] * 2, [False]]


def test_rows_without_ids_are_distinguished_by_their_places(root: Path) -> None:
    rows = [f"2026-11-09T10:00:0{s}Z,{i % n}.0,0.0" for s, n in ((0, 3), (1, 4)) for i in range(8)]
    assert told(read(root, "a.csv", "\n".join(["ts,x_m,y_m", *rows, ""]))) == ({"observations": 8}, {"too-many": 8})


def test_second_sightings_in_one_sampling_period_are_no_crowd(root: Path) -> None:
    rows = [f"2026-11-09T10:00:00.{s}Z,t{i},{i}.{s},0.0" for s in range(9) for i in range(3)]
    result = read(root, "a.csv", "\n".join(["ts,track_id,x_m,y_m", *rows, ""]), period_s=1.0)
    assert told(result) == ({"observations": 27}, {})
    assert result.fold.tables["observations"].n_new == 3


def test_a_crowded_frame_of_a_table_of_pairs_is_quarantined(root: Path) -> None:
    rows = [f"2026-11-09T10:00:0{s}Z,t0,t{i + 1},1.0" for s, n in ((0, 2), (1, 3)) for i in range(n)]
    result = read(root, "a.csv", "\n".join(["ts,track_a,track_b,distance_m", *rows, ""]))
    assert told(result) == ({"pairs": 2}, {"too-many": 3})


def test_rows_of_a_crowded_frame_are_not_stored_one_by_one_by_a_replay(root: Path) -> None:
    rows = [f"2026-11-09T10:00:00Z,t{i},{i}.0,0.0" for i in range(5)]
    read(root, "a.csv", "\n".join(["ts,track_id,x_m,y_m", *rows, ""]))
    result = replay(load_site(root), now=NOW)
    assert not result.n_records
    assert dict(result.n_not_replayable) == {"too-many": 5}


def test_the_limits_are_far_above_the_most_crowded_recordings_and_below_what_failed() -> None:
    assert 4 * 246 <= DEFAULTS.persons_max < 2200
    assert DEFAULTS.pairs_max >= 246 * 245 / 2
