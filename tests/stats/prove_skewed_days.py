"""Prove that levels hold where coach parties come on few days: python tests/stats/prove_skewed_days.py --weeks 1500.

A camera with 150 violations a day of its own, by weekday, times a gamma-distributed factor of the day; on a share of
the days a party of gamma-distributed size adds to them, a quarter of all violations on average. The level of the last
of six weeks, beside what is true in the long run; before is without `vsd_analytics.stats.skewed_days`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from unittest import mock

import numpy as np
from prove_logged_changes import share as shown

from vsd_analytics.stats import rates

BUSY = np.array([0.9, 0.85, 0.9, 1.0, 1.2, 1.4, 0.75])
PER_DAY, N_WEEKS, OPEN_H, COACHES = 150.0, 6, 13.0, 0.25


def week(rng: np.random.Generator, day_cv: float, party_share: float) -> tuple[np.ndarray, float]:
    """Return violations by day and the true rate per open hour."""
    n = 7 * N_WEEKS
    own = np.tile(BUSY / BUSY.mean(), N_WEEKS) * rng.gamma(1 / day_cv**2, day_cv**2, n)
    if not party_share:
        return rng.poisson(PER_DAY * own).astype(float), PER_DAY / OPEN_H
    parties = (rng.random(n) < party_share) * rng.gamma(2, 0.5, n) * COACHES / (1 - COACHES) / party_share
    return rng.poisson(PER_DAY * (own + parties)).astype(float), PER_DAY / (1 - COACHES) / OPEN_H


@contextmanager
def before() -> Iterator[None]:
    """Give levels the ends they had."""
    with mock.patch.object(rates, "upper_quantile", return_value=0.0):
        yield


def row(day_cv: float, party_share: float, n: int) -> str:
    rng, last = np.random.default_rng([int(100 * day_cv), int(100 * party_share)]), 7 * (N_WEEKS - 1)
    hours, weekday = np.full((1, 7 * N_WEEKS), OPEN_H), np.arange(7 * N_WEEKS) % 7
    held: dict[str, list[bool]] = {"before": [], "now": []}
    width: dict[str, list[float]] = {"before": [], "now": []}

    def level(name: str, counts: np.ndarray, truth: float) -> None:
        found = rates.violation_rate(
            counts[None, last:], hours[:, last:], weekday=weekday[last:], history_n=counts[None, :last],
            history_x_h=hours[:, :last], history_weekday=weekday[:last],
        )  # fmt: skip
        assert found.lo is not None
        assert found.hi is not None
        held[name].append(found.lo <= truth <= found.hi)
        width[name].append(float(np.log(found.hi / found.lo) / 2))

    for _ in range(n):
        counts, truth = week(rng, day_cv, party_share)
        level("now", counts, truth)
        with before():
            level("before", counts, truth)
    cells = [f"{shown(np.array(held[k]))}, ±{np.median(width[k]):.2f}" for k in ("before", "now")]
    days = f"{party_share:.0%} of days" if party_share else "none"
    return f"| {day_cv:g} | {days} | {n} | {cells[0]} | {cells[1]} |"


def main(print_row: Callable[[str], None] = print) -> None:
    """Print the table of docs/statistics.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weeks", type=int, default=1500)
    n = parser.parse_args().weeks
    print_row("| day sd | parties | weeks | before | now |\n|---|---|---|---|---|")
    for day_cv in (0.1, 0.25, 0.4):
        for party_share in (0.0, 0.1, 0.2, 0.3):
            print_row(row(day_cv, party_share, n))


if __name__ == "__main__":
    main()
