"""How often a second delivery is seen in each spelling, and how often other recordings are taken for one.

    python tests/ingest/prove_second_deliveries.py                 # made-up recordings
    VSD_REALDATA=... python tests/ingest/prove_second_deliveries.py  # real ones too

Prints the tables of docs/methods, and ends with 1 where a second delivery of the twelve spellings is silent, or
another recording is taken for one.
"""

from __future__ import annotations

import gzip
import io
import json
import os
import re
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1]))

from ingest.spellings import (
    SPELLINGS,
    START_MS,
    TWELVE,
    Spelling,
    escalator,
    hall,
    halves_of_people,
    moved,
    project,
    queue,
    renamed,
    seen_twice,
    standing,
    statue,
    to_25_cm,
    write,
)

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import SourceResult, ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions

NOW = datetime(2026, 1, 1, tzinfo=UTC)
ROWS_MAX = 30_000
CODES = ("W230", "W231")
MADE_UP: Mapping[str, Callable[[], pd.DataFrame]] = {
    "hall, 1 Hz": hall,
    "hall, 10 Hz": lambda: hall(2, minutes=5, hz=10, n_people=20),
    "queue": queue,
    "escalator": escalator,
    "people who stand": standing,
}


def came(root: Path, frame: pd.DataFrame, name: str, how: str = "csv", *, is_sure: bool = False) -> SourceResult:
    """Ingest a recording and return what came of it."""
    columns = {"x_m": "x_ft", "y_m": "y_ft"} if "feet" in how else {}
    options = IngestOptions(map=columns, is_sure=is_sure)
    return ingest(load_site(root), [write(frame, root / f"{name}.csv", how)], options, now=NOW).sources[0]


def doubts(source: SourceResult) -> str:
    """Return the codes by which a file is taken for a second delivery, or its unit for another one; "" = none."""
    seen = () if source.card is None else source.card.warnings
    what = [w.code for w in seen if w.code in CODES or (w.code == "W220" and "times as large" in w.what)]
    return " ".join(dict.fromkeys(what))


def again(frame: pd.DataFrame, spelling: Spelling) -> str:
    """Return what is said of a recording that comes again."""
    with tempfile.TemporaryDirectory() as folder:
        root = project(Path(folder), *spelling.cameras)
        came(root, spelling.stored(frame), "first", is_sure=True)
        return doubts(came(root, spelling.again(frame), "second", spelling.write))


def real() -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield real recordings, where they are, as frames with times from the same instant on."""
    folder = Path(os.environ.get("VSD_REALDATA", ""))
    if not os.environ.get("VSD_REALDATA") or not folder.is_dir():
        print("no real recordings: VSD_REALDATA is not set", file=sys.stderr)
        return
    names = ["s", "track", "x", "y", "speed", "angle"]
    for hour in (9, 10):
        for part in ("train", "test"):
            atc = pd.read_csv(folder / f"atc/atc-1024-{hour}_{part}.csv.gz", names=names)
            yield f"ATC {hour} h, {part}", _recording(atc["s"] - atc["s"].iloc[0], atc)
    for name, hz in (("seq_eth", 15), ("seq_hotel", 25), ("zara01", 25)):
        columns = ["frame", "track", "x", "z", "y", "vx", "vz", "vy"]
        walk = pd.read_csv(folder / f"eth_ucy/{name}/obsmat.txt.gz", sep=r"\s+", names=columns)
        yield name, _recording((walk["frame"] - walk["frame"].min()) / hz, walk)
    for name in ("CocktailParty", "CoffeeBreak_Seq1"):
        stand = pd.read_csv(folder / f"standing_groups/{name}.csv.gz")
        stand = stand.assign(track=stand["person"], x=stand["x_cm"] / 100, y=stand["y_cm"] / 100)
        yield name, _recording((stand["t"] - stand["t"].min()) / _per_second(stand["t"]), stand)
    for name in ("uo-180-180-070", "uo-180-180-120", "uo-300-300-200"):
        columns = ["track", "frame", "x", "y", "z"]
        run = pd.read_csv(folder / f"hermes/{name}.txt.gz", sep=r"\s+", names=columns, comment="#")
        yield name, _recording((run["frame"] - run["frame"].min()) / 16, run.assign(x=run["x"] / 100, y=run["y"] / 100))

    yield from _annotated(folder)


def _annotated(folder: Path) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield recordings of other forms: a forum in pixels of known size, MOTChallenge in metres, cells, PeTrack."""
    text = gzip.decompress((folder / "edinburgh/annotations/tracks.01Aug.txt.gz").read_bytes()).decode()
    tracks = re.findall(r"TRACK\.R(\d+)=\[(.*?)\]\s*;", text, re.S)
    points = [(track, *map(int, point)) for track, way in tracks for point in re.findall(r"(\d+) (\d+) (\d+)", way)]
    forum = pd.DataFrame(points, columns=["track", "u", "v", "frame"])
    forum = forum.assign(x=forum["u"] * 0.0247, y=forum["v"] * 0.0247)
    yield "Edinburgh", _recording((forum["frame"] - forum["frame"].min()) / 9, forum)
    with zipfile.ZipFile(folder / "pets_mot/3DMOT2015Labels.zip") as archive:
        for name in ("PETS09-S2L1", "TUD-Stadtmitte"):
            text = archive.read(f"3DMOT2015Labels/train/{name}/gt/gt.txt").decode()
            mot = pd.read_csv(io.StringIO(text), names=["frame", "track", *"lbwhcxyz"])
            yield name, _recording((mot["frame"] - 1) / (7 if name.startswith("PETS") else 25), mot)
    with tarfile.open(folder / "wildtrack/annotations_positions_0_995.tar.gz") as archive:
        cells = [
            (int(Path(member.name).stem), str(person["personID"]), person["positionID"])
            for member in archive.getmembers()
            if member.name.endswith(".json") and (file := archive.extractfile(member)) is not None
            for person in json.load(file)
        ]
    square = pd.DataFrame(cells, columns=["frame", "track", "cell"])
    square = square.assign(x=-3 + 0.025 * (square["cell"] % 480), y=-9 + 0.025 * (square["cell"] // 480))
    yield "WILDTRACK", _recording(square["frame"] / 10, square)
    columns = ["track", "frame", "x", "y", "z"]
    crowd = pd.read_csv(folder / "juelich/bottleneck/040_c_56_h-.txt.gz", sep=r"\s+", names=columns, comment="#")
    yield "Jülich", _recording((crowd["frame"] - crowd["frame"].min()) / 25, crowd)


def _per_second(times: pd.Series) -> float:
    step = float(np.median(np.diff(np.unique(times))))
    return 10.0 ** round(np.log10(step / 0.1)) if step > 60 else 1.0


def _recording(seconds: pd.Series, frame: pd.DataFrame) -> pd.DataFrame:
    ms = START_MS + np.rint(seconds.to_numpy(dtype=float) * 1000).astype(np.int64)
    made = pd.DataFrame(
        {"ms": ms, "camera": "a", "track": frame["track"].astype(str), "x": frame["x"], "y": frame["y"]}
    )
    return made.round({"x": 3, "y": 3}).sort_values("ms", kind="stable", ignore_index=True)[:ROWS_MAX]


def after(first: pd.DataFrame, then: pd.DataFrame, *cameras: str) -> str:
    """Return what is said of a recording that comes after another one."""
    with tempfile.TemporaryDirectory() as folder:
        root = project(Path(folder), *(cameras or ("a",)))
        came(root, first, "first", is_sure=True)
        return doubts(came(root, then, "second"))


def second_views(frame: pd.DataFrame) -> Iterator[tuple[str, str]]:
    """Yield what is said of the same people, seen by a second camera."""
    for name, made in (("", lambda f: f), (", to 25 cm", to_25_cm), (", to a decimetre", lambda f: f.round(1))):
        for error_m in (0.05, 0.1):
            one, two = (made(f) for f in seen_twice(frame, error_m=error_m))
            yield f"errors of {100 * error_m:.0f} cm{name}", after(one, two, "a", "b")


def others() -> Iterator[tuple[str, Callable[[], str]]]:
    """Yield recordings that are no second delivery, each with what is said of it."""

    day = 86_400_000
    for name, made in (("hall", hall), ("queue", queue), ("escalator", escalator), ("people who stand", standing)):
        yield f"{name}: the next day, other people", lambda m=made: after(m(1), moved(renamed(m(2)), ms=day))
        yield f"{name}: an hour later, other people", lambda m=made: after(m(1), moved(renamed(m(3)), ms=3_600_000))
        yield f"{name}: the next part", lambda m=made: after(*_halves(m(1)))
        yield f"{name}: one half of the people, then the other", lambda m=made: after(*halves_of_people(m(1)))
        yield (
            f"{name}: one half of the people, then the other, to 25 cm",
            lambda m=made: after(*halves_of_people(to_25_cm(m(1)))),
        )
        yield (
            f"{name}: another camera, 40 m further, at the same times",
            lambda m=made: after(m(1), m(4).assign(camera="b", x=m(4)["x"] + 40), "a", "b"),
        )
        yield (
            f"{name}: another camera with axes of its own, at the same times",
            lambda m=made: after(m(1), renamed(m(5)).assign(camera="b"), "a", "b"),
        )
    yield "statue: the next day", lambda: after(statue(), statue(1))
    yield "the same file again", lambda: after(hall(), hall())
    yield "a file that has grown", lambda: after(_halves(hall())[0], hall())


def _halves(frame: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    is_first = frame["ms"] < frame["ms"].quantile(0.5)
    return frame[is_first], frame[~is_first]


def beside_each_other(recordings: Mapping[str, pd.DataFrame]) -> Iterator[tuple[str, str]]:
    """Yield what is said of each recording that comes after all before it, at the same times and on the same floor."""
    cameras = [f"c{i}" for i in range(len(recordings))]
    with tempfile.TemporaryDirectory() as folder:
        root = project(Path(folder), *cameras)
        for camera, (name, frame) in zip(cameras, recordings.items(), strict=True):
            yield name, doubts(came(root, frame.assign(camera=camera), camera, is_sure=True))


def main() -> int:
    """Print the tables."""
    recordings = dict(real())
    shown = [
        *MADE_UP,
        *[n for n in recordings if n in ("ATC 9 h, train", "seq_hotel", "zara01", "CocktailParty", "uo-180-180-070")],
    ]
    worlds = {name: MADE_UP[name]() if name in MADE_UP else recordings[name] for name in shown}
    print(f"| spelling | {' | '.join(worlds)} |\n|---|{'---|' * len(worlds)}")
    is_bad = False
    for name, spelling in SPELLINGS.items():
        said = [again(frame, spelling) for frame in worlds.values()]
        is_bad |= name in TWELVE and "" in said
        print(f"| {name} | {' | '.join(s or 'silent' for s in said)} |", flush=True)
    print(f"\n| a second view | {' | '.join(worlds)} |\n|---|{'---|' * len(worlds)}")
    views = [dict(second_views(frame)) for frame in worlds.values()]
    for name in views[0]:
        is_bad |= any("W230" in of_world[name] for of_world in views)
        print(f"| {name} | {' | '.join(of_world[name] or 'silent' for of_world in views)} |", flush=True)
    print("\n| no second delivery | said |\n|---|---|")
    for name, ask in others():
        said_of = ask()
        is_bad |= bool(said_of)
        print(f"| {name} | {said_of or 'nothing'} |", flush=True)
    halves = [(n, f) for n, f in recordings.items() if n.startswith("ATC 9")]
    if halves:
        with tempfile.TemporaryDirectory() as folder:
            root = project(Path(folder), "a")
            said = [doubts(came(root, frame, f"half{i}", is_sure=True)) for i, (_, frame) in enumerate(halves)]
        is_bad |= any(said)
        print(f"| ATC 9 h: both files of the hour, one camera | {' '.join(said).strip() or 'nothing'} |")
    for name, frame in recordings.items():
        said_of = after(*halves_of_people(frame))
        is_bad |= bool(said_of)
        print(f"| {name}: one half of the people, then the other | {said_of or 'nothing'} |", flush=True)
    for name, said_of in beside_each_other(recordings):
        is_bad |= bool(said_of)
        print(f"| {name}, beside the others | {said_of or 'nothing'} |", flush=True)
    return int(is_bad)


if __name__ == "__main__":
    sys.exit(main())
