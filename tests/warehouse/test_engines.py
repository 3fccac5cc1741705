"""Engines differ: sent pairs, pixels, overlapping cameras, no heartbeat."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from warehouse.small_projects import HOUR, T0, Frame, Pair, Person, at, beats, make_site, open_days, put

from vsd_analytics.errors import ConfigError
from vsd_analytics.figures import operator_counts
from vsd_analytics.site.model import Calibration, Camera


def scaled(metres_per_px: float, *, valid_from: datetime | None = None) -> Calibration:
    s = metres_per_px
    return Calibration(((s, 0.0, 0.0), (0.0, s, 0.0), (0.0, 0.0, 1.0)), valid_from, f"{round(s * 1e6):08x}")


def hour(warehouse: object, local_hour: int = 8) -> dict[str, object]:
    rows: list[dict[str, object]] = warehouse.rows(f"select * from hours where local_hour = {local_hour}")  # type: ignore[attr-defined]
    return rows[0]


def test_sent_pairs_are_used_and_none_is_derived(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    stand = [(t, x) for t, x in (("a", 0), ("b", 500), ("c", 1000))]
    records: list[Person | Pair | Frame] = []
    for k in range(10):
        ts = T0 + k * 1000
        records += [Frame(ts, n_persons=3, n_pairs=1), Pair(ts, "a", "c", 1500)]
        records += [Person(ts, t, x, 0) for t, x in stand]
    put(site, records)
    with open_days(site) as warehouse:
        found = hour(warehouse)
        violations = warehouse.rows("select track_a, track_b, duration_s, x_m, min_distance_m from violations")
        heat = operator_counts.heatmap(warehouse, at="person")
    assert (found["person_records"], found["violation_records"], found["violation_s"]) == (30, 10, 20.0)
    assert violations == [{"track_a": "a", "track_b": "c", "duration_s": 10.0, "x_m": 0.5, "min_distance_m": 1.5}]
    assert {(r.cx, r.cy): r.records for r in heat.itertuples() if r.records} == {(0, 0): 10, (1, 0): 10}


def test_an_empty_list_of_pairs_means_nobody_was_close(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [Frame(T0, n_persons=2, n_pairs=0), Person(T0, "a", 0, 0), Person(T0, "b", 500, 0)])
    with open_days(site) as warehouse:
        assert (hour(warehouse)["violation_records"], hour(warehouse)["person_records"]) == (0, 2)


def test_frames_that_do_not_speak_of_pairs_have_them_derived(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [Frame(T0, n_persons=2, n_pairs=None), Person(T0, "a", 0, 0), Person(T0, "b", 500, 0)])
    with open_days(site) as warehouse:
        assert hour(warehouse)["violation_records"] == 1


def test_pairs_alone_give_violations_and_unknown_exposure(tmp_path: Path) -> None:
    site = make_site(tmp_path, cameras=[Camera("cam", "Cam", "ground", hz=0.05)])
    put(site, [Pair(T0 + k * 20_000, "a", "b", 1000) for k in range(30)])
    with open_days(site) as warehouse:
        found = hour(warehouse)
        violations = warehouse.rows("select duration_s, x_m, area_id from violations")
        cameras = warehouse.rows("select * from camera_hours where local_hour = 8")
    assert (found["person_records"], found["exposure_s"]) == (None, None)
    assert (found["violation_records"], found["violation_s"]) == (30, 1200.0)
    assert violations == [{"duration_s": 600.0, "x_m": None, "area_id": None}]
    assert cameras[0]["exposure_open_s"] is None


def test_pixels_become_metres_by_the_calibration_in_force(tmp_path: Path) -> None:
    """Two people 100 px apart are 1 m apart until the camera is recalibrated in mid hour, then 3 m."""
    change = datetime(2026, 11, 9, 8, 0, 30, tzinfo=UTC)
    camera = Camera(
        "cam",
        "Cam",
        "ground",
        hz=1.0,
        calibrations=(scaled(0.01), scaled(0.03, valid_from=change)),
        picture_px=(1000, 1000),
    )
    site = make_site(tmp_path, cameras=[camera])
    put(site, [Person(T0 + k * 1000, t, u=u, v=500.0) for k in range(60) for t, u in (("a", 100.0), ("b", 200.0))])
    with open_days(site) as warehouse:
        found = hour(warehouse)
        pairs = warehouse.rows("select distinct distance_mm, x_a_mm, x_b_mm from pairs")
        cells = warehouse.rows("select cx, sum(person_records) as n from floor_cells group by cx order by cx")
    assert (found["person_records"], found["violation_records"]) == (120, 30)
    assert pairs == [{"distance_mm": 1000, "x_a_mm": 1000, "x_b_mm": 2000}]
    assert {c["cx"]: c["n"] for c in cells if c["n"]} == {4: 30, 8: 30, 12: 30, 24: 30}


def test_pixels_without_calibration_are_people_without_a_place(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [Person(T0, "a", u=100.0, v=5.0), Person(T0, "b", u=101.0, v=5.0)])
    with open_days(site) as warehouse:
        found = hour(warehouse)
        n_unlocated = warehouse.rows("select sum(n_unlocated) as n from exposure")[0]["n"]
        heat = operator_counts.heatmap(warehouse)
    assert (found["person_records"], found["violation_records"], n_unlocated) == (2, None, 2)
    assert heat.empty


def overlapping() -> list[Camera]:
    """Return a camera that sees x from 0 to 12 m and one that sees 8 to 20 m; neither has a homography."""
    views = {"cam": (0.0, 12.0), "cam-2": (8.0, 20.0)}
    return [
        Camera(c, c, "ground", hz=1.0, view=((x0, 0.0), (x1, 0.0), (x1, 10.0), (x0, 10.0)))
        for c, (x0, x1) in views.items()
    ]


def test_people_two_cameras_see_are_counted_once(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    cameras = overlapping()
    spans = {"cam": (0, 12_000), "cam-2": (8_000, 20_000)}
    records: list[Person | Frame] = [f for c in spans for f in beats(T0, T0 + 100_000, camera=c)]
    people: list[tuple[int, int, int]] = []
    for second in range(100):
        for i, (x, y) in enumerate(rng.integers((0, 0), (20_000, 10_000), size=(12, 2))):
            people.append((second, int(x), int(y)))
            for camera, (low, high) in spans.items():
                if low < x < high:
                    records.append(Person(T0 + second * 1000, f"{camera}-{i}", int(x), int(y), camera))
    n_seen_twice = sum(8_000 < x < 12_000 for _, x, _ in people)
    site = make_site(tmp_path, cameras=cameras)
    put(site, records)
    with open_days(site) as warehouse:
        found = hour(warehouse)
        told = warehouse.rows("select sum(person_records) as n, sum(n_doubled) as doubled from exposure")[0]
        heat = operator_counts.heatmap(warehouse, at="person")
        cells = warehouse.rows("select sum(person_records) as n, sum(violation_persons) as v from heatmap")[0]
        owned = warehouse.rows(
            "select camera_id, min(cx) as low, max(cx) as high from owner_cells where cy between 0 and 19 "
            "group by 1 order by 1"
        )
    assert n_seen_twice > 200
    assert found["person_records"] == told["n"] == cells["n"] == len(people)
    assert found["exposure_s"] == heat["exposure_s"].sum() == len(people)
    assert told["doubled"] == n_seen_twice
    assert [(r["camera_id"], r["low"], r["high"]) for r in owned] == [("cam", 12, 19), ("cam-2", 20, 27)]
    in_view = Counter()
    for second in range(100):
        group = [(x, y) for s, x, y in people if s == second]
        for camera, (low, high) in spans.items():
            own = [(x, y) for x, y in group if low < x < high]
            counts_here = (lambda x: x < 10_000) if camera == "cam" else (lambda x: x >= 10_000)
            close = [
                (p, q)
                for i, p in enumerate(own)
                for q in own[i + 1 :]
                if (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 < 2000**2
            ]
            in_view["records"] += sum(counts_here((p[0] + q[0]) / 2) for p, q in close)
            in_view["persons"] += sum(counts_here(x) for x, _ in {xy for pair in close for xy in pair})
    assert found["violation_records"] == in_view["records"] > 100
    assert found["violation_s"] == cells["v"] == in_view["persons"]


def test_a_violation_two_cameras_see_is_counted_once(tmp_path: Path) -> None:
    site = make_site(tmp_path, cameras=overlapping())
    put(
        site,
        [
            Person(T0 + k * 1000, f"{c}-{t}", x, 5_000, c)
            for k in range(10)
            for c in ("cam", "cam-2")
            for t, x in (("a", 8_500), ("b", 9_500))
        ],
    )
    with open_days(site) as warehouse:
        assert warehouse.rows("select camera_id from violations") == [{"camera_id": "cam"}]
        assert warehouse.rows("select sum(n_violations) as n from hours") == [{"n": 1}]


def test_one_camera_down_leaves_the_others_counts(tmp_path: Path) -> None:
    cameras = [Camera(c, c, "ground", hz=1.0) for c in ("cam", "cam-2")]
    site = make_site(tmp_path, cameras=cameras)
    put(site, [*beats(T0, T0 + HOUR), Person(T0, "a", 0, 0)])
    with open_days(site) as warehouse:
        found = hour(warehouse)
        per_camera = warehouse.rows("select camera_id, person_records from camera_hours where local_hour = 8")
    assert (found["person_records"], found["cameras_down"], found["recorded_s"]) == (1, 1, 1800)
    assert {r["camera_id"]: r["person_records"] for r in per_camera} == {"cam": 1, "cam-2": None}


def test_records_of_a_camera_that_left_vsd_toml_stop_all_figures(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(
        site,
        [Person(T0, "a", 0, 0), Person(T0, "b", 0, 500), Person(T0, "c", 0, 0, "gone"), Pair(T0, "c", "d", 5, "gone")],
    )
    with pytest.raises(ConfigError, match="does not describe what is stored"):
        open_days(site)


def test_body_scaled_pairs_without_persons_in_range_keep_their_rows(tmp_path: Path) -> None:
    """Several pairs of one frame without ids: each pair is a record, people are distinguished by their number."""
    site = make_site(tmp_path)
    put(site, [Pair(T0, None, None, 1000, persons=(0, 1)), Pair(T0, None, None, 1500, persons=(0, 2))])
    with open_days(site) as warehouse:
        found = hour(warehouse)
    assert (found["violation_records"], found["violation_s"], found["n_violations"]) == (2, 3.0, None)


def test_instants_before_1970_and_far_ahead_do_not_break_hours(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [Person(at("1999-12-31 23:59:59"), "a", 0, 0), Person(at("2000-01-01 00:00"), "a", 0, 0)])
    with open_days(site, "1999-12-31", "2000-01-01") as warehouse:
        rows = warehouse.rows("select local_date, local_hour, person_records from hours where person_records > 0")
    assert [(r["local_date"].isoformat(), r["local_hour"], r["person_records"]) for r in rows] == [
        ("1999-12-31", 23, 1),
        ("2000-01-01", 0, 1),
    ]
