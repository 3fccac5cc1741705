"""Prove what is said of logged changes: python tests/stats/prove_logged_changes.py --sites 2000.

The worlds are those of `claim_worlds`, the rules those of the running verdict (`vsd_analytics.stats.logged_change`), of
the outcome "works" (`vsd_analytics.figures.change_outcome`) and of the net effect. All is computed for many sites at
once; `test_logged_changes_at_once.py` holds that the arithmetic is the product's. A verdict is read after every week:
what is counted is whether it was ever given.
"""

from __future__ import annotations

import argparse
import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from claim_worlds import MUSEUM, OFFICE, SHOP, WEEKS_BEFORE, Site, Weeks, draw
from scipy.stats import beta

from vsd_analytics.figures.change_outcome import MOSTLY_MOVED, WORKS_E, WORKS_WEEKS
from vsd_analytics.stats.logged_change import AreaWeeks, taken_up, verdict_of_weeks
from vsd_analytics.stats.net_effect import net_effect
from vsd_analytics.stats.placebos import mean_shifts, spread_half_width
from vsd_analytics.stats.running_verdict import LAST_PART, LAST_WEEKS, log_e_values

OPEN_H = 70.0
FEW = 50.0
"""Violations a week of a middle area below which some week has none."""


@dataclass(frozen=True)
class Readings:
    """What is said after each week, shape (n_sites, n_weeks) each: clear at all, a clear fall, that it works."""

    is_clear: np.ndarray
    is_fall: np.ndarray
    works: np.ndarray


def readings(drawn: Weeks) -> Readings:
    """Return the verdicts on the change of area 0, beside all others, read after every week."""
    m, v = WEEKS_BEFORE, drawn.violation_h
    rest = v[:, 1:].sum(axis=1, keepdims=True)
    y = np.log(v[:, :1]) - np.log(np.concatenate([rest, rest - v[:, 1:]], axis=1))  # beside all, and without each
    before, after = y[..., :m], y[..., m:]
    mean = before.mean(axis=-1)
    log_e = log_e_values(m, mean, ((before - mean[..., None]) ** 2).sum(axis=-1), after)
    shift = mean_shifts(before, after)
    own = mean_shifts(np.log(v[..., :m]), np.log(v[..., m:]))
    is_out = np.abs(shift[:, 0]) > spread_half_width(own[:, 0], own[:, 1:])
    is_one_way = (np.sign(shift) == np.sign(shift[:, :1])).all(axis=1)
    is_clear = (log_e >= math.log(20)).all(axis=1) & is_one_way & is_out
    is_fall = is_clear & (shift[:, 0] < 0)
    n = np.arange(1, v.shape[2] - m + 1)
    was, now = v[..., :m].mean(axis=2)[..., None], np.cumsum(v[..., m:], axis=2) / n
    ratio = (now / was)[:, 1:]
    lost = was[:, 0] * np.median(ratio, axis=1) - now[:, 0]
    others = [np.median(np.delete(ratio, k, axis=1), axis=1) for k in range(ratio.shape[1])]
    taken = np.maximum(now[:, 1:] - was[:, 1:] * np.stack(others, axis=1), 0.0)
    most = np.sort(taken, axis=1)[:, -2:].sum(axis=1)
    fell = was[:, 0] - now[:, 0]
    rest_rose = now[:, 1:].sum(axis=1) - was[:, 1:].sum(axis=1)
    is_gone = (most < MOSTLY_MOVED * lost) & (rest_rose < MOSTLY_MOVED * fell)
    is_lasting = _last_shifts(before[:, 0], after[:, 0]) <= LAST_PART * shift[:, 0]
    is_sure = (log_e[:, 0] >= math.log(WORKS_E)) & (n >= WORKS_WEEKS) & is_lasting
    works = is_fall & is_sure & is_gone & (fell > 0)
    return Readings(is_clear, is_fall, works)


def _last_shifts(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the shift of the last weeks read, after each week, shape (n_sites, n_weeks)."""
    weeks = range(1, after.shape[1] + 1)
    last = np.stack([after[:, max(0, n - LAST_WEEKS) : n].mean(axis=1) for n in weeks], axis=1)
    return last - before.mean(axis=1, keepdims=True)


def one_by_one(drawn: Weeks) -> Readings:
    """Return the same, each site by the product's own functions: for weeks without a violation, which have no log."""
    n_sites, n_weeks = len(drawn.n), drawn.n.shape[2] - WEEKS_BEFORE
    said = {name: np.zeros((n_sites, n_weeks), dtype=bool) for name in ("is_clear", "is_fall", "works")}
    hours = np.full(drawn.n.shape[1:], OPEN_H)
    for k in range(n_sites):
        made = AreaWeeks(drawn.violation_h[k], hours, drawn.n[k])
        week = np.arange(hours.shape[1])
        before = made.at(week < WEEKS_BEFORE)
        for n in range(1, n_weeks + 1):
            after = made.at((week >= WEEKS_BEFORE) & (week < WEEKS_BEFORE + n))
            found = verdict_of_weeks(before, after)
            share = taken_up(before, after, range(1, len(hours))).share
            means = [w.time_h.mean(axis=1) for w in (before, after)]
            fell, rose = means[0][0] - means[1][0], (means[1] - means[0])[1:].sum()
            is_fall = found.verdict == "clear_fall"
            said["is_clear"][k, n - 1] = found.verdict in ("clear_fall", "clear_rise")
            said["is_fall"][k, n - 1] = is_fall
            is_gone = share is not None and share < MOSTLY_MOVED and rose < MOSTLY_MOVED * fell
            is_sure = (found.e_value or 0.0) >= WORKS_E and n >= WORKS_WEEKS and found.is_lasting
            said["works"][k, n - 1] = is_fall and is_gone and is_sure and fell > 0
    return Readings(**said)


def floor_clear(drawn: Weeks, *, every: int = 1) -> np.ndarray:
    """Return whether the floor's change is clear after each week read, shape (n_sites, n_readings)."""
    m, v = WEEKS_BEFORE, drawn.violation_h
    hours = np.full(v.shape[2], OPEN_H)
    reads = range(every, v.shape[2] - m + 1, every)
    said = [[net_effect(w[:, :m], hours[:m], w[:, m : m + n], hours[:n]).verdict for n in reads] for w in v]
    return np.isin(np.array(said), ["clear_fall", "clear_rise"])


def share(flags: np.ndarray) -> str:
    """Return a share with its exact 95 % interval (Clopper and Pearson)."""
    k, n = int(flags.sum()), len(flags)
    lo = 0.0 if k == 0 else beta.ppf(0.025, k, n - k + 1)
    hi = 1.0 if k == n else beta.ppf(0.975, k + 1, n - k)
    return f"{k / n:.1%} ({lo:.1%} to {hi:.1%})"


def named(site: Site, name: str, **changes: object) -> Site:
    return site.but(name=name, **changes)


def nothing_done() -> Iterator[tuple[Site, int]]:
    """Yield the worlds in which the entry did nothing, and the weeks that are read."""
    for site in (OFFICE, SHOP, MUSEUM):
        yield named(site, f"nothing happens: {site.name}"), 8
    yield named(OFFICE, "nothing happens: office, three comparison areas", n_areas=4), 8
    yield named(OFFICE, "nothing happens: office, 15 a week", per_week=15.0), 8
    for sd in (0.1, 0.2, 0.3, 0.4):
        yield named(OFFICE, f"site -30 %, felt with log sd {sd:g}: office", whole=(0.7, sd)), 8
    yield named(SHOP, "site -30 %, felt with log sd 0.4: shop", whole=(0.7, 0.4)), 8
    yield named(OFFICE, "site -30 %, felt with log sd 0.4: three comparison areas", whole=(0.7, 0.4), n_areas=4), 8
    for weeks in (8, 26):
        yield named(OFFICE, "season of 25 %, areas up to nine weeks apart", season=(0.25, 9.0)), weeks
    for weeks, read in ((2, 8), (6, 8), (6, 12), (9, 12)):
        yield named(OFFICE, f"the area -40 % in a holiday of {weeks} weeks", holiday=(0.6, weeks)), read
    for n in (1, 3):
        name = "its own camera" if n == 1 else "three areas of eight"
        yield named(OFFICE, f"recall .95 to .85 in eight weeks: {name}", drift=((0.85 / 0.95) ** 2, n)), 8
    for part, name in ((0.5, "half of the floor"), (1.0, "all")):
        yield named(OFFICE, f"a detector that finds 10 % more people: {name}", detector=(1.21, part)), 8


def moved_on() -> Iterator[tuple[Site, int]]:
    """Yield the worlds in which all that an area lost went to others."""
    for site in (OFFICE, SHOP):
        for effect in (0.7, 0.5):
            yield named(site, f"{effect - 1:+.0%}, all into one: {site.name}", effect=effect, moves=(1.0, 1)), 8
        yield named(site, f"-50%, all into two: {site.name}", effect=0.5, moves=(1.0, 2)), 8


def worked() -> Iterator[tuple[Site, int]]:
    """Yield the worlds in which the change worked."""
    for site in (OFFICE, SHOP, MUSEUM):
        for effect in (0.8, 0.7, 0.5):
            yield named(site, f"{effect - 1:+.0%}: {site.name}", effect=effect), 8


def floors() -> Iterator[tuple[Site, int]]:
    """Yield the worlds in which the floor is read for half a year."""
    yield named(OFFICE, "weeks independent", week_cv=0.10), 26
    yield named(OFFICE, "weeks correlated .4", week_cv=0.10, week_correlation=0.4), 26
    yield named(SHOP, "weeks correlated .4, sd .20", week_cv=0.20, week_correlation=0.4), 26
    yield named(OFFICE, "season of 25 %", season=(0.25, 0.0)), 26
    yield named(OFFICE, "the whole site -30 %: office", whole=(0.7, 0.0)), 8
    yield named(SHOP, "the whole site -30 %: shop", whole=(0.7, 0.0)), 8


def drawn(site: Site, n: int, weeks: int) -> Weeks:
    return draw(site, n, weeks_after=weeks, seed=zlib.crc32(site.name.encode()))


def cleared(usual: float, n: int) -> str:
    """Return the row of an area with so many violations a week that has none from the entry on."""
    made = drawn(named(OFFICE, f"none after {usual:g} a week", per_week=usual), n, 6)
    first = {"clear": np.zeros((n, 6), bool), "hi": np.full((n, 6), np.nan)}
    hours = np.full(made.n.shape[1:], OPEN_H)
    for k in range(n):
        time_h, count = made.violation_h[k].copy(), made.n[k].copy()
        time_h[0, WEEKS_BEFORE:] = count[0, WEEKS_BEFORE:] = 0.0
        sides = [slice(None, WEEKS_BEFORE), slice(WEEKS_BEFORE, None)]
        before, after = (AreaWeeks(time_h[:, s], hours[:, s], count[:, s]) for s in sides)
        for week in range(6):
            found = verdict_of_weeks(before, after.at(np.arange(6) <= week))
            first["clear"][k, week] = found.verdict == "clear_fall"
            first["hi"][k, week] = np.nan if found.hi is None else found.hi
    weeks = [f"{first['clear'][:, w].mean():.0%}" for w in range(6)]
    ends = [f"{np.nanmedian(first['hi'][:, w]):.1%}" for w in (0, 5)]
    return f"| {usual:g} | {n} | {' '.join(weeks)} | {' to '.join(ends)} |"


def main() -> None:
    """Print the tables of docs/methods/logged-changes.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", type=int, default=2000)
    n = parser.parse_args().sites
    for title, worlds in (("nothing was done", nothing_done()), ("moved", moved_on()), ("it works", worked())):
        print(f"\n| {title} | weeks | sites | clear | works |\n|---|---|---|---|---|")
        for site, weeks in worlds:
            is_few = site.per_week < FEW
            n_sites = n // 4 if is_few else n
            made = drawn(site, n_sites, weeks)
            found = one_by_one(made) if is_few else readings(made)
            cells = [share(flags.any(axis=1)) for flags in (found.is_clear, found.works)]
            print(f"| {site.name} | {weeks} | {n_sites} | {' | '.join(cells)} |", flush=True)
    print("\n| floor | weeks | sites | clear |\n|---|---|---|---|")
    for site, weeks in floors():
        print(f"| {site.name} | {weeks} | {n} | {share(floor_clear(drawn(site, n, weeks)).any(axis=1))} |", flush=True)
    print("\n| violations a week before, none after | sites | clear fall after 1 to 6 weeks | median upper end |")
    print("|---|---|---|---|")
    for usual in (470.0, 15.0, 5.0):
        print(cleared(usual, min(n, 1000)), flush=True)


if __name__ == "__main__":
    main()
