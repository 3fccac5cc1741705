"""How good the whole way from a picture to close pairs is, on real frames with a real detector, step by step.

Run `VSD_REALDATA=... python tests/engine/prove_detector.py`; the tables are in docs/methods. The 100 frames of the
Oxford clip go through NanoDet once for each set of tiles (`--outputs FILE` keeps what comes out). Then each step of
`engine.bodies` is added in turn. The homography is known. Persons are matched by boxes that share half of their union,
or by places within a metre. The annotation leaves people out, most of them at the far end: in the columns "counted",
nobody counts whose head would be above the picture.
"""

from __future__ import annotations

import argparse
import os
import pickle
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))
from engine.prove_engine import SIZE, oxtown, people_of

from vsd_analytics.engine import bodies as rules
from vsd_analytics.engine.bodies import Bodies, body_sizes_px, people_with_bodies
from vsd_analytics.engine.detections import Detections, joined
from vsd_analytics.engine.detector import LEAST_SCORE, Detector
from vsd_analytics.engine.evaluation import Evaluation, evaluate
from vsd_analytics.engine.floor_method import locate
from vsd_analytics.engine.people import People
from vsd_analytics.engine.people_of_pictures import PeopleOfPictures, SeenFrame
from vsd_analytics.engine.pictures import VideoFile
from vsd_analytics.engine.place_matching import assigned, matched_by_place, without_uncounted
from vsd_analytics.engine.suppression import areas, each_once
from vsd_analytics.engine.tiles import PictureTile, tiles_for
from vsd_analytics.engine.tracker import tracked
from vsd_analytics.engine.truth import FoundPairs, Positions
from vsd_analytics.geometry.homography import to_floor

Array = NDArray[np.float64]
N_FRAMES, CLIP_HZ = 100, 25
CLOSE_M = 2.0
LOWEST_SCORE = 0.2
WHOLE = [PictureTile(0, 0, *SIZE)]


class Scene:
    """The clip: its homography, its annotated people, and what the network gives for each tile of each frame."""

    def __init__(self, data: Path, outputs: Path | None) -> None:
        self.homography = np.loadtxt(data / "oxtown" / "H_image_to_ground_m.txt")
        people, _ = people_of(oxtown(data))
        people = people.rows(people.frame < N_FRAMES)
        self.truth = replace(people, frames=np.arange(N_FRAMES))
        self.xy = locate(self.truth, homography=self.homography, picture_px=SIZE, within_m=0, name="").xy
        model = data / "detector_models" / "nanodet_416.onnx"
        detector = Detector(model, least_score=LOWEST_SCORE)
        self.tiles = tiles_for(
            SIZE, input_px=detector.decoder.preparation.size_px, body_px=body_sizes_px(self.homography, SIZE)
        )
        if outputs is not None and outputs.is_file():
            self.seen: list[dict[PictureTile, Detections]] = pickle.loads(outputs.read_bytes())
            return
        self.seen = []
        for shot in VideoFile(data / "oxtown" / "oxford_clip_frames_0_99.mp4").pictures(CLIP_HZ):
            assert shot.picture is not None
            self.seen.append({tile: detector._in_tile(shot.picture, tile) for tile in [*WHOLE, *self.tiles]})
        if outputs is not None:
            outputs.write_bytes(pickle.dumps(self.seen))

    def people(
        self, tiles: Sequence[PictureTile], *, has_inner_edges: bool, least_score: float = LEAST_SCORE
    ) -> People:
        """Return what the detector finds with some tiles, each person once."""
        every = PeopleOfPictures()
        for number, of_tile in enumerate(self.seen):
            parts = []
            for tile in tiles:
                part = of_tile[tile].rows(of_tile[tile].score >= least_score)
                parts.append(part if has_inner_edges else part.rows(~tile.is_cut(part, SIZE)))
            every.add(SeenFrame(number, number * 1000 // CLIP_HZ, each_once(joined(parts))))
        return every.people()

    def far_end(self) -> Array:
        """Return the corners of the floor where somebody of usual height has the head above the picture."""
        camera = Bodies(self.homography, SIZE).camera
        assert camera is not None
        u = np.linspace(-100, SIZE[0] + 100, 20)
        top = np.column_stack([u, np.zeros(20), u, np.ones(20)])
        bottom = rules.to_floor_boxes(top, camera, rules.BOX.high_m)[:, 3]
        pixels = np.concatenate([np.column_stack([u, bottom]), np.column_stack([u, np.full(20, -100.0)])[::-1]])
        return to_floor(self.homography, pixels, picture_px=SIZE)


def positions(people: People, xy: Array, frames: Sequence[int]) -> Positions:
    used = np.isin(people.frame, frames)
    track = np.array([str(t) if t is not None else f"#{i}" for i, t in enumerate(people.track)], dtype=object)
    return Positions(people.frame[used], track[used], xy[used], np.array(frames), "frame")


def scored(
    scene: Scene, people: People, *, by: str, is_counted: bool, every: int = 1, couple: tuple[str, str] | None = None
) -> Evaluation:
    frames = list(range(0, N_FRAMES, every))
    truth = positions(scene.truth, scene.xy, frames)
    seen = locate(people, homography=scene.homography, picture_px=SIZE, within_m=0, name="")
    nobody = np.empty(0, dtype=object)
    found = FoundPairs(
        positions(people, seen.xy, frames),
        np.empty(0, dtype=np.int64),
        nobody,
        nobody,
        np.empty(0),
        np.empty(0, dtype=np.int64),
        0,
    )
    found = matched_by_place(found, truth) if by == "place" else matched_by_box(found, people, scene.truth, frames)
    if is_counted:
        found, truth, *_ = without_uncounted(found, truth, [scene.far_end()])
    if couple is not None:
        keep, kept = (np.isin(part.track, couple) for part in (found.positions, truth))
        found = replace(found, positions=rows_of(found.positions, keep))
        truth = rows_of(truth, kept)
    return evaluate(found, truth, distance_m=CLOSE_M)


def rows_of(some: Positions, kept: NDArray[np.bool_]) -> Positions:
    return replace(some, instant=some.instant[kept], track=some.track[kept], xy=some.xy[kept])


def matched_by_box(found: FoundPairs, people: People, truth: People, frames: Sequence[int]) -> FoundPairs:
    track = np.array([f"unmatched {i}" for i in range(len(found.positions.instant))], dtype=object)
    for frame in frames:
        rows = np.flatnonzero(found.positions.instant == frame)
        others = np.flatnonzero(truth.frame == frame)
        box = people.box[people.frame == frame]
        for row, other in assigned(1 - shared(box, truth.box[others]), within=0.5 + 1e-9):
            track[rows[row]] = str(truth.track[others[other]])
    return replace(found, positions=replace(found.positions, track=track))


def shared(a: Array, b: Array) -> Array:
    """Return the area that boxes share over that of both, shape (n, m)."""
    low, high = np.maximum(a[:, None, :2], b[None, :, :2]), np.minimum(a[:, None, 2:], b[None, :, 2:])
    both = np.prod(np.maximum(high - low, 0), axis=2)
    return both / (areas(a)[:, None] + areas(b)[None] - both)


def with_rules(scene: Scene, people: People, *names: str) -> People:
    """Return people after some of the steps of `Bodies`; the others are switched off."""
    bodies = Bodies(scene.homography, SIZE)
    kept = rules.WHOLE_M, rules.INSIDE_SHARE
    low = kept[0][0] if "half bodies" in names else -np.inf
    high = kept[0][1] if "heights" in names else np.inf
    for_usual = Bodies(scene.homography, SIZE)
    people_with_bodies(people, for_usual)
    bodies._heights_m = for_usual._heights_m
    bodies.learn = lambda detections: None  # type: ignore[method-assign]
    if "half bodies" not in names:
        bodies.size_px = (SIZE[0], 10**9)  # no box is cut at the bottom
    try:
        rules.WHOLE_M = (low, high)
        rules.INSIDE_SHARE = kept[1] if "containment" in names else 2.0
        return people_with_bodies(people, bodies)
    finally:
        rules.WHOLE_M, rules.INSIDE_SHARE = kept


def confirmed(scene: Scene, people: People, every: int) -> People:
    """Return the people whose track has two sightings or more, at some frame rate."""
    frames = np.arange(0, N_FRAMES, every)
    some = replace(people.rows(np.isin(people.frame, frames)), frames=frames)
    some = tracked(some, homography=scene.homography, picture_px=SIZE, ts_ms=frames * 1000 // CLIP_HZ)
    names, n = np.unique(some.track.astype(str), return_counts=True)
    return some.rows(np.isin(some.track.astype(str), names[n >= 2]))


def row(scene: Scene, name: str, people: People, every: int = 1) -> str:
    cells = []
    for by in ("box", "place"):
        for is_counted in (False, True):
            done = scored(scene, people, by=by, is_counted=is_counted, every=every)
            detection, persons, pairs = done.detection[0], done.persons[0], done.pairs[0]
            if is_counted:
                cells += [detection.f1.value, persons.f1.value, pairs.f1.value]
            else:
                cells += [detection.recall.value, detection.precision.value, detection.f1.value, pairs.f1.value]
    return f"| {name} | " + " | ".join(f"{value:.2f}".lstrip("0") for value in cells) + " |"


HEAD = (
    "| step | recall | precision | F1 | pair-F1 | counted: F1 | person-F1 | pair-F1 "
    "| by place: recall | precision | F1 | pair-F1 | counted: F1 | person-F1 | pair-F1 |\n"
    "|---|" + "--:|" * 14
)


def steps(scene: Scene) -> list[tuple[str, Callable[[], People]]]:
    def tiled() -> People:
        return scene.people(scene.tiles, has_inner_edges=False)

    return [
        ("whole frame", lambda: scene.people(WHOLE, has_inner_edges=False)),
        (f"{len(scene.tiles)} tiles", lambda: scene.people(scene.tiles, has_inner_edges=True)),
        ("+ boxes at inner edges dropped", tiled),
        ("+ half bodies down to the floor", lambda: with_rules(scene, tiled(), "half bodies")),
        ("+ impossible heights dropped", lambda: with_rules(scene, tiled(), "half bodies", "heights")),
        ("+ containment", lambda: with_rules(scene, tiled(), "half bodies", "heights", "containment")),
        (
            "whole frame, all steps",
            lambda: with_rules(
                scene, scene.people(WHOLE, has_inner_edges=False), "half bodies", "heights", "containment"
            ),
        ),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--outputs", type=Path, help="keep what the network gives in this file, or take it from there")
    data = os.environ.get("VSD_REALDATA") or str(Path(__file__).parents[3] / "shared" / "data")
    scene = Scene(Path(data), parser.parse_args().outputs)
    print(f"{len(scene.truth):,} annotated persons in {N_FRAMES} frames\n\n{HEAD}")
    for name, people in steps(scene):
        print(row(scene, name, people()), flush=True)
    full = steps(scene)[5][1]()
    print(f"\n{HEAD.replace('step', 'frames a second')}")
    for every in (1, 10, 25):
        print(row(scene, f"{CLIP_HZ / every:g}", full, every))
        print(row(scene, f"{CLIP_HZ / every:g}, tracks of one sighting left out", confirmed(scene, full, every), every))
    print("\n| couple | frames closer than 2 m | found | false |\n|---|--:|--:|--:|")
    for couple in close_couples(scene):
        done = scored(scene, full, by="place", is_counted=False, couple=couple)
        hits = round(done.pairs[0].recall.value * done.n_true_pairs)
        print(f"| {couple[0]} and {couple[1]} | {done.n_true_pairs} | {hits} | {done.n_found_pairs - hits} |")


def close_couples(scene: Scene) -> list[tuple[str, str]]:
    couples: dict[tuple[str, str], int] = {}
    for frame in range(N_FRAMES):
        rows = np.flatnonzero(scene.truth.frame == frame)
        for k, i in enumerate(rows):
            for j in rows[k + 1 :]:
                if np.linalg.norm(scene.xy[i] - scene.xy[j]) < CLOSE_M:
                    a, b = sorted((str(scene.truth.track[i]), str(scene.truth.track[j])), key=int)
                    couples[a, b] = couples.get((a, b), 0) + 1
    return sorted(couples, key=lambda couple: -couples[couple])


if __name__ == "__main__":
    main()
