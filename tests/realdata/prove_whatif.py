"""How well `vsd whatif` predicts, on real recordings: widths of ways, people at another time, fixtures.

Run `VSD_REALDATA=... python tests/realdata/prove_whatif.py`; the tables are in docs/methods/whatif.md.

Widths: seven runs through a corridor with an exit or an entrance of some width. Each narrower run is predicted from
each wider one of the same corridor, and is no part of its own prediction: the rule of exits has no parameter.

Another time: everybody of every second ten minutes (100 s in short scenes) is shifted by 20 and 40 s to either side,
with company and own path, among all others as recorded. The strength of stepping aside comes from the other half. The
right answer is known: on average people come as close as they did. Floor is parted into squares of 4 m for the ranges.
"""

from __future__ import annotations

import gzip
import os
import sys
import tempfile
from collections.abc import Iterator
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd

from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.settings import Settings
from vsd_analytics.site.layout import DoorEdit, FixtureEdit
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.whatif.closeness import n_close
from vsd_analytics.whatif.doors import predicted_seconds
from vsd_analytics.whatif.fixture_edits import AROUND, fixture_effect
from vsd_analytics.whatif.floor_records import ALONE, FloorRecords, floor_records, records_of
from vsd_analytics.whatif.frame_pairs import FramePairs
from vsd_analytics.whatif.ranges import MIN_CLOSE_S, Z, spread
from vsd_analytics.whatif.retiming import SHIFTS_S, Meetings, shifted, step_aside

DAY = datetime(2026, 11, 2, 9, tzinfo=UTC)
DISTANCES_M = (1.0, 2.0)
SQUARE_M = 4.0
EXIT_LINE, ENTRANCE_LINE = ((-2.0, -4.0), (5.0, -4.0)), ((-2.0, 7.5), (5.0, 7.5))
EXITS = (("180-180-180", 1.8), ("180-180-120", 1.2), ("180-180-070", 0.7), ("300-300-300", 3.0), ("300-300-200", 2.0))
ENTRANCES = (("180-180-180", 1.8), ("145-180-180", 1.45), ("100-180-180", 1.0))


def corridor(root: Path, run: str) -> FloorRecords:
    """Return a run at 4 frames a second, floor metres."""
    with gzip.open(root / "hermes" / f"uo-{run}.txt.gz") as file:
        rows = np.loadtxt(file)
    rows = rows[rows[:, 1] % 4 == 0]
    return floor_records(
        track=rows[:, 0], camera=0 * rows[:, 0], t_s=rows[:, 1] / 16, x_m=rows[:, 2] / 100, y_m=rows[:, 3] / 100
    )


def widths(root: Path, within_m: float) -> None:
    for kind, runs, line in (("exit", EXITS, EXIT_LINE), ("entrance", ENTRANCES, ENTRANCE_LINE)):
        errors, held, n_refused = [], 0, 0
        for old, old_m in runs:
            for new, new_m in runs:
                if (kind == "exit" and old[:3] != new[:3]) or old_m == new_m:
                    continue
                door = DoorEdit("", line, kind, old_m, new_m)  # type: ignore[arg-type]
                found = predicted_seconds(corridor(root, old), door, within_m=within_m)
                if new_m > old_m:
                    n_refused += found.refusal is not None and found.refusal.code == "whatif.wider"
                    continue
                truth = predicted_seconds(corridor(root, new), door, within_m=within_m).traffic.close_s_per_person
                if found.value is None or found.lo is None or found.hi is None:
                    print(f"  {old} to {new}: refused, {found.refusal}")
                    continue
                errors.append(abs(found.value / truth - 1))
                held += found.lo <= truth <= found.hi
                print(f"  {kind} {old} to {new}: {found.value:.1f} s predicted, {truth:.1f} s")
        print(
            f"{kind}s at {within_m:g} m: {len(errors)} narrower, error {np.median(errors):.1%} in the median, "
            f"{max(errors):.1%} at most, {held} in their range; wider refused: {n_refused}"
        )


def refusals(root: Path) -> None:
    """Print what is said of the same corridor with people both ways, and with every sixth person only."""
    records = corridor(root, "180-180-180")
    door = DoorEdit("", EXIT_LINE, "exit", 1.8, 1.2)
    last = records.t_s.max()
    back = np.isin(records.track, np.unique(records.track)[::3])
    both = floor_records(
        track=records.track, camera=records.camera, x_m=records.x_m, y_m=records.y_m,
        t_s=np.where(back, last - records.t_s, records.t_s),
    )  # fmt: skip
    few = np.isin(records.track, np.unique(records.track)[::2])
    thin = floor_records(
        track=records.track[few], camera=records.camera[few], x_m=records.x_m[few], y_m=records.y_m[few],
        t_s=records.t_s[few] + 20 * (np.searchsorted(np.unique(records.track), records.track[few])),
    )  # fmt: skip
    for name, changed in (("both ways", both), ("no queue", thin)):
        print(f"{name}: {predicted_seconds(changed, door, within_m=1.0).refusal}")


def scenes(root: Path) -> Iterator[tuple[str, FloorRecords, float]]:
    """Yield real scenes with the groups that the product finds, and the length of the blocks that part them."""
    for hour in (10, 11):
        rows = pd.concat(
            pd.read_csv(root / "atc" / f"atc-1024-{hour}_{part}.csv.gz", header=None) for part in ("train", "test")
        )
        yield f"shopping centre, {hour} h", stored(np.floor(rows[0]), rows[1], rows[2], rows[3]), 600.0
    for folder, fps in (("zara01", 25), ("seq_eth", 15), ("seq_hotel", 25)):
        with gzip.open(root / "eth_ucy" / folder / "obsmat.txt.gz") as file:
            a = np.loadtxt(file)
        yield folder, stored(a[:, 0] / fps, a[:, 1], a[:, 2], a[:, 4]), 100.0


def stored(t_s: object, track: object, x_m: object, y_m: object) -> FloorRecords:
    """Return records as a project of their own stores them, with its groups."""
    table = pd.DataFrame({"t": np.asarray(t_s), "track": np.asarray(track, np.int64), "x_m": x_m, "y_m": y_m})
    table = table.drop_duplicates(["t", "track"]).sort_values("t")
    ts = DAY + pd.to_timedelta(np.round((table["t"] - table["t"].min()) * 1000), unit="ms")
    table = table.assign(ts=ts.dt.strftime("%Y-%m-%dT%H:%M:%S.%f").str[:-3] + "Z")
    with tempfile.TemporaryDirectory() as folder:
        site = Site(
            site_id="scene", name="Scene", timezone="UTC", root=Path(folder), opening=None, closed=frozenset(),
            day_starts_min=240, floors=(Floor("floor", "Floor"),), cameras=(Camera("cam", "Camera", "floor"),),
            areas=(), settings=Settings(),
        )  # fmt: skip
        file = Path(folder) / "positions.csv"
        table[["ts", "track", "x_m", "y_m"]].rename(columns={"track": "track_id"}).to_csv(file, index=False)
        ingest(site, [file], IngestOptions(camera="cam"), now=DAY + timedelta(days=9))
        day = date(2026, 11, 2)
        with open_warehouse(site, day, day, relations=("located", "pair_days", "track_days")) as warehouse:
            return records_of(warehouse, "floor", day, day, (-1e4, -1e4, 1e4, 1e4))


def another_time(records: FloorRecords, block_s: float, within_m: float) -> str:
    """Return bias and coverage of people shifted in time, each half of the time checked with the other's strength."""
    first = (records.t_s - records.t_s.min()) // block_s % 2 == 0
    weight_s = records.weight_s * records.is_owned
    company_s = companions(records, within_m)
    ratios, raw, held, n_squares = [], [], 0, 0
    for learned, checked in ((first, ~first), (~first, first)):
        aside = step_aside(records, learned, within_m=within_m)
        after, without, before, square = [], [], [], []
        for shift_s in SHIFTS_S:
            layer = shifted(records, checked, shift_s)
            meets = Meetings(records, layer, within_m=within_m)
            recorded = n_close(records.frames, records.x_m, records.y_m, within_m=within_m)[layer.rows] > 0
            for strength, out in ((aside.strength, after), (0.0, without)):
                out.append(weight_s[layer.rows] * (meets.is_close(strength) | company_s[layer.rows]))
            before.append(weight_s[layer.rows] * recorded)
            cells = np.floor(np.column_stack([layer.x_m, layer.y_m]) / SQUARE_M).astype(np.int64)
            square.append(cells[:, 0] * 10_000 + cells[:, 1])
        total = np.concatenate(before).sum()
        ratios.append(np.concatenate(after).sum() / total)
        raw.append(np.concatenate(without).sum() / total)
        _, at = np.unique(np.concatenate(square), return_inverse=True)
        own, new = (np.bincount(at.ravel(), weights=np.concatenate(v)) / len(SHIFTS_S) for v in (before, after))
        for close_s, then_s in zip(own, new, strict=True):
            if close_s >= MIN_CLOSE_S:
                sd = spread(close_s=close_s, within_m=within_m, by_day=np.zeros(0))
                held += abs(then_s / close_s - 1) <= Z * sd
                n_squares += 1
    share = f"{held / n_squares:.0%} of {n_squares}" if n_squares else "none"
    return f"{np.mean(ratios):.3f} (halves {ratios[0]:.3f}, {ratios[1]:.3f}; without {np.mean(raw):.3f}), held {share}"


def companions(records: FloorRecords, within_m: float) -> np.ndarray:
    """Return which records are too close to a companion: those stay together at any time."""
    own = records.company != ALONE
    frame = np.where(own, records.frame * 1_000_003 + records.company % 1_000_003, -1 - np.arange(own.size))
    return n_close(FramePairs(frame), records.x_m, records.y_m, within_m=within_m) > 0


def fixtures(records: FloorRecords, seed: int = 3) -> None:
    """Print what 2 x 1 m at 12 places where people walk is said to do, and at places that nobody comes near."""
    rng = np.random.default_rng(seed)
    shares, los, his, nulls = [], [], [], []
    for k in rng.choice(records.x_m.size, 12, replace=False):
        effect = _effect(records, float(records.x_m[k]), float(records.y_m[k]))
        around = next(p for p in effect.places if p.place_id == AROUND)
        shares.append(effect.n_touched / effect.n_near)
        if around.change is not None:
            los.append(around.change.lo)
            his.append(around.change.hi)
    outside = float(records.x_m.max()) + 10
    for k in range(3):
        [null] = _effect(records, outside + 5 * k, float(records.y_m.mean())).places
        nulls.append(null.change.value if null.change is not None else np.nan)
    print(
        f"2 x 1 m at 12 places: {min(shares):.0%} to {max(shares):.0%} of people touched, {len(los)} ranges, ends "
        f"{min(los):+.0%} to {max(his):+.0%}, {sum(lo > 0 or hi < 0 for lo, hi in zip(los, his, strict=True))} without "
        f"no change; where nobody is: {nulls}"
    )


def _effect(records: FloorRecords, x: float, y: float):  # type: ignore[no-untyped-def]
    polygon = ((x - 1, y - 0.5), (x + 1, y - 0.5), (x + 1, y + 0.5), (x - 1, y + 0.5))
    return fixture_effect(records, FixtureEdit("new", "New", None, polygon), (), {}, {}, within_m=2.0, widths_m=(1.2,))


def main() -> int:
    """Print the tables."""
    root = Path(os.environ.get("VSD_REALDATA", "../shared/data"))
    for within_m in (0.75, *DISTANCES_M):
        widths(root, within_m)
    refusals(root)
    for name, records, block_s in scenes(root):
        n_people = np.unique(records.track).size
        for within_m in DISTANCES_M:
            print(f"{name}, {n_people} people, {within_m:g} m: {another_time(records, block_s, within_m)}", flush=True)
        if name.startswith("shopping"):
            fixtures(records)
    return 0


if __name__ == "__main__":
    sys.exit(main())
