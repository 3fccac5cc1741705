"""How good track ids are that the engine gives, against the annotated ones of the shared scenes, beside SORT's.

Run `VSD_REALDATA=... python tests/engine/prove_tracks.py` with `trackeval` installed; the tables are in docs/methods.
The boxes are the annotated ones, so what is scored is the assignment alone: HOTA and IDF1 by `trackeval`. The camera
comes from the same boxes without their ids, as `vsd calibrate --from-people` finds it. OxTown is thinned from 25 frames
a second; WILDTRACK has 2 frames a second, and 1 when thinned, to the frames of even and of odd places. With `trackers`
installed, ByteTrack's are added.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

sys.path.insert(0, str(Path(__file__).parents[1]))
from engine.prove_engine import SIZE, nameless, real_scenes

from vsd_analytics.engine.people import People
from vsd_analytics.engine.people_calibration import calibrate_from_people
from vsd_analytics.engine.safe_space import pairs_of_frames
from vsd_analytics.engine.tracker import tracked

Array = NDArray[np.float64]
CLOSE_M, EPISODE_S, GAP_S = 2.0, 3.0, 1.0


def thinned(people: People, every: int, first: int = 0) -> tuple[People, NDArray[np.bool_]]:
    frames = people.frames[first::every]
    chosen = np.isin(people.frame, frames)
    some = people.rows(chosen)
    return People(some.frame, some.track, some.box, some.joints, frames), chosen


def scored(people: People, ids: NDArray[np.object_]) -> tuple[float, float]:
    """Return HOTA and IDF1 of some ids; boxes are equal, so a box is similar to itself only."""
    from trackeval.metrics import HOTA, Identity

    true, given = (np.unique(np.asarray(who).astype(str), return_inverse=True)[1] for who in (people.track, ids))
    edges = np.searchsorted(people.frame, [*people.frames, people.frames[-1] + 1])
    spans = [slice(a, b) for a, b in pairwise(edges)]
    data = {
        "num_timesteps": len(spans),
        "gt_ids": [true[s] for s in spans],
        "tracker_ids": [given[s] for s in spans],
        "similarity_scores": [np.eye(s.stop - s.start) for s in spans],
        "num_gt_dets": len(people),
        "num_tracker_dets": len(people),
        "num_gt_ids": int(true.max()) + 1,
        "num_tracker_ids": int(given.max()) + 1,
    }
    quiet = {"PRINT_CONFIG": False}
    hota, identity = HOTA().eval_sequence(data), Identity(quiet).eval_sequence(data)
    return float(np.mean(hota["HOTA"])), float(identity["IDF1"])


def episodes(people: People, ids: NDArray[np.object_], xy: Array, hz: float) -> int:
    """Return how many times two ids are closer than 2 m for 3 s or longer, with gaps of a second or less."""
    a, b = pairs_of_frames(people.frame)
    near = np.linalg.norm(xy[a] - xy[b], axis=1) < CLOSE_M
    who = np.unique(np.asarray(ids).astype(str), return_inverse=True)[1]
    low, high = np.minimum(who[a], who[b])[near], np.maximum(who[a], who[b])[near]
    step = np.searchsorted(people.frames, people.frame)[a][near] / hz
    order = np.lexsort((step, high, low))
    low, high, at = low[order], high[order], step[order]
    gap = max(GAP_S, 1.5 / hz)
    is_new = np.r_[True, (np.diff(low) != 0) | (np.diff(high) != 0) | (np.diff(at) > gap)]
    first = np.flatnonzero(is_new)
    last = np.r_[first[1:], len(at)] - 1
    return int(np.sum(at[last] - at[first] + 1 / hz >= EPISODE_S))


# --- SORT, after Bewley and others 2016 ---------------------------------------------------------------------------


def sort_ids(people: People, *, least_iou: float = 0.3, max_age: int = 3) -> NDArray[np.object_]:
    """Return ids of SORT: Kalman filter on (u, v, area, aspect) with constant velocity, Hungarian method on IoU.

    Noise as in the authors' code. Its default `max_age` of 1 loses every person missed in one frame; 3 is kinder.
    """
    move = np.eye(7)
    move[[0, 1, 2], [4, 5, 6]] = 1
    see = np.eye(4, 7)
    noise = np.diag([1.0, 1, 1, 1, 0.01, 0.01, 0.0001])
    mark = np.diag([1.0, 1, 10, 10])
    state, covariance = np.empty((0, 7)), np.empty((0, 7, 7))
    number, age = np.empty(0, dtype=int), np.empty(0, dtype=int)
    ids = np.empty(len(people), dtype=object)
    n_ids = 0
    edges = np.searchsorted(people.frame, [*people.frames, people.frames[-1] + 1])
    for start, stop in pairwise(edges):
        box = people.box[start:stop]
        keep = age <= max_age
        state, covariance, number, age = state[keep], covariance[keep], number[keep], age[keep] + 1
        state[:, 6] = np.where(state[:, 2] + state[:, 6] <= 0, 0, state[:, 6])
        state = state @ move.T
        covariance = move @ covariance @ move.T + noise
        overlap = iou(corners(state), box)
        of_track, of_row = linear_sum_assignment(-overlap)
        good = overlap[of_track, of_row] >= least_iou
        of_track, of_row = of_track[good], of_row[good]
        seen = measured(box)
        gain = covariance[of_track][:, :, :4] @ np.linalg.inv(covariance[of_track][:, :4, :4] + mark)
        state[of_track] += np.einsum("nij,nj->ni", gain, seen[of_row] - state[of_track, :4])
        covariance[of_track] = (np.eye(7) - gain @ see) @ covariance[of_track]
        age[of_track] = 0
        ids[start + of_row] = number[of_track]
        new = np.setdiff1d(np.arange(stop - start), of_row)
        fresh = n_ids + np.arange(len(new))
        n_ids += len(new)
        ids[start + new] = fresh
        state = np.concatenate([state, np.column_stack([seen[new], np.zeros((len(new), 3))])])
        first = np.diag([10.0, 10, 10, 10, 1e4, 1e4, 1e4])
        covariance = np.concatenate([covariance, np.tile(first, (len(new), 1, 1))])
        number, age = np.concatenate([number, fresh]), np.concatenate([age, np.zeros(len(new), dtype=int)])
    return ids


def byte_ids(people: People, hz: float) -> NDArray[np.object_] | None:
    """Return ids of ByteTrack as the package `trackers` has it, all boxes certain; None where it is not installed.

    A box it gives no id in a frame has one of its own: it waits for a second frame before it begins a track.
    """
    try:
        import supervision
        from trackers import ByteTrackTracker
    except ImportError:
        return None
    tracker = ByteTrackTracker(frame_rate=hz, lost_track_buffer=30, minimum_consecutive_frames=1)
    ids = np.array([f"none-{row}" for row in range(len(people))], dtype=object)
    edges = np.searchsorted(people.frame, [*people.frames, people.frames[-1] + 1])
    for start, stop in pairwise(edges):
        rows = np.arange(start, stop)
        given = supervision.Detections(
            xyxy=people.box[rows],
            confidence=np.full(len(rows), 0.95),
            class_id=np.zeros(len(rows), int),
            data={"row": rows},
        )
        found = tracker.update(given)
        for row, number in zip(found.data.get("row", []), found.tracker_id, strict=True):
            if number >= 0:
                ids[row] = f"b{number}"
    return ids


def measured(box: Array) -> Array:
    width, height = (box[:, 2:] - box[:, :2]).T
    return np.column_stack([(box[:, :2] + box[:, 2:]) / 2, width * height, width / height])


def corners(state: Array) -> Array:
    width = np.sqrt(np.maximum(state[:, 2] * state[:, 3], 1e-6))
    height = np.maximum(state[:, 2], 1e-6) / width
    half = np.column_stack([width, height]) / 2
    return np.column_stack([state[:, :2] - half, state[:, :2] + half])


def iou(a: Array, b: Array) -> Array:
    low, high = np.maximum(a[:, None, :2], b[None, :, :2]), np.minimum(a[:, None, 2:], b[None, :, 2:])
    both = np.prod(np.maximum(high - low, 0), axis=2)
    area = [np.prod(box[:, 2:] - box[:, :2], axis=1) for box in (a, b)]
    return np.asarray(both / np.maximum(area[0][:, None] + area[1][None] - both, 1e-9))


def main() -> None:
    folder = Path(os.environ.get("VSD_REALDATA", "../shared/data"))
    rates = {"OxTown": (("25", 25.0, 1, 0), ("2.5", 2.5, 10, 0), ("1", 1.0, 25, 0))}
    of_view = (("2", 2.0, 1, 0), ("1", 1.0, 2, 0), ("1, odd frames", 1.0, 2, 1))
    print("| scene, frames a second | IDF1: ours | SORT | ByteTrack | HOTA: ours | SORT | ByteTrack | episodes |")
    print("|---|---|---|---|---|---|---|---|")
    means: dict[str, list[list[float]]] = {}
    for name, people, xy in real_scenes(folder):
        found = calibrate_from_people(nameless(people), size_px=SIZE)
        for label, hz, every, first in rates.get(name, of_view):
            some, chosen = thinned(people, every, first)
            ts_ms = np.round(np.arange(len(some.frames)) * 1000 / hz).astype(np.int64)
            start = time.perf_counter()
            ours = tracked(some, homography=found.homography, picture_px=SIZE, ts_ms=ts_ms).track
            took = time.perf_counter() - start
            all_ids = [ours, sort_ids(some), byte_ids(some, hz)]
            scores = [(np.nan, np.nan) if ids is None else scored(some, ids) for ids in all_ids]
            values = [score[k] for k in (1, 0) for score in scores]
            true, *counts = (
                np.nan if ids is None else episodes(some, ids, xy[chosen], hz) for ids in (some.track, *all_ids)
            )
            shares = [n / true - 1 for n in counts]
            row(f"{name}, {label}", values, f"{true:g}", shares)
            print(f"{len(some) / took:,.0f} persons a second", file=sys.stderr, flush=True)
            if name != "OxTown":
                means.setdefault(label, []).append([*values, *shares])
    for label, values_of in means.items():
        mean = np.mean(values_of, axis=0)
        row(f"WILDTRACK, {label}, mean of seven", mean[:6], "", np.mean(np.abs(np.array(values_of)[:, 6:]), axis=0))


def row(name: str, values: Iterable[float], true: str, shares: Iterable[float]) -> None:
    """Print a row; shares are those of episodes more or fewer than with true ids."""
    texts = ["" if np.isnan(value) else f"{value:.3f}" for value in values]
    more = ", ".join("" if np.isnan(share) else f"{share:+.0%}" for share in shares)
    print(f"| {name} | {' | '.join(texts)} | {true} ({more}) |", flush=True)


if __name__ == "__main__":
    main()
