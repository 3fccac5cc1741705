"""Counts WILDTRACK's people once from seven cameras that see one floor, by several owner maps, and prints how well.

Run `VSD_REALDATA=... python tests/realdata/prove_cameras.py`; the table is in docs/methods. Records come from
the adapter with `per_camera`, floor positions through each camera's calibration, and counting is plain numpy: nothing
of the store or of the SQL takes part. Truth is the positions fused from all views, person by person and pair by pair.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from unittest.mock import patch

import numpy as np
import shapely

from vsd_analytics.geometry import ownership
from vsd_analytics.geometry.camera_views import seen_floor
from vsd_analytics.geometry.homography import to_floor
from vsd_analytics.ingest.formats.wildtrack import ADAPTER, VIEWS
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.site.model import Calibration, Camera

SIZE = (1920, 1080)
DISTANCE_M = 2.0
Cell = tuple[int, int]
Key = tuple[object, ...]


@dataclass(frozen=True)
class Records:
    """People and pairs nearer than 2 m: who (as in the truth), which camera, where."""

    who: Sequence[Key]
    camera: Sequence[str]
    xy: np.ndarray  # type: ignore[type-arg]


def load(folder: Path, *, per_camera: bool) -> tuple[list[Key], list[str], np.ndarray]:  # type: ignore[type-arg]
    """Return (instant, person), camera and floor position of every person record."""
    matrices = json.loads((folder / "H_image_to_ground_m.json").read_text())
    options = IngestOptions(start=0, per_camera=per_camera)
    source = Source(folder / "annotations_positions_0_995.tar.gz")
    rows = [r for batch in ADAPTER.read(source, options) for r in batch.table("observations").to_pylist()]
    places = [
        to_floor(matrices[r["camera"]], [(r["u_px"], r["v_px"])], picture_px=SIZE)[0]
        if per_camera
        else (r["x_m"], r["y_m"])
        for r in rows
    ]
    return [(r["ts_ms"], r["track"]) for r in rows], [r["camera"] for r in rows], np.array(places)


def pairs_of(who: Sequence[Key], camera: Sequence[str], xy: np.ndarray) -> Records:  # type: ignore[type-arg]
    """Return the pairs nearer than 2 m within a camera's frame, at their midpoints."""
    frames: dict[Key, list[int]] = {}
    for i, (name, key) in enumerate(zip(camera, who, strict=True)):
        frames.setdefault((name, key[0]), []).append(i)
    near = [
        (i, j)
        for members in frames.values()
        for i, j in combinations(members, 2)
        if np.hypot(*(xy[i] - xy[j])) < DISTANCE_M
    ]
    names = [(who[i][0], *sorted((str(who[i][1]), str(who[j][1])))) for i, j in near]
    return Records(names, [camera[i] for i, _ in near], np.array([(xy[i] + xy[j]) / 2 for i, j in near]))


def counted(records: Records, owners: Mapping[Cell, str], *, cell_m: float) -> Counter[Key]:
    """Return how often each is counted: a record counts unless another camera owns its place."""
    cells = map(tuple, np.floor(records.xy / cell_m).astype(int).tolist())
    named = zip(records.who, records.camera, cells, strict=True)
    return Counter(who for who, camera, cell in named if owners.get(cell, camera) == camera)


def owner_map(cameras: Sequence[Camera], *, cell_m: float, pair_m: float, cut_m: float, vote: int) -> dict[Cell, str]:
    """Return the owner map with other constants than those in use."""
    with (
        patch.object(ownership, "PAIR_REACH_M", pair_m),
        patch.object(ownership, "CUT_FEET_M", cut_m),
        patch.object(ownership, "VOTE_CELLS", vote),
    ):
        return {(c.cx, c.cy): c.camera_id for c in ownership.owner_cells(cameras, cell_m=cell_m)}


def most_records(people: Records, *, cell_m: float) -> dict[Cell, str]:
    """Return the camera with most person records per cell: a map made of the very data it is to merge."""
    cells = map(tuple, np.floor(people.xy / cell_m).astype(int).tolist())
    n = Counter(zip(cells, people.camera, strict=True))
    return {cell: camera for (cell, camera), _ in sorted(n.items(), key=lambda item: (item[1], item[0][1]))}


def main() -> None:
    folder = Path(os.environ.get("VSD_REALDATA", "")) / "wildtrack"
    if not folder.is_dir():
        print("skipped: VSD_REALDATA names no folder with the recording wildtrack")
        return
    matrices = json.loads((folder / "H_image_to_ground_m.json").read_text())
    cameras = [Camera(v, v, "f", (Calibration(matrices[v], None, v),), picture_px=SIZE) for v in VIEWS]
    true_people = Records(*load(folder, per_camera=False))
    truth = true_people, pairs_of(true_people.who, true_people.camera, true_people.xy)
    people = Records(*load(folder, per_camera=True))
    found = people, pairs_of(people.who, people.camera, people.xy)

    views = {v: seen_floor(matrices[v], picture_px=SIZE) for v in VIEWS}
    boxes = set(zip(people.who, people.camera, strict=True))
    seen = [
        (who, v) in boxes
        for v, view in views.items()
        for who, is_in in zip(true_people.who, shapely.contains_xy(view, *true_people.xy.T), strict=True)
        if is_in
    ]
    outside = [not views[c].intersects(shapely.Point(at)) for c, at in zip(people.camera, people.xy, strict=True)]
    print(f"People whose true feet lie in a view and who have a box there: {np.mean(seen):.1%} of {len(seen):,}.")
    print(f"Boxes whose feet lie outside their own picture: {np.mean(outside):.1%} of {len(outside):,}.\n")

    pair_m, cut_m, vote = ownership.PAIR_REACH_M, ownership.CUT_FEET_M, ownership.VOTE_CELLS
    used = {"cell_m": 0.5, "pair_m": pair_m, "cut_m": cut_m, "vote": vote}
    finest = {"cell_m": 0.5, "pair_m": 0.0, "cut_m": 0.0, "vote": 1}
    rules = {
        "no map: naive sum of cameras": None,
        "most records per cell (made of the data)": "data",
        "finest camera": finest,
        "finest, vote of 5 x 5 cells": {**finest, "vote": 5},
        "finest, vote, feet cut off": {**finest, "vote": 5, "cut_m": 2.0},
        "finest, vote, both of a pair in view": {**finest, "vote": 5, "pair_m": 1.0},
        "**all three: in use**": used,
        "all three, no vote": {**used, "vote": 1},
        "all three, vote of 9 x 9": {**used, "vote": 9},
        "all three, pairs 0.5 m around": {**used, "pair_m": 0.5},
        "all three, pairs 1.5 m around": {**used, "pair_m": 1.5},
        "all three, feet 1 m outside": {**used, "cut_m": 1.0},
        "all three, feet 3 m outside": {**used, "cut_m": 3.0},
        "all three, cells of 0.25 m": {**used, "cell_m": 0.25},
        "all three, cells of 1 m": {**used, "cell_m": 1.0},
    }
    print("| owner of a cell | person records | twice | missed | violation records | twice | missed |")
    print("|---|---|---|---|---|---|---|")
    for name, rule in rules.items():
        cell_m = rule["cell_m"] if isinstance(rule, dict) else 0.5
        owners = owner_map(cameras, **rule) if isinstance(rule, dict) else {}  # type: ignore[arg-type]
        if rule == "data":
            owners = most_records(people, cell_m=cell_m)
        told = []
        for true, records in zip(truth, found, strict=True):
            n = counted(records, owners, cell_m=cell_m)
            missed = sum(who not in n for who in true.who)
            told.append(f"{n.total():,} ({n.total() / len(true.who) - 1:+.1%}) | {n.total() - len(n):,} | {missed:,}")
        print(f"| {name} | {' | '.join(told)} |")
    print(f"| truth: fused from all views | {len(truth[0].who):,} | | | {len(truth[1].who):,} | | |")


if __name__ == "__main__":
    main()
