"""Counts people who cross lines on real recordings and in a simulated shop, and prints how far the counts are off.

Run `VSD_REALDATA=... python tests/realdata/prove_lines.py`; the tables are in docs/lines.md. Records go through store,
facts and SQL as in a project. The truth is `crossings` below, person by person from whole tracks: nothing of the
package takes part in it. Lines lie across the way of the people; in open places there are several.
"""

from __future__ import annotations

import gzip
import json
import math
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.ingest.formats.wildtrack import VIEWS
from vsd_analytics.simulate.demo_project import opening
from vsd_analytics.simulate.people import simulate_day
from vsd_analytics.site.lines import Line
from vsd_analytics.site.model import Calibration, Camera

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parent)]
from prove_cameras import load  # noqa: E402
from warehouse.small_projects import T0, Frame, Person, make_site, open_days, put  # noqa: E402

Ends = tuple[tuple[float, float], tuple[float, float]]
FRAME_MS = {"hermes": 62.5, "juelich": 40.0, "oxtown": 40.0}
MARGIN_M = 0.25


@dataclass(frozen=True)
class Recording:
    """People on a floor, as whole tracks.

    Attributes:
        name: What it is.
        ms: Instant of each record, milliseconds from the start.
        who: Its person.
        xy: Its place, metres.
        camera: Its camera.
        lines: Where people are counted.
        cameras: The cameras, with their views.
        true_paths: Places of people that the truth is counted from: person to instants and places.
    """

    name: str
    ms: NDArray[np.int64]
    who: NDArray[np.int64]
    xy: NDArray[np.float64]
    camera: Sequence[str]
    lines: Mapping[str, Ends]
    cameras: Sequence[Camera]
    true_paths: Mapping[int, tuple[NDArray[np.int64], NDArray[np.float64]]]


def one_camera(
    name: str,
    ms: NDArray[np.int64],
    who: NDArray[np.int64],
    xy: NDArray[np.float64],
    lines: Mapping[str, Ends],
    hz: float,
) -> Recording:
    """Return a recording of one camera, in order of time; its own records are the truth."""
    order = np.lexsort((who, ms))
    ms, who, xy = ms[order], who[order], xy[order]
    paths = {int(p): (ms[who == p], xy[who == p]) for p in np.unique(who)}
    return Recording(name, ms, who, xy, ["cam"] * len(ms), lines, (Camera("cam", "Cam", "ground", hz=hz),), paths)


def leaps(ms: NDArray[np.int64], path: NDArray[np.float64]) -> bool:
    """Tell whether an annotated person goes faster than 10 m/s from one record to the next: two people with one id."""
    step_m = np.hypot(*np.diff(path, axis=0).T)
    return bool((step_m > 0.5 + 10 * np.diff(ms) / 1000).any())


def without_leaps(recording: Recording) -> Recording:
    """Return a recording without the people who leap."""
    gone = {p for p, (ms, path) in recording.true_paths.items() if leaps(ms, path)}
    kept = ~np.isin(recording.who, list(gone))
    return replace(
        recording,
        ms=recording.ms[kept],
        who=recording.who[kept],
        xy=recording.xy[kept],
        camera=[c for c, is_kept in zip(recording.camera, kept, strict=True) if is_kept],
        true_paths={p: path for p, path in recording.true_paths.items() if p not in gone},
    )


def crossings(path: NDArray[np.float64], ends: Ends) -> tuple[int, int]:
    """Return how often one person crosses a line to its left and to its right, by a walk along the path.

    A crossing is complete when the person was 0.25 m away on one side, then is 0.25 m away on the other, and the path
    between went through the line once more in this direction than in the other.
    """
    (ax, ay), (bx, by) = ends
    length = math.hypot(bx - ax, by - ay)
    counts = {1: 0, -1: 0}
    last_side, net, before = 0, 0, None
    for x, y in path.tolist():
        away = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / length
        along = ((bx - ax) * (x - ax) + (by - ay) * (y - ay)) / length
        if before is not None and (away >= 0) != (before[0] >= 0):
            share = before[0] / (before[0] - away)
            if 0 <= before[1] + share * (along - before[1]) < length:
                net += 1 if away >= 0 else -1
        side = 1 if away >= MARGIN_M else -1 if away <= -MARGIN_M else 0
        if side:
            if last_side and side != last_side and net * side > 0:
                counts[side] += 1
            last_side, net = side, 0
        before = away, along
    return counts[1], counts[-1]


def truth(recording: Recording) -> Counter[tuple[str, str]]:
    """Return the true number of crossings by line and side."""
    counts: Counter[tuple[str, str]] = Counter()
    for name, ends in recording.lines.items():
        for _, path in recording.true_paths.values():
            left, right = crossings(path, ends)
            counts[name, "left"] += left
            counts[name, "right"] += right
    return counts


def disturbed(recording: Recording, *, lost: float, cut_s: float | None, seed: int = 1) -> Iterator[Person]:
    """Yield the records: some are lost at random, and each track gets a new id again and again."""
    rng = np.random.default_rng(seed)
    kept = rng.random(len(recording.ms)) >= lost
    phases = {p: rng.random() for p in sorted({*zip(recording.who.tolist(), recording.camera, strict=True)})}
    rows = zip(
        recording.ms.tolist(), recording.who.tolist(), recording.xy.tolist(), recording.camera, kept, strict=True
    )
    for ms, person, (x, y), camera, is_kept in rows:
        if is_kept:
            piece = 0 if cut_s is None else int(ms / 1000 / cut_s + phases[person, camera])
            yield Person(T0 + ms, f"{person}#{piece}", round(x * 1000), round(y * 1000), camera)


def counted(recording: Recording, records: Sequence[Person]) -> Counter[tuple[str, str]]:
    """Return the crossings that the fact has for a new project with these records, by line and side."""
    beats = [Frame(ts, camera) for camera, ts in sorted({(r.camera, r.ts) for r in records})]
    lines = tuple(Line(name, name, "ground", ends, "left", "right") for name, ends in recording.lines.items())
    with tempfile.TemporaryDirectory() as root:
        site = replace(make_site(Path(root), cameras=recording.cameras), lines=lines)
        put(site, [*records, *beats])
        with open_days(site) as warehouse:
            rows = warehouse.rows("select line_id, is_to_left from line_crossings")
    return Counter((r["line_id"], "left" if r["is_to_left"] else "right") for r in rows)


def hermes(folder: Path) -> Iterator[Recording]:
    for path in sorted((folder / "hermes").glob("*.txt.gz")):
        rows = np.loadtxt(path)
        ms = np.round(rows[:, 1] * FRAME_MS["hermes"]).astype(np.int64)
        lines = {f"y{y:+.0f}": ((-2.0, y), (5.0, y)) for y in (-5.0, -4.0, 0.0, 5.0)}
        yield one_camera(path.stem.partition(".")[0], ms, rows[:, 0].astype(np.int64), rows[:, 2:4] / 100, lines, 16.0)


def juelich(folder: Path) -> Recording:
    rows = np.loadtxt(folder / "juelich" / "bottleneck" / "040_c_56_h-.txt.gz")
    ms = np.round(rows[:, 1] * FRAME_MS["juelich"]).astype(np.int64)
    lines = {f"y{y:+.1f}": ((-3.0, y), (3.0, y)) for y in (-1.0, 0.0, 1.0)}
    return one_camera("Jülich 040_c_56_h", ms, rows[:, 0].astype(np.int64), rows[:, 2:4], lines, 25.0)


def oxtown(folder: Path) -> Recording:
    h = np.loadtxt(folder / "oxtown" / "H_image_to_ground_m.txt").reshape(3, 3)
    text = gzip.decompress((folder / "oxtown" / "TownCentre-groundtruth.top.gz").read_bytes()).decode()
    parts = [line.split(",") for line in text.splitlines()]
    rows = np.array([[float(v) for v in p] for p in parts if len(p) == 12 and p[0].strip().isdigit()])
    feet = np.stack([(rows[:, 8] + rows[:, 10]) / 2, rows[:, 11], np.ones(len(rows))])
    x, y, w = h @ feet
    xy = np.stack([x / w, y / w], axis=1)
    ms = np.round(rows[:, 1] * FRAME_MS["oxtown"]).astype(np.int64)
    middle = np.median(xy, axis=0)
    lines = {
        "across": ((middle[0], middle[1] - 12), (middle[0], middle[1] + 12)),
        "along": ((middle[0] - 12, middle[1]), (middle[0] + 12, middle[1])),
        "slant": ((middle[0] - 6, middle[1] - 6), (middle[0] + 6, middle[1] + 6)),
        "short": ((middle[0] - 3, middle[1] - 1), (middle[0] - 3, middle[1] + 3)),
    }
    return one_camera("Oxford street", ms, rows[:, 0].astype(np.int64), xy, lines, 25.0)


def wildtrack(folder: Path) -> Iterator[Recording]:
    """Yield WILDTRACK's seven views; the truth is its positions fused from all of them."""
    folder = folder / "wildtrack"
    matrices = json.loads((folder / "H_image_to_ground_m.json").read_text())
    who, view, xy = load(folder, per_camera=True)
    true_who, _, true_xy = load(folder, per_camera=False)
    number = {name: k for k, name in enumerate(sorted({str(p) for _, p in true_who}))}
    cameras = [
        Camera(
            v,
            v,
            "ground",
            hz=2.0,
            picture_px=(1920, 1080),
            calibrations=(Calibration(tuple(tuple(row) for row in matrices[v]), None, v),),
        )
        for v in VIEWS
    ]
    people = np.array([number[str(p)] for _, p in true_who])
    ms = np.array([int(str(t)) for t, _ in true_who])
    order = np.argsort(ms, kind="stable")
    paths = {int(p): (ms[order][people[order] == p], true_xy[order][people[order] == p]) for p in np.unique(people)}
    short = {f"y{y:+.0f}": ((-3.0, y), (9.0, y)) for y in (0.0, 8.0, 16.0)}
    long = {f"x{x:+.0f}": ((x, -8.0), (x, 26.0)) for x in (0.0, 2.0, 4.0)}
    seen_ms = np.array([int(str(t)) for t, _ in who])
    seen_by = np.array([number[str(p)] for _, p in who])
    order = np.lexsort((seen_by, seen_ms))
    views = [view[k] for k in order.tolist()]
    yield Recording(
        "WILDTRACK, lines in one view", seen_ms[order], seen_by[order], xy[order], views, short, cameras, paths
    )
    yield Recording(
        "WILDTRACK, lines over six views", seen_ms[order], seen_by[order], xy[order], views, long, cameras, paths
    )


def recordings(folder: Path) -> Iterator[Recording]:
    yield from hermes(folder)
    yield juelich(folder)
    yield oxtown(folder)
    yield from wildtrack(folder)


RUNS = (
    ("true ids", 0.0, None),
    ("7 % of boxes lost", 0.07, None),
    ("and ids cut every 10 s", 0.07, 10.0),
    ("and ids cut every 3 s", 0.07, 3.0),
)


DOOR_RUNS = ((0.0, None), (0.07, 10.0), (0.07, 3.0))


def off(true: Counter[tuple[str, str]], found: Counter[tuple[str, str]]) -> float:
    """Return the sum of the differences by line and direction, over the true number."""
    return sum(abs(true[key] - found[key]) for key in true | found) / max(1, true.total())


@dataclass(frozen=True)
class Doors:
    """What the doors of a floor say of one day.

    Attributes:
        name: Of the run.
        true_in, true_out: People who come in and who go out.
        n_in, n_out: As counted.
        left: People inside by the doors at the end.
    """

    name: str
    true_in: int
    true_out: int
    n_in: int
    n_out: int
    left: int


def doors(recording: Recording, inside: Mapping[str, str], *, lost: float, cut_s: float | None) -> Doors:
    """Return what doors say of a recording that begins and ends with nobody inside."""
    true, found = truth(recording), counted(recording, list(disturbed(recording, lost=lost, cut_s=cut_s)))
    outside = {"left": "right", "right": "left"}
    into = [(name, side) for name, side in inside.items()]
    out_of = [(name, outside[side]) for name, side in inside.items()]
    n = [sum(counts[key] for key in keys) for counts in (true, found) for keys in (into, out_of)]
    name = f"{recording.name}, {'true ids' if cut_s is None else f'7 % lost, ids cut every {cut_s:g} s'}"
    return Doors(name, *n, left=n[2] - n[3])


def simulated_shop() -> Recording:
    """Return a day of the simulated shop at two frames a second; people come in past shelves and go out past tills."""
    opens, closes = opening(date(2026, 11, 10))
    simulated = simulate_day(opens, closes=closes, seed=1, interval_s=0.5, display_moved=True)
    ms = simulated.frame_ms[simulated.frame]
    xy = np.stack([simulated.x_m, simulated.y_m], axis=1)
    lines = {"shelves": ((16.9, 3.2), (24.0, 3.2)), "tills": ((16.9, 0.0), (16.9, 3.2))}
    return one_camera("simulated shop", ms - ms.min(), simulated.person, xy, lines, 2.0)


def door_rows(folder: Path) -> None:
    """Print people in and out and who is left: HERMES between entrance and exit, and a day of the simulated shop."""
    print("\n| run | true in | true out | in | out | left inside |\n|---|---|---|---|---|---|")
    runs = [(recording, {"y+5": "right", "y-4": "left"}) for recording in hermes(folder)]
    for recording, inside in (*runs, (simulated_shop(), {"shelves": "left", "tills": "left"})):
        for lost, cut_s in DOOR_RUNS:
            d = doors(recording, inside, lost=lost, cut_s=cut_s)
            print(f"| {d.name} | {d.true_in} | {d.true_out} | {d.n_in} | {d.n_out} | {d.left:+d} |", flush=True)


def main() -> None:
    """Print the crossings of each recording, then those of doors; with the argument `doors` only these."""
    folder = Path(os.environ["VSD_REALDATA"])
    if sys.argv[1:] != ["doors"]:
        crossing_rows(folder)
    door_rows(folder)


def crossing_rows(folder: Path) -> None:
    print("| recording | people | lines | true crossings | " + " | ".join(name for name, _, _ in RUNS) + " |")
    print("|---|---|---|---|" + "---|" * len(RUNS))
    for whole in recordings(folder):
        recording = without_leaps(whole)
        true = truth(recording)
        cells = []
        for _, lost, cut_s in RUNS:
            found = counted(recording, list(disturbed(recording, lost=lost, cut_s=cut_s)))
            cells.append(f"{off(true, found):.1%}")
        people = f"{len(recording.true_paths)} of {len(whole.true_paths)}"
        head = f"| {recording.name} | {people} | {len(recording.lines)} | {true.total():,} |"
        print(f"{head} {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
