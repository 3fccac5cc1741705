"""Prove the watch on cameras that lose or gain people: python tests/stats/prove_camera_drift.py --sites 1000.

People come in waves of an hour, not as in `claim_worlds`: a site's hour has visitors (log-normal by day and week), who
choose among what the cameras see by weights that vary by day and week; each stays a gamma-distributed time. Every
camera has its own profile of the week, and misses hours. Twelve weeks of reference, then the watch, as beside an entry
of the log: an alarm within 26 weeks in which nothing drifts is false.
"""

from __future__ import annotations

import argparse
import zlib
from dataclasses import dataclass, replace

import numpy as np
from prove_logged_changes import share as shown
from scipy.stats import chi2

from vsd_analytics.stats.camera_drift import Drift, drifts, shares

REFERENCE, WATCHED, SLOTS = 12, 26, 28
"""Weeks, and hours of the week: four parts of seven days."""
WEEKS_OF_DECADE = 522
STAY_H, STAY_CV2 = 0.25, 0.8


@dataclass(frozen=True)
class Site:
    """How a kind of site varies.

    Attributes:
        name: For tables.
        day_sd, week_sd, week_correlation: Of the log visitors of the site.
        own_day_cv, own_week_cv, own_correlation: Of the weights of each camera's floor.
        feels: Log sd with which each camera's floor feels the site's weeks.
        visitors: Of a week, all cameras together.
        season: Amplitude of a yearly wave, and weeks that floors may be apart.
        holiday: Factor on the site in two weeks of every 13, log sd with which floors feel it, in the calendar or not.
        drift: Share of people that is still found after eight weeks, and of how many cameras (the first ones).
        n_cameras: Cameras.
    """

    name: str
    day_sd: float = 0.10
    week_sd: float = 0.0
    week_correlation: float = 0.0
    own_day_cv: float = 0.06
    own_week_cv: float = 0.03
    own_correlation: float = 0.0
    feels: float = 0.0
    visitors: float = 160_000.0
    season: tuple[float, float] = (0.0, 0.0)
    holiday: tuple[float, float, bool] = (1.0, 0.0, False)
    drift: tuple[float, int] = (1.0, 0)
    n_cameras: int = 8

    def but(self, name: str, **changes: object) -> Site:
        return replace(self, name=name, **changes)


OFFICE = Site("office")
SHOP = Site("shop", day_sd=0.25, week_sd=0.10, own_day_cv=0.15, own_week_cv=0.06)
MUSEUM = Site("museum", day_sd=0.40, week_sd=0.20, week_correlation=0.2, own_day_cv=0.25, own_week_cv=0.08)


def draw(site: Site, rng: np.random.Generator, n_weeks: int, *, since: int) -> tuple[np.ndarray, np.ndarray]:
    """Return person-hours and what was recorded of one site, each (n_cameras, n_weeks, SLOTS)."""
    n, weeks = site.n_cameras, np.arange(n_weeks)
    days = np.exp(rng.normal(0, site.day_sd, (n_weeks, 7)))
    z = in_a_row(rng.normal(size=(1, n_weeks)), site.week_correlation)
    loading = np.exp(rng.normal(0, site.feels, (n, 1)))
    own = in_a_row(rng.normal(size=(n, n_weeks)), site.own_correlation)
    log_week = site.week_sd * z * loading + site.own_week_cv * own
    amplitude, apart = site.season
    phase = rng.uniform(0, 52) + rng.uniform(-apart / 2, apart / 2, (n, 1))
    log_week = log_week + np.log(1 + amplitude * np.sin(2 * np.pi * (weeks + phase) / 52))
    low, unequal, is_known = site.holiday
    is_holiday = (weeks + rng.integers(13)) % 13 < 2
    log_week = log_week + np.where(is_holiday, np.log(low) * np.exp(rng.normal(0, unequal, (n, 1))), 0.0)
    left, n_drifting = site.drift
    found = np.ones((n, n_weeks))
    found[:n_drifting] = 1 - (1 - left) * np.clip((weeks - since + 1) / 8, 0, 1)
    popular = rng.dirichlet(np.full(n, 5.0))[:, None, None, None]
    profile = np.exp(rng.normal(0, 0.3, (n, 1, 7, 4)))
    weight = (
        np.exp(log_week)[..., None, None]
        * profile
        * rng.gamma(1 / site.own_day_cv**2, site.own_day_cv**2, (n, n_weeks, 7, 1))
    )
    mean = site.visitors / 28 * popular * weight * days[:, :, None] * found[..., None, None]
    visits = rng.poisson(mean)
    people = rng.gamma(np.maximum(visits, 1) / STAY_CV2, STAY_CV2 * STAY_H) * (visits > 0)
    recorded = rng.random((n, n_weeks, 7, 4)) > 0.02
    recorded &= ~(rng.random((n, n_weeks, 1, 1)) < 0.02)  # a week down
    if is_known:
        recorded &= ~is_holiday[:, None, None]
    flat = (n, n_weeks, SLOTS)
    return people.reshape(flat), recorded.reshape(flat)


def in_a_row(z: np.ndarray, correlation: float) -> np.ndarray:
    for k in range(1, z.shape[-1]):
        z[..., k] = correlation * z[..., k - 1] + np.sqrt(1 - correlation**2) * z[..., k]
    return z


def alarms(site: Site, n_sites: int, *, watched: int) -> list[list[Drift | None]]:
    rng = np.random.default_rng(zlib.crc32(site.name.encode()))
    return [watch(*draw(site, rng, REFERENCE + watched, since=REFERENCE)) for _ in range(n_sites)]


def watch(people: np.ndarray, recorded: np.ndarray) -> list[Drift | None]:
    return drifts(shares(people, recorded, n_reference=REFERENCE), n_reference=REFERENCE)


def halves(site: Site, n_sites: int) -> tuple[int, float]:
    """Return the alarms that begin on the weekly pages of ten years, and the camera-decades.

    The watch starts again every half-year with the twelve weeks before, so neighbouring half-years share weeks.
    """
    rng = np.random.default_rng(zlib.crc32(f"ten years of {site.name}".encode()))
    begun = 0
    for _ in range(n_sites):
        people, recorded = draw(site, rng, WEEKS_OF_DECADE, since=0)
        for k in range(REFERENCE, WEEKS_OF_DECADE, WATCHED):
            weeks = slice(k - REFERENCE, k + WATCHED)
            begun += sum(one is not None for one in watch(people[:, weeks], recorded[:, weeks]))
    return begun, float(n_sites * site.n_cameras)


def a_decade(n: int, decades: float) -> str:
    """Return alarms a camera-decade with the exact 95 % interval of a Poisson count; a site's cameras are not alike."""
    lo = 0.0 if n == 0 else chi2.ppf(0.025, 2 * n) / 2
    return f"{n / decades:.2f} ({lo / decades:.2f} to {chi2.ppf(0.975, 2 * n + 2) / 2 / decades:.2f})"


def nothing() -> list[Site]:
    own = {"own_week_cv": 0.05, "own_correlation": 0.5}
    return [
        OFFICE, SHOP, MUSEUM,
        OFFICE.but("office, three cameras", n_cameras=3), OFFICE.but("office, two cameras", n_cameras=2),
        OFFICE.but("the site's weeks correlated .4, sd .10, felt with log sd .2", week_sd=0.1, week_correlation=0.4,
                   feels=0.2),
        OFFICE.but("each floor's own weeks correlated .5, sd .05", **own),
        OFFICE.but("holidays of two weeks, -50 %, felt with log sd .2, in the calendar", holiday=(0.5, 0.2, True)),
        OFFICE.but("the same, not in the calendar", holiday=(0.5, 0.2, False)),
        OFFICE.but("season of 25 %, all alike", season=(0.25, 0.0)),
        OFFICE.but("season of 25 %, up to four weeks apart", season=(0.25, 4.0)),
        OFFICE.but("season of 25 %, up to nine weeks apart", season=(0.25, 9.0)),
    ]  # fmt: skip


def drifting() -> list[Site]:
    lost = 0.85 / 0.95
    made = [site.but(f"{site.name}: {n} of 8", drift=(lost, n)) for site in (OFFICE, SHOP, MUSEUM) for n in (1, 3)]
    made += [OFFICE.but("office of 4,000 people a week at a camera: 1 of 8", drift=(lost, 1), visitors=32_000.0)]
    made += [OFFICE.but("office: 1 of 3", drift=(lost, 1), n_cameras=3)]
    return [*made, *(s.but(f"{s.name}, to .75: 1 of 8", drift=(0.75 / 0.95, 1)) for s in (OFFICE, SHOP, MUSEUM))]


def main() -> None:
    """Print the tables of docs/methods/camera-watch.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", type=int, default=1000)
    parser.add_argument("--decades", type=int, default=0, help="sites whose pages are read every week for ten years")
    asked = parser.parse_args()
    n = asked.sites
    print("| nothing drifts | sites | false alarms a camera-decade |\n|---|---|---|")
    for site in nothing():
        found = alarms(site, n, watched=WATCHED)
        begun = sum(one is not None for cameras in found for one in cameras)
        print(f"| {site.name} | {n} | {a_decade(begun, n * site.n_cameras * WATCHED / WEEKS_OF_DECADE)} |", flush=True)
    print(
        "\n| recall .95 to .85 in eight weeks | sites | the first camera, by week 8 | any that drifts |\n"
        "|---|---|---|---|"
    )
    for site in drifting():
        n_drifting = site.drift[1]
        found = [
            [one is not None and one.change < 0 for one in cameras[:n_drifting]]
            for cameras in alarms(site, n, watched=8)
        ]
        flags = np.array(found)
        print(f"| {site.name} | {n} | {shown(flags[:, 0])} | {shown(flags.any(axis=1))} |", flush=True)
    if asked.decades:
        print(
            "\n| the page's own watch, nothing drifts | camera-decades | alarms that begin, a camera-decade |\n"
            "|---|---|---|"
        )
        for site in (OFFICE, SHOP, MUSEUM):
            begun, decades = halves(site, asked.decades)
            print(f"| {site.name} | {decades:g} | {a_decade(begun, decades)} |", flush=True)


if __name__ == "__main__":
    main()
