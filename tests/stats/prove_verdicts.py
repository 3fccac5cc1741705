"""Draws sites in which nothing, or something known, changes, and prints how often verdicts and levels are right.

Run `python tests/stats/prove_verdicts.py`; the table is in docs/methods/verdicts.md. The worlds are those of
`day_worlds`. Unless a row says otherwise a site has twelve weeks of history. "Before" is what the method of May 2026
did, which knew days and no weeks, in the measurements that asked for this one; a dash where none was made.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from day_worlds import AREAS, FLOORS, LEVELS, MUSEUM, OFFICE, WEEKDAYS_OFFICE, Drawn, Variation, World, step

from vsd_analytics.stats.changes import compare_encounter_rates, compare_violation_rates
from vsd_analytics.stats.estimates import ChangeEstimate
from vsd_analytics.stats.false_alarms import false_alarm_rate
from vsd_analytics.stats.family import judge_family
from vsd_analytics.stats.rates import violation_rate

CLEAR = {"clear_fall", "clear_rise"}
HISTORY = 12
YEAR = 52


@dataclass(frozen=True)
class Row:
    """One line of the table: shares in percent, or numbers a year."""

    world: str
    promised: str
    before: str
    after: str


def per_open_h(
    drawn: Drawn, site: int, week: int, *, history: int = HISTORY, place: int | None = None
) -> ChangeEstimate:
    """Return the change of M0 from the week before to `week`, of one place or the floor (as one camera)."""
    n = drawn.floor_n[site] if place is None else drawn.n[site, :, place]
    x = np.broadcast_to(drawn.x_h[0], n.shape)
    past = slice(max(0, week - 1 - history), week - 1)
    return compare_violation_rates(
        n[week - 1], x[0], n[week], x[0], history_n=n[past, None], history_x_h=x[past, None]
    )  # fmt: skip


def encounter_rate(
    drawn: Drawn, site: int, week: int, *, history: int = HISTORY, place: int | None = None
) -> ChangeEstimate:
    """Return the change of violations per person-hour, likewise."""
    n = drawn.floor_n[site] if place is None else drawn.n[site, :, place]
    people = drawn.floor_person_h[site] if place is None else drawn.person_h[site, :, place]
    past = slice(max(0, week - 1 - history), week - 1)
    return compare_encounter_rates(
        n[week - 1], people[week - 1], n[week], people[week],
        history_n=n[past], history_exposure_h=people[past], min_exposure_h=0.0,
    )  # fmt: skip


def share(found: list[bool]) -> str:
    """Write a share of runs in percent."""
    return f"{100 * float(np.mean(found)):.1f} %"


def verdicts(
    world: World, runs: int, *, seed: int, history: int = HISTORY, figure: Callable[..., ChangeEstimate] = per_open_h,
    effect: float = 1.0, step_before: float = 1.0,
) -> list[ChangeEstimate]:  # fmt: skip
    """Return the change of the last week of `runs` sites; `step_before` changes something six weeks earlier."""
    weeks = history + 2
    factor = step(weeks, at=weeks - 1, ratio=effect) * step(weeks, at=max(weeks - 7, 0), ratio=step_before)
    drawn = world.draw(np.random.default_rng(seed), sites=runs, weeks=weeks, effect=factor)
    return [figure(drawn, site, weeks - 1, history=history) for site in range(runs)]


def clear(found: list[ChangeEstimate]) -> str:
    """Write the share of clear verdicts."""
    return share([change.verdict in CLEAR for change in found])


def null_rows(runs: int, seed: int) -> Iterator[Row]:
    """Yield rows 1 to 3: nothing changes."""
    before = {"independent days": "3.4 %", "days correlated .4": "10.8 %", "week sd .05": "12.7 %"}
    before |= {"days correlated .3, week sd .10": "35.9 %", "museum": "22.6 %"}
    for name, world in FLOORS.items():
        after = clear(verdicts(world, runs, seed=seed))
        yield Row(f"M0, clear verdict, nothing changes: {name}", "at most 6 %", before.get(name, "-"), after)
    for name in ("office", "museum"):
        after = clear(verdicts(FLOORS[name], runs, seed=seed, figure=encounter_rate))
        yield Row(f"M7, the same: {name}", "at most 6 %", {"museum": "15.9 %"}.get(name, "-"), after)
    for history in (0, 2, 4, 8):
        for name in ("office", "days correlated .3, week sd .10", "museum"):
            after = clear(verdicts(FLOORS[name], runs, seed=seed, history=history))
            yield Row(f"M0, the same with {history} weeks of history: {name}", "at most 6 %", "-", after)


def power_rows(runs: int, seed: int) -> Iterator[Row]:
    """Yield the price: how often a true fall is called one."""
    for name, promised in (("office", "at least 85 %"), ("museum", "-")):
        for history in (HISTORY, 8, 4, 2, 0):
            after = clear(verdicts(FLOORS[name], runs, seed=seed, history=history, effect=0.7))
            known = promised if history == HISTORY else "-"
            yield Row(f"power for -30 % in one week, {history} weeks of history: {name}", known, "-", after)
    calm = World(Variation(day_sd=0.05))
    for history in (8, 4, 0):
        after = clear(verdicts(calm, runs, seed=seed, history=history, effect=0.86))
        yield Row(f"power for -14 % in one week, {history} weeks of history: shop, day sd .05", "-", "-", after)
    after = clear(verdicts(FLOORS["office"], runs, seed=seed, effect=0.7, step_before=0.6))
    yield Row("power for -30 %, another change of -40 % six weeks before: office", "-", "-", after)


def word_rows(runs: int, seed: int) -> Iterator[Row]:
    """Yield row 17: what a true change of 20 % or more is called, and what no change is."""
    for name in ("office", "museum"):
        found = [
            change.verdict == "about_same"
            for k, effect in enumerate((0.8, 1.25))
            for change in verdicts(FLOORS[name], runs // 2, seed=seed + k, effect=effect)
        ]
        yield Row(f'"about the same" when it changed by 20 % or more: {name}', "at most 5 %", "-", share(found))
        same = [change.verdict == "about_same" for change in verdicts(FLOORS[name], runs, seed=seed)]
        yield Row(f'"about the same" when nothing changes: {name}', "-", "-", share(same))


def held(world: World, runs: int, *, seed: int) -> list[bool]:
    """Return for each of `runs` sites whether the interval of a level holds the mean that days come from."""
    drawn = world.draw(np.random.default_rng(seed), sites=runs, weeks=6)
    x, days = drawn.x_h, np.arange(world.n_days)
    truth, found = float(drawn.expected[0, 0].sum() / x.sum()), []
    for n in drawn.n:
        past = n[:5].transpose(1, 0, 2).reshape(1, -1)
        level = violation_rate(
            n[5], x, weekday=days, history_n=past, history_x_h=np.tile(x, 5), history_weekday=np.tile(days, 5)
        )
        found.append(level.lo is not None and level.hi is not None and level.lo <= truth <= level.hi)
    return found


def level_rows(runs: int, seed: int) -> Iterator[Row]:
    """Yield row 5: how often the interval of a level holds the truth."""
    before = {"0.15": "91 %", "0.3": "88 %", "0.6": "72 %"}
    for name, world in LEVELS.items():
        promised = "at least 88 %" if world.variation.correlation > 0.3 else "93 to 98 %"
        key = f"{world.variation.correlation:g}"
        after = share(held(world, runs, seed=seed))
        yield Row(f"level of M0 holds the truth: {name}", promised, before.get(key, "-"), after)
    for name in ("office", "week sd .05", "days correlated .3, week sd .10", "museum"):
        yield Row(
            f"level of M0 holds the mean of many weeks: {name}", "-", "-", share(held(FLOORS[name], runs, seed=seed))
        )


def timed(drawn: Drawn, *, seed: int) -> Drawn:
    """Return person-seconds too close instead of violations: of two people, each violation of its own length.

    Lengths are exponential with a mean of 20 s, so that time too close differs more between days than violations do.
    """
    rng = np.random.default_rng([seed, 6])
    return replace(drawn, n=np.where(drawn.n > 0, 40 * rng.gamma(np.maximum(drawn.n, 1e-12)), 0.0))


def family(drawn: Drawn, close: Drawn, site: int, week: int) -> tuple[list[str], list[str], list[str]]:
    """Return the verdicts of the floor and of its areas on how often and time too close (M6), and of areas on M7."""
    places = range(drawn.n.shape[2])
    figures = [
        (figure(of, site, week), [figure(of, site, week, place=place) for place in places])
        for figure, of in ((per_open_h, drawn), (encounter_rate, close), (encounter_rate, drawn))
    ]
    judged, beside = judge_family(figures[:2]), judge_family(figures[2:])
    floor = [change.verdict for change, _ in figures[:2]]
    return floor, *([area.verdict for areas in of for area in areas] for of in (judged, beside))  # type: ignore[return-value]


def family_rows(runs: int, seed: int) -> Iterator[Row]:
    """Yield row 4: false verdicts a year of the floor and eight areas, and the power an area has."""
    for name, promised, before in (("office", "at most 3", "33"), ("museum", "at most 6", "128")):
        world = replace(FLOORS[name], shares=AREAS)
        drawn = world.draw(np.random.default_rng(seed), sites=runs, weeks=HISTORY + 2)
        close = timed(drawn, seed=seed)
        judged = [family(drawn, close, site, HISTORY + 1) for site in range(runs)]
        floor, areas, beside = (YEAR * sum(v in CLEAR for one in judged for v in one[k]) / runs for k in (0, 1, 2))
        after = f"{floor + areas:.1f} (floor {floor:.1f}, areas {areas:.1f})"
        yield Row(f"false verdicts a year, 9 places x 2 figures (M0, M6): {name}", promised, before, after)
        yield Row(f"the same of M7, areas only, a family of its own: {name}", "-", "-", f"{beside:.1f}")
    office = replace(FLOORS["office"], shares=AREAS)
    effect = np.ones((HISTORY + 2, len(AREAS), 1))
    effect[-1, 0] = 0.5
    for what, factor in (
        ("the largest area alone falls by half", effect),
        ("all areas fall by 30 %", step(HISTORY + 2, at=HISTORY + 1, ratio=0.7)),
    ):
        drawn = office.draw(np.random.default_rng(seed), sites=runs // 2, weeks=HISTORY + 2, effect=factor)
        close = timed(drawn, seed=seed)
        judged = [family(drawn, close, site, HISTORY + 1)[1] for site in range(runs // 2)]
        for figure, at in (("M0", 0), ("M6", len(AREAS))):
            found = [one[at] == "clear_fall" for one in judged]
            yield Row(f"power for the largest area, {figure}, {what}: office", "-", "-", share(found))


def few_days_rows(runs: int, seed: int) -> Iterator[Row]:
    """Yield sites open three or four days a week."""
    for n_days in (3, 4):
        for name, variation in (("office", OFFICE), ("museum", MUSEUM)):
            world = World(variation, weekdays=WEEKDAYS_OFFICE[:n_days])
            null = clear(verdicts(world, runs, seed=seed))
            fall = clear(verdicts(world, runs, seed=seed, effect=0.7))
            what = f"open {n_days} days a week: {name}"
            yield Row(f"M0, clear verdict, nothing changes, {what}", "at most 6 %", "no verdict", null)
            yield Row(f"power for -30 %, {what}", "-", "no verdict", fall)


def own_rate_rows(runs: int, seed: int) -> Iterator[Row]:
    """Yield what sites find about themselves: the share of false alarms of 26 weeks shuffled."""
    for name, variation in (("office", OFFICE), ("museum", MUSEUM), ("week sd .10", Variation(0.10, week_sd=0.10))):
        drawn = World(variation).draw(np.random.default_rng(seed), sites=runs // 50, weeks=26)
        x = np.broadcast_to(drawn.x_h, drawn.n.shape[1:])
        found = [false_alarm_rate(n, x) for n in drawn.n]
        mean = float(np.mean([f.value for f in found if f is not None]))
        yield Row(f"false alarms a site finds in 26 weeks of its own: {name}", "-", "-", f"{100 * mean:.1f} %")


TABLES = (null_rows, power_rows, word_rows, level_rows, family_rows, few_days_rows, own_rate_rows)


def main() -> None:
    """Print the table of docs/methods/verdicts.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000, help="sites drawn per row")
    parser.add_argument("--seed", type=int, default=20261109)
    arguments = parser.parse_args()
    started = time.process_time()
    print("| world | runs | promised | before | after |\n|---|---|---|---|---|")
    for rows in TABLES:
        for row in rows(arguments.runs, arguments.seed):
            cells = (row.world, f"{arguments.runs:,}", row.promised, row.before, row.after)
            print(f"| {' | '.join(cells)} |", flush=True)
    print(f"\n{time.process_time() - started:.0f} s of processor time")


if __name__ == "__main__":
    main()
