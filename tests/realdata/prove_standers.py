"""Do people who stand in the way tell how far others keep from an obstacle? A natural experiment on a shopping centre.

Run `VSD_REALDATA=... python tests/realdata/prove_standers.py`; docs/methods says what came. Whoever stands for a
minute is an obstacle. People who walk past the same spot in the minutes right before and after are led around it, as
`vsd whatif` does, and compared with those who passed while somebody stood there: time within 1 and 2 m of the spot, for
each pass. The clearance is chosen on one half of the cases and checked on the other.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import shapely

from vsd_analytics.whatif.detours import detours
from vsd_analytics.whatif.floor_records import floor_records

STAND_S, STAND_M = 60, 0.6
"""Whoever stays within 0.6 m of the middle of the spell for a minute stands."""
AROUND_M, WINDOW_S, MARGIN_S = 4.0, 300, 5
COMPANY_M, COMPANY_SHARE = 1.5, 0.3
"""Who is nearer than this for so much of the spell stands together with them, and passes nobody."""
CLEARANCES_M = (0.1, 0.2, 0.3, 0.5, 0.7)
WITHIN_M = (1.0, 2.0)
MIN_DURING, MIN_FREE, MOST_DURING = 3, 6, 200


@dataclass(frozen=True, slots=True)
class Case:
    """Seconds within 1 and 2 m of a spot, mean over passes: while somebody stands there, free, and led around.

    Attributes:
        n_during, n_free: Passes.
        during_s, free_s: Shape (2,).
        led_s: Shape (n_clearances, 2).
    """

    n_during: int
    n_free: int
    during_s: np.ndarray
    free_s: np.ndarray
    led_s: np.ndarray


def spells(people: pd.DataFrame) -> Iterator[tuple[int, int, int, float, float]]:
    """Yield who stands, from when to when, and where."""
    for person, own in people.groupby("id"):
        t_s, x_m, y_m = (own[c].to_numpy() for c in ("t", "x", "y"))
        first = 0
        while first < t_s.size:
            last = first
            while last + 1 < t_s.size and t_s[last + 1] - t_s[last] <= 5:
                part = slice(first, last + 2)
                away = np.hypot(x_m[last + 1] - np.median(x_m[part]), y_m[last + 1] - np.median(y_m[part]))
                if away > STAND_M:
                    break
                last += 1
            if t_s[last] - t_s[first] >= STAND_S:
                part = slice(first, last + 1)
                yield int(person), int(t_s[first]), int(t_s[last]), np.median(x_m[part]), np.median(y_m[part])
            first = last + 1


def passes(people: pd.DataFrame, spot: tuple[float, float], begin_s: float, end_s: float) -> list[np.ndarray]:
    """Return who walks past within `AROUND_M`: arrays of t, x, y."""
    there = people[(people["t"] >= begin_s) & (people["t"] < end_s)]
    there = there[np.hypot(there["x"] - spot[0], there["y"] - spot[1]) < AROUND_M + 3]
    found = []
    for _, own in there.groupby("id"):
        whole = own[["t", "x", "y"]].to_numpy(float)
        for way in np.split(whole, np.flatnonzero(np.diff(whole[:, 0]) > 2) + 1):
            steps_m = np.hypot(*np.diff(way[:, 1:], axis=0).T)
            walks = len(way) > 2 and steps_m.sum() > 0.5 * (way[-1, 0] - way[0, 0])
            if walks and np.hypot(*(way[-1] - way[0])[1:]) > 3 and _near_m(way, spot).min() < AROUND_M:
                found.append(way)
    return found


def _near_m(way: np.ndarray, spot: tuple[float, float]) -> np.ndarray:
    """Return the distance from a spot every tenth of a second."""
    at = np.arange(way[0, 0], way[-1, 0] + 0.05, 0.1)
    x, y = (np.interp(at, way[:, 0], way[:, k]) for k in (1, 2))
    return np.hypot(x - spot[0], y - spot[1])


def seconds(ways: list[np.ndarray], spot: tuple[float, float]) -> np.ndarray:
    """Return the seconds within 1 and 2 m, mean over passes."""
    return np.array([[0.1 * (_near_m(way, spot) < d).sum() for d in WITHIN_M] for way in ways]).mean(axis=0)


def led(ways: list[np.ndarray], spot: tuple[float, float], clearance_m: float) -> list[np.ndarray]:
    """Return the ways around somebody of 0.5 m who stands at a spot."""
    track = np.repeat(np.arange(len(ways)), [len(way) for way in ways])
    t_s, x_m, y_m = np.concatenate(ways).T
    body = shapely.box(spot[0] - 0.25, spot[1] - 0.25, spot[0] + 0.25, spot[1] + 0.25).exterior.coords[:-1]
    records = floor_records(track=track, camera=0 * track, t_s=t_s, x_m=x_m, y_m=y_m)
    moved = detours(records, tuple(body), solid=None, clearance_m=clearance_m)
    every = np.column_stack([records.t_s, moved.x_m, moved.y_m])
    return [every[records.track == k] for k in range(len(ways))]


def cases(root: Path) -> Iterator[Case]:
    for hour in (9, 10, 11):
        parts = [pd.read_csv(root / "atc" / f"atc-1024-{hour}_{p}.csv.gz", header=None) for p in ("train", "test")]
        rows = pd.concat(parts)
        people = pd.DataFrame({"t": np.floor(rows[0]).astype(int), "id": rows[1], "x": rows[2], "y": rows[3]})
        people = people.drop_duplicates(["t", "id"]).sort_values(["id", "t"])
        for person, begin_s, end_s, *spot in spells(people):
            here = people[(people["t"] >= begin_s) & (people["t"] <= end_s)]
            near_s = here[np.hypot(here["x"] - spot[0], here["y"] - spot[1]) < COMPANY_M].groupby("id").size()
            company = {person, *near_s[near_s > COMPANY_SHARE * (end_s - begin_s)].index}
            others = people[~people["id"].isin(company)]
            place, wide_s = (spot[0], spot[1]), max(end_s - begin_s, WINDOW_S)
            during = passes(others, place, begin_s + MARGIN_S, end_s - MARGIN_S)
            free = passes(others, place, begin_s - wide_s, begin_s - MARGIN_S)
            free += passes(others, place, end_s + MARGIN_S, end_s + wide_s)
            if MIN_DURING <= len(during) <= MOST_DURING and len(free) >= MIN_FREE:
                around = [seconds(led(free, place, c), place) for c in CLEARANCES_M]
                yield Case(len(during), len(free), seconds(during, place), seconds(free, place), np.array(around))


def ratios(some: list[Case]) -> tuple[np.ndarray, np.ndarray]:
    """Return free and led passes over those while somebody stood there, all cases together."""
    n = np.array([c.n_during for c in some])
    came = n @ np.array([c.during_s for c in some])
    return n @ np.array([c.free_s for c in some]) / came, np.tensordot(n, [c.led_s for c in some], 1) / came


def main() -> int:
    """Print what passers-by keep from people who stand, and whether a clearance foresees it."""
    every = list(cases(Path(os.environ.get("VSD_REALDATA", "../shared/data"))))
    draw = np.random.default_rng(1)
    print(f"{len(every)} cases, {sum(c.n_during for c in every)} passes, {sum(c.n_free for c in every)} free ones")
    drawn = [ratios([every[k] for k in draw.integers(0, len(every), len(every))]) for _ in range(1000)]
    for k, within_m in enumerate(WITHIN_M):
        lo, hi = np.percentile([free[k] for free, _ in drawn], [5, 95])
        print(f"within {within_m:g} m: free passes {ratios(every)[0][k]:.2f} times as long ({lo:.2f} to {hi:.2f})")
        for at, clearance_m in enumerate(CLEARANCES_M):
            lo, hi = np.percentile([around[at, k] for _, around in drawn], [5, 95])
            print(f"  led around at {clearance_m:g} m: {ratios(every)[1][at, k]:.2f} ({lo:.2f} to {hi:.2f})")
    left_out = []
    for _ in range(500):
        order = draw.permutation(len(every))
        learned, checked = ([every[k] for k in half] for half in np.array_split(order, 2))
        best = int(np.argmin(np.abs(np.log(ratios(learned)[1][:, 1]))))
        left_out.append(ratios(checked)[1][best, 1])
    lo, mid, hi = np.percentile(left_out, [5, 50, 95])
    print(f"clearance of one half, other half, 2 m: {mid:.2f} ({lo:.2f} to {hi:.2f}); "
          f"within 10 %: {np.mean(np.abs(np.array(left_out) - 1) <= 0.1):.0%}")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
