"""How good the engine is: the paper's method with the truth's help, and the calibration from people without any.

Run `VSD_REALDATA=... python tests/engine/prove_engine.py`; the tables are in docs/methods. `--part simulated`,
`boxes`, `lens`, `real`, `error`, `moved` or `speed` runs one of them. Real boxes are the annotated ones of OxTown and
WILDTRACK, not detections.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))
from engine.pair_errors import distances, pair_errors
from engine.simulated_people import SIZE, Scene, SimulatedCamera, boxes_only, simulate
from engine.simulated_rooms import room_picture
from engine.simulated_weeks import MONDAY_MS, simulate_week

from vsd_analytics.engine.body import PART_M, ground_points, part_px
from vsd_analytics.engine.camera_moves import HOUR_MS, CameraCheck, check_camera
from vsd_analytics.engine.floor_method import locate
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.people import People
from vsd_analytics.engine.people_calibration import FromPeople, calibrate_from_people
from vsd_analytics.engine.ratio_search import Labelled, paper_distances, search
from vsd_analytics.engine.ratios import Ratios
from vsd_analytics.engine.safe_space import pairs_of_frames, safe_spaces
from vsd_analytics.engine.scores import f1_of, f1_of_frames
from vsd_analytics.engine.vanishing_points import camera_from_segments, line_segments
from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry.homography import to_floor

Array = NDArray[np.float64]
BY_EYE = Ratios(0.7, 0.7)
"""The published default, for what a user has who tunes nothing."""


def labelled(people: People, xy: Array) -> Labelled:
    a, b = pairs_of_frames(people.frame)
    return Labelled(people, a, b, np.linalg.norm(xy[a] - xy[b], axis=1), SIZE)


def scores(given: Labelled, found_m: Array) -> list[float]:
    pairs, persons = given.hits(found_m, distance_m=2.0)
    score = pair_errors(given.distance_m, found_m)
    return [f1_of(pairs), f1_of_frames(pairs), f1_of_frames(persons), score.error, score.bias]


def floor_m(given: Labelled, homography: Array) -> Array:
    return distances(
        given.people.frame,
        to_floor(homography, floor_points(given.people, homography=homography, picture_px=SIZE), picture_px=SIZE),
    )


def nameless(people: People) -> People:
    none = np.full(len(people), None, dtype=object)
    return People(people.frame, none, people.box, people.joints, people.frames, people.ts_ms)


def show(name: str, values: list[float]) -> None:
    print(
        f"| {name} | " + " | ".join(f"{v:.3f}" for v in values[:3]) + f" | {values[3]:.1%} | {values[4]:+.1%} |",
        flush=True,
    )


def head(first: str) -> None:
    print(f"\n| {first} | F1 pairs, pooled | F1 pairs, frame mean | F1 persons, frame mean | distance error | bias |")
    print("|---|---|---|---|---|---|")


# --- real scenes ------------------------------------------------------------------------------------------------


def people_of(rows: Array) -> tuple[People, Array]:
    """Return people and true positions of rows (frame, track, left, top, right, bottom, x, y)."""
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    frame = rows[:, 0].astype(np.int64)
    track = rows[:, 1].astype(int).astype(str).astype(object)
    joints = np.full((len(rows), 25, 2), np.nan)
    return People(frame, track, rows[:, 2:6], joints, np.unique(frame)), rows[:, 6:8]


def oxtown(folder: Path) -> Array:
    import gzip

    rows = []
    with gzip.open(folder / "oxtown" / "TownCentre-groundtruth.top.gz", "rt") as lines:
        for line in lines:
            parts = line.strip().split(",")
            if len(parts) == 12 and parts[0].isdigit():
                rows.append([float(parts[1]), float(parts[0]), *map(float, parts[8:12])])
    given = np.array(rows)
    matrix = np.loadtxt(folder / "oxtown" / "H_image_to_ground_m.txt")
    uv = np.column_stack([(given[:, 2] + given[:, 4]) / 2, given[:, 5]])
    return np.column_stack([given, to_floor(matrix, uv, picture_px=SIZE)])


def wildtrack(folder: Path) -> dict[str, Array]:
    import tarfile

    rows: dict[int, list[list[float]]] = {view: [] for view in range(7)}
    with tarfile.open(folder / "wildtrack" / "annotations_positions_0_995.tar.gz") as archive:
        for member in archive.getmembers():
            name = Path(member.name)
            if name.suffix != ".json" or name.name.startswith("."):
                continue
            content = archive.extractfile(member)
            assert content is not None
            for person in json.load(content):
                at = (-3 + 0.025 * (person["positionID"] % 480), -9 + 0.025 * (person["positionID"] // 480))
                for view in person["views"]:
                    if view["xmax"] >= 0:
                        box = [float(view[side]) for side in ("xmin", "ymin", "xmax", "ymax")]
                        rows[view["viewNum"]].append([float(name.stem), person["personID"], *box, *at])
    return {f"C{view + 1}": np.array(found) for view, found in rows.items()}


def real_scenes(folder: Path) -> Iterator[tuple[str, People, Array]]:
    yield "OxTown", *people_of(oxtown(folder))
    for view, rows in wildtrack(folder).items():
        yield f"WILDTRACK {view}", *people_of(rows)


def real(folder: Path) -> None:
    tables: dict[str, list[list[float]]] = {}
    for name, people, xy in real_scenes(folder):
        head(name)
        given = labelled(people, xy)
        some = people.frame % 10 == 0 if len(people) > 20_000 else np.ones(len(people), dtype=bool)
        grid = labelled(people.rows(np.flatnonzero(some)), xy[some])
        best = search([grid], part="box", by="pairs").ratios
        methods = {
            ("paper, ratios found with the truth", f"({best})"): paper_distances(given, ratios=best, part="box"),
            ("paper, default ratios", f"({BY_EYE})"): paper_distances(given, ratios=BY_EYE, part="box"),
        }
        for label, who in (("people, with track ids", people), ("people, without", nameless(people))):
            start = time.perf_counter()
            found = calibrate_from_people(who, size_px=SIZE)
            took = time.perf_counter() - start
            methods[label, f"(stated {found.error:.0%}; {took:.0f} s)"] = floor_m(given, found.homography)
        for (label, more), found_m in methods.items():
            values = scores(given, found_m)
            show(f"{label} {more}", values)
            tables.setdefault(label, []).append(values)
    head("mean of the eight")
    for label, rows in tables.items():
        show(label, np.mean(rows, axis=0).tolist())


# --- simulated scenes -------------------------------------------------------------------------------------------


def cameras(n: int, seed: int) -> Iterator[SimulatedCamera]:
    rng = np.random.default_rng(seed)
    for _ in range(n):
        yield SimulatedCamera(
            height_m=rng.uniform(2.5, 8),
            tilt_deg=rng.uniform(10, 60),
            roll_deg=rng.normal(0, 1.5),
            f_widths=float(np.exp(rng.uniform(np.log(0.6), np.log(2)))),
            k1=rng.normal(0, 0.05),
        )


def worlds(n: int, seed: int) -> Iterator[Scene]:
    for i, camera in enumerate(cameras(n, seed)):
        scene = simulate(camera, seed=seed + i, n_tracks=100, seconds=20, children=0.1, sitting=0.1)
        a, b = pairs_of_frames(scene.people.frame)
        if np.sum(np.linalg.norm(scene.xy[a] - scene.xy[b], axis=1) < 2) >= 20:
            yield scene


def by_lines(scene: Scene, given: Labelled, *, seed: int) -> dict[str, Array]:
    """Return distances by the vanishing points of a tiled room: measured by the torso, and by the camera's height."""
    turn_deg = float(np.random.default_rng(seed).uniform(-45, 45))
    segments = line_segments(room_picture(scene.camera, seed=seed, turn_deg=turn_deg))
    found = camera_from_segments(segments, size_px=SIZE, height_m=scene.camera.height_m)
    homography, people = found.camera.homography(), given.people
    length = part_px(people, "torso")
    spaces = safe_spaces(
        homography, ground_points(people), length, length_m=PART_M["torso"], radius_m=1.0, picture_px=SIZE
    )
    apart = np.linalg.norm(spaces.centre[given.a] - spaces.centre[given.b], axis=1)
    torso_m = apart / (spaces.radius[given.a] + spaces.radius[given.b]) * 2
    return {"vanishing points, torso": torso_m, "vanishing points, height given": floor_m(given, homography)}


def simulated(n: int, seed: int) -> None:
    rows: dict[str, list[list[float]]] = {}
    refused: dict[str, int] = {}
    n_used = 0
    for scene in worlds(n, seed):
        n_used += 1
        given = labelled(scene.people, scene.xy)
        boxed = labelled(boxes_only(scene), scene.xy)
        best = {part: search([given], part=part).ratios for part in PART_M}
        for part, own in best.items():
            given_as = {"ratios found with the truth": own}
            if part != "torso":
                given_as["the torso's ratios"] = best["torso"]
            for which, ratios in given_as.items():
                measured = scores(given, paper_distances(given, ratios=ratios, part=part))
                rows.setdefault(f"paper, {part}, {which}", []).append(measured)
        name = "paper, torso, default ratios"
        rows.setdefault(name, []).append(scores(given, paper_distances(given, ratios=BY_EYE, part="torso")))
        for name, who in (
            ("people, joints and track ids", given),
            ("people, joints alone", labelled(nameless(given.people), scene.xy)),
            ("people, boxes and track ids", boxed),
            ("people, boxes alone", labelled(nameless(boxed.people), scene.xy)),
        ):
            try:
                found = calibrate_from_people(who.people, size_px=SIZE)
            except CalibrationError:
                refused[name] = refused.get(name, 0) + 1
                continue
            rows.setdefault(name, []).append(scores(who, floor_m(who, found.homography)))
        try:
            for name, found_m in by_lines(scene, given, seed=seed + n_used).items():
                rows.setdefault(name, []).append(scores(given, found_m))
        except CalibrationError:
            for name in ("vanishing points, torso", "vanishing points, height given"):
                refused[name] = refused.get(name, 0) + 1
        name = "true camera, joints"
        rows.setdefault(name, []).append(scores(given, floor_m(given, scene.camera.homography())))
    print(f"\n{n_used} of {n} cameras saw 20 close pairs or more. Medians over cameras; distance error also at 90 %.")
    head("method")
    for name, values in sorted(rows.items(), key=lambda item: item[0]):
        worst = float(np.nanquantile([v[3] for v in values], 0.9))
        label = f"{name} ({refused.get(name, 0)} refused; 90 % of errors below {worst:.1%})"
        show(label, np.nanmedian(values, axis=0).tolist())


def boxes(n: int, seed: int) -> None:
    """Print which part of the error of boxes with track ids goes away when a part of the camera or the feet is true."""
    rows: dict[str, list[list[float]]] = {}
    for scene in worlds(n, seed):
        people = boxes_only(scene)
        given = labelled(people, scene.xy)
        try:
            found = calibrate_from_people(people, size_px=SIZE)
        except CalibrationError:
            continue
        true, camera = scene.camera.homography(), found.camera
        a, b = given.a, given.b
        near = (given.distance_m > 0.3) & (given.distance_m < 6)
        own = floor_m(given, found.homography)
        ratio = np.median((own / given.distance_m)[near & np.isfinite(own)])
        tilt, roll = np.radians(scene.camera.tilt_deg), np.radians(scene.camera.roll_deg)
        focal, middle = scene.camera.f_widths * SIZE[0], (SIZE[0] / 2, SIZE[1] / 2)
        feet_px = scene.camera.project(np.column_stack([scene.xy, np.zeros(len(scene.xy))]))
        at_feet = to_floor(found.homography, feet_px, picture_px=SIZE)
        views = {
            "true focal length and axis": replace(camera, focal_px=focal, centre_px=middle),
            "true tilt and roll": replace(camera, tilt_rad=tilt, roll_rad=roll),
            "true focal length, axis, tilt and roll": replace(
                camera, focal_px=focal, centre_px=middle, tilt_rad=tilt, roll_rad=roll
            ),
            "true height": replace(camera, height_m=scene.camera.height_m),
        }
        each = {
            "as found": own,
            "as found, scale right on average": own / ratio,
            "as found, at the true feet": np.linalg.norm(at_feet[a] - at_feet[b], axis=1),
            "true camera, feet from boxes": floor_m(given, true),
        }
        each |= {name: floor_m(given, view.homography()) for name, view in views.items()}
        for name, found_m in each.items():
            rows.setdefault(name, []).append(scores(given, found_m))
    head(f"boxes and track ids, {len(rows['as found'])} cameras")
    for name, values in rows.items():
        show(name, np.nanmedian(values, axis=0).tolist())


def lens(n: int, seed: int) -> None:
    """Print what knowing the lens distortion would bring: joints as they are, and with their pixels made straight."""
    rows: dict[str, list[list[float]]] = {}
    for scene in worlds(n, seed):
        straight = replace(scene.people, joints=scene.camera.straightened(scene.people.joints))
        for name, people in (("as it is", scene.people), ("distortion known", straight)):
            given = labelled(people, scene.xy)
            true = scene.camera.homography()
            rows.setdefault(f"true camera, lens {name}", []).append(scores(given, floor_m(given, true)))
            found = calibrate_from_people(people, size_px=SIZE)
            rows.setdefault(f"people, lens {name}", []).append(scores(given, floor_m(given, found.homography)))
    head("joints and track ids")
    for name, values in sorted(rows.items()):
        worst = float(np.quantile([v[3] for v in values], 0.9))
        show(f"{name} (90 % of errors below {worst:.1%})", np.median(values, axis=0).tolist())


def error(n: int, seed: int) -> None:
    """Print how often the true distance lies within the stated 90 % bound, by distance from the camera."""
    bins = np.array([0, 5, 10, 15, 20, 40])
    for name in ("joints", "boxes"):
        inside, total, each = np.zeros(len(bins) - 1), np.zeros(len(bins) - 1), []
        for scene in worlds(n, seed):
            people = scene.people if name == "joints" else boxes_only(scene)
            try:
                found = calibrate_from_people(people, size_px=SIZE)
            except CalibrationError:
                continue
            given = labelled(people, scene.xy)
            near = np.flatnonzero((given.distance_m > 0.3) & (given.distance_m < 4))
            a, b = given.a[near], given.b[near]
            uv = floor_points(people, homography=found.homography, picture_px=SIZE)
            sd = found.distance_sd_m(uv[a], uv[b])
            off = np.abs(floor_m(given, found.homography)[near] - given.distance_m[near])
            known = np.isfinite(off) & np.isfinite(sd)
            is_in = off[known] < 1.645 * sd[known]
            away = np.linalg.norm((scene.xy[a] + scene.xy[b])[known] / 2, axis=1)
            where = np.digitize(away, bins[1:-1])
            inside += np.bincount(where, is_in, minlength=len(bins) - 1)
            total += np.bincount(where, minlength=len(bins) - 1)
            each.append(float(is_in.mean()))
        print(f"\n{name}: share of distances within the stated 90 % bound, by distance from the camera")
        for low, high, good, all_ in zip(bins[:-1], bins[1:], inside, total, strict=True):
            print(f"| {low} to {high} m | {good / max(all_, 1):.3f} | {int(all_):,} pairs |")
        print(
            f"| cameras whose bound holds for 90 % of distances | {np.mean(np.array(each) >= 0.9):.2f} | {len(each)} |"
        )


def moved(n: int, seed: int) -> None:
    """Print when a turned camera is found, and how often one that nobody touched is called moved.

    Each camera is calibrated from two days of a week with another crowd. Every second one is turned on Wednesday at
    14:18.
    """
    rng = np.random.default_rng(seed)
    day = 24 * HOUR_MS
    turned_h, n_cameras, n_alarms, n_thin = 2 * 24 + 14.3, 0, 0, 0
    until = {"that evening": 3, "Thursday evening": 4, "Friday evening": 5, "end of the week": 7}
    found: dict[float, list[str]] = {}
    late: dict[float, list[float]] = {}
    size: dict[float, list[float]] = {}
    while n_cameras < n:
        camera = SimulatedCamera(
            height_m=rng.uniform(2.5, 6),
            tilt_deg=rng.uniform(10, 35),
            roll_deg=rng.normal(0, 1.5),
            f_widths=float(np.exp(rng.uniform(np.log(0.6), np.log(1.5)))),
            k1=rng.normal(0, 0.05),
        )
        seed += 2
        try:
            known = calibrate_from_people(simulate_week(camera, seed=seed + 1, days=2), size_px=SIZE)
        except CalibrationError:
            continue
        quiet = check_week(simulate_week(camera, seed=seed), known)
        if quiet.least_deg is None:
            n_thin += 1
            continue
        n_cameras += 1
        n_alarms += bool(quiet.moves)
        if n_cameras % 2:
            continue
        for tilt in (1.0, 2.0, 5.0):
            week = simulate_week(camera, seed=seed, moved_h=turned_h, tilt_deg=tilt)
            when = "not found"
            for label, days in until.items():
                assert week.ts_ms is not None
                n_frames = int(np.searchsorted(week.ts_ms, MONDAY_MS + days * day))
                some = replace(week.rows(week.frame < n_frames), frames=week.frames[:n_frames])
                moves = check_week(replace(some, ts_ms=week.ts_ms[:n_frames]), known).moves
                if moves:
                    when = label
                    move = max(moves, key=lambda move: move.chi_square)
                    late.setdefault(tilt, []).append((move.before_ms - MONDAY_MS) / HOUR_MS - turned_h)
                    size.setdefault(tilt, []).append(move.tilt_deg)
                    break
            found.setdefault(tilt, []).append(when)
    print(f"\nfalse alarms: {n_alarms} of {n_cameras} quiet camera-weeks ({n_thin} cameras saw too few people to tell)")
    print(f"| turned by | {' | '.join(until)} | not found | tilt found, 10 to 90 % | found to be later than it was |")
    print("|---|" + "---|" * (len(until) + 3))
    for tilt, days_found in found.items():
        share = [f"{days_found.count(label) / len(days_found):.0%}" for label in (*until, "not found")]
        low, high = np.quantile(size[tilt], [0.1, 0.9])
        off = np.quantile(late[tilt], [0.1, 0.5, 0.9])
        print(
            f"| {tilt:g} degrees | {' | '.join(share)} | {low:.1f} to {high:.1f} degrees "
            f"| {off[1]:+.1f} h ({off[0]:+.1f} to {off[2]:+.1f}) |"
        )


def check_week(week: People, known: FromPeople) -> CameraCheck:
    return check_camera(week, known.camera, depth_m=known.depth_m, size_px=SIZE, usual=known.usual_turn)


def seconds_of(people: People, xy: Array, seconds: int, rng: np.random.Generator) -> tuple[People, Array]:
    """Return so many seconds of a recording of 25 frames a second, as a detector sees them at one or five a second.

    It misses 15 % of the people, and edges of boxes are off by 2 % of the height (sd).
    """
    begin = int(rng.integers(0, max(1, int(people.frame.max()) - seconds * 25)))
    frames = np.arange(begin, begin + seconds * 25, int(rng.choice([5, 25])))
    rows = np.flatnonzero(np.isin(people.frame, frames) & (rng.random(len(people.frame)) > 0.15))
    some = people.rows(rows)
    jitter = rng.normal(0, 0.02, some.box.shape) * (some.box[:, 3] - some.box[:, 1])[:, None]
    return replace(some, box=some.box + jitter, frames=frames), xy[rows]


def few(folder: Path, n: int, seed: int) -> None:
    """Print how often calibrations from some seconds of OxTown are off, with and without the warning W406."""
    people, xy = people_of(oxtown(folder))
    rng = np.random.default_rng(seed)
    rows: dict[tuple[bool, int], list[tuple[float, bool]]] = {}
    for seconds in (4, 10, 20, 40, 90, 150):
        for _ in range(n):
            some, true_xy = seconds_of(people, xy, seconds, rng)
            true_m = distances(some.frame, true_xy)
            for has_ids, who in ((True, some), (False, nameless(some))):
                try:
                    found = calibrate_from_people(who, size_px=SIZE)
                except CalibrationError:
                    continue
                uv = floor_points(who, homography=found.homography, picture_px=SIZE)
                off = distances(who.frame, to_floor(found.homography, uv, picture_px=SIZE)) / true_m - 1
                near = (true_m > 1) & (true_m < 6) & np.isfinite(off)
                result = (float(np.median(np.abs(off[near]))), found.is_of_few)
                rows.setdefault((has_ids, seconds), []).append(result)
    print("\n| track ids | seconds | accepted | off by more than 10 % | warned | of the others, more than 10 % |")
    print("|---|--:|--:|--:|--:|--:|")
    for (has_ids, seconds), results in [
        *sorted(rows.items(), key=lambda row: (not row[0][0], row[0][1])),
        *all_of(rows),
    ]:
        off_by, is_few = np.array([error for error, _ in results]), np.array([warned for _, warned in results])
        others = f"{np.sum(off_by[~is_few] > 0.1)} of {np.sum(~is_few)}"
        counts = f"{len(results)} | {np.sum(off_by > 0.1)} | {is_few.sum()} | {others}"
        print(f"| {has_ids} | {seconds or 'all'} | {counts} |")
        if not seconds:
            good = off_by <= 0.1
            middle, high = np.quantile(off_by, [0.5, 0.9])
            print(
                f"  good: {good.sum()}, {np.sum(good & is_few)} of them warned of; error {middle:.3f}, 90 % {high:.3f}"
            )


def all_of(
    rows: dict[tuple[bool, int], list[tuple[float, bool]]],
) -> list[tuple[tuple[bool, int], list[tuple[float, bool]]]]:
    return [
        ((kind, 0), [r for (has_ids, _), rs in rows.items() if has_ids is kind for r in rs]) for kind in (True, False)
    ]


def speed() -> None:
    people = boxes_only(simulate(SimulatedCamera(), seed=1, n_tracks=100, seconds=60))
    times = 50
    start = time.process_time()
    for _ in range(times):
        locate(people, homography=SimulatedCamera().homography(), picture_px=SIZE, within_m=2.5, name="x")
    rate = times * len(people) / (time.process_time() - start)
    print(f"\nplaces and pairs: {rate:,.0f} persons a second of processor time")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", choices=["simulated", "boxes", "lens", "real", "error", "moved", "speed", "few"])
    parser.add_argument("--cameras", type=int, default=40)
    parser.add_argument("--seed", type=int, default=100)
    given = parser.parse_args()
    folder = Path(os.environ.get("VSD_REALDATA", "../shared/data"))
    if given.part in {None, "simulated"}:
        simulated(given.cameras, given.seed)
    if given.part in {None, "boxes"}:
        boxes(given.cameras, given.seed)
    if given.part in {None, "lens"}:
        lens(given.cameras, given.seed)
    if given.part in {None, "error"}:
        error(given.cameras, given.seed)
    if given.part in {None, "moved"}:
        moved(100, given.seed)
    if given.part in {None, "speed"}:
        speed()
    if given.part == "few":
        few(folder, given.cameras, given.seed)
    if given.part in {None, "real"}:
        if folder.is_dir():
            real(folder)
        else:
            print(f"no real recordings at {folder}: set VSD_REALDATA")


if __name__ == "__main__":
    main()
