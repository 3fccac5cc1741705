"""The build is like make: it recomputes what is stale, says why, and its bytes do not depend on the range asked for."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from warehouse.small_projects import (
    FACTS_WITHOUT_AREAS,
    HOUR,
    T0,
    Frame,
    Pair,
    Person,
    beats,
    build_hour_by_hour,
    fact_files,
    fact_hours,
    make_site,
    open_days,
    put,
)

from vsd_analytics.errors import StoreError
from vsd_analytics.site.model import Calibration, Camera
from vsd_analytics.warehouse import build as build_module
from vsd_analytics.warehouse import factfiles, units
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.compute import hour_facts

HOUR0 = T0 // HOUR


def three_hours(rng: np.random.Generator) -> list[Person | Frame]:
    people = [
        Person(T0 + s * 1000, f"t{i}", *map(int, rng.integers(-2500, 2500, size=2)))
        for s in range(0, 3 * 3600, 20)
        for i in range(3)
    ]
    return [*people, *beats(T0, T0 + 3 * HOUR)]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    put(make_site(root), three_hours(np.random.default_rng(1)))
    build(make_site(root))
    return root


@pytest.fixture
def project(built: Path, tmp_path: Path) -> Path:
    """Return a copy of a project with facts, for one test to change."""
    return Path(shutil.copytree(built, tmp_path, dirs_exist_ok=True))


def test_first_build_is_new_and_second_computes_nothing(project: Path) -> None:
    files = fact_files(make_site(project))
    assert len(files) == len(FACTS_WITHOUT_AREAS) + 1, "a file for each fact and UTC day, however many hours it has"
    assert fact_hours(make_site(project)).keys() == {
        (name, HOUR0 + k) for name in FACTS_WITHOUT_AREAS for k in range(3)
    }
    done: list[int] = []
    planned: list[int] = []
    result = build(make_site(project), on_hours=done.append, on_plan=planned.append)
    assert (result.n_built, result.n_fresh, dict(result.reasons)) == (0, 3, {})
    assert (done, planned) == ([], [0])
    assert fact_files(make_site(project)) == files


def test_late_data_recomputes_its_hour_and_one_beside_it_if_that_is_near(project: Path) -> None:
    site = make_site(project)
    put(site, beats(T0 + 10 * HOUR, T0 + 11 * HOUR))
    assert dict(build(site).reasons) == {"new": 1}
    put(site, [Person(T0 + HOUR // 2, "late", 0, 0)])
    before = fact_hours(site)
    assert dict(build(site).reasons) == {"late data": 1}
    after = fact_hours(site)
    assert {hour for name, hour in after if after[name, hour] != before[name, hour]} == {HOUR0}
    put(site, [Person(T0 + HOUR + 1000, "late", 0, 0)])
    assert dict(build(site).reasons) == {"late data": 2}
    assert {hour for name, hour in after if fact_hours(site)[name, hour] != after[name, hour]} == {HOUR0, HOUR0 + 1}


def test_late_data_gives_what_timely_data_would_have_given(project: Path, tmp_path: Path) -> None:
    late = [Person(T0 + HOUR - 1000, "x", 0, 0), Person(T0 + HOUR + 1000, "x", 0, 0)]
    put(make_site(project), late)
    build(make_site(project))
    timely = make_site(tmp_path / "timely")
    put(timely, [*three_hours(np.random.default_rng(1)), *late])
    build(timely)

    def rows(root: Path) -> dict[str, list[object]]:
        found: dict[str, list[object]] = {}
        for path in sorted((root / "facts").rglob("*.parquet")):
            key = f"{path.parent.parent.parent.name} {path.name[:2]}"
            found[key] = pq.ParquetFile(path).read().to_pylist()
        return found

    assert rows(project) == rows(timely.root)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"pair_max_m": 3.0}, "settings changed"),
        ({"episode_gap_s": 5.0}, "settings changed"),
    ],
)
def test_changed_settings_make_all_stale_and_say_so(project: Path, change: dict[str, float], reason: str) -> None:
    assert dict(build(make_site(project, **change)).reasons) == {reason: 3}


def test_settings_facts_do_not_depend_on_change_nothing(project: Path) -> None:
    assert build(make_site(project, episode_min_s=10.0, full_hour_share=0.8)).n_built == 0


def calibrated(camera: Camera, *rows: tuple[float, float, float], valid_from: datetime | None = None) -> Camera:
    calibration = Calibration(rows, valid_from, "0" * 8)  # type: ignore[arg-type]
    return replace(camera, calibrations=(*camera.calibrations, calibration))


def test_changed_calibration_says_so(project: Path) -> None:
    camera = make_site(project).cameras[0]
    one = calibrated(camera, (0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 1.0))
    two = calibrated(camera, (0.02, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 1.0))
    reason = {"calibration changed": 3}
    assert dict(build(make_site(project, cameras=[one])).reasons) == reason
    assert dict(build(make_site(project, cameras=[two])).reasons) == reason, "the numbers count, not the id alone"
    later = calibrated(
        one, (0.01, 0.0, 0.5), (0.0, 0.01, 0.0), (0.0, 0.0, 1.0), valid_from=datetime(2026, 11, 9, tzinfo=UTC)
    )
    assert dict(build(make_site(project, cameras=[later])).reasons) == reason


def test_a_display_name_makes_nothing_stale(project: Path) -> None:
    camera = replace(make_site(project).cameras[0], name="Another name")
    assert build(make_site(project, cameras=[camera])).n_built == 0


def test_a_changed_frame_interval_says_so(project: Path) -> None:
    camera = replace(make_site(project).cameras[0], hz=None)
    assert build(make_site(project, cameras=[camera])).n_built == 0, "the interval is the same as was set"
    put(make_site(project), beats(T0 + 9 * HOUR + 500, T0 + 13 * HOUR, every=200))
    reasons = build(make_site(project, cameras=[camera])).reasons
    assert reasons == {"new": 4, "frame interval changed": 3}


def test_a_removed_fact_file_is_rebuilt(project: Path) -> None:
    site = make_site(project)
    before = fact_files(site)
    for relations in (["camera_days"], ["exposure"], FACTS_WITHOUT_AREAS):
        for relation in relations:
            next((site.root / "facts" / relation).rglob("*.parquet")).unlink()
        build(site)
        assert fact_files(site) == before, relations


def test_the_hours_of_a_removed_fact_file_are_called_incomplete(project: Path) -> None:
    next(iter((project / "facts" / "distance_times").rglob("*.parquet"))).unlink()
    result = build(make_site(project))
    assert (dict(result.reasons), dict(result.facts)) == ({"incomplete": 3}, {"distance_times": 3})


def test_late_data_computes_no_other_hour_again(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The others come from the file that is replaced, to the byte."""
    site, asked = make_site(project), list[tuple[int, int]]()

    def noting(*args: Any, first_hour: int, last_hour: int, **options: Any) -> Any:
        asked.append((first_hour, last_hour))
        return hour_facts(*args, first_hour=first_hour, last_hour=last_hour, **options)

    monkeypatch.setattr(build_module, "hour_facts", noting)
    put(site, [Person(T0 + 10 * HOUR + 1000, "x", 0, 0), *beats(T0 + 10 * HOUR, T0 + 11 * HOUR)])
    build(site)
    assert asked == [(HOUR0 + 10, HOUR0 + 10)]
    stepwise = fact_files(site)
    shutil.rmtree(project / "facts")
    build(site)
    assert fact_files(site) == stepwise


def test_rows_of_a_damaged_file_are_not_used_again(project: Path) -> None:
    """Else a flipped bit would get a digest that says it is right."""
    path = next((project / "facts" / "exposure").rglob("*.parquet"))
    data = path.read_bytes()
    path.write_bytes(data[:50] + bytes([data[50] ^ 1]) + data[51:])
    put(make_site(project), [Person(T0 + 10 * HOUR + 1000, "x", 0, 0), *beats(T0 + 10 * HOUR, T0 + 11 * HOUR)])
    build(make_site(project))
    stepwise = fact_files(make_site(project))
    shutil.rmtree(project / "facts")
    build(make_site(project))
    assert fact_files(make_site(project)) == stepwise


def test_row_groups_end_where_the_hours_do_whatever_was_computed_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(factfiles, "ROW_GROUP", 100)
    late = [Person(T0 + 2 * HOUR + HOUR // 2, "late", 0, 0)]
    sites = [make_site(tmp_path / name) for name in ("at-once", "stepwise")]
    put(sites[1], three_hours(np.random.default_rng(1)))
    build(sites[1])
    put(sites[1], late)
    shutil.copytree(tmp_path / "stepwise" / "store", tmp_path / "at-once" / "store")
    for site in sites:
        build(site)
    assert fact_files(sites[0]) == fact_files(sites[1])
    (path,) = (sites[0].root / "facts" / "distance_times").rglob("*.parquet")
    assert pq.read_metadata(path).num_row_groups == 3


def test_a_day_that_does_not_fit_whole_is_computed_with_the_next_ones(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else its files would be written with the rows of two runs."""
    site, asked = make_site(project), list[tuple[int, int]]()

    def noting(*args: Any, first_hour: int, last_hour: int, **options: Any) -> Any:
        asked.append((first_hour, last_hour))
        return hour_facts(*args, first_hour=first_hour, last_hour=last_hour, **options)

    put(site, [frame for h in (24, 25) for frame in beats(T0 + h * HOUR, T0 + (h + 1) * HOUR)])
    own = len(list(beats(T0, T0 + HOUR)))
    n_rows = sum(pq.read_metadata(path).num_rows for path in (project / "store").rglob("*.parquet"))
    monkeypatch.setattr(build_module, "hour_facts", noting)
    shutil.rmtree(project / "facts")
    build(site)
    everything = fact_files(site)
    assert asked == [(HOUR0, HOUR0 + 25)]
    monkeypatch.setattr(units, "QUIET_ROWS", n_rows - own)  # room for one hour of the second day
    shutil.rmtree(project / "facts")
    build(site)
    assert asked[1:] == [(HOUR0, HOUR0 + 2), (HOUR0 + 24, HOUR0 + 25)]
    assert fact_files(site) == everything


def test_a_fact_file_has_the_names_of_its_rows_only() -> None:
    ids = pa.DictionaryArray.from_arrays(pa.array([2, None, 0], pa.int32()), pa.array(["name-c", "other", "name-b"]))
    data = factfiles.fact_bytes(pa.table({"hour": [1, 1, 2], "camera_id": ids, "track_id": ids}), inputs={})
    found = pq.read_table(pa.BufferReader(data))
    assert found["camera_id"].to_pylist() == found["track_id"].to_pylist() == ["name-b", None, "name-c"]
    assert pa.types.is_string(found["track_id"].type)
    plain = factfiles.fact_bytes(found, inputs={})
    assert plain == data, "texts and dictionaries of more names give the same bytes"


@given(data=st.data())
def test_the_bytes_of_a_fact_file_follow_from_its_rows_however_they_come(data: st.DataObject) -> None:
    names = ["a", "b", "c", "d"]
    ids = data.draw(st.lists(st.sampled_from([*names, None]), min_size=1, max_size=12))
    cuts = sorted(data.draw(st.sets(st.integers(0, len(ids)))) | {0, len(ids)})
    writer = factfiles.FactWriter({})
    for first, after in pairwise(cuts):
        known = data.draw(st.permutations(names))
        numbers = [None if name is None else known.index(name) for name in ids[first:after]]
        held = pa.DictionaryArray.from_arrays(pa.array(numbers, pa.int32()), pa.array(known))
        is_text = data.draw(st.booleans())
        column = held.cast(pa.string()) if is_text else held
        writer.add(pa.table({"hour": pa.array([7] * len(numbers)), "camera_id": column, "track_id": column}))
    texts = pa.array(ids, pa.string())
    whole = pa.table({"hour": [7] * len(ids), "camera_id": texts, "track_id": texts})
    assert writer.finish() == factfiles.fact_bytes(whole, inputs={})


def test_files_of_hours_of_an_older_version_give_way_to_those_of_days(project: Path) -> None:
    site = make_site(project)
    files = fact_files(site)
    for name in files:
        path = project / "facts" / name
        shutil.copy(path, path.with_name("09-0123456789abcdef.parquet"))
    shutil.rmtree(project / "facts" / "distance_times")
    build(site)
    assert fact_files(site) == files


def test_older_facts_are_removed_and_other_hours_left(project: Path) -> None:
    site = make_site(project)
    first = fact_files(site)
    build(make_site(project, distance_m=1.5))
    second = fact_files(site)
    assert len(second) == len(first)
    renamed = {f.split("/")[0] for f in second.keys() - first.keys()}
    assert "episode_segments" in renamed
    assert not renamed & {"distance_times", "coverage", "exposure"}, "what does not read the distance keeps its file"
    path = next((site.root / "facts" / "distance_times").rglob("*.parquet"))
    causes = json.loads(pq.read_metadata(path).metadata[b"vsd.causes"])
    assert causes.keys() == {"records", "sql", "settings", "cameras", "calibration", "views", "frame interval", "staff"}


def mixed(rng: np.random.Generator) -> list[Person | Pair | Frame]:
    """Return records of two days with gaps, sent and derived pairs, with and without ids, near midnight."""
    start = T0 + 14 * HOUR
    records: list[Person | Pair | Frame] = []
    ts = start
    while ts < start + 3 * HOUR:
        ts += int(
            rng.choice([200, 1000, 1000, 1000, 2100, 60_000, 601_000, 3_000_000], p=[0.1] * 4 + [0.3, 0.28, 0.01, 0.01])
        )
        for i in range(int(rng.integers(0, 6))):
            track = f"t{i}" if rng.random() < 0.8 else None
            records.append(Person(ts, track, *map(int, rng.integers(-2500, 2500, size=2))))
        if rng.random() < 0.2:
            records.append(Frame(ts, n_pairs=2, seq=len(records)))
            records += [Pair(ts, "t0", "t9", int(rng.integers(0, 2500))), Pair(ts, None, None, 500, persons=(3, 4))]
    return records


@pytest.mark.parametrize("hz", [None, 1.0])
def test_bytes_do_not_depend_on_range_or_batch(
    tmp_path: Path, hz: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    cameras = [Camera("cam", "Cam", "ground", hz=hz)]
    whole = make_site(tmp_path / "whole", cameras=cameras)
    put(whole, mixed(np.random.default_rng(5)))
    shutil.copytree(whole.root / "store", tmp_path / "hourly" / "store")
    shutil.copytree(whole.root / "store", tmp_path / "small" / "store")
    numbers = sorted(build(whole).fingerprints)
    assert len(numbers) > 2
    expected = fact_files(whole)
    hourly = make_site(tmp_path / "hourly", cameras=cameras)
    build_hour_by_hour(hourly)
    assert fact_files(hourly) == expected
    backwards = make_site(tmp_path / "backwards", cameras=cameras)
    shutil.copytree(whole.root / "store", tmp_path / "backwards" / "store")
    for number in numbers[::-1]:
        build(backwards, first_hour=number, last_hour=number)
    assert fact_files(backwards) == expected
    small = make_site(tmp_path / "small", cameras=cameras)
    for limit in ("BATCH_ROWS", "QUIET_ROWS"):
        monkeypatch.setattr(units, limit, 1000)
    build(small)
    assert fact_files(small) == expected


@pytest.mark.parametrize("built_first", [-1, 0])
def test_hours_on_both_sides_of_midnight_know_each_other(tmp_path: Path, built_first: int) -> None:
    """Also when one is built alone: the time a frame covers reaches over midnight, into another UTC day's intervals."""
    site = make_site(tmp_path)
    midnight = T0 + 16 * HOUR
    put(site, [Person(midnight - 1000, "a", 0, 0), Person(midnight + 500, "a", 0, 0)])
    build(site, first_hour=midnight // HOUR + built_first, last_hour=midnight // HOUR + built_first)
    alone = fact_files(site)
    build(site)
    assert alone.items() <= fact_files(site).items()
    with open_days(site, "2026-11-09", "2026-11-10") as warehouse:
        hours = warehouse.rows("select recorded_s, exposure_s from hours where recorded_s > 0")
    assert hours == [{"recorded_s": 1.0, "exposure_s": 1.5}, {"recorded_s": 1.5, "exposure_s": 1.0}]


def test_a_silence_taken_as_recorded_reaches_over_the_hour_in_any_range(tmp_path: Path) -> None:
    """Without a heartbeat, five minutes of silence are recorded time, also when the next frame is in the next hour."""
    sites = [
        make_site(tmp_path / name, cameras=[Camera("cam", "Cam", "ground", hz=1.0)]) for name in ("whole", "hourly")
    ]
    instants = [T0 + HOUR + s * 1000 for start in (-600, 150) for s in range(start, start + 450)]
    for site in sites:
        put(site, [Person(ts, "a", 0, 0) for ts in instants])
    build(sites[0])
    build_hour_by_hour(sites[1])
    assert fact_files(sites[0]) == fact_files(sites[1])
    with open_days(sites[1]) as warehouse:
        recorded = warehouse.rows("select recorded_s from hours where recorded_s > 0")
    assert recorded == [{"recorded_s": 600.0}, {"recorded_s": 600.0}]


def test_an_engine_with_a_frame_an_hour_gives_the_same_bytes_in_any_range(tmp_path: Path) -> None:
    """Frames farther apart than the hours a unit reads must not reach over them."""
    cameras = [Camera("cam", "Cam", "ground")]
    instants = [T0 + k * 90 * 60_000 for k in range(8)]
    records = [Person(ts, t, x, 0) for ts in instants for t, x in (("a", 0), ("b", 1000))]
    sites = [make_site(tmp_path / name, cameras=cameras) for name in ("whole", "hourly")]
    for site in sites:
        put(site, records)
    build(sites[0])
    build_hour_by_hour(sites[1])
    assert fact_files(sites[0]) == fact_files(sites[1])


def test_a_build_leaves_no_temporary_files_and_sweeps_those_of_the_dead(project: Path) -> None:
    folder = next(iter((project / "facts" / "distance_times").rglob("*.parquet"))).parent
    dead = folder / ".08-0123456789abcdef.parquet.4194999.tmp"
    dead.write_bytes(b"torn")
    build(make_site(project, distance_m=1.5))
    assert list((project / "facts").rglob(".*")) == []


def test_a_day_file_left_by_a_crash_is_not_read_twice(project: Path) -> None:
    day = next(iter((project / "facts" / "camera_days").rglob("*.parquet")))
    shutil.copy(day, day.with_name("00-0123456789abcdef.parquet"))
    with open_days(make_site(project)) as warehouse:
        assert warehouse.rows("select count(*) as n from camera_days")[0]["n"] == 1


@pytest.mark.parametrize(
    ("relation", "n_bytes"), [("exposure", 0), ("distance_times", 200), ("camera_days", 0), ("camera_days", 7)]
)
def test_fact_file_that_breaks_off_is_computed_again(project: Path, relation: str, n_bytes: int) -> None:
    site = make_site(project)
    whole = fact_files(site)
    path = next((project / "facts" / relation).rglob("*.parquet"))
    path.write_bytes(path.read_bytes()[:n_bytes])
    with open_days(site) as warehouse:
        assert warehouse.rows("select sum(person_records) as n from exposure") == [{"n": 3 * 540}]
        warehouse.rows(f"select count(*) as n from {relation}")
    assert fact_files(site) == whole
    assert build(site).n_built == 0


@pytest.mark.parametrize("relation", ["exposure", "camera_days"])
def test_fact_file_of_garbage_between_right_ends_says_how_to_fix_it(project: Path, relation: str) -> None:
    path = next((project / "facts" / relation).rglob("*.parquet"))
    path.write_bytes(b"PAR1" + b"\xff" * 50 + (20).to_bytes(4, "little") + b"PAR1")
    with pytest.raises(StoreError, match="facts") as caught, open_days(make_site(project)) as warehouse:
        warehouse.rows("select * from exposure")
    assert (caught.value.code, "delete the folder facts" in str(caught.value.fix)) == ("E302", True)


def test_stored_part_that_breaks_off_is_named_by_the_build(project: Path) -> None:
    path = next((project / "store" / "observations").rglob("*.parquet"))
    path.write_bytes(path.read_bytes()[:100])
    shutil.rmtree(project / "facts")
    with pytest.raises(StoreError) as caught:
        build(make_site(project))
    assert (caught.value.code, caught.value.where and caught.value.where.file) == ("E302", str(path))
