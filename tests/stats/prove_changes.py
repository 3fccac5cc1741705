"""Prove what is claimed of logged changes, on drawn sites: python tests/stats/prove_changes.py --sites 1000.

The worlds are those of `change_worlds`; the statistics are those of `vsd compare --change` and `vsd plan`: before and
after on person-time in violation per open hour (or per person-hour), running verdict, net effect, and plans.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from change_worlds import MUSEUM, OFFICE, SHOP, Drawn, World, draw

from vsd_analytics.stats.before_after import BeforeAfter, before_after
from vsd_analytics.stats.comparison_weights import weekly_log_ratios
from vsd_analytics.stats.experiment import variation_of, weeks_needed
from vsd_analytics.stats.net_effect import NetEffect, net_effect
from vsd_analytics.stats.running_verdict import log_e_values, running_verdict

LOG_E = math.log(20)
REFERENCE = 12
HALF_YEAR = 26

Line = tuple[str, str, int, str, str, str]
"""Claim, world, runs, promised, before (of the earlier method, None measured: a dash), after."""


def effects(drawn: Drawn, *, weeks: int = 4, per: str = "open") -> list[BeforeAfter]:
    """Return before and after with equally many weeks on both sides, and all weeks before as history."""
    cut = drawn.world.weeks_before
    return [
        before_after(
            drawn.period(k, cut - weeks, cut, per=per),
            drawn.period(k, cut, cut + weeks, per=per),
            history=drawn.period(k, 0, cut, per=per),
        )
        for k in range(len(drawn.n))
    ]


def log_e(drawn: Drawn) -> np.ndarray:
    """Return the running verdict's ln e of each site after each week, negative where the change is a rise."""
    world = drawn.world
    weeks = drawn.violation_h.reshape(*drawn.violation_h.shape[:2], -1, 7).sum(axis=3)
    y = np.log(weeks[:, 0]) - np.log(weeks[:, 1:].sum(axis=1))
    before, after = y[:, : world.weeks_before][:, -REFERENCE:], y[:, world.weeks_before :]
    mean = before.mean(axis=1)
    return log_e_values(REFERENCE, mean, ((before - mean[:, None]) ** 2).sum(axis=1), after)


def floor(drawn: Drawn) -> list[NetEffect]:
    """Return the net effect on each site's floor, by area."""
    cut = drawn.world.weeks_before
    weeks = drawn.violation_h.reshape(*drawn.violation_h.shape[:2], -1, 7).sum(axis=3)
    open_h = np.full(weeks.shape[2], 70.0)
    return [net_effect(w[:, :cut], open_h[:cut], w[:, cut:], open_h[cut:]) for w in weeks]


def covers(world: World, n: int, *, before: str = "–", per: str = "open") -> Line:
    """Return how often the interval of before and after holds the truth."""
    found = effects(draw(world, n, 1), per=per)
    holds = np.mean([e.lo <= world.effect <= e.hi for e in found])
    clear = np.mean([e.verdict == "clear_fall" for e in found])
    claim = "before/after covers" if per == "open" else "before/after covers, share of person-time"
    return claim, world.name, n, "93 % or more", before, f"{holds:.1%} (clear fall {clear:.1%})"


def says_clear(world: World, n: int, *, before: str) -> Line:
    """Return how often before and after says clear fall or clear rise where nobody did anything."""
    found = effects(draw(world, n, 2))
    clear = np.mean([e.verdict in ("clear_fall", "clear_rise") for e in found])
    alone = np.mean([max(e.day_hi, e.placebo_hi) < 1 for e in found])
    return "before/after clear", world.name, n, "7 % or less", before, f"{clear:.1%} (without the line {alone:.1%})"


def read_again(world: World, n: int, *, before: str) -> Line:
    """Return how often before and after is ever clear when it is read after 1, 2, 3 and 4 weeks."""
    drawn = draw(world, n, 3)
    clear = [[e.verdict in ("clear_fall", "clear_rise") for e in effects(drawn, weeks=w)] for w in (1, 2, 3, 4)]
    return "before/after, read 4 times", world.name, n, "5 % or less", before, f"{np.any(clear, axis=0).mean():.1%}"


def read_half_a_year(world: World, n: int, *, before: str) -> Line:
    """Return how often the running verdict is ever clear in 26 weeks in which nothing changed."""
    ever = np.mean(log_e(draw(world.but(weeks_after=HALF_YEAR), n, 4)).max(axis=1) >= LOG_E)
    return "running verdict, read 26 times", world.name, n, "5 % or less", before, f"{ever:.1%}"


def drifts(world: World, n: int) -> Line:
    """Return how often the running verdict takes a trend for a change, and how often the page then names a trend.

    It does where the weeks before had a slope that shows, or could have had one that explains the effect unseen.
    """
    drawn = draw(world.but(weeks_after=8), n, 5)
    is_clear = log_e(drawn).max(axis=1) >= LOG_E
    named = [_names_a_trend(e, weeks=4) for e, clear in zip(effects(drawn), is_clear, strict=True) if clear]
    found = f"{is_clear.mean():.1%}; a trend named in {np.mean(named):.0%} of them"
    return "running verdict, 8 weeks", world.name, n, "named as a doubt", "–", found


def _names_a_trend(effect: BeforeAfter, *, weeks: int) -> bool:
    """Return whether doubts or cautions of the page name a slope (`change_effect.unseen_trend`)."""
    trend = effect.trend
    if trend is None or effect.value is None:
        return False
    unseen = trend.detectable_per_week
    return not trend.is_flat or (unseen is not None and abs(np.log(effect.value)) < weeks * np.log1p(unseen))


def power(world: World, n: int) -> Line:
    """Return how often the running verdict is clear by the fourth and the eighth week."""
    found = np.maximum.accumulate(log_e(draw(world.but(weeks_after=8, effect=0.7), n, 6)) >= LOG_E, axis=1).mean(axis=0)
    promised = "80 % or more by week 8" if world.name == "museum" else "–"
    return "running verdict, -30 %", world.name, n, promised, "–", f"{found[3]:.1%} by week 4, {found[7]:.1%} by week 8"


def power_once(world: World, n: int) -> Line:
    """Return how often before and after over four weeks on either side is clear."""
    found = [e.verdict == "clear_fall" for e in effects(draw(world.but(effect=0.7), n, 7))]
    return "before/after, 4 + 4 weeks, -30 %", world.name, n, "–", "–", f"{np.mean(found):.1%}"


def spills(world: World, n: int) -> Iterator[Line]:
    """Return whether the net effect on the floor is covered, and what is said of the area."""
    drawn = draw(world, n, 8)
    found, area = floor(drawn), effects(drawn)
    holds = np.mean([f.lo <= net <= f.hi for f, net in zip(found, drawn.net, strict=True)])
    yield "net effect covers", world.name, n, "93 % or more", "–", f"{holds:.1%}"
    fall = np.array([e.verdict == "clear_fall" for e in area])
    floor_fell = np.array([f.verdict == "clear_fall" for f in found])
    moved = np.array([(f.moved_elsewhere(0) or 0.0) >= 0.5 for f in found])
    if world.spill[0] == 1.0:
        said = f"area {fall.mean():.1%}; floor {floor_fell.mean():.1%}; said that it moved {moved[fall].mean():.1%}"
        yield "clear fall", world.name, n, "floor 5 % or less", "area: yes; floor: not asked", said


def plant_pot(world: World, n: int) -> Line:
    """Return how often anything is claimed of an entry that did nothing while the whole site fell by 30 %."""
    drawn = draw(world.but(weeks_after=8), n, 9)
    area = [e.verdict in ("clear_fall", "clear_rise") for e in effects(drawn)]
    ever = log_e(drawn).max(axis=1) >= LOG_E
    said = f"before/after {np.mean(area):.1%}, running verdict {np.mean(ever):.1%}"
    return "plant pot watered, site -30 %", world.name, n, "5 % or less", "yes, in the headline", said


def rows(n: int) -> list[Callable[[], Line | Iterator[Line]]]:
    """Return the rows of the table."""
    plain, quiet = World("own weeks 0"), World("quiet", day_sd=0.10, own_day_sd=0.05)
    some, much = (plain.but(name=f"own weeks {sd:g}", own_week_sd=sd) for sd in (0.05, 0.10))
    shared = much.but(name="own weeks 0.1, shared weeks .10, loadings .4", week_sd=0.10, loading_sd=0.4)
    few = much.but(name="own weeks 0.1, three comparison areas", n_areas=4)
    two = plain.but(name="-70 %, all of it into two areas", effect=0.3, spill=(1.0, 2), weeks_after=8)
    six = plain.but(name="-70 %, half of it into six areas", effect=0.3, spill=(0.5, 6), weeks_after=8)
    pot = SHOP.but(name="shop", season=0.7)
    return [
        partial(covers, some, n, before="92 %"),
        partial(covers, much, n, before="81 %"),
        partial(covers, much, n, per="people"),
        partial(covers, shared, n),
        partial(covers, few, n),
        partial(covers, MUSEUM, n),
        partial(covers, MUSEUM.but(name="museum, -30 %", effect=0.7), n),
        partial(says_clear, plain.but(name="trend -2 % a week", trend=-0.02), n, before="23 %"),
        partial(says_clear, quiet.but(name="trend -2 % a week, quiet days", trend=-0.02), n, before="–"),
        partial(read_again, plain, n, before="12.7 %"),
        partial(read_again, much, n, before="40.1 %"),
        partial(read_half_a_year, plain, n, before="12.7 % (4 readings)"),
        partial(read_half_a_year, some, n, before="20.7 % (4 readings)"),
        partial(read_half_a_year, much, n, before="40.1 % (4 readings)"),
        partial(read_half_a_year, shared, n, before="–"),
        partial(read_half_a_year, MUSEUM, n, before="–"),
        partial(drifts, plain.but(name="trend -2 % a week", trend=-0.02), n),
        partial(power, OFFICE, n),
        partial(power, SHOP, n),
        partial(power, MUSEUM, n),
        partial(power_once, OFFICE, n),
        partial(power_once, SHOP, n),
        partial(power_once, MUSEUM, n),
        partial(spills, two, n),
        partial(spills, six, n),
        partial(
            spills, MUSEUM.but(name="museum, all of it into two areas", effect=0.3, spill=(1.0, 2), weeks_after=8), n
        ),
        partial(plant_pot, pot, n),
    ]


def planned(world: World, effect: float, n: int) -> str:
    """Return the row of a plan: its weeks, the power it promised and the share of sites that saw the effect by then."""
    drawn = draw(world.but(weeks_after=HALF_YEAR, effect=effect), n, 10)
    weeks, promised, came = [], [], []
    for k in range(n):
        history = drawn.period(k, 0, world.weeks_before)
        variation = variation_of(history, None)
        assert variation is not None
        plan = weeks_needed(variation, effect, weeks_max=HALF_YEAR)
        last = plan.weeks_after or HALF_YEAR
        _, y = weekly_log_ratios(drawn.period(k, world.weeks_before, world.weeks_before + last))
        found = running_verdict(variation.log_ratios, y)
        weeks.append(plan.weeks_after or HALF_YEAR + 1)
        promised.append(plan.power)
        came.append(found.clear_since is not None)
    low, middle, high = ("over 26" if w > HALF_YEAR else f"{w:.0f}" for w in np.quantile(weeks, [0.1, 0.5, 0.9]))
    cells = [world.name, f"{effect - 1:+.0%}", str(n), f"{middle} ({low} to {high})"]
    return f"| {' | '.join([*cells, f'{np.mean(promised):.1%}', f'{np.mean(came):.1%}'])} |"


def printed(make: Callable[[], Line | Iterator[Line]]) -> str:
    """Return the lines of one row of the table."""
    found = make()
    lines = [found] if isinstance(found, tuple) else list(found)
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sites", type=int, default=1000)
    n = parser.parse_args().sites
    print("| what | world | sites | promised | before | after |\n|---|---|---|---|---|---|")
    with ProcessPoolExecutor(2) as pool:
        for line in pool.map(printed, rows(n)):
            print(line, flush=True)
        print("\n| site | effect | sites | weeks planned (80 % of sites) | power promised | power found |")
        print("|---|---|---|---|---|---|")
        jobs = [partial(planned, w, effect, 4 * n // 5) for w in (OFFICE, SHOP, MUSEUM) for effect in (0.85, 0.7, 0.5)]
        for row in pool.map(_call, jobs):
            print(row, flush=True)


def _call(job: Callable[[], str]) -> str:
    return job()


if __name__ == "__main__":
    main()
