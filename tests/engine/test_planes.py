"""Several planes in one picture: a floor, a ramp and a stage seen by one pinhole camera, each by its own homography."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from itertools import combinations
from pathlib import Path

import cv2
import duckdb
import numpy as np
import pytest
import shapely
from engine.simulated_people import SIZE, SimulatedCamera, boxes_only, simulate, upright_boxes
from engine.vsd_in_a_shop import Vsd, shop, write_boxes
from numpy.typing import NDArray
from site_text import site_text

from vsd_analytics.api.floor_view import picture_view
from vsd_analytics.config.project import load_site
from vsd_analytics.engine.calibration_error import LikelyCameras
from vsd_analytics.engine.floor_method import locate
from vsd_analytics.engine.people import N_JOINTS, People
from vsd_analytics.engine.plane_method import locate_on_planes
from vsd_analytics.errors import ConfigError, UsageError
from vsd_analytics.site.model import Calibration, Plane

Array = NDArray[np.float64]
CAMERA = SimulatedCamera(height_m=4, tilt_deg=25)
STAGE_M = 0.8
CORNERS = {  # on the plan; a ramp on the left and a step on the right lead from the floor at 0 up to the stage
    "ramp": [(-5, 10), (0, 10), (0, 14), (-5, 14)],
    "stage": [(0, 10), (5, 10), (6, 16), (-6, 16), (-5, 14), (0, 14)],
}
HEIGHTS = {"ramp": (-2.0, 0.0, 0.2), "stage": (STAGE_M, 0.0, 0.0)}  # a, b, c of a + b x + c y
HEIGHT_LINES = {"ramp": "height_m = [[0, 10, 0], [2, 10, 0], [0, 14, 0.8]]", "stage": "height_m = 0.8"}


def in_space(xy: Array, name: str | None) -> Array:
    a, b, c = HEIGHTS[name] if name else (0.0, 0.0, 0.0)
    return np.column_stack([xy, a + xy @ (b, c)])


def seen_at(xy: object, name: str | None) -> Array:
    return CAMERA.project(in_space(np.asarray(xy, dtype=float), name))


def places(rng: np.random.Generator, n: int, name: str | None) -> Array:
    low, high = {None: ((-3, 6.5), (3, 9.3)), "ramp": ((-4.5, 10.1), (-0.5, 13.9)), "stage": ((0.5, 10.2), (4.5, 15))}[
        name
    ]
    return rng.uniform(low, high, (n, 2))


def boxes(feet: Array, frame: NDArray[np.int64], track: list[str]) -> People:
    box = upright_boxes(CAMERA, feet)
    names = np.array(track, dtype=object)
    return People(frame, names, box, np.full((len(feet), N_JOINTS, 2), np.nan), np.unique(frame))


def crowd(n_frames: int = 30) -> tuple[People, Array]:
    """Return four people on each plane in each frame, and where they are in space."""
    rng = np.random.default_rng(3)
    groups = [(places(rng, 4 * n_frames, name), name) for name in (None, "ramp", "stage")]
    xyz = np.concatenate([in_space(xy, name) for xy, name in groups])
    frame = np.tile(np.repeat(np.arange(n_frames), 4), 3)
    order = np.argsort(frame, kind="stable")
    people = boxes(CAMERA.project(xyz)[order], frame[order], [str(i % 12) for i in range(len(order))])
    return people, xyz[order]


def write_planes(folder: Path, *, names: tuple[str, ...] = ("ramp", "stage"), has_heights: bool = True) -> None:
    """Write the planes of cam-1, each measured at its corners to whole pixels, as somebody clicks them."""
    (folder / "calibration").mkdir(exist_ok=True)
    entries = []
    for name in names:
        spots = np.array([*CORNERS[name], np.mean(CORNERS[name], axis=0)])
        pairs = np.column_stack([seen_at(spots, name).round(), spots])
        np.savetxt(folder / f"calibration/{name}.csv", pairs, delimiter=",", header="u,v,x,y", comments="")
        corners = seen_at(CORNERS[name], name).round().tolist()
        height = f"{HEIGHT_LINES[name]}\n" if has_heights else ""
        entries.append(f'[[plane]]\nid = "{name}"\npolygon_px = {corners}\npoints = "calibration/{name}.csv"\n{height}')
    with (folder / "calibration/cam-1.toml").open("a") as file:
        file.write("\n".join(entries))


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    return shop(tmp_path, capsys)


@pytest.fixture
def calibrated(tmp_path: Path, vsd: Vsd) -> Vsd:
    np.savetxt(tmp_path / "matrix.txt", CAMERA.homography())
    assert vsd("calibrate", "cam-1", "--matrix", str(tmp_path / "matrix.txt"))[0] == 0
    return vsd


def run(vsd: Vsd, folder: Path, people: People, *words: str, with_tracks: bool = True) -> tuple[list[dict], dict]:
    source, out = write_boxes(folder / "people.csv", people, with_tracks=with_tracks), folder / "frames.jsonl"
    start = ["--hz", "2", "--start", "2026-11-09T08:00Z", "--out", str(out), "--json"]
    code, printed, err = vsd("engine", "run", str(source), "--camera", "cam-1", *start, *words)
    assert code == 0, err
    return [json.loads(line) for line in out.read_text().splitlines()], json.loads(printed)


def found_places(messages: list[dict]) -> Array:
    return np.array([(p["x_m"], p["y_m"]) for m in messages for p in m["persons"]])


def close_pairs(messages: list[dict], below_m: float) -> set[tuple[int, str, str]]:
    return {(m["seq"], *sorted((p["a"], p["b"]))) for m in messages for p in m["pairs"] if p["distance_m"] < below_m}


def true_pairs(people: People, xyz: Array, below_m: float) -> set[tuple[int, str, str]]:
    rows = range(len(people))
    return {
        (int(people.frame[i]), *sorted((people.track[i], people.track[j])))
        for i, j in combinations(rows, 2)
        if people.frame[i] == people.frame[j] and np.linalg.norm(xyz[i] - xyz[j]) < below_m
    }


def f1(found: set, true: set) -> float:
    return 2 * len(found & true) / (len(found) + len(true))


def test_with_planes_people_are_where_they_stand_and_with_one_homography_metres_away(
    tmp_path: Path, calibrated: Vsd
) -> None:
    people, xyz = crowd()
    is_raised = xyz[:, 2] > 0.4
    flat, _ = run(calibrated, tmp_path, people)
    write_planes(tmp_path)
    planes, done = run(calibrated, tmp_path, people)
    off_flat, off = (np.linalg.norm(found_places(m) - xyz[:, :2], axis=1) for m in (flat, planes))
    assert np.median(off_flat[is_raised]) > 2.0
    assert np.median(off) < 0.02
    assert off.max() < 0.06
    true = true_pairs(people, xyz, 2.0)
    assert f1(close_pairs(planes, 2.0), true) > 0.98
    assert f1(close_pairs(flat, 2.0), true) < 0.85
    assert done["left_out"] == {}
    assert done["engine"].startswith("vsd-people planes ")


def test_the_example_of_the_docs_is_this_scene(tmp_path: Path) -> None:
    write_planes(tmp_path)
    page = (Path(__file__).parents[2] / "docs/engine.md").read_text(encoding="utf-8")
    example = next(block for block in page.split("```toml\n")[1:] if "[[plane]]" in block).partition("```")[0]
    assert tomllib.loads(example) == tomllib.loads((tmp_path / "calibration/cam-1.toml").read_text())


def test_the_camera_itself_is_calibrated_from_the_people_outside_its_planes(tmp_path: Path, vsd: Vsd) -> None:
    walk = boxes_only(simulate(CAMERA, seed=4, n_tracks=40, seconds=15))
    dwarfs = walk.frame % 3 == 0
    people = replace(walk, box=np.where(dwarfs[:, None], walk.box * (1, 0.2, 1, 0.2), walk.box))
    outside = people.rows(people.box[:, 3] > 220)
    found = []
    for seen, is_plane in ((outside, False), (people, True)):
        if is_plane:
            (tmp_path / "calibration/far.csv").write_text("u,v,x,y\n0,0,0,9\n1920,0,9,9\n1920,220,9,8\n0,220,0,8\n")
            corners = "[[0, 0], [1920, 0], [1920, 220], [0, 220]]"
            plane = f'[[plane]]\nid = "far"\npolygon_px = {corners}\npoints = "calibration/far.csv"\n'
            (tmp_path / "calibration/cam-1.toml").write_text(plane)
        source = write_boxes(tmp_path / "people.csv", seen)
        code, printed, err = vsd("calibrate", "cam-1", "--from-people", str(source), "--json")
        assert code == 0, err
        found.append(json.loads(printed)["tilt_deg"])
    assert len(outside) < len(people)
    assert found[0] == found[1]


def test_a_distance_along_a_ramp_or_over_a_step_is_that_in_space(tmp_path: Path, calibrated: Vsd) -> None:
    write_planes(tmp_path)
    feet = np.concatenate(
        [seen_at([(-2, 11), (-2, 12.5)], "ramp"), seen_at([(2, 9.6)], None), seen_at([(2, 10.3)], "stage")]
    )
    messages, _ = run(calibrated, tmp_path, boxes(feet, np.zeros(4, dtype=np.int64), list("abcd")))
    found = {(p["a"], p["b"]): p["distance_m"] for p in messages[0]["pairs"]}
    assert found == {
        ("a", "b"): pytest.approx(np.hypot(1.5, 0.3), abs=0.05),
        ("c", "d"): pytest.approx(np.hypot(0.7, STAGE_M), abs=0.05),
    }


def test_without_heights_nobody_on_one_plane_is_near_anybody_on_another(tmp_path: Path, calibrated: Vsd) -> None:
    write_planes(tmp_path, has_heights=False)
    people, xyz = crowd()
    messages, _ = run(calibrated, tmp_path, people)
    plane = {
        (int(f), t): int(x[2] > 0) + int(x[1] > 10 and x[0] > 0)
        for f, t, x in zip(people.frame, people.track, xyz, strict=True)
    }
    pairs = close_pairs(messages, 9.0)
    assert len(pairs) > 50
    assert all(plane[frame, a] == plane[frame, b] for frame, a, b in pairs)


def test_people_outside_all_planes_are_counted_and_the_rest_reach_the_store_in_metres(tmp_path: Path, vsd: Vsd) -> None:
    write_planes(tmp_path, names=("stage",))
    people, xyz = crowd()
    messages, done = run(vsd, tmp_path, people, with_tracks=False)
    n_stage = int((xyz[:, 2] == STAGE_M).sum())
    assert done["left_out"] == {"outside all planes": len(people) - n_stage}
    assert not any(key in p for m in messages for p in m["persons"] for key in ("u_px", "v_px"))
    assert all("pairs" in m for m in messages), "a reader would derive distances from the plan alone"
    code, _, err = vsd("ingest", str(tmp_path / "frames.jsonl"))
    assert code in {0, 1}  # ids that name rows of frames are doubted
    assert "quarantined" not in err
    stored = duckdb.sql(f"select count(x_mm), count(u_px) from '{tmp_path}/store/observations/**/*.parquet'").fetchall()
    assert stored == [(n_stage, 0)]


def test_somebody_who_walks_up_the_ramp_is_one_track(tmp_path: Path, calibrated: Vsd) -> None:
    write_planes(tmp_path)
    y = np.arange(7, 15.5, 0.5)
    xy = np.column_stack([np.full(len(y), -2.0), y])
    feet = np.concatenate([seen_at([p], None if p[1] < 10 else "ramp" if p[1] < 14 else "stage") for p in xy])
    people = boxes(feet, np.arange(len(y)), ["?"] * len(y))
    messages, _ = run(calibrated, tmp_path, people, "--track", with_tracks=False)
    assert len({p["id"] for m in messages for p in m["persons"]}) == 1
    assert np.abs(found_places(messages) - xy).max() < 0.06


def test_a_plane_calibrated_again_holds_from_its_date(tmp_path: Path, calibrated: Vsd) -> None:
    write_planes(tmp_path, names=("stage",))
    moved = np.loadtxt(tmp_path / "calibration/stage.csv", delimiter=",", skiprows=1) + np.array([0, 0, 100, 0])
    np.savetxt(tmp_path / "calibration/later.csv", moved, delimiter=",", header="u,v,x,y", comments="")
    file = tmp_path / "calibration/cam-1.toml"
    entry = file.read_text().partition("[[plane]]")[2].replace("stage.csv", "later.csv")
    file.write_text(f"{file.read_text()}\n[[plane]]{entry}from = 2026-11-09T08:00:01Z\n")
    (tmp_path / "vsd.toml").write_text(
        (tmp_path / "vsd.toml").read_text() + "view = [[-6, 4], [6, 4], [6, 16], [-6, 16]]\n"
    )
    feet = seen_at([(2, 12)] * 4, "stage")
    messages, _ = run(calibrated, tmp_path, boxes(feet, np.arange(4), ["a"] * 4))
    assert found_places(messages)[:, 0] == pytest.approx([2, 2, 102, 102], abs=0.05)
    assert len({m["engine"] for m in messages}) == 2


@pytest.fixture
def planes() -> Callable[..., tuple[Plane, ...]]:
    def exact(*names: str) -> tuple[Plane, ...]:
        found = []
        for name in names:
            a, b, c = HEIGHTS[name]
            lift = np.array([[1, 0, 0], [0, 1, 0], [b, c, a], [0, 0, 1]])
            h = tuple(map(tuple, np.linalg.inv(CAMERA.matrix() @ lift).tolist()))
            corners = tuple(map(tuple, seen_at(CORNERS[name], name).tolist()))
            found.append(Plane(name, corners, Calibration(h, None, name), HEIGHTS[name]))
        return tuple(found)

    return exact


def test_a_safe_space_is_drawn_on_the_plane_of_its_person(planes: Callable[..., tuple[Plane, ...]]) -> None:
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    homography = tuple(map(tuple, CAMERA.homography().tolist()))
    spots = [((0, 8), None), ((-2, 12), "ramp"), ((2, 13), "stage")]
    feet = np.concatenate([seen_at([at], name) for at, name in spots])
    people = boxes(feet, np.zeros(3, dtype=np.int64), list("abc"))
    seen = locate_on_planes(
        people,
        planes=planes("ramp", "stage"),
        calibration=Calibration(homography, None, "floor"),
        picture_px=SIZE,
        within_m=2.5,
    )
    assert seen.spaces is not None
    true = np.stack([seen_at(ring + np.array(at), name) for at, name in spots])
    assert seen.spaces.ellipses() == pytest.approx(true, abs=1e-6)
    assert seen.spaces.ellipses(np.array([2])) == pytest.approx(true[2:], abs=1e-6)
    alone = locate(people, homography=CAMERA.homography(), picture_px=SIZE, within_m=2.5, name="floor")
    assert alone.spaces is not None
    assert np.abs(alone.spaces.ellipses() - true)[2].max() > 20


def test_the_stated_error_of_a_plane_goes_with_the_distances_on_it(planes: Callable[..., tuple[Plane, ...]]) -> None:
    def stated_error(used: Calibration) -> LikelyCameras | None:
        h = np.array(used.homography)
        return LikelyCameras(h, np.repeat(h[None], 5, axis=0), SIZE) if used.calibration_id == "stage" else None

    feet = np.concatenate([seen_at([(-1, 12), (-2, 12)], "ramp"), seen_at([(1, 12), (2, 12)], "stage")])
    people = boxes(feet, np.zeros(4, dtype=np.int64), list("abcd"))
    both = planes("ramp", "stage")
    seen = locate_on_planes(
        people, planes=both, calibration=None, picture_px=SIZE, within_m=2.5, stated_error=stated_error
    )
    assert list(zip(seen.a.tolist(), seen.b.tolist(), strict=True)) == [(0, 1), (0, 2), (2, 3)]
    assert seen.sd_m is not None
    assert np.isfinite(seen.sd_m).tolist() == [False, False, True]
    alone = stated_error(both[1].calibration)
    assert alone is not None
    assert seen.sd_m[2] == pytest.approx(alone.distance_sd_m(seen.uv[[2]], seen.uv[[3]])[0])


def test_what_the_camera_sees_is_the_outline_of_its_planes(tmp_path: Path, calibrated: Vsd) -> None:
    write_planes(tmp_path)
    camera = load_site(tmp_path).cameras[0]
    assert camera.view is not None
    view = shapely.Polygon(camera.view)
    assert shapely.contains_xy(view, *np.array([(0, 8), (-2, 12), (3, 12), (0, 15.8)]).T).all()
    assert not shapely.contains_xy(view, [0, 0], [17, 19]).any(), "the stage hides the floor behind it"
    assert shapely.contains_xy(view, 0, 21)


def test_no_map_is_drawn_over_a_picture_of_several_planes(tmp_path: Path, calibrated: Vsd) -> None:
    write_planes(tmp_path)
    site = load_site(tmp_path)
    picture = tmp_path / "scene.png"
    cv2.imwrite(str(picture), np.full((1080, 1920, 3), 200, dtype=np.uint8))
    seen = replace(site, cameras=(replace(site.cameras[0], picture=picture),))
    with pytest.raises(UsageError, match="cannot be drawn over the picture"):
        picture_view(seen, "cam-1", floor=site.floors[0], until=date(2026, 11, 9))
    flat = replace(seen, cameras=(replace(seen.cameras[0], planes=()),))
    assert picture_view(flat, "cam-1", floor=site.floors[0], until=date(2026, 11, 9)).camera.picture == picture


def test_planes_that_lie_apart_need_a_view_and_the_message_has_its_line(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text(site_text())
    write_planes(tmp_path, names=("ramp", "stage"))
    apart = tmp_path / "calibration/stage.csv"
    np.savetxt(
        apart,
        np.loadtxt(apart, delimiter=",", skiprows=1) + np.array([0, 0, 20, 0]),
        delimiter=",",
        header="u,v,x,y",
        comments="",
    )
    with pytest.raises(ConfigError) as caught:
        load_site(tmp_path)
    (problem,) = caught.value.problems
    assert problem.code == "E123"
    assert problem.fix is not None
    line = problem.fix.partition(": ")[2]
    (tmp_path / "vsd.toml").write_text(f"{(tmp_path / 'vsd.toml').read_text()}{line}\n")
    view = shapely.Polygon(load_site(tmp_path).cameras[0].view)
    assert shapely.contains_xy(view, [-2, 23], [12, 12]).all()
