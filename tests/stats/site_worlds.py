"""Sites with days, weeks, sizes, opening hours and crowding of their own, a few of which really differ.

Person-time too close is person-time times a rate that rises with crowding (elasticity .33 on average, as ATC's hours
have it, with a log sd of .05 between sites) times shocks of the site's day and week, which sites have to different
degrees, from an office's to a museum's. A site may have a constant of its own (`own_sd`) that is no difference a
reader should act on. One site loses the camera over its queue in most weeks, another in three of ten.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta

import numpy as np
import numpy.typing as npt
from report import sample_weeks

from vsd_analytics.figures.close_by_crowding import EDGES
from vsd_analytics.figures.week.results import CloseByCrowding, CloseInClasses, CloseInDays, SiteRef, WeekRef
from vsd_analytics.site_index.floor_weeks import FloorKey, FloorWeeks
from vsd_analytics.site_index.read_reports import Entry, IndexedReport, IndexedStory, Levels, Recorded, RecordedCamera

LAST = date(2026, 11, 9)
N_CLASSES = len(EDGES) + 1
ELASTICITY, ELASTICITY_SD = 0.33, 0.05
COMMON_RATE, COMMON_CROWDING = 0.25, 4.0
LAG = 0.14
QUEUE_PEOPLE, QUEUE_RATE = 0.2, 2.2
"""Share of a site's people whom the camera over the queue counts, and their rate over the site's."""


@dataclass(frozen=True)
class SiteWorld:
    """What is drawn.

    Attributes:
        n_sites: Sites.
        effects: Factors of the first sites; the others have 1.
        own_sd: Log sd of what sites that do not differ have of their own.
        has_gaps: The last two sites lose a camera, in seven and in three of their ten weeks.
        crowding_sd: Log sd of crowding between sites.
        day_sd, week_sd: Least and greatest log sd of a site's days and weeks.
        n_weeks: Least and greatest number of weeks of a site.
    """

    n_sites: int = 40
    effects: tuple[float, ...] = (1.5, 1.5, 1 / 1.5, 1 / 1.5)
    own_sd: float = 0.05
    has_gaps: bool = True
    crowding_sd: float = 0.6
    day_sd: tuple[float, float] = (0.1, 0.4)
    week_sd: tuple[float, float] = (0.0, 0.22)
    n_weeks: tuple[int, int] = (4, 10)


def site_floors(
    world: SiteWorld, rng: np.random.Generator, *, says_gaps: bool = True
) -> tuple[list[FloorWeeks], npt.NDArray[np.float64]]:
    """Return the sites as the index reads them from JSON files, and the true log ratio of each.

    Args:
        world: What is drawn.
        rng: Where from.
        says_gaps: False: files do not tell which cameras were silent, as if nobody looked.
    """
    floors, truth = [], np.zeros(world.n_sites)
    for k in range(world.n_sites):
        effect = world.effects[k] if k < len(world.effects) else 1.0
        dead = {world.n_sites - 1: 7, world.n_sites - 2: 3}.get(k, 0) if world.has_gaps else 0
        floor, truth[k] = _floor(k, world, rng, effect=effect, n_dead=dead, says_gaps=says_gaps)
        floors.append(floor)
    return floors, truth


def raw_rates(floors: list[FloorWeeks]) -> npt.NDArray[np.float64]:
    """Return the share of person-time too close of each site, as a league table would rank it."""
    rates = []
    for floor in floors:
        found = [e.report.close_by_crowding for e in floor.weeks.values() if e.report is not None]
        days = [d for f in found if f is not None for d in f.days]
        rates.append(sum(d.close_h for d in days) / sum(sum(d.person_h) for d in days))
    return np.array(rates)


def _floor(
    k: int, world: SiteWorld, rng: np.random.Generator, *, effect: float, n_dead: int, says_gaps: bool
) -> tuple[FloorWeeks, float]:
    n_weeks = 10 if n_dead else int(rng.integers(world.n_weeks[0], world.n_weeks[1] + 1))
    n_days, n_hours = int(rng.integers(5, 8)), int(rng.integers(7, 15))
    shape = (n_weeks, n_days, n_hours)
    area_100m2 = 3 * np.exp(rng.normal(0, 0.7))
    profile = np.exp(0.5 * np.sin(np.linspace(0, 2 * np.pi, n_hours)) + rng.normal(0, 0.2, n_hours))
    crowding = COMMON_CROWDING * np.exp(rng.normal(0, world.crowding_sd)) * profile
    crowding = crowding * np.exp(rng.normal(0, 0.2, (n_weeks, n_days, 1)) + rng.normal(0, 0.2, shape))
    people_h = crowding * area_100m2 / 1.3
    elasticity = rng.normal(ELASTICITY, ELASTICITY_SD)
    common = COMMON_RATE * (crowding / COMMON_CROWDING) ** ELASTICITY
    log_rate = elasticity * np.log(crowding / COMMON_CROWDING) + rng.normal(0, world.own_sd) + np.log(effect)
    truth = np.log((people_h * COMMON_RATE * np.exp(log_rate)).sum() / (people_h * common).sum())
    for sd, shocks in (
        (rng.uniform(*world.week_sd), rng.standard_normal((n_weeks, 1, 1))),
        (rng.uniform(*world.day_sd), _days(rng, n_weeks * n_days).reshape(n_weeks, n_days, 1)),
    ):
        log_rate = log_rate + sd * shocks - sd**2 / 2  # restless sites are no other sites on average
    rate = COMMON_RATE * np.exp(log_rate) * rng.gamma(20, 1 / 20, shape)
    close_h = people_h * np.minimum(rate, 0.95)
    of_class = np.searchsorted(EDGES, crowding, side="right")
    weeks = {}
    for w in range(n_weeks):
        is_dead = w < n_dead
        seen, close = (1 - QUEUE_PEOPLE, 1 - QUEUE_PEOPLE * QUEUE_RATE) if is_dead else (1.0, 1.0)
        found = _close_by_crowding(_monday(n_weeks, w), of_class[w], people_h[w] * seen, close_h[w] * close)
        shares = (1.0, 1.0, 0.0 if is_dead and says_gaps else 1.0)
        weeks[_monday(n_weeks, w)] = _entry(k, _monday(n_weeks, w), found, shares, n_days * n_hours)
    key = FloorKey(f"site-{k:02d}", f"site-{k:02d}", "ground")
    return FloorWeeks(key=key, site_name=f"Site {k + 1}", name="Ground floor", rank=0, weeks=weeks), float(truth)


def _monday(n_weeks: int, w: int) -> date:
    return LAST - timedelta(weeks=n_weeks - 1 - w)


def _days(rng: np.random.Generator, n: int) -> npt.NDArray[np.float64]:
    """Return an AR(1) series with variance 1."""
    shocks = rng.standard_normal(n)
    for i in range(1, n):
        shocks[i] = LAG * shocks[i - 1] + np.sqrt(1 - LAG**2) * shocks[i]
    return shocks


def _close_by_crowding(
    monday: date,
    of_class: npt.NDArray[np.int64],
    people_h: npt.NDArray[np.float64],
    close_h: npt.NDArray[np.float64],
) -> CloseByCrowding:
    person = np.array([np.bincount(c, weights=x, minlength=N_CLASSES) for c, x in zip(of_class, people_h, strict=True)])
    by_class = np.bincount(of_class.ravel(), weights=close_h.ravel(), minlength=N_CLASSES)
    days = [monday + timedelta(days=d) for d in range(len(person))]
    return CloseByCrowding(
        edges=EDGES,
        days=tuple(
            CloseInDays(first=day, last=day, close_h=float(close), person_h=tuple(x.tolist()))
            for day, close, x in zip(days, close_h.sum(axis=1), person, strict=True)
        ),
        classes=tuple(
            CloseInClasses(first=int(k), last=int(k), close_h=float(by_class[k]))
            for k in np.flatnonzero(person.any(axis=0))
        ),
    )


_PLAIN = sample_weeks.normal()


def _entry(k: int, monday: date, found: CloseByCrowding, shares: tuple[float, ...], open_h: float) -> Entry:
    site_id = f"site-{k:02d}"
    report = IndexedReport(
        schema=_PLAIN.schema,
        site=SiteRef(site_id=site_id, name=f"Site {k + 1}", floor_id="ground", floor_name="Ground floor"),
        week=WeekRef.of(monday, zone="Europe/Rome"),
        generated_at=datetime(2026, 11, 16, tzinfo=UTC),
        provenance=_PLAIN.provenance,
        rules=_PLAIN.rules,
        state="normal",
        coverage=Recorded(
            share=float(np.mean(shares)),
            cameras=tuple(RecordedCamera(share=s, scheduled_h=open_h, recorded_h=s * open_h) for s in shares),
        ),
        level=Levels(violation_rate=_PLAIN.level.violation_rate, encounter_rate=_PLAIN.level.encounter_rate),
        story=IndexedStory(headline="A week"),
        close_by_crowding=found,
    )
    return Entry(project=site_id, stem=report.week.iso, report=report, links={"report": f"{site_id}.html"})
