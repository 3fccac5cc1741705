"""Counts violations of real recordings with true ids, whole and with ids that a tracker cut: docs/methods.

Run `VSD_REALDATA=... python tests/realdata/prove_recorded_encounters.py`. The true count is that of the whole
recording. Where ids are joined that were not cut, the recording cut them itself, or two people were taken for one.
"""

from __future__ import annotations

import gzip
import io
import json
import os
import sys
import tarfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from invariances.encounter_worlds import Seen, cut
from invariances.prove_encounters import counted
from realdata.prove_atc import FILES
from stats.group_scenes import read_scene

FOLDER = Path(os.environ.get("VSD_REALDATA", "."))
DISTANCES_M = (1.0, 1.25, 1.5, 2.0)
SHARES = (0.1, 0.3, 0.5)


def seen(t_s: npt.ArrayLike, person: npt.ArrayLike, x_m: npt.ArrayLike, y_m: npt.ArrayLike) -> Seen:
    """Return records in order of instants, with people numbered."""
    ts = np.rint(1000 * np.asarray(t_s, dtype=np.float64)).astype(np.int64)
    number = np.unique(np.asarray(person), return_inverse=True)[1]
    every = Seen(ts - ts.min(), number, number, *(np.asarray(v, dtype=np.float64) for v in (x_m, y_m)))
    return every.rows(np.lexsort((number, ts)))


def street(name: str) -> Seen:
    """Return a street scene, 2.5 annotations a second."""
    scene = read_scene(FOLDER / "eth_ucy" / name)
    return seen(scene["t"], scene["track"], scene["x"], scene["y"])


def shopping_centre() -> Seen:
    """Return three hours of a shopping centre, one record a second."""
    texts = [gzip.decompress((FOLDER / "atc" / name).read_bytes()).decode() for name in FILES]
    rows = np.array([line.split(",")[:4] for text in texts for line in text.splitlines() if line.strip()], dtype=float)
    rows[:, 0] = np.floor(rows[:, 0])
    _, once = np.unique(rows[:, :2], axis=0, return_index=True)
    return seen(*rows[once].T)


def square() -> Seen:
    """Return the people of a square, fused from seven views, two frames a second."""
    packed = gzip.decompress((FOLDER / "wildtrack" / "annotations_positions_0_995.tar.gz").read_bytes())
    rows = []
    with tarfile.open(fileobj=io.BytesIO(packed)) as files:
        for member in files.getmembers():
            if member.name.endswith(".json") and (file := files.extractfile(member)) is not None:
                frame = int(Path(member.name).stem)
                for person in json.load(file):
                    across, along = person["positionID"] % 480, person["positionID"] // 480
                    rows.append((frame / 10, person["personID"], -3 + 0.025 * across, -9 + 0.025 * along))
    return seen(*np.array(rows).T)


def pavement() -> Seen:
    """Return the people of a shopping street, feet in the picture projected to the ground, five frames a second."""
    h = np.loadtxt(FOLDER / "oxtown" / "H_image_to_ground_m.txt").reshape(3, 3)
    text = gzip.decompress((FOLDER / "oxtown" / "TownCentre-groundtruth.top.gz").read_bytes()).decode()
    lines = [line.split(",") for line in text.splitlines()]
    boxes = np.array([line for line in lines if len(line) == 12 and line[0].strip().isdigit()], dtype=np.float64)
    u, v = (boxes[:, 8] + boxes[:, 10]) / 2, boxes[:, 11]
    inside = (boxes[:, 1] % 5 == 0) & (u >= 0) & (u < 1920) & (v >= 0) & (v < 1080)
    x, y, w = h @ np.stack([u, v, np.ones(len(u))])[:, inside]
    return seen(boxes[inside, 1] / 25, boxes[inside, 0], x / w, y / w)


RECORDINGS: dict[str, tuple[Callable[[], Seen], int]] = {
    "ETH": (lambda: street("seq_eth"), 400),
    "Hotel": (lambda: street("seq_hotel"), 400),
    "Zara01": (lambda: street("zara01"), 400),
    "WILDTRACK": (square, 500),
    "Oxford Town Centre": (pavement, 200),
    "ATC": (shopping_centre, 1000),
}


def main() -> None:
    """Print a row for each recording: violations whole by distance, and the change at 1 and 2 m with ids cut."""
    print("| recording | whole: " + ", ".join(f"{d} m" for d in DISTANCES_M) + " | cut 10, 30, 50 %: 1 m | 2 m |")
    print("|---|---|---|---|")
    for name, (read, every_ms) in RECORDINGS.items():
        people = read()
        whole = {d: counted(people, every_ms=every_ms, distance_m=d)[0] for d in DISTANCES_M}
        changes = {}
        for d in (1.0, 2.0):
            pieces = (cut(people, np.random.default_rng(5), share=share) for share in SHARES)
            changes[d] = [counted(of, every_ms=every_ms, distance_m=d)[0] / whole[d] - 1 for of in pieces]
        cells = " | ".join(", ".join(f"{c:+.1%}" for c in changes[d]) for d in (1.0, 2.0))
        print(f"| {name} | {', '.join(map(str, whole.values()))} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
