"""How good track ids are on real walks in the pictures of made-up cameras, at one frame a second.

Run `VSD_REALDATA=... python tests/engine/prove_tracks_of_walks.py` with `trackeval` installed; the figures are in
docs/methods. The walks are those of ETH, Hotel, Zara and two hours of ATC, put on whole seconds; four copies of the
first three, shifted in time, make crowds. Boxes have noise, and a share of them is missed. These are other people and
other views than those of `prove_tracks.py`.
"""

from __future__ import annotations

import gzip
import os
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))
from engine.prove_tracks import episodes, scored, sort_ids
from engine.simulated_people import SIZE, SimulatedCamera

from vsd_analytics.engine.people import N_JOINTS, People
from vsd_analytics.engine.tracker import tracked

Array = NDArray[np.float64]
CAMERAS = (
    (SimulatedCamera(height_m=5, tilt_deg=28, f_widths=0.9), 0.5),
    (SimulatedCamera(height_m=3.2, tilt_deg=18, f_widths=0.8), 2.3),
)
AHEAD_M = 8.0
LEAST_EPISODES, LEAST_PEOPLE = 25, 500


def recordings(folder: Path) -> Iterator[tuple[str, Array]]:
    """Yield rows of seconds, person, x and y."""
    for name, fps in (("seq_eth", 15), ("seq_hotel", 25), ("zara01", 25)):
        with gzip.open(folder / "eth_ucy" / name / "obsmat.txt.gz") as lines:
            rows = np.loadtxt(lines)
        yield name, np.column_stack([rows[:, 0] / fps, rows[:, [1, 2, 4]]])
    for hour in (9, 11):
        parts = []
        for part in ("train", "test"):
            with gzip.open(folder / "atc" / f"atc-1024-{hour}_{part}.csv.gz") as lines:
                parts.append(np.loadtxt(lines, delimiter=",")[:, :4])
        yield f"atc-{hour}", np.concatenate(parts) - (min(part[:, 0].min() for part in parts), 0, 0, 0)


def whole_seconds(rows: Array) -> Array:
    """Return the walks at whole seconds; a gap of more than 3 s parts a walk."""
    found, n = [], 0
    for who in np.unique(rows[:, 1]):
        walk = rows[rows[:, 1] == who]
        walk = walk[np.unique(walk[:, 0], return_index=True)[1]]
        for piece in np.split(walk, np.flatnonzero(np.diff(walk[:, 0]) > 3) + 1):
            t = np.arange(np.ceil(piece[0, 0]), np.floor(piece[-1, 0]) + 1)
            if len(t) > 1:
                at = [np.interp(t, piece[:, 0], piece[:, k]) for k in (2, 3)]
                found.append(np.column_stack([t, np.full(len(t), n), *at]))
                n += 1
    return np.concatenate(found)


def crowded(rows: Array, copies: int) -> Array:
    """Return half of a recording with copies of its parts at once."""
    span = np.floor(np.ptp(rows[:, 0]))
    many = []
    for copy in range(copies):
        one = rows.copy()
        one[:, 0] = (one[:, 0] - rows[:, 0].min() + copy * np.floor(span / copies)) % span
        one[:, 1] += copy * (rows[:, 1].max() + 1)
        many.append(one)
    found = np.concatenate(many)
    return np.asarray(found[found[:, 0] < span / 2])


def spots(name: str, rows: Array) -> list[Array]:
    """Return what the cameras look at: the middle, and in ATC three squares of 8 m among the busiest."""
    if not name.startswith("atc"):
        return [np.median(rows[:, 2:], axis=0)]
    squares, n = np.unique(np.floor(rows[:, 2:] / 8), axis=0, return_counts=True)
    return [8 * squares[i] + 4 for i in np.argsort(-n, kind="stable")[:12:4]]


def view(
    rows: Array, camera: SimulatedCamera, at: Array, yaw: float, *, noise: float, missed: float, seed: int
) -> tuple[People, Array]:
    """Return the boxes of a camera that looks at a spot, and the true places; noise in body heights."""
    rng = np.random.default_rng(seed)
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    place = (rows[:, 2:] - at) @ turn.T + (0, AHEAD_M)
    ahead = place[:, 1] > 0.5
    rows, place = rows[ahead], place[ahead]
    who = rows[:, 1].astype(int)
    tall = np.random.default_rng(5).normal(1.7, 0.08, who.max() + 1)[who]
    foot, head = (camera.project(np.column_stack([place, z])) for z in (0 * tall, tall))
    high = foot[:, 1] - head[:, 1]
    middle = (foot[:, 0] + head[:, 0]) / 2
    box = np.column_stack([middle - 0.175 * high, head[:, 1], middle + 0.175 * high, foot[:, 1]])
    box += rng.normal(0, 1, box.shape) * (noise * high)[:, None]
    middle = (box[:, 0] + box[:, 2]) / 2
    inside = (middle > 0) & (middle < SIZE[0]) & (box[:, 3] < SIZE[1] - 1) & (box[:, 1] > -0.3 * high)
    inside &= (box[:, 3] > box[:, 1] + 15) & (box[:, 2] > box[:, 0]) & (rng.random(len(box)) >= missed)
    frame = np.round(rows[:, 0]).astype(np.int64)
    some = np.flatnonzero(inside)[np.lexsort((who[inside], frame[inside]))]
    ids = who[some].astype(str).astype(object)
    frames = np.arange(frame[some].min(), frame[some].max() + 1)
    return People(frame[some], ids, box[some], np.full((len(some), N_JOINTS, 2), np.nan), frames), place[some]


def main() -> None:
    folder = Path(os.environ.get("VSD_REALDATA", "../shared/data"))
    walks = [(name, whole_seconds(rows)) for name, rows in recordings(folder)]
    print("| boxes | views, people | IDF1: ours | SORT | episodes off: ours | SORT |\n|---|---|---|---|---|---|")
    for noise, missed in ((0.03, 0.0), (0.05, 0.07)):
        found, off, n_people, seed = [], [], 0, 0
        for name, rows in walks:
            for copies, spot, (camera, yaw) in product(
                (1,) if name.startswith("atc") else (1, 4), spots(name, rows), CAMERAS
            ):
                seed += 1
                some = rows if copies == 1 else crowded(rows, copies)
                people, xy = view(some, camera, spot, yaw, noise=noise, missed=missed, seed=seed)
                if len(people) < LEAST_PEOPLE:
                    continue
                ts_ms = np.arange(len(people.frames), dtype=np.int64) * 1000
                ours = tracked(people, homography=camera.homography(), picture_px=SIZE, ts_ms=ts_ms).track
                both = (ours, sort_ids(people))
                found.append([scored(people, ids)[1] for ids in both])
                n_people += len(people)
                true = episodes(people, people.track, xy, 1.0)
                if true >= LEAST_EPISODES:
                    off.append([episodes(people, ids, xy, 1.0) / true - 1 for ids in both])
        (ours_f1, sort_f1), (ours_off, sort_off) = np.mean(found, axis=0), np.mean(np.abs(off), axis=0)
        worst = np.max(np.abs(off), axis=0)[0]
        print(
            f"| noise {noise:.0%}, missed {missed:.0%} | {len(found)}, {n_people:,} | {ours_f1:.3f} | {sort_f1:.3f} "
            f"| {ours_off:.1%} (at most {worst:.0%}) | {sort_off:.1%} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
