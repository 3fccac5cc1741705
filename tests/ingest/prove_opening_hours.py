"""How often `vsd check` doubts the clock of a file by opening hours (W223): prints a table of docs/methods/imports.md.

Run `python tests/ingest/prove_opening_hours.py --files 200`. Each file is a day of a made-up shop in one of six zones,
with opening hours of its own. Its times are right, or its program counted local time as UTC (off by one offset), or it
added the offset from UTC where it had to subtract it (off by two).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from site_text import site_text

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions

ZONES = (
    "Europe/Rome",
    "Europe/Helsinki",
    "America/New_York",
    "Asia/Kolkata",
    "Australia/Sydney",
    "America/Los_Angeles",
)
DAY = datetime(2025, 11, 25, 12, tzinfo=UTC)
NOW = datetime(2025, 12, 1, tzinfo=UTC)
EVERY_MIN, STAY_MIN = 1.0, 8.0
"""Minutes from one record of a person to the next, and of a visit (mean)."""

Stays = list[tuple[float, float]]
"""First and last local hour of each person."""


def customers(rng: np.random.Generator, opens_h: float, closes_h: float, *, n: int = 250) -> Stays:
    """Return visits that come most at two times of the day, the last ones until a quarter of an hour after closing."""
    peaks = rng.uniform(opens_h + 1, closes_h - 1, 2)
    came_h = rng.normal(rng.choice(peaks, n), rng.uniform(1.5, 3.0))
    came_h = came_h[(came_h > opens_h) & (came_h < closes_h)]
    return [(h, min(h + rng.exponential(STAY_MIN) / 60, closes_h + rng.uniform(0, 0.25))) for h in came_h]


def staff(rng: np.random.Generator, from_h: float, until_h: float) -> Stays:
    """Return the shifts of three to eight people in view a third of the time."""
    shifts = [(from_h + rng.uniform(0, 0.3), until_h - rng.uniform(0, 0.3)) for _ in range(rng.integers(3, 9))]
    return [(h, h + 0.1) for a, b in shifts for h in np.arange(a, b, 0.3)]


def _in_hours(rng: np.random.Generator, opens_h: float, closes_h: float) -> Stays:
    return customers(rng, opens_h, closes_h)


def _with_staff(rng: np.random.Generator, opens_h: float, closes_h: float) -> Stays:
    on = staff(rng, opens_h - rng.uniform(0.5, 2), closes_h + rng.uniform(0, 1.5))
    return [*customers(rng, opens_h, closes_h), *on]


def _empty_end(rng: np.random.Generator, opens_h: float, closes_h: float) -> Stays:
    last_h = closes_h - rng.uniform(1, 3)
    return [*customers(rng, opens_h, last_h), *staff(rng, opens_h - rng.uniform(1, 2.5), last_h)]


def _open_longer(rng: np.random.Generator, opens_h: float, closes_h: float) -> Stays:
    return customers(rng, opens_h + rng.uniform(0, 1), closes_h + rng.uniform(0.5, 2))


def _cleaned(rng: np.random.Generator, opens_h: float, closes_h: float) -> Stays:
    at_h = rng.choice([opens_h - rng.uniform(2, 4), closes_h + rng.uniform(0.5, 2)])
    return [*customers(rng, opens_h, closes_h), *staff(rng, at_h, at_h + 1.5)]


WORLDS: dict[str, Callable[[np.random.Generator, float, float], Stays]] = {
    "customers in opening hours": _in_hours,
    "staff half an hour to two hours before, and until 1.5 h after": _with_staff,
    "staff 1 to 2.5 h before; nobody in the last 1 to 3 h": _empty_end,
    "closes half an hour to two hours later than vsd.toml says": _open_longer,
    "cleaned for 1.5 h before opening or after closing": _cleaned,
}


def is_doubted(stays: Stays, *, zone: str, opens_h: float, closes_h: float, n_offsets: int, seed: int) -> bool:
    """Return whether the doubt comes for a file of these people whose times are off by some offsets of the zone."""
    rng, here = np.random.default_rng(seed), ZoneInfo(zone)
    local = DAY.astimezone(here)
    midnight, offset = local.replace(hour=0, minute=0), local.utcoffset()
    assert offset is not None
    rows = []
    for person, (first_h, last_h) in enumerate(stays):
        place = rng.uniform(1, 19, 2)
        for h in np.arange(first_h, last_h, EVERY_MIN / 60):
            at = midnight + timedelta(hours=float(h)) + n_offsets * offset
            place = place + rng.normal(0, 1.0, 2)
            rows.append((at.timestamp(), person, *place))
    lines = [f"{t:.3f},{who},{x:.3f},{y:.3f}" for t, who, x, y in sorted(rows)]
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        opening = f'opening = {{ mon-sun = "{_clock(opens_h)}-{_clock(closes_h)}" }}\n'
        (root / "vsd.toml").write_text(site_text(site=opening, timezone=zone), encoding="utf-8")
        path = root / "day.csv"
        path.write_text("\n".join(["ts,track_id,x_m,y_m", *lines]) + "\n", encoding="utf-8")
        (found,) = ingest(load_site(root), [path], IngestOptions(camera="cam-1"), now=NOW, is_dry_run=True).sources
    assert found.card is not None
    return any(d.code == "W223" and "opening hours" in d.what for d in found.card.warnings)


def _clock(hours: float) -> str:
    return f"{int(hours):02d}:{round(hours % 1 * 60):02d}"


def row(world: str, n_files: int, seed: int) -> str:
    """Return a row of the table."""
    n_doubted = np.zeros(3, dtype=int)
    for k in range(n_files):
        rng = np.random.default_rng([seed, list(WORLDS).index(world), k])
        zone = ZONES[k % len(ZONES)]
        opens_h, closes_h = rng.integers(14, 21) / 2, rng.integers(34, 45) / 2  # 7:00 to 10:00, 17:00 to 22:00
        stays = WORLDS[world](rng, opens_h, closes_h)
        given = {"zone": zone, "opens_h": opens_h, "closes_h": closes_h, "seed": k}
        n_doubted += [is_doubted(stays, n_offsets=n, **given) for n in range(3)]
    return f"| {world} | " + " | ".join(f"{n / n_files:.0%}" for n in n_doubted) + " |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print("| people | times are right: doubted (a false alarm) | off by one offset: doubted | off by two: doubted |")
    print("|---|--:|--:|--:|")
    with ProcessPoolExecutor() as pool:
        for line in pool.map(row, WORLDS, [given.files] * len(WORLDS), [given.seed] * len(WORLDS)):
            print(line, flush=True)


if __name__ == "__main__":
    main()
