"""Counts violations of recordings whose track ids were taken away, in several ways, beside those by id.

Run `VSD_REALDATA=... python tests/realdata/prove_without_ids.py`; the table is in docs/methods. Plain numpy
and scipy on true positions: an engine that sends no ids also misses people and places them with noise.
"""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from vsd_analytics.simulate.people import simulate_day

FPS = {"seq_eth": 15.0, "seq_hotel": 25.0, "zara01": 25.0}
NEAR_M, MIN_MS, REACH_M, WALK_M_S = 2.0, 3000, 1.0, 2.0
Array = np.ndarray  # rows t_ms, id, x_m, y_m; pairs t_ms, id_a, id_b, x_a, y_a, x_b, y_b


def pairs_of(people: Array) -> Array:
    """Return the pairs nearer than 2 m, by time."""
    found = []
    for rows in _frames(people):
        for i, j in sorted(cKDTree(rows[:, 2:]).query_pairs(NEAR_M - 1e-9)):
            a, b = sorted((rows[i].tolist(), rows[j].tolist()), key=lambda row: row[1])
            found.append([a[0], a[1], b[1], *a[2:], *b[2:]])
    return np.array(found)


def _frames(rows: Array) -> list[Array]:
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    return np.split(rows, np.flatnonzero(np.diff(rows[:, 0])) + 1)


def _gap_ms(h_ms: float) -> float:
    return max(3000.0, 2.5 * h_ms)


def n_long(labels: Array, t_ms: Array, h_ms: float) -> int:
    """Return how many labels last 3 s or more, first to last and one frame interval."""
    first, last = np.full(labels.max() + 1, np.inf), np.full(labels.max() + 1, -np.inf)
    np.minimum.at(first, labels, t_ms)
    np.maximum.at(last, labels, t_ms)
    return int((last - first + h_ms >= MIN_MS).sum())


def by_id(pairs: Array, h_ms: float) -> int:
    """Return the violations by track id."""
    pairs = pairs[np.lexsort((pairs[:, 0], pairs[:, 2], pairs[:, 1]))]
    begins = (np.diff(pairs[:, 1:3], axis=0) != 0).any(axis=1) | (np.diff(pairs[:, 0]) > _gap_ms(h_ms))
    return n_long(np.concatenate([[0], np.cumsum(begins)]), pairs[:, 0], h_ms)


def by_place(pairs: Array, h_ms: float) -> int:
    """Return the runs of records whose midpoints lie within 1 m and a gap of one another."""
    gap = _gap_ms(h_ms)
    at = np.column_stack([(pairs[:, 3:5] + pairs[:, 5:7]) / 2 / REACH_M, pairs[:, 0] / gap])
    edges = cKDTree(at).query_pairs(2**0.5, output_type="ndarray")
    apart = np.abs(at[edges[:, 0]] - at[edges[:, 1]])
    edges = edges[(np.hypot(apart[:, 0], apart[:, 1]) <= 1) & (apart[:, 2] <= 1)]
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(at), len(at)))
    return n_long(connected_components(graph, directed=False)[1], pairs[:, 0], h_ms)


def linked(rows: Array, h_ms: float, *, expects: bool) -> Array:
    """Return people with ids made by linking frames one to one, nearest first, at most 0.3 m + 2 m/s off.

    Args:
        rows: People; their ids are not looked at.
        h_ms: Frame interval.
        expects: Whoever moved is looked for where the last step leads, 0.3 m + 1.4 m/s around.
    """
    made, known, n_ids = [], np.zeros((0, 7)), 0  # known: id, t, x, y, vx, vy, has moved
    for frame in _frames(rows):
        t_ms = frame[0, 0]
        known = known[t_ms - known[:, 1] <= 2.5 * h_ms]
        dt_s = (t_ms - known[:, 1]) / 1000
        reach = 0.3 + WALK_M_S * dt_s * np.where((known[:, 6] > 0) & expects, 0.7, 1.0)
        off = cdist(known[:, 2:4] + known[:, 4:6] * dt_s[:, None] * expects, frame[:, 2:])
        off = np.where(off <= reach[:, None], off, np.inf)
        new, left = np.zeros((len(frame), 7)), np.ones(len(known), dtype=bool)
        ids = np.full(len(frame), -1)
        for at in np.argsort(off, axis=None, kind="stable"):
            i, j = divmod(int(at), len(frame))
            if not np.isfinite(off[i, j]):
                break
            if left[i] and ids[j] < 0:
                left[i], ids[j] = False, known[i, 0]
                new[j, 4:] = *((frame[j, 2:] - known[i, 2:4]) / dt_s[i]), 1
        fresh = ids < 0
        ids[fresh] = n_ids + np.arange(fresh.sum())
        n_ids += int(fresh.sum())
        new[:, 0], new[:, 1], new[:, 2:4] = ids, t_ms, frame[:, 2:]
        known = np.concatenate([known[left], new])
        made.append(np.column_stack([frame[:, 0], ids, frame[:, 2:]]))
    return np.concatenate(made)


def scene(path: Path, *, fps: float, step: int) -> Array:
    """Return every `step`-th annotation of a street scene."""
    told = np.loadtxt(path / "obsmat.txt.gz")
    rows = np.column_stack([np.round(told[:, 0] / fps * 1000), told[:, 1], told[:, 2], told[:, 4]])
    return rows[np.isin(rows[:, 0], np.unique(rows[:, 0])[::step])]


def shop(interval_s: float) -> Array:
    """Return an hour of the made-up shop with 5 cm of noise."""
    zone = ZoneInfo("Europe/Rome")
    hours = (datetime(2026, 11, 12, h, tzinfo=zone) for h in (16, 17))
    day = simulate_day(next(hours), closes=next(hours), seed=4, interval_s=interval_s, display_moved=True)
    noise = np.random.default_rng(1).normal(0, 0.05, (2, len(day.x_m)))
    return np.column_stack([day.frame * day.interval_ms, day.person, day.x_m + noise[0], day.y_m + noise[1]])


def main() -> None:
    """Print the table."""
    folder = Path(os.environ["VSD_REALDATA"]) / "eth_ucy"
    worlds = [(n, 400.0 * k, scene(folder / n, fps=f, step=k)) for n, f in FPS.items() for k in (1, 3)]
    worlds += [("shop, 1 hour", 1000 * s, shop(s)) for s in (0.5, 1.0, 2.0)]
    print("| recording | every | by id | midpoints within 1 m | people linked, nearest | people linked, expected |")
    print("|---|---|---|---|---|---|")
    for name, h_ms, people in worlds:
        pairs = pairs_of(people)
        n = by_id(pairs, h_ms)
        ways = [by_place(pairs, h_ms)]
        ways += [by_id(pairs_of(linked(people, h_ms, expects=e)), h_ms) for e in (False, True)]
        print(f"| {name} | {h_ms / 1000:g} s | {n} | {' | '.join(f'{w} ({w / n - 1:+.0%})' for w in ways)} |")


if __name__ == "__main__":
    main()
