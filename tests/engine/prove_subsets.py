"""How a calibration from people does with less of the real scenes: fewer frames, or fewer people.

Run `VSD_REALDATA=... python tests/engine/prove_subsets.py`; the table is in docs/methods. The part calibrates, and
the whole scene (each 10th frame of OxTown) is measured with it.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from engine.prove_engine import SIZE, floor_m, labelled, nameless, real_scenes, scores

from vsd_analytics.engine.people import People
from vsd_analytics.engine.people_calibration import calibrate_from_people
from vsd_analytics.errors import CalibrationError

PARTS = {
    "all": {},
    "every 10th frame": {"every": 10},
    "30 frames, spread": {"n_spread": 30},
    "the first 30 frames": {"n_first": 30},
    "the second half": {"n_last": 2},
    "12 people": {"n_people": 12},
    "8 people": {"n_people": 8},
    "5 people": {"n_people": 5},
}


def part_of(
    people: People,
    *,
    every: int = 1,
    n_spread: int | None = None,
    n_first: int | None = None,
    n_last: int | None = None,
    n_people: int | None = None,
) -> People:
    """Return some frames, or those who are seen most often; `n_last` is the share 1 / n at the end."""
    frames = people.frames[:: every if n_spread is None else max(1, len(people.frames) // n_spread)][:n_first]
    frames = frames if n_last is None else frames[-(len(frames) // n_last) :]
    chosen = np.isin(people.frame, frames)
    if n_people is not None:
        who, times = np.unique(people.track.astype(str), return_counts=True)
        chosen &= np.isin(people.track.astype(str), who[np.argsort(-times)][:n_people])
    return replace(people.rows(np.flatnonzero(chosen)), frames=frames)


def main() -> None:
    found: dict[str, list[list[float]]] = {}
    refused: dict[str, int] = {}
    for name, people, xy in real_scenes(Path(os.environ.get("VSD_REALDATA", "../shared/data"))):
        some = people.frame % (10 if name == "OxTown" else 1) == 0
        whole = labelled(people.rows(np.flatnonzero(some)), xy[some])
        for part, given in PARTS.items():
            chosen = part_of(people, **given)  # type: ignore[arg-type]
            for ids, who in (("track ids", chosen), ("no ids", nameless(chosen))):
                label = f"{part} | {ids}"
                try:
                    camera = calibrate_from_people(who, size_px=SIZE)
                except CalibrationError as error:
                    print(f"{name}, {label}: {error.why}", file=sys.stderr, flush=True)
                    refused[label] = refused.get(label, 0) + 1
                    continue
                values = scores(whole, floor_m(whole, camera.homography))
                found.setdefault(label, []).append([values[0], values[3], values[3] / camera.error])
    print(
        "| what calibrates | | refused | F1 pairs, mean (least) | distance error, mean (most) | within the stated sd |"
    )
    print("|---|---|---|---|---|---|")
    for part in PARTS:
        for ids in ("track ids", "no ids"):
            label = f"{part} | {ids}"
            rows = np.array(found.get(label, [])).reshape(-1, 3)
            f1, off, share = rows.T
            good = f"{f1.mean():.3f} ({f1.min():.3f}) | {off.mean():.1%} ({off.max():.1%})" if len(rows) else "– | –"
            print(
                f"| {label} | {refused.get(label, 0)} of 8 | {good} | {np.sum(share <= 1)} of {len(rows)} |", flush=True
            )


if __name__ == "__main__":
    main()
