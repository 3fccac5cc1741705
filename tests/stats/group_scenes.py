"""Recordings with true groups through ingest and marts, and how well what is called agrees with what is true."""

from __future__ import annotations

import gzip
import json
import math
from collections.abc import Collection, Hashable, Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from vsd_analytics.figures.groups import Groups, groups
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import open_warehouse

START_MS = 1_767_258_000_000  # 2026-01-01 09:00 UTC
DAY = date(2026, 1, 1)
INTERVAL_S = 0.4
STANDING = ("CocktailParty", "CoffeeBreak_Seq1", "CoffeeBreak_Seq2")
FPS = {"seq_eth": 15.0, "seq_hotel": 25.0, "zara01": 25.0}
Partition = list[frozenset[str]]


def read_scene(folder: Path) -> pd.DataFrame:
    """Return a recording's rows: t (seconds), track, x, y (metres)."""
    with gzip.open(folder / "obsmat.txt.gz") as f:
        rows = np.loadtxt(f)
    track = rows[:, 1].astype(int).astype(str)
    return pd.DataFrame({"t": rows[:, 0] / FPS[folder.name], "track": track, "x": rows[:, 2], "y": rows[:, 4]})


def read_groups(folder: Path) -> Partition:
    """Return the true groups, closed: lines that share a person are one group."""
    lines = [line.split() for line in (folder / "groups.txt").read_text().splitlines()]
    return components((a, b) for line in lines for a in line for b in line[:1] if len(line) > 1)


def components(edges: Iterable[tuple[Hashable, Hashable]]) -> list[frozenset]:
    """Return the connected components of a graph, by networkx."""
    nx = pytest.importorskip("networkx")
    return [frozenset(c) for c in nx.connected_components(nx.Graph(list(edges))) if len(c) > 1]


def thinned(scene: pd.DataFrame, every: int, phase: int = 0) -> pd.DataFrame:
    """Return every n-th frame of a recording."""
    return scene[np.round(scene["t"] / INTERVAL_S).astype(int) % every == phase]


def noisy(scene: pd.DataFrame, sd_m: float, *, seed: int) -> pd.DataFrame:
    """Return a recording with Gaussian noise on each coordinate."""
    off = np.random.default_rng(seed).normal(0, sd_m, (2, len(scene)))
    return scene.assign(x=scene["x"] + off[0], y=scene["y"] + off[1])


def cut(scene: pd.DataFrame, after_s: float) -> pd.DataFrame:
    """Return a recording in which everybody gets a new id after so many seconds in view, again and again."""
    life = scene["t"] - scene.groupby("track")["t"].transform("min")
    return scene.assign(track="p" + scene["track"] + "n" + (life // after_s).astype(int).astype(str))


def recut(truth: Partition, scene: pd.DataFrame) -> Partition:
    """Return the true groups among the ids of a cut recording: pieces of people of one group."""
    group = {person: k for k, members in enumerate(truth) for person in members}
    ids = pd.Series(scene["track"].unique())
    of = ids.str.extract(r"^p(?P<person>.+)n\d+$")["person"].map(group)
    return [frozenset(part) for _, part in ids.groupby(of) if len(part) > 1]


def project(root: Path) -> Site:
    """Return a site of one camera that keeps the recording's own ids."""
    settings = Settings().with_values({"pseudonyms": False})
    cameras = (Camera("street", "Street", "floor"),)
    return Site("site", "Site", "UTC", root, floors=(Floor("floor", "Floor"),), cameras=cameras, settings=settings)


def write(scene: pd.DataFrame, path: Path) -> None:
    """Write a recording as a table of positions."""
    ts = (START_MS + np.round(scene["t"] * 1000).astype(np.int64)).astype(np.int64)
    table = scene.assign(ts=pd.to_datetime(ts, unit="ms", utc=True).dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ"))
    table = table.rename(columns={"track": "track_id", "x": "x_m", "y": "y_m"})
    table.to_csv(path, columns=["ts", "track_id", "x_m", "y_m"], index=False)


def read_standing(folder: Path, name: str) -> tuple[pd.DataFrame, dict[float, Partition]]:
    """Return a recording of people who stand, one place a second, and its true companies by second"""
    per_second = 1e6 if name == "CocktailParty" else 1.0
    rows = pd.read_csv(folder / f"{name}.csv.gz")
    start = rows["t"].min()
    scene = pd.DataFrame(
        {
            "t": ((rows["t"] - start) // per_second).astype(float),
            "track": rows["person"].astype(str),
            "x": rows["x_cm"] / 100,
            "y": rows["y_cm"] / 100,
        }
    )
    truth = json.loads((folder / f"{name}.gt.json").read_text())
    companies = {
        float((int(t) - start) // per_second): [frozenset(map(str, members)) for members in groups_then]
        for t, groups_then in truth.items()
    }
    return scene.drop_duplicates(["t", "track"]), companies


def standing_scores(
    found: Groups, scene: pd.DataFrame, truth: Mapping[float, Partition], *, naive_m: float = 1.25
) -> dict[str, tuple[float, float, float]]:
    """Return precision, recall and F1 over the pairs of each annotated instant: of our rule, and of closeness then."""
    n_true, sums = 0, {"rule": [0, 0], "naive": [0, 0]}  # called, called and true
    for t, companies in truth.items():
        instant = datetime.fromtimestamp(START_MS / 1000 + t, tz=UTC)
        here = scene[scene["t"] == t]
        place = dict(zip(here["track"], zip(here["x"], here["y"], strict=True), strict=True))
        everybody = set(combinations(sorted(place), 2))
        true = pairs_in(companies) & everybody
        n_true += len(true)
        now = [frozenset(g.tracks) for g in found.groups if g.start <= instant < g.end]
        near = {(a, b) for a, b in everybody if math.dist(place[a], place[b]) < naive_m}
        for rule, pairs in (("rule", pairs_in(now) & everybody), ("naive", near)):
            sums[rule][0] += len(pairs)
            sums[rule][1] += len(pairs & true)
    return {k: (right / max(1, n), right / n_true, 2 * right / (n_true + n)) for k, (n, right) in sums.items()}


def pairs_in(partition: Iterable[Iterable[str]]) -> set[tuple[str, ...]]:
    """Return the pairs of members of groups."""
    return {pair for members in partition for pair in combinations(sorted(members), 2)}


def through(scene: pd.DataFrame, root: Path, **settings: float) -> tuple[Groups, pd.DataFrame]:
    """Ingest a recording and return what is said of its groups, and the mart `pair_days`."""
    site = project(root)
    site = replace(site, settings=site.settings.with_values(settings))
    path = root / "scene.csv"
    write(scene, path)
    result = ingest(site, [path], IngestOptions(format="positions"), now=datetime(2026, 11, 20, tzinfo=UTC))
    assert [s.error for s in result.sources] == [None]
    with open_warehouse(site, DAY, DAY) as warehouse:
        return groups(warehouse), warehouse.frame("select * from pair_days")


@dataclass(frozen=True)
class Scores:
    """Agreement of called groups with true ones.

    Attributes:
        precision, recall, f1: Over pairs ever closer than 2 m.
        mitre_precision, mitre_recall: G-MITRE (Solera et al. 2016): links that must be moved, singles included.
        time_precision, time_recall: Over the violation time of those pairs.
        true_share, called_share: Share of violation time within groups.
    """

    precision: float
    recall: float
    mitre_precision: float
    mitre_recall: float
    time_precision: float
    time_recall: float
    true_share: float
    called_share: float

    @property
    def f1(self) -> float:
        return 2 * self.precision * self.recall / (self.precision + self.recall)


def score(pairs: pd.DataFrame, called: Collection[frozenset], truth: Collection[frozenset], *, tracks: set) -> Scores:
    """Return how called groups agree with true ones.

    Args:
        pairs: track_a, track_b, violation_s, standing_s of every pair ever closer than 2 m.
        called: Groups that walk, disjoint; of all other pairs the time they stand in company is called within groups.
        truth: True groups, disjoint.
        tracks: Everybody.
    """
    in_truth, in_called = _labels(truth), _labels(called)
    true = np.array([_same(in_truth, a, b) for a, b in zip(pairs["track_a"], pairs["track_b"], strict=True)])
    found = np.array([_same(in_called, a, b) for a, b in zip(pairs["track_a"], pairs["track_b"], strict=True)])
    time = pairs["violation_s"].to_numpy(dtype=float)
    both = true & found
    called_s = np.where(found, time, pairs["standing_s"].to_numpy(dtype=float))
    return Scores(
        precision=both.sum() / found.sum(),
        recall=both.sum() / true.sum(),
        mitre_precision=_mitre(called, in_truth, tracks),
        mitre_recall=_mitre(truth, in_called, tracks),
        time_precision=called_s[true].sum() / called_s.sum(),
        time_recall=called_s[true].sum() / time[true].sum(),
        true_share=time[true].sum() / time.sum(),
        called_share=called_s.sum() / time.sum(),
    )


def _labels(partition: Collection[frozenset]) -> Mapping[Hashable, int]:
    return {member: k for k, members in enumerate(partition) for member in members}


def _same(labels: Mapping[Hashable, int], a: Hashable, b: Hashable) -> bool:
    return a in labels and labels[a] == labels.get(b)


def _mitre(partition: Collection[frozenset], other: Mapping[Hashable, int], tracks: set) -> float:
    """Return the share of links of a partition's spanning forest that the other one has; a single links to itself."""
    grouped = set().union(*partition) & tracks
    n_links = n_kept = 0
    for members in ([m for m in group if m in tracks] for group in partition):
        parts = {other[m] for m in members if m in other}
        n_parts = len(parts) + sum(m not in other for m in members)
        n_links += len(members) - 1
        n_kept += len(members) - n_parts
    singles = tracks - grouped
    return (n_kept + sum(m not in other for m in singles)) / (n_links + len(singles))
