"""Checks, units and pseudonyms that are the same for all formats."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from raw_reading import NINE_MS, NOW, small_site

from vsd_analytics.errors import StoreError
from vsd_analytics.ingest.intake.normalise import NORMALISED, Normalised, Normaliser
from vsd_analytics.ingest.intake.pseudonyms import Pseudonyms
from vsd_analytics.ingest.reading.adapter import RawBatch, Rejected
from vsd_analytics.schema import RAW_SCHEMAS, TableName
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Site
from vsd_analytics.store.secrets import DayKeys, namer

SITE = small_site(Path("unused"))
PERSON: dict[str, Any] = {"camera": "cam-1", "ts_ms": NINE_MS, "person": 0, "x_m": 1.0, "y_m": 2.0, "quality": "metric"}
PAIR: dict[str, Any] = {
    "camera": "cam-1",
    "ts_ms": NINE_MS,
    "person_a": 0,
    "person_b": 1,
    "track_a": "a",
    "track_b": "b",
    "distance_m": 1.5,
    "quality": "metric",
}


def normalised(name: TableName, *rows: dict[str, Any], site: Site = SITE, keys: DayKeys | None = None) -> Normalised:
    schema = RAW_SCHEMAS[name]
    full = [{**dict.fromkeys(schema.names), **row, "line": row.get("line", i + 1)} for i, row in enumerate(rows)]
    batch = RawBatch({name: pa.Table.from_pylist(full, schema=schema)})
    found = Normaliser(site, now=NOW, keys=keys).normalise(batch)
    assert found.tables[name].schema == NORMALISED[name]
    assert found.tables[name].num_rows + len(found.rejected) + sum(found.n_dropped.values()) == len(rows)
    return found


def person(**changes: Any) -> dict[str, Any]:
    return {**PERSON, **changes}


def stored(name: TableName, *rows: dict[str, Any], **arguments: Any) -> list[dict[str, Any]]:
    found = normalised(name, *rows, **arguments)
    assert not found.rejected
    table: list[dict[str, Any]] = found.tables[name].to_pylist()
    return table


def reasons(name: TableName, *rows: dict[str, Any], **arguments: Any) -> dict[int, str]:
    return {r.line: r.reason for r in normalised(name, *rows, **arguments).rejected}


def test_metres_become_millimetres_and_pixels_quarters() -> None:
    (row,) = stored("observations", person(x_m=-1.2344999, y_m=0.0006, u_px=100.12, v_px=0.38, track="t"))
    assert row == {
        "camera_id": "cam-1",
        "ts": datetime.fromtimestamp(NINE_MS / 1000, tz=UTC),
        "person": 0,
        "track_id": "t",
        "x_mm": -1234,
        "y_mm": 1,
        "u_px": 100.0,
        "v_px": 0.5,
        "quality": "metric",
        "is_staff": None,
    }


@given(st.integers(-10_000_000, 10_000_000))
def test_whole_millimetres_survive_metres(mm: int) -> None:
    (row,) = stored("observations", person(x_m=mm / 1000))
    assert row["x_mm"] == mm


def test_half_a_place_is_no_place_and_pixels_alone_are_enough() -> None:
    (row,) = stored("observations", person(y_m=None, u_px=3.0, v_px=4.0))
    assert (row["x_mm"], row["y_mm"], row["u_px"]) == (None, None, 3.0)


OBSERVATIONS: dict[str, tuple[dict[str, Any], str]] = {
    "nan": ({"x_m": math.nan}, "not-a-number"),
    "infinite pixel": ({"u_px": math.inf}, "not-a-number"),
    "nowhere": ({"x_m": None, "v_px": 3.0}, "no-position"),
    "far away": ({"y_m": -10_000.1}, "out-of-range"),
    "beyond any picture": ({"u_px": 1e7, "v_px": 1.0}, "out-of-range"),
    "long id": ({"track": "x" * 201}, "long-track-id"),
    "quality": ({"quality": "good"}, "unknown-quality"),
    "no time": ({"ts_ms": None}, "no-time"),
    "year 1": ({"ts_ms": -62135596800000}, "time-out-of-range"),
    "1989": ({"ts_ms": 631152000000 - 1}, "time-out-of-range"),
    "future": ({"ts_ms": int(NOW.timestamp() * 1000) + 86_400_001}, "time-out-of-range"),
    "largest": ({"ts_ms": 2**63 - 1}, "time-out-of-range"),
    "no camera": ({"camera": None}, "no-camera"),
    "unknown camera": ({"camera": "cam-9"}, "unknown-camera"),
    "path": ({"camera": "../../x"}, "unknown-camera"),
    "script": ({"camera": "<script>"}, "unknown-camera"),
    "blank camera": ({"camera": ""}, "unknown-camera"),
}


@pytest.mark.parametrize("name", OBSERVATIONS)
def test_a_bad_person_record_is_rejected_and_its_neighbours_are_stored(name: str) -> None:
    changes, reason = OBSERVATIONS[name]
    found = normalised("observations", person(), person(**changes), person(person=2))
    assert [(r.line, r.reason) for r in found.rejected] == [(2, reason)]
    assert found.tables["observations"]["person"].to_pylist() == [0, 2]


def test_the_edges_of_what_is_accepted_are_accepted() -> None:
    edges: list[dict[str, Any]] = [
        {"ts_ms": 631152000000},
        {"ts_ms": int(NOW.timestamp() * 1000) + 86_400_000},
        {"x_m": -10_000.0},
    ]
    assert len(stored("observations", *(person(**e) for e in edges))) == 3


def test_settings_move_the_edges() -> None:
    strict = Settings().with_values({"earliest_year": 2026, "coordinate_max_m": 5.0, "future_max_s": 0.0})
    site = small_site(Path("unused"), settings=strict)
    bad: list[dict[str, Any]] = [
        {"ts_ms": NINE_MS - 365 * 86_400_000},
        {"x_m": 5.1},
        {"ts_ms": int(NOW.timestamp() * 1000) + 1},
    ]
    assert len(reasons("observations", *(person(**b) for b in bad), site=site)) == 3
    assert reasons("observations", *(person(**b) for b in bad)) == {}


def test_the_reason_names_the_cameras_that_are_known() -> None:
    (rejected,) = normalised("frames", {"camera": "cam9", "ts_ms": NINE_MS}).rejected
    assert all(name in rejected.detail for name in ("cam-1", "cam-2", "left"))
    assert "camera=cam9" in rejected.text


def test_engine_names_of_cameras_become_ours() -> None:
    rows = stored("frames", *({"camera": c, "ts_ms": NINE_MS} for c in ("left", "7", "cam-2")))
    assert [r["camera_id"] for r in rows] == ["cam-1", "cam-1", "cam-2"]


def test_what_adapters_rejected_and_left_out_is_passed_on() -> None:
    batch = RawBatch(rejected=[Rejected(9, "bad-json", "no")], n_dropped={"unknown field": 3})
    found = Normaliser(SITE, now=NOW, keys=None).normalise(batch)
    assert (found.tables, found.rejected, found.n_dropped) == ({}, batch.rejected, {"unknown field": 3})


PAIRS: dict[str, tuple[dict[str, Any], str]] = {
    "negative": ({"distance_m": -0.001}, "negative-distance"),
    "negative spread": ({"distance_sd_m": -1.0}, "negative-distance"),
    "nan": ({"distance_m": math.nan}, "not-a-number"),
    "infinite": ({"distance_m": math.inf}, "not-a-number"),
    "far away": ({"x_a_m": 2e4}, "out-of-range"),
    "no distance": ({"distance_m": None, "x_a_m": 1.0, "y_a_m": 1.0, "x_b_m": 1.0}, "no-distance"),
    "one person": ({"track_b": "a"}, "same-person"),
    "one unnamed person": ({"track_a": None, "track_b": None, "person_b": 0}, "same-person"),
    "long id": ({"track_b": "x" * 201}, "long-track-id"),
    "quality": ({"quality": ""}, "unknown-quality"),
    "unknown camera": ({"camera": "nowhere"}, "unknown-camera"),
}


@pytest.mark.parametrize("name", PAIRS)
def test_a_bad_pair_is_rejected_and_its_neighbours_are_stored(name: str) -> None:
    changes, reason = PAIRS[name]
    found = normalised("pairs", PAIR, {**PAIR, **changes}, {**PAIR, "track_a": "c"})
    assert [(r.line, r.reason) for r in found.rejected] == [(2, reason)]
    assert found.tables["pairs"].num_rows == 2


def test_pairs_that_lie_too_far_apart_are_counted_and_left_out() -> None:
    found = normalised("pairs", PAIR, {**PAIR, "distance_m": 2.5}, {**PAIR, "distance_m": 2.51})
    assert found.n_dropped == {"pair beyond pair_max_m": 1}
    assert found.tables["pairs"]["distance_mm"].to_pylist() == [1500, 2500]


@pytest.mark.parametrize(
    ("metres", "mm"), [(1.9996, 1999), (2.0, 2000), (1.001, 1001), (0.0, 0), (1.9999999999, 2000), (1.83, 1830)]
)
def test_distances_are_rounded_down_so_that_strictly_closer_stays_exact(metres: float, mm: int) -> None:
    (row,) = stored("pairs", {**PAIR, "distance_m": metres})
    assert row["distance_mm"] == mm


def test_a_distance_that_is_not_given_is_measured_between_the_places() -> None:
    places = {"x_a_m": 1.0, "y_a_m": 1.0, "x_b_m": 2.2, "y_b_m": 2.6, "distance_m": None}
    (row,) = stored("pairs", {**PAIR, **places})
    assert (row["distance_mm"], row["x_b_mm"], row["y_b_mm"], row["distance_sd_mm"]) == (2000, 2200, 2600, None)


def test_a_pair_is_the_same_in_either_order() -> None:
    places = {"x_a_m": 1.0, "y_a_m": 2.0, "x_b_m": 1.5, "y_b_m": 2.5}
    turned = {"x_a_m": 1.5, "y_a_m": 2.5, "x_b_m": 1.0, "y_b_m": 2.0, "track_a": "b", "track_b": "a"}
    one, other = stored("pairs", {**PAIR, **places}, {**PAIR, **turned, "person_a": 1, "person_b": 0})
    assert one == other
    assert (one["track_a"], one["x_a_mm"], one["person_a"]) == ("a", 1000, 0)
    unnamed = {"track_a": None, "track_b": None}
    one, other = stored(
        "pairs",
        {**PAIR, **places, **unnamed},
        {**PAIR, **turned, **unnamed, "person_a": 1, "person_b": 0},
    )
    assert one == other


def _tracks(keys: DayKeys | None, *rows: tuple[str, datetime, str | None], site: Site = SITE) -> list[str | None]:
    sent = [person(camera=c, ts_ms=int(at.timestamp() * 1000), track=t) for c, at, t in rows]
    return [r["track_id"] for r in stored("observations", *sent, site=site, keys=keys)]


NOON = datetime(2026, 11, 9, 12, tzinfo=SITE.zone)


def test_a_pseudonym_is_the_same_within_camera_and_site_day_only(tmp_path: Path) -> None:
    keys = DayKeys(tmp_path)
    same = [("cam-1", NOON, "7"), ("left", NOON + timedelta(hours=3), "7")]
    others = [
        ("cam-2", NOON, "7"),
        ("cam-1", NOON + timedelta(days=1), "7"),
        ("cam-1", NOON, "8"),
        ("cam-1", NOON, "07"),
    ]
    names = _tracks(keys, *same, *others)
    assert names[0] == names[1]
    assert len(set(names)) == 5
    assert all(n is not None and len(n) == 16 and n != "7" for n in names)
    assert _tracks(DayKeys(tmp_path), *same, *others) == names


def test_a_site_day_starts_at_four_local_time(tmp_path: Path) -> None:
    def at(hour: int, minute: int = 0, second: int = 0) -> tuple[str, datetime, str]:
        return ("cam-1", datetime(2026, 11, 10, hour, minute, second, tzinfo=SITE.zone), "7")

    evening = ("cam-1", datetime(2026, 11, 9, 23, 59, tzinfo=SITE.zone), "7")
    names = _tracks(DayKeys(tmp_path), evening, at(0), at(3, 59, 59), at(4), at(12, 0))
    assert names[0] == names[1] == names[2] != names[3] == names[4]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["2026-11-09.key", "2026-11-10.key"]
    midnight = small_site(Path("unused"), day_starts_min=0)
    names = _tracks(DayKeys(tmp_path), evening, at(0), at(4), site=midnight)
    assert names[0] != names[1] == names[2]


def test_missing_ids_stay_missing_and_no_keys_keep_the_engines(tmp_path: Path) -> None:
    rows = [("cam-1", NOON, None), ("cam-1", NOON, ""), ("cam-1", NOON, "x")]
    assert _tracks(None, *rows) == [None, None, "x"]
    names = _tracks(DayKeys(tmp_path / "k"), *rows)
    assert names[:2] == [None, None]
    assert names[2] is not None
    assert _tracks(DayKeys(tmp_path / "none"), *rows[:2]) == [None, None]
    assert not (tmp_path / "none").exists()


def test_pairs_and_persons_get_the_same_pseudonyms(tmp_path: Path) -> None:
    keys = DayKeys(tmp_path)
    names = _tracks(keys, *(("cam-1", NOON, t) for t in "ab"))
    (row,) = stored("pairs", {**PAIR, "ts_ms": int(NOON.timestamp() * 1000)}, keys=keys)
    assert [row["track_a"], row["track_b"]] == sorted(str(n) for n in names)


def test_a_key_that_was_destroyed_meanwhile_names_no_other_track(tmp_path: Path) -> None:
    keys = DayKeys(tmp_path)
    pseudonyms = Pseudonyms(SITE, keys)

    def named(track: str) -> str | None:
        at = {"camera_ids": pa.array(["cam-1"]), "ts_ms": np.array([NINE_MS])}
        name: str | None = pseudonyms.tracks(pa.array([track]), **at)[0].as_py()
        return name

    first = named("7")
    assert first is not None
    assert first == named("7")
    keys.forget(keys.days())
    with pytest.raises(StoreError, match="was destroyed"):
        named("8")


@pytest.mark.parametrize("names_max", [5, 500_000])
def test_each_track_has_the_pseudonym_of_its_camera_and_day(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, names_max: int
) -> None:
    monkeypatch.setattr("vsd_analytics.ingest.intake.pseudonyms.NAMES_MAX", names_max)
    keys, rng = DayKeys(tmp_path), np.random.default_rng(3)
    pseudonyms = Pseudonyms(SITE, keys)
    for _ in range(3):
        tracks = [[None, "", "7", "8", "é"][i] for i in rng.integers(0, 5, 200)]
        cameras = [f"cam-{i}" for i in rng.integers(1, 4, 200)]
        ts_ms = NINE_MS + 7_200_000 * rng.integers(0, 30, 200)
        for ids in (pa.array(cameras), pa.array(cameras).dictionary_encode()):
            found = pseudonyms.tracks(pa.array(tracks), camera_ids=ids, ts_ms=ts_ms)
            days = [next(iter(pseudonyms.days(np.array([at])))) for at in ts_ms.tolist()]
            assert len(set(days)) == 3
            assert found.to_pylist() == [
                namer(keys.key(day), camera_id=camera)(track) if track else None
                for track, camera, day in zip(tracks, cameras, days, strict=True)
            ]


def test_records_without_ids_make_no_key(tmp_path: Path) -> None:
    normalised("observations", person(), keys=DayKeys(tmp_path))
    assert DayKeys(tmp_path).days() == []
