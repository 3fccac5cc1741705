"""How the two risk numbers move with people in view, and what two weeks of a workplace say: real recordings.

Run `VSD_REALDATA=... python tests/realdata/prove_crowding.py`; the tables are in docs/methods/crowds.md.

Crowding: three hours of a shopping centre in windows of five minutes. For a risk number r and people in view p,
elasticity e means r ~ p^e: a number that does not depend on crowding has e = 0. Least squares of log r on log p; the
interval leaves out one quarter-hour at a time (jackknife, 11 degrees of freedom). Person-time too close is counted here
with a k-d tree and compared with the stored facts.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree
from scipy.stats import t as student

from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import open_warehouse

NOW = datetime(2026, 11, 20, tzinfo=UTC)
DAY = date(2012, 10, 24)
COLUMNS = ("ts", "track_id", "x_m", "y_m", "speed", "angle")
FILES = tuple(f"atc-1024-{hour}_{part}.csv.gz" for hour in (9, 10, 11) for part in ("train", "test"))
CLOSE_M = 2.0
WINDOW_S = 300
QUARTER_S = 900
WORKPLACE = """\
[site]
id = "office"
name = "Office"
timezone = "Europe/Paris"
opening = { mon-fri = "09:00-18:00" }

[[floor]]
id = "floor"
name = "Floor"

[[camera]]
id = "office"
name = "Office"
floor = "floor"
hz = 0.05
"""


@dataclass(frozen=True)
class Elasticity:
    """Elasticity of one number to people in view, its 95 % interval, and the number of windows."""

    value: float
    lo: float
    hi: float
    n: int


def elasticity(people: np.ndarray, rate: np.ndarray, cluster: np.ndarray) -> Elasticity:
    """Return the slope of log rate on log people, and its jackknife interval over clusters."""
    is_known = (people > 0) & (rate > 0)
    x, y, c = np.log(people[is_known]), np.log(rate[is_known]), cluster[is_known]
    names = np.unique(c)
    slope = float(np.polyfit(x, y, 1)[0])
    without = np.array([np.polyfit(x[c != name], y[c != name], 1)[0] for name in names])
    n = len(names)
    half = float(student.ppf(0.975, n - 1) * np.sqrt((n - 1) / n * ((without - without.mean()) ** 2).sum()))
    return Elasticity(slope, slope - half, slope + half, len(x))


def counted_close(rows: pd.DataFrame) -> np.ndarray:
    """Return for each record whether somebody else was closer than 2 m in its second."""
    close = np.zeros(len(rows), dtype=bool)
    for at in rows.groupby("second").indices.values():
        xy = rows[["x_m", "y_m"]].to_numpy()[at]
        pairs = cKDTree(xy).query_pairs(CLOSE_M, output_type="ndarray")
        is_close = np.hypot(*(xy[pairs[:, 0]] - xy[pairs[:, 1]]).T) < CLOSE_M
        close[at[np.unique(pairs[is_close])]] = True
    return close


def shopping_centre(folder: Path, root: Path) -> None:
    """Print the elasticities, and how far the stored person-time too close is from the count made here."""
    settings = Settings().with_values({"pseudonyms": False})
    camera = Camera("atc", "ATC", "floor", hz=1.0)
    site = Site(
        "atc", "ATC", "Asia/Tokyo", root, floors=(Floor("floor", "Floor"),), cameras=(camera,), settings=settings
    )
    done = ingest(
        site, [folder / f for f in FILES], IngestOptions(format="positions", columns=COLUMNS, period_s=1.0), now=NOW
    )
    assert not any(s.error for s in done.sources)
    with open_warehouse(site, DAY, DAY) as warehouse:
        warehouse.materialise("episodes", "violations")
        stored = warehouse.rows("select quarter, sum(violation_ms) / 1000.0 as s from violation_time group by quarter")
        started = warehouse.frame("select started_ms from episodes where is_violation")["started_ms"].to_numpy() // 1000
    rows = pd.concat(pd.read_csv(folder / f, names=COLUMNS) for f in FILES)
    rows["second"] = np.floor(rows["ts"]).astype("int64")
    # two records of one person in one second are one sighting, as in the store; millimetres too
    rows = rows.drop_duplicates(["second", "track_id"]).reset_index(drop=True)
    rows[["x_m", "y_m"]] = rows[["x_m", "y_m"]].round(3)
    rows["is_close"] = counted_close(rows)
    by_quarter = rows.groupby(rows["second"] // QUARTER_S)["is_close"].sum()
    facts = pd.Series({int(r["quarter"]): float(r["s"]) for r in stored})
    difference = (facts - by_quarter).abs().sum() / by_quarter.sum()
    window = rows["second"] // WINDOW_S
    found = pd.DataFrame({
        "person_s": window.value_counts(),
        "close_s": rows.groupby(window)["is_close"].sum(),
        "violations": pd.Series(started // WINDOW_S).value_counts(),
    }).dropna()  # fmt: skip
    people = (found["person_s"] / WINDOW_S).to_numpy()
    quarter = (found.index * WINDOW_S // QUARTER_S).to_numpy()
    print(f"{len(found)} windows of 5 minutes, {people.min():.0f} to {people.max():.0f} people in view; ", end="")
    print(f"stored person-time too close differs from the k-d tree's by {difference:.3%}\n")
    print("| number | elasticity to people in view | 95 % interval |\n|---|--:|---|")
    rates = {
        "M6 share of time too close": found["close_s"] / found["person_s"],
        "M7 violations per person-hour": found["violations"] / found["person_s"],
        "M0 violations per open hour": found["violations"],
        "person-minutes too close per open hour": found["close_s"],
    }
    for name, rate in rates.items():
        e = elasticity(people, rate.to_numpy(dtype=float), quarter)
        print(f"| {name} | {e.value:.2f} | {e.lo:.2f} to {e.hi:.2f} |")


def workplace(folder: Path, root: Path) -> None:
    """Print what `vsd compare` says of the second week of the contacts of a workplace against the first."""
    (root / "vsd.toml").write_text(WORKPLACE, encoding="utf-8")
    with zipfile.ZipFile(folder / "workplace_InVS_tij.dat.zip") as archive:
        told = [line.split()[:3] for line in archive.read("tij_InVS.dat").decode().splitlines()]
    monday = int(datetime(2013, 6, 24, tzinfo=UTC).timestamp())
    contacts = sorted({(int(t), *sorted((a, b))) for t, a, b in told})
    path = root / "contacts.csv"
    rows = "".join(f"{monday + t},{a},{b},1.0\n" for t, a, b in contacts)
    path.write_text("ts,track_a,track_b,distance_m\n" + rows, encoding="utf-8")
    vsd = [str(Path(sys.executable).with_name("vsd")), "-C", str(root), "--now", NOW.isoformat()]
    subprocess.run([*vsd, "ingest", str(path), "--format", "pairs"], check=True, capture_output=True)
    done = subprocess.run(
        [*vsd, "compare", "2013-W26", "2013-W27", "--json"], check=False, capture_output=True, text=True
    )
    found = json.loads(done.stdout)
    floor = found["answers"]["compared_places"]["rows"][0]
    change = floor["violations_per_open_h_change"]
    print("| workplace, badges | week 1 | week 2 | ratio | likely between | verdict |\n|---|--:|--:|--:|---|---|")
    n_a, n_b = (floor[f"n_compared_{when}"]["value"] for when in ("before", "after"))
    rates = (n_a / floor["compared_h_before"], n_b / floor["compared_h_after"], 1 + change["value"])
    bounds = (1 + change["lo"], 1 + change["hi"])
    verdict = floor["violations_per_open_h_verdict"].replace("_", " ")
    cells = [*(f"{v:.3g}" for v in rates), " and ".join(f"{v:.2f}" for v in bounds), verdict]
    print(f"| violations per open hour, {n_a:.0f} and {n_b:.0f} of them | {' | '.join(cells)} |")
    print("| M6, M7 | – | – | – | – | not measurable: badges send no positions, so person-time is unknown |")


def main() -> int:
    """Print both tables; 0 also where the recordings are absent, which is said."""
    folder = Path(os.environ.get("VSD_REALDATA", ""))
    if not (folder / "atc").is_dir():
        print("skipped: VSD_REALDATA names no folder with the recordings atc and sociopatterns")
        return 0
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as two:
        shopping_centre(folder / "atc", Path(one))
        print()
        workplace(folder / "sociopatterns", Path(two))
    return 0


if __name__ == "__main__":
    sys.exit(main())
