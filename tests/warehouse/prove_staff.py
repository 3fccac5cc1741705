"""Proof: who is called staff in a shop with other behaviour than the rules assume, and the figures before and after.

`PYTHONPATH=.:tests python tests/warehouse/prove_staff.py [DAYS]` prints, for tracks that are never cut and for tracks
that are cut, and for an engine that tags none, half and all of the records of staff: precision and recall of each rule,
the visitors called staff, and the figures of all people, of visitors by the rule, and of visitors by the truth. One day
takes 45 seconds.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from datetime import timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from warehouse.staffed_shop import MONDAY, Records, Shop, put, records_of, site_of

from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import Warehouse

FIGURES = {
    "violations (M0)": "select sum(n_violations) as v from hours",
    "person-hours": "select sum(exposure_s) / 3600 as v from hours",
    "share of person-time too close (M6)": "select sum(violation_s) / sum(exposure_s) as v from hours",
    "people in view, mean (M2)": "select sum(exposure_s) / sum(recorded_s) as v from hours",
    "minutes in the queue, mean": "select avg(dwell_s) / 60 as v from visits where area_id = 'queue' and is_open",
    "visits of the queue": "select count(*) as v from visits where area_id = 'queue' and is_open",
}


def named(site: Site, n_days: int) -> dict[str, str]:
    """Return the rule that named each track of staff."""
    with Warehouse(site, MONDAY.date(), MONDAY.date() + timedelta(days=n_days - 1)) as warehouse:
        rows = warehouse.rows("select distinct track_id, rule from staff_tracks")
    return {row["track_id"]: row["rule"] for row in rows}


def judged(of: Records, staff: Mapping[str, str]) -> dict[str, float]:
    """Return precision and recall by person-time and by track of those called staff."""
    called = np.isin(of.track, np.array([int(t[1:]) for t in staff] or [-1]))
    tracks, first = np.unique(of.track, return_index=True)
    is_called = np.isin(tracks, of.track[called])
    truly = of.is_staff[first]
    return {
        "precision": float((called & of.is_staff).sum() / max(1, called.sum())),
        "recall": float((called & of.is_staff).sum() / of.is_staff.sum()),
        "precision by track": float((is_called & truly).sum() / max(1, is_called.sum())),
        "recall by track": float((is_called & truly).sum() / truly.sum()),
        "visitors called staff": float((is_called & ~truly).sum()),
        "share of visitors' time called staff": float((called & ~of.is_staff).sum() / (~of.is_staff).sum()),
    }


def figures(site: Site, n_days: int) -> dict[str, float]:
    """Return the figures of the days."""
    with Warehouse(site, MONDAY.date(), MONDAY.date() + timedelta(days=n_days - 1)) as warehouse:
        found: dict[str, Any] = {name: warehouse.rows(query)[0]["v"] for name, query in FIGURES.items()}
    return {name: float(value or 0) for name, value in found.items()}


def main(n_days: int) -> None:
    """Print the tables."""
    for cuts in (0.0, 0.5, 4.0):
        of = records_of(Shop(n_days=n_days, cuts_per_h=cuts, seed=7))
        print(f"\nnew ids an hour: {cuts:g}; records {len(of.at_s):,}, of staff {of.is_staff.mean():.1%}")
        for tagged in (0.0, 0.5, 1.0):
            with TemporaryDirectory() as folder:
                classes = {"staff_classes": ("staff",)} if tagged else {}
                every, truth = site_of(Path(folder) / "all", **classes), site_of(Path(folder) / "truth")
                put(every, of, tagged=tagged)
                put(truth, of, only=~of.is_staff)
                print(f" tagged by the engine: {tagged:.0%} of the records of staff")
                _print_tables(of, every, truth, n_days)


def _print_tables(of: Records, every: Site, truth: Site, n_days: int) -> None:
    staff = named(every, n_days)
    for rule in ("tag", "area", "view", "closed", "any"):
        found = judged(of, {t: r for t, r in staff.items() if rule in ("any", r)})
        print(f"  {rule:8}", ", ".join(f"{name} {value:.3f}" for name, value in found.items()))
    columns = [figures(s, n_days) for s in (every, every.with_settings(people="visitors"), truth)]
    print(f"  {'':40}{'all':>10}{'visitors':>10}{'truth':>10}")
    for name in FIGURES:
        print(f"  {name:40}" + "".join(f"{c[name]:10.3f}" for c in columns))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
