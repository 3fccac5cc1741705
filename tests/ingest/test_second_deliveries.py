"""A recording that comes again in another spelling is seen, and other recordings are not taken for it."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from ingest.prove_second_deliveries import NOW, again, beside_each_other, came, doubts, others, second_views
from ingest.spellings import SPELLINGS, hall, of_people, project, renamed, seen_twice, write
from store.stored_rows import NINE, person
from store.stored_rows import table as stored_table

from vsd_analytics.api.ingest_frame import ingest_frame
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import InputError
from vsd_analytics.ingest.intake import stored_recordings
from vsd_analytics.ingest.intake.recording import Recording
from vsd_analytics.store.segments import read_segment
from vsd_analytics.store.store import Store

Vsd = Callable[..., tuple[int, str]]


@pytest.fixture
def vsd(capsys: pytest.CaptureFixture[str]) -> Vsd:
    def call(root: Path, *words: object) -> tuple[int, str]:
        code = run(cli, ["-C", str(root), "--now", "2026-01-01T00:00Z", *map(str, words)])
        return code, "".join(capsys.readouterr())

    return call


def n_stored(root: Path) -> int:
    return sum(pq.read_metadata(path).num_rows for path in (root / "store" / "observations").rglob("*.parquet"))


def small() -> pd.DataFrame:
    return hall(7, minutes=6, n_people=14)


@pytest.mark.parametrize("name", SPELLINGS)
def test_every_spelling_is_seen(name: str) -> None:
    assert "W230" in again(small(), SPELLINGS[name])


@pytest.mark.parametrize("name", [n for n, _ in others() if n.startswith(("queue", "statue"))])
def test_other_recordings_are_not_taken_for_it(name: str) -> None:
    assert dict(others())[name]() == ""


def test_recordings_of_one_floor_at_the_same_times_are_not_taken_for_each_other() -> None:
    recordings = {f"{seed}": hall(seed, minutes=6, n_people=14) for seed in range(20, 24)}
    assert [said for _, said in beside_each_other(recordings)] == [""] * 4


def test_the_same_again_is_refused_and_the_fix_brings_it_in(tmp_path: Path, vsd: Vsd) -> None:
    root = project(tmp_path / "p", "a")
    one, two = write(small(), tmp_path / "one.csv"), write(renamed(small()), tmp_path / "two.csv")
    assert vsd(root, "ingest", one)[0] == 0
    assert "W230" in vsd(root, "check", two)[1]
    code, said = vsd(root, "ingest", two)
    assert (code, n_stored(root)) == (2, len(small())), said
    purge = re.findall(r"`vsd (purge --import .+?)`", said)[0]
    assert vsd(root, *purge.split())[0] == 0
    code, said = vsd(root, "ingest", two)
    assert (code, n_stored(root)) == (0, len(small())), said


def test_a_second_file_of_one_command_is_compared_with_the_first(tmp_path: Path, vsd: Vsd) -> None:
    root = project(tmp_path / "p", "a")
    files = [write(small(), tmp_path / "one.csv"), write(renamed(small()), tmp_path / "two.csv")]
    assert "W230" in vsd(root, "check", *files)[1]
    code, said = vsd(root, "ingest", *files)
    assert (code, "W230" in said, n_stored(root)) == (2, True, len(small()))


def test_the_same_file_again_and_a_file_that_has_grown_are_known_by_their_keys(tmp_path: Path, vsd: Vsd) -> None:
    root = project(tmp_path / "p", "a")
    part = small()[: len(small()) // 2]
    for frame in (part, part, small()):
        path = write(frame, tmp_path / "day.csv")
        assert "W230" not in vsd(root, "check", path)[1]
        code, said = vsd(root, "ingest", path)
        assert (code, "W230" in said) == (0, False), said
    assert n_stored(root) == len(small())


def test_of_a_file_that_overlaps_the_rest_is_stored_after_the_cut(tmp_path: Path, vsd: Vsd) -> None:
    root = project(tmp_path / "p", "a")
    overlap = SPELLINGS["overlap"]
    vsd(root, "ingest", write(overlap.stored(small()), tmp_path / "one.csv"))
    later = overlap.again(small())
    code, said = vsd(root, "ingest", write(later, tmp_path / "two.csv"))
    assert code == 2
    end = re.findall(r"from .{25} to (.{25}), are at the same places", said)[0]
    rest = later[pd.to_datetime(later["ms"], unit="ms", utc=True) > pd.Timestamp(end) + pd.Timedelta(seconds=1)]
    code, said = vsd(root, "ingest", write(rest, tmp_path / "rest.csv"))
    assert (code, n_stored(root)) == (0, len(overlap.stored(small())) + len(rest)), said


def two_views() -> pd.DataFrame:
    return pd.concat(seen_twice(small())).sort_values("ms", kind="stable")


def test_what_two_cameras_see_is_no_recording_that_comes_again_however_places_are_rounded() -> None:
    assert set(dict(second_views(small())).values()) == {"W231"}


@pytest.mark.parametrize("is_one_file", [True, False])
def test_two_cameras_of_one_floor_are_asked_for_their_views_and_the_lines_settle_it(
    is_one_file: bool, tmp_path: Path, vsd: Vsd
) -> None:
    root = project(tmp_path / "p", "a", "b")
    both = two_views()
    parts = [both] if is_one_file else [both[both["camera"] == camera] for camera in "ab"]
    files = [write(part, tmp_path / f"{i}.csv") for i, part in enumerate(parts)]
    for file in files[:-1]:
        assert vsd(root, "ingest", file)[0] == 0
    code, said = vsd(root, "ingest", files[-1])
    assert (code, "W231" in said, n_stored(root)) == (1, True, len(both)), said
    text = (root / "vsd.toml").read_text()
    lines = dict(re.findall(r'under \[\[camera\]\] id = "(\w)": (view = \[\[.+?\]\])', said))
    assert set(lines) == {"a", "b"}
    for camera, line in lines.items():
        text = text.replace(f'id = "{camera}"\n', f'id = "{camera}"\n{line}\n')
    (root / "vsd.toml").write_text(text)
    assert "W231" not in vsd(root, "check", files[-1])[1]
    code, said = vsd(root, "ingest", files[-1])
    assert (code, "W231" in said, n_stored(root)) == (0, False, len(both)), said


def test_segments_of_the_spool_are_opened_once_and_those_of_the_import_itself_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a file of many batches opens all of them again for each."""
    store, own, other = Store(tmp_path / "store", site_id="shop"), "0" * 15 + "1", "0" * 15 + "2"
    for k in range(6):
        rows = stored_table("observations", [person(NINE + k, f"t{k}", k)])
        store.append("observations", rows, import_id=own if k % 2 else other)
    opened = Counter[str]()

    def counted(path: Path, **options: Any) -> pa.Table:
        opened[path.name] += 1
        return read_segment(path, **options)

    monkeypatch.setattr(stored_recordings, "read_segment", counted)
    spool = stored_recordings.Spool(own)
    for _ in range(3):
        tables = list(spool.rows(store, "observations", NINE, NINE + 10))
        assert sorted(pa.concat_tables(tables)["track_id"].to_pylist()) == ["t0", "t2", "t4"]
        assert list(spool.rows(store, "observations", NINE + 10, NINE + 20)) == []
    assert sorted(opened.values()) == [1, 1, 1]


def test_what_finds_records_of_the_same_cameras_is_made_once() -> None:
    """Else each camera of a batch has all the records of the others sorted again."""
    camera = np.array([0, 1, 1, 2])
    places = np.arange(8.0).reshape(4, 2)
    recording = Recording(np.arange(4), places, camera, np.full(4, -1), np.zeros(4, dtype=np.int64), ("a", "b", "c"))
    some = recording.of_cameras(frozenset({1, 2, -2}))
    assert some.camera.tolist() == [1, 1, 2]
    assert some is recording.of_cameras(frozenset({2, 1}))
    assert some.near(side_m=0.5) is some.near(side_m=0.5)


@pytest.mark.parametrize("kind", ["pairs", "persons"])
def test_pairs_without_places_and_pixels_say_nothing_of_what_two_cameras_see(
    kind: str, tmp_path: Path, vsd: Vsd
) -> None:
    """Distances are alike in all cameras, and in two pictures people may come to the same side."""
    root, rng = project(tmp_path / "p", "a", "b"), np.random.default_rng(3)
    lines = []
    for k in range(600):
        n = 1 + k // 60 % 3  # a busy minute is one in both
        for camera in "ab":
            ts = datetime.fromtimestamp(1_763_370_000 + k, tz=UTC).isoformat()
            near = enumerate(rng.normal(1.3, 0.2, n).round(3).tolist())
            made = {
                "pairs": [{"a": f"{camera}{i}", "b": f"{camera}{i + 1}", "distance_m": d} for i, d in near],
                "persons": [{"id": f"{camera}{i}", "u_px": 300 * n + rng.normal(0, 9), "v_px": 300} for i in range(n)],
            }
            lines.append(json.dumps({"v": 1, "camera": camera, "ts": ts, kind: made[kind]}))
    path = tmp_path / "both.jsonl"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    code, said = vsd(root, "ingest", path)
    assert (code, "W231" in said, "new records stored" in said) == (0 if kind == "pairs" else code, False, True), said


@pytest.mark.parametrize("further_m", [0.3, 1.0])
def test_a_recording_that_comes_at_places_beside_is_the_same_one_and_no_cut_is_advised(
    further_m: float, tmp_path: Path, vsd: Vsd
) -> None:
    root = project(tmp_path / "p", "a")
    assert vsd(root, "ingest", write(small(), tmp_path / "one.csv"))[0] == 0
    calibrated = renamed(small()).assign(x=small()["x"] + further_m)
    code, said = vsd(root, "ingest", write(calibrated, tmp_path / "two.csv"))
    assert (code, n_stored(root), "cut the file" in said) == (2, len(small()), False), said
    assert f"the same recording is stored already, {further_m:g} m away: 100% of its records" in said
    purge = re.findall(r"`vsd (purge --import .+?)`", said)[0]
    assert vsd(root, *purge.split())[0] == 0
    assert vsd(root, "ingest", tmp_path / "two.csv")[0] == 0


def test_parts_that_are_spread_over_the_whole_file_are_not_to_be_cut_off(tmp_path: Path, vsd: Vsd) -> None:
    root = project(tmp_path / "p", "a")
    one = small()[pd.factorize(small()["track"])[0] % 2 == 0]
    assert vsd(root, "ingest", write(one, tmp_path / "one.csv"))[0] == 0
    code, said = vsd(root, "ingest", write(renamed(small()), tmp_path / "two.csv"))
    assert (code, "a part of it is stored already" in said, "cut the file" in said) == (2, True, False), said
    assert re.search(r"leave it out; to have it in place of what is stored: `vsd purge --import \w+ --force`", said)


def in_feet(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(x=(frame["x"] / 0.3048).round(3), y=(frame["y"] / 0.3048).round(3))


def next_hour() -> pd.DataFrame:
    return renamed(hall(8, minutes=6, n_people=14)).assign(ms=lambda f: f["ms"] + 3_600_000)


@pytest.mark.parametrize("is_one_file", [True, False])
def test_feet_after_metres_are_refused_and_their_unit_settles_it(is_one_file: bool, tmp_path: Path, vsd: Vsd) -> None:
    root = project(tmp_path / "p", "a")
    first, then = small(), in_feet(next_hour())
    if is_one_file:
        code, said = vsd(root, "ingest", write(pd.concat([first, then]), tmp_path / "day.csv"))
        cut = pd.Timestamp(re.findall(r"from (.{25}) on, positions of camera a", said)[0])
        assert abs((pd.Timestamp(int(then["ms"].min()), unit="ms", tz="UTC") - cut).total_seconds()) < 60
    assert vsd(root, "ingest", write(first, tmp_path / "one.csv"))[0] == 0
    if not is_one_file:
        code, said = vsd(root, "ingest", write(then, tmp_path / "two.csv"))
    assert (code, "W220" in said, "3.28 times as large" in said, "--unit ft" in said) == (2, True, True, True), said
    unnamed = write(then, tmp_path / "two.csv")
    unnamed.write_text(unnamed.read_text().replace("x_m,y_m", "x,y", 1))
    code, said = vsd(root, "ingest", unnamed, "--unit", "ft", "--map", "x_m=x,y_m=y")
    assert (code, n_stored(root)) == (0, len(first) + len(then)), said


def test_metres_after_feet_that_were_taken_for_metres(tmp_path: Path) -> None:
    root = project(tmp_path / "p", "a")
    came(root, in_feet(small()), "one", is_sure=True)
    assert doubts(came(root, next_hour(), "two")) == "W220"


def test_a_frame_in_memory_is_asked_the_same(tmp_path: Path) -> None:
    root = project(tmp_path / "p", "a")
    columns = {"ms": "ts", "camera": "camera_id", "track": "track_id", "x": "x_m", "y": "y_m"}

    def stored(frame: pd.DataFrame) -> None:
        named = frame.rename(columns=columns).assign(ts=pd.to_datetime(frame["ms"], unit="ms", utc=True))
        ingest_frame(load_site(root), named, camera=None, clock=None, name="frame", now=NOW)

    stored(small())
    stored(small())
    with pytest.raises(InputError, match="the same recording is stored already"):
        stored(renamed(small()))


def test_a_file_can_be_checked_without_a_project(tmp_path: Path, vsd: Vsd) -> None:
    path = write(two_views(), tmp_path / "day.csv")
    code, said = vsd(tmp_path, "check", path)
    assert code == 1
    assert "E102" not in said
    assert "W231" in said
    assert f"cameras   a ({len(small()):,}), b ({len(small()):,})" in said
    assert "To go on: vsd init" in said
    assert sorted(p.name for p in tmp_path.iterdir()) == ["day.csv"]
    assert vsd(tmp_path, "check", path, "--save", "days")[0] == 2


def test_feet_are_seen_though_other_cameras_were_stored_last(tmp_path: Path, vsd: Vsd) -> None:
    root = project(tmp_path / "p", "a", "b")
    day_ms = 24 * 3_600_000
    elsewhere = hall(31, minutes=6, n_people=14).assign(camera="b")
    elsewhere["x"] += 40
    hours = [elsewhere.assign(ms=elsewhere["ms"] + day_ms + k * 3_600_000) for k in range(4)]
    for number, frame in enumerate((small(), *hours)):
        assert vsd(root, "ingest", write(frame, tmp_path / f"{number}.csv"), "--yes")[0] <= 1
    feet = in_feet(next_hour())
    code, said = vsd(root, "ingest", write(feet.assign(ms=feet["ms"] + day_ms), tmp_path / "feet.csv"))
    assert (code, "3.28 times as large" in said) == (2, True), said


def test_the_next_seconds_of_people_who_sit_are_another_recording(tmp_path: Path, vsd: Vsd) -> None:
    root, rng = project(tmp_path / "p", "a"), np.random.default_rng(1)
    seats = np.array([(2 + 1.3 * k, 1 + k * 37 % 5) for k in range(6)])

    def seated(from_s: float) -> pd.DataFrame:
        tracks = [(from_s, np.repeat(seat[None], 200, axis=0)) for seat in seats]
        return of_people(tracks, hz=10, seed=int(rng.integers(99)), jitter_m=0.01)

    first, then = seated(0), seated(20)
    assert vsd(root, "ingest", write(first, tmp_path / "one.csv"))[0] == 0
    code, said = vsd(root, "ingest", write(then, tmp_path / "two.csv"))
    assert (code, n_stored(root)) == (0, len(first) + len(then)), said
