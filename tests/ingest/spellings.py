"""A recording, and other spellings of it: the ways in which programs deliver the same people once more."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

START_MS = 1_764_061_200_000
"""2025-11-25T09:00:00Z."""
VSD_TOML = """\
[site]
id = "hall"
name = "Hall"
timezone = "UTC"
[[floor]]
id = "ground"
name = "Ground floor"
"""
CAMERA = """[[camera]]
id = "{id}"
name = "{id}"
floor = "ground"
"""


def project(folder: Path, *cameras: str) -> Path:
    """Write a project of a floor with cameras without views."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vsd.toml").write_text(VSD_TOML + "".join(CAMERA.format(id=camera) for camera in cameras))
    return folder


def of_people(tracks: list[tuple[float, np.ndarray]], *, hz: float, seed: int, jitter_m: float = 0.02) -> pd.DataFrame:
    """Return a recording of people, each from a second on at places in frames of `hz`; places have errors."""
    rng = np.random.default_rng(seed)
    parts = []
    for track, (from_s, places) in enumerate(tracks):
        ms = START_MS + np.rint(np.rint(from_s * hz) / hz * 1000 + np.arange(len(places)) * 1000 / hz).astype(np.int64)
        x, y = (places + rng.normal(0, jitter_m, places.shape)).T.round(3)
        parts.append(pd.DataFrame({"ms": ms, "camera": "a", "track": f"{track}", "x": x, "y": y}))
    return pd.concat(parts).sort_values(["ms", "track"], ignore_index=True)


@cache
def hall(seed: int = 1, *, minutes: float = 20, hz: float = 1.0, n_people: int = 60) -> pd.DataFrame:
    """Return people who cross a hall of 20 x 12 m by ways of their own."""
    rng = np.random.default_rng(seed)
    tracks = []
    for _ in range(n_people):
        stops = rng.uniform((0, 0), (20, 12), (4, 2))
        steps = [np.linspace(p, q, max(2, round(float(np.hypot(*(q - p))) / 1.2 * hz))) for p, q in pairwise(stops)]
        tracks.append((float(rng.uniform(0, 60 * minutes)), np.concatenate(steps)))
    return of_people(tracks, hz=hz, seed=seed)


@cache
def queue(seed: int = 1, *, minutes: float = 20, hz: float = 1.0) -> pd.DataFrame:
    """Return a queue: people step from place to place, as each day."""
    rng = np.random.default_rng(seed)
    tracks = []
    for from_s in np.cumsum(rng.exponential(25, round(minutes * 2))):
        places = [
            (12 - 1.0 * place, 3.0) for place in range(8, 0, -1) for _ in range(max(1, round(rng.uniform(8, 25) * hz)))
        ]
        tracks.append((float(from_s), np.array(places)))
    return of_people(tracks, hz=hz, seed=seed, jitter_m=0.05)


@cache
def escalator(seed: int = 1, *, minutes: float = 20, hz: float = 5.0) -> pd.DataFrame:
    """Return people on an escalator: all have the same way and speed."""
    rng = np.random.default_rng(seed)
    n = round(12 / 0.5 * hz)
    way = np.column_stack([np.linspace(0, 12, n), np.full(n, 5.0)])
    starts = np.cumsum(rng.exponential(6, round(minutes * 8)))
    return of_people(
        [(float(s), way + np.array((0, rng.normal(0, 0.15)))) for s in starts], hz=hz, seed=seed, jitter_m=0.02
    )


@cache
def standing(seed: int = 1, *, minutes: float = 10, hz: float = 2.0) -> pd.DataFrame:
    """Return six people who stand and talk."""
    rng = np.random.default_rng(seed)
    n = round(60 * minutes * hz)
    tracks = []
    for angle in np.linspace(0, 2 * np.pi, 6, endpoint=False):
        sway = np.cumsum(rng.normal(0, 0.004, (n, 2)), axis=0)
        tracks.append((0.0, np.array([6 + np.cos(angle), 5 + np.sin(angle)]) + sway * 0.3))
    return of_people(tracks, hz=hz, seed=seed, jitter_m=0.01)


def statue(days: int = 0, *, minutes: float = 10) -> pd.DataFrame:
    """Return a statue that a detector takes for a person, on some day."""
    n = round(60 * minutes)
    ms = START_MS + 1000 * np.arange(n) + 86_400_000 * days
    return pd.DataFrame({"ms": ms, "camera": "a", "track": "1", "x": 3.125, "y": 2.5})


def moved(frame: pd.DataFrame, *, ms: int = 0, **columns: object) -> pd.DataFrame:
    """Return a recording at other times, and with some columns replaced."""
    return frame.assign(ms=frame["ms"] + ms, **columns)


def renamed(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a recording with the ids of another tracker."""
    return frame.assign(track="n" + frame["track"].astype(str))


def to_25_cm(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a recording whose places are rounded to 25 cm."""
    return frame.assign(x=(frame["x"] * 4).round() / 4, y=(frame["y"] * 4).round() / 4)


def seen_twice(frame: pd.DataFrame, *, error_m: float = 0.1) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return what two cameras see of the same people, each with errors of its own."""
    rng = np.random.default_rng(3)
    one, two = (
        frame.assign(
            camera=camera,
            track=f"{camera}" + frame["track"].astype(str),
            **{axis: (frame[axis] + rng.normal(0, error_m, len(frame))).round(3) for axis in "xy"},
        )
        for camera in "ab"
    )
    return one, two


def halves_of_people(frame: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the records of every second person, and those of the others."""
    is_one = pd.factorize(frame["track"])[0] % 2 == 0
    return frame[is_one], frame[~is_one]


@dataclass(frozen=True)
class Spelling:
    """One way to deliver a recording again.

    Attributes:
        stored: What is stored first, of the recording.
        again: What comes then.
        write: How it is written.
        cameras: Cameras of the site.
    """

    again: Callable[[pd.DataFrame], pd.DataFrame]
    stored: Callable[[pd.DataFrame], pd.DataFrame] = lambda frame: frame
    write: str = "csv"
    cameras: tuple[str, ...] = ("a",)


def _later_part(frame: pd.DataFrame) -> pd.DataFrame:
    return frame[frame["ms"] >= frame["ms"].quantile(0.5)]


def _first_part(frame: pd.DataFrame) -> pd.DataFrame:
    return frame[frame["ms"] < frame["ms"].quantile(0.65)]


def _thinned(frame: pd.DataFrame) -> pd.DataFrame:
    return frame[pd.factorize(frame["ms"], sort=True)[0] % 2 == 0]


def _gaps(frame: pd.DataFrame) -> pd.DataFrame:
    return frame[(frame["ms"] - frame["ms"].min()) // 7000 % 3 != 1]


def _two_cameras(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(camera=np.where(frame["x"] < frame["x"].median(), "a", "b"))


SPELLINGS: Mapping[str, Spelling] = {
    "ids": Spelling(renamed),
    "rounding": Spelling(lambda f: renamed(f).round({"x": 2, "y": 2})),
    "shift": Spelling(lambda f: moved(f, ms=30)),
    "thinning": Spelling(lambda f: _thinned(renamed(f))),
    "overlap": Spelling(lambda f: _later_part(renamed(f)), stored=_first_part),
    "order": Spelling(lambda f: renamed(f).sort_values(["track", "ms"], ascending=[True, False])),
    "unit named": Spelling(renamed, write="csv in feet"),
    "camera renamed": Spelling(lambda f: f.assign(camera="b"), cameras=("a", "b")),
    "times floored": Spelling(
        lambda f: renamed(f).assign(ms=f["ms"] // 1000 * 1000).drop_duplicates(["camera", "track", "ms"])
    ),
    "merged cameras": Spelling(renamed, stored=_two_cameras, cameras=("a", "b")),
    "gaps": Spelling(lambda f: _gaps(renamed(f))),
    "another format": Spelling(renamed, write="frames"),
    "without ids": Spelling(lambda f: moved(f, ms=7, track="")),
    "to a decimetre": Spelling(lambda f: renamed(f).round({"x": 1, "y": 1})),
    "two seconds later": Spelling(lambda f: moved(renamed(f), ms=2_340)),
    "an hour later": Spelling(lambda f: moved(renamed(f).round({"x": 2, "y": 2}), ms=3_600_000)),
    "feet as metres": Spelling(lambda f: renamed(f).assign(x=f["x"] / 0.3048, y=f["y"] / 0.3048)),
    "every frame after every second": Spelling(renamed, stored=_thinned),
    "0.4 m further": Spelling(lambda f: moved(renamed(f), ms=30, x=f["x"] + 0.3, y=f["y"] + 0.3)),
    "a metre further": Spelling(lambda f: moved(renamed(f), x=f["x"] + 1)),
    "camera renamed, to 25 cm": Spelling(
        lambda f: to_25_cm(renamed(f)).assign(camera="b"), stored=to_25_cm, cameras=("a", "b")
    ),
}
"""The twelve ways of `TWELVE`, and more."""
TWELVE = tuple(SPELLINGS)[:12]


def write(frame: pd.DataFrame, path: Path, how: str = "csv") -> Path:
    """Write a recording as a table, or as frame messages, and return the path."""
    if how == "frames":
        path = path.with_suffix(".jsonl")
        with path.open("w") as file:
            for (camera, ms), people in frame.groupby(["camera", "ms"]):
                persons = [
                    {"id": t, "x_m": x, "y_m": y}
                    for t, x, y in zip(people["track"], people["x"], people["y"], strict=True)
                ]
                at = pd.Timestamp(ms, unit="ms", tz="UTC").isoformat(timespec="milliseconds")
                frame_of_people = {"v": 1, "camera": camera, "ts": at, "persons": persons}
                file.write(json.dumps(frame_of_people) + "\n")
        return path
    ts = pd.to_datetime(frame["ms"], unit="ms", utc=True).dt.strftime("%Y-%m-%dT%H:%M:%S.%f").str[:-3] + "Z"
    unit, divisor = ("ft", 0.3048) if how == "csv in feet" else ("m", 1.0)
    table = pd.DataFrame({"ts": ts, "camera_id": frame["camera"], "track_id": frame["track"]})
    table[f"x_{unit}"], table[f"y_{unit}"] = ((frame[axis] / divisor).round(3) for axis in "xy")
    table.to_csv(path, index=False)
    return path
