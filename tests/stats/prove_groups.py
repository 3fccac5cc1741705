"""Measure the rule for groups on recordings and on simulated shops: python tests/stats/prove_groups.py --data FOLDER.

Recordings below FOLDER: three street scenes with true groups (`eth_ucy`), and three of people who stand
(`standing_groups`). In tables of walkers P, R and F1 are of pairs that walk together, times of both rules. Shops: days
of the people simulator, whose parties are planted. Weeks: drawn shares, whether the interval of the between-groups
share holds the truth.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from datetime import datetime, timedelta
from functools import partial
from itertools import product
from pathlib import Path
from unittest.mock import patch
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
from group_scenes import (
    FPS,
    STANDING,
    Scores,
    components,
    cut,
    noisy,
    read_groups,
    read_scene,
    read_standing,
    recut,
    score,
    standing_scores,
    thinned,
    through,
)

from vsd_analytics.figures.groups import Groups
from vsd_analytics.simulate.cameras import CAMERAS
from vsd_analytics.simulate.frame_messages import track_ids
from vsd_analytics.simulate.people import simulate_day
from vsd_analytics.stats.groups import share_by_days
from vsd_analytics.warehouse.rules import RULES

HEAD = (
    "| {} | | P | R | F1 | G-MITRE P/R | time P/R | within groups, true -> called | 20 s or more | ids cut | filter |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|"
)


def variants(scene: pd.DataFrame, *, seed: int) -> Iterator[tuple[str, pd.DataFrame]]:
    """Return a recording as it is, and made worse."""
    yield "as recorded", scene
    yield "every 1.2 s", thinned(scene, 3)
    yield "noise 0.1 m", noisy(scene, 0.1, seed=seed)
    yield "every 1.2 s, noise 0.1 m", noisy(thinned(scene, 3), 0.1, seed=seed)
    yield "every 1.2 s, noise 0.2 m", noisy(thinned(scene, 3), 0.2, seed=seed)
    for after_s in (10.0, 5.0):
        yield f"new ids every {after_s:g} s", cut(scene, after_s)
    yield "every 1.2 s, new ids every 10 s", cut(thinned(scene, 3), 10.0)


def measure(name: str, *, data: Path, seed: int) -> list[str]:
    """Return the rows of one recording."""
    folder = data / "eth_ucy" / name
    whole, truth = read_scene(folder), read_groups(folder)
    rows = []
    for label, scene in variants(whole, seed=seed):
        true = recut(truth, scene) if "ids" in label else truth
        with tempfile.TemporaryDirectory() as root:
            found, pairs = through(scene, Path(root))
        called = [frozenset(g.tracks) for g in found.groups if not g.is_standing]
        shown = label
        if "ids" in label:
            ids = scene["track"].drop_duplicates()
            cut_share = 1 - ids.str.extract("^p(.+)n")[0].nunique() / len(ids)
            shown = f"{label} ({cut_share:.0%} cut)"
        rows.append(row(name, shown, score(pairs, called, true, tracks=set(scene["track"])), found))
    return rows


NEAR, LIFE, WALKED_M = (0.3, 0.5, 0.7), tuple(np.arange(0.3, 0.81, 0.05).round(2)), (0.0, 1.0, 2.0, 3.0, 4.0, 6.0)
"""Grid of the rule's thresholds: share of records near, share of life close, metres walked."""


def left_out(data: Path) -> list[str]:
    """Return for each recording its F1 under the thresholds that are best on the two others, and under ours."""
    scenes = {}
    for name in FPS:
        scene, truth = read_scene(data / "eth_ucy" / name), read_groups(data / "eth_ucy" / name)
        with tempfile.TemporaryDirectory() as root:
            found, pairs = through(scene, Path(root))
        scenes[name] = (
            pairs,
            truth,
            set(scene["track"]),
            [frozenset(g.tracks) for g in found.groups if not g.is_standing],
        )

    def f1(name: str, near: float, life: float, walked_m: float) -> float:
        pairs, truth, tracks, _ = scenes[name]
        is_long = (pairs["violation_s"] >= 2) & (pairs["n_records"] >= 3)
        is_one = (
            is_long & (pairs["near_share"] >= near) & (pairs["life_share"] >= life) & (pairs["walked_m"] >= walked_m)
        )
        called = components(zip(pairs["track_a"][is_one], pairs["track_b"][is_one], strict=True))
        return score(pairs, called, truth, tracks=tracks).f1

    grid = {at: {name: f1(name, *at) for name in scenes} for at in product(NEAR, LIFE, WALKED_M)}
    rows = []
    for name, (pairs, truth, tracks, called) in scenes.items():
        near, life, walked_m = at = max(grid, key=lambda at: sum(v for k, v in grid[at].items() if k != name))
        ours = score(pairs, called, truth, tracks=tracks).f1
        chosen = f"near {near:g}, close {life:g} of their time, walked {walked_m:g} m"
        rows.append(f"| {name} | {chosen} | **{grid[at][name]:.3f}** | {ours:.3f} |")
    return rows


WINDOWS_S, TOGETHER_M, ALIGNED_S = (60, 120, 180, 240), (1.15, 1.2, 1.25, 1.3, 1.35), (0, 1, 2, 3)
"""Grid of the rule for people who stand, one at a time, and quarters of a window by which recordings are moved."""


def standing_scene(name: str, *, data: Path) -> tuple[str, dict[tuple[str, float], float], float]:
    """Return the row of a recording of people who stand, its F1 by window and by distance, and that of closeness."""
    scene, truth = read_standing(data / "standing_groups", name)

    def f1(window_s: float, together_m: float, part: int) -> dict[str, tuple[float, float, float]]:
        moved_s = part * window_s // 4
        moved = {t + moved_s: companies for t, companies in truth.items()}
        with patch.dict(RULES, company_window_ms=int(window_s * 1000)), tempfile.TemporaryDirectory() as root:
            found, _ = through(scene.assign(t=scene["t"] + moved_s), Path(root), together_m=together_m)
        return standing_scores(found, scene.assign(t=scene["t"] + moved_s), moved)

    found = [f1(120, 1.25, part) for part in ALIGNED_S]
    naive = found[0]["naive"][2]
    precision, recall, _ = np.mean([s["rule"] for s in found], axis=0)
    grid = {("both", 0.0): float(np.mean([s["rule"][2] for s in found]))}
    grid |= {("window", w): float(np.mean([f1(w, 1.25, p)["rule"][2] for p in ALIGNED_S])) for w in WINDOWS_S}
    grid |= {("distance", m): float(np.mean([f1(120, m, p)["rule"][2] for p in ALIGNED_S])) for m in TOGETHER_M}
    aligned = " / ".join(f"{s['rule'][2]:.3f}" for s in found)
    told = f"| {name} | {naive:.3f} | {precision:.2f} | {recall:.2f} | **{grid['both', 0.0]:.3f}** | {aligned} |"
    return told, grid, naive


def standing(pool: ProcessPoolExecutor, data: Path) -> Iterator[str]:
    """Return the tables of people who stand: the rule, and thresholds chosen on the other recordings."""
    yield "| scene | closer than 1.25 m | P | R | F1 | F1 as windows begin |\n|---|---|---|---|---|---|"
    scenes = dict(zip(STANDING, pool.map(partial(standing_scene, data=data), STANDING), strict=True))
    yield from (told for told, _, _ in scenes.values())
    yield "\n| scene left out | chosen on the others | F1 there | beyond closeness |\n|---|---|---|---|"
    for name, (_, grid, naive) in scenes.items():
        for kind, unit in (("window", "s"), ("distance", "m")):
            gains = {
                at: sum(other[at] for k, (_, other, _) in scenes.items() if k != name) for at in grid if at[0] == kind
            }
            best = max(gains, key=gains.__getitem__)
            yield f"| {name} | {kind} {best[1]:g} {unit} | **{grid[best]:.3f}** | {grid[best] - naive:+.3f} |"


def shop_day(seed: int, *, interval_s: float) -> list[str]:
    """Return the rows of one simulated day, one a camera: people in view with 5 cm of noise, parties planted."""
    zone = ZoneInfo("Europe/Rome")
    opens = datetime(2026, 1, 1, 9, tzinfo=zone)
    day = simulate_day(opens, closes=opens + timedelta(hours=9), seed=seed, interval_s=interval_s, display_moved=False)
    noise = np.random.default_rng(seed)
    made = []
    for camera in CAMERAS:
        seen = np.flatnonzero(camera.sees(day.x_m, day.y_m))
        track = track_ids(day.person[seen], day.frame[seen])
        scene = pd.DataFrame(
            {
                "t": (day.frame_ms[day.frame[seen]] - day.frame_ms[0]) / 1000,
                "track": track.astype(str),
                "x": day.x_m[seen] + noise.normal(0, 0.05, len(seen)),
                "y": day.y_m[seen] + noise.normal(0, 0.05, len(seen)),
            }
        )
        party = pd.Series(day.party[seen], index=scene["track"]).groupby(level=0).first()
        with tempfile.TemporaryDirectory() as root:
            found, pairs = through(scene, Path(root))
        met = zip(pairs["track_a"], pairs["track_b"], strict=True)
        truth = components((a, b) for a, b in met if party[a] == party[b])
        called = [frozenset(g.tracks) for g in found.groups if not g.is_standing]
        label = f"{1 / interval_s:g} frames/s, {len(party):,} tracks"
        made.append(row(camera.camera_id, label, score(pairs, called, truth, tracks=set(party.index)), found))
    return made


def row(name: str, label: str, s: Scores, found: Groups) -> str:
    """Return one row of the tables."""
    lives = found.cameras[0].lives
    state = "applies" if found.state == "ok" else "**not applicable**"
    told = (
        *(f"{s.precision:.2f}", f"{s.recall:.2f}", f"**{s.f1:.3f}**"),
        f"{s.mitre_precision:.2f}/{s.mitre_recall:.2f}",
        f"{s.time_precision:.2f}/{s.time_recall:.2f}",
        f"{s.true_share:.2f} -> {s.called_share:.2f}",
        *(f"{lives.long_share:.0%}", f"{lives.cut_share or 0:.0%}", state),
    )
    return f"| {name} | {label} | {' | '.join(told)} |"


def covers(world: tuple[float, float, float], weeks: int, seed: int) -> str:
    """Return one row of the table of intervals: true share, day sd of its logit, violations a week."""
    share, sd, n_week = world
    rng = np.random.default_rng([seed, round(share * 100), round(sd * 100), round(n_week)])
    busy = np.array([0.9, 0.85, 0.9, 1.0, 1.2, 1.4, 0.75])
    many = 1 / (1 + np.exp(-(np.log(share / (1 - share)) + rng.normal(0, sd, 400_000))))
    held = [0, 0]
    width = []
    for _ in range(weeks):
        of = rng.poisson(n_week / 7 * busy * rng.gamma(16, 1 / 16, 7))
        n = rng.binomial(of, 1 / (1 + np.exp(-(np.log(share / (1 - share)) + rng.normal(0, sd, 7)))))
        found = share_by_days(n, of)
        assert None not in (found.lo, found.hi, found.value)
        held[0] += found.lo <= many.mean() <= found.hi
        half = 1.96 * np.sqrt(found.value * (1 - found.value) / found.of)
        held[1] += abs(found.value - many.mean()) <= half
        width.append((found.hi - found.lo) / 2)
    ours, binomial, half_width = held[0] / weeks, held[1] / weeks, np.median(width)
    return f"| {share:.0%} | {sd:.2f} | {n_week:,} | {ours:.1%} (±{half_width:.1%}) | {binomial:.1%} |"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, help="folder of the recordings; without it only simulated rows")
    parser.add_argument("--weeks", type=int, default=3000)
    parser.add_argument("--days", type=int, default=1, help="simulated days of the shop")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    with ProcessPoolExecutor(2) as pool:
        if asked.data is not None:
            print(HEAD.format("scene"))
            for rows in pool.map(partial(measure, data=asked.data, seed=asked.seed), FPS):
                print("\n".join(rows), flush=True)
            print()
        if asked.data is not None:
            print("| scene left out | best on the two others | F1 there | F1 of the rule in use |\n|---|---|---|---|")
            print("\n".join(left_out(asked.data)), flush=True)
            print()
        if asked.data is not None:
            for line in standing(pool, asked.data):
                print(line, flush=True)
            print()
        print(HEAD.format("shop camera"))
        for rows in pool.map(partial(shop_day, interval_s=1.0), range(asked.seed, asked.seed + asked.days)):
            print("\n".join(rows), flush=True)
        print("\n| true share | day sd (logit) | violations a week | holds (half width) | binomial, by violations |")
        print("|---|---|---|---|---|")
        worlds = [(p, sd, n) for p in (0.5, 0.85) for n in (300, 3000) for sd in (0.0, 0.1, 0.25)]
        for line in pool.map(partial(covers, weeks=asked.weeks, seed=asked.seed), worlds):
            print(line, flush=True)


if __name__ == "__main__":
    main()
