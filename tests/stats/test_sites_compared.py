"""The comparison of sites: what crowding explains is no difference, and what it does not is found."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm
from stats.site_worlds import LAST, SiteWorld, site_floors

from vsd_analytics.site_index.site_comparison import compare_sites
from vsd_analytics.stats.funnel import BETA, CUT, ERROR, funnel, usual
from vsd_analytics.stats.standard_ratio import SiteTime, class_rates, known_shares, standard_ratios

RATES = np.array([0.1, 0.2, 0.3, 0.45])


def site(person_h: list[float], ratio: float, *, is_wide: bool = False) -> SiteTime:
    """Return ten alike days of a site whose rates are exactly `ratio` times `RATES`."""
    x = np.array(person_h)
    close = RATES * ratio * x
    groups = [(0, 0), (1, 2), (3, 3)] if is_wide else [(k, k) for k in range(4)]
    return SiteTime(
        close_h=np.full(10, close.sum()),
        person_h=np.tile(x, (10, 1)),
        week=np.arange(10) // 5,
        classes=np.array(groups),
        class_close_h=10 * np.array([close[a : b + 1].sum() for a, b in groups]),
    )


def test_sites_that_differ_in_crowding_only_have_one_ratio_however_their_classes_are_grouped() -> None:
    empty, middle, crowded = [90, 20, 5, 0], [20, 40, 40, 20], [0, 10, 30, 90]
    sites = [site(x, 1.0, is_wide=k == 1) for k, x in enumerate((empty, middle, crowded, [10, 10, 10, 10]))]
    assert [r.ratio for r in standard_ratios(sites)] == pytest.approx([1] * 4, rel=1e-6)
    raw = [s.close_h.sum() / s.person_h.sum() for s in sites]
    assert max(raw) / min(raw) > 2


def test_a_site_that_differs_has_its_true_ratio_even_where_it_is_most_of_the_crowd() -> None:
    sites = [site([90, 20, 5, 1], 1.0), site([50, 30, 9, 2], 1.0), site([5, 10, 40, 300], 1.5)]
    rates, theta = class_rates(sites)
    assert theta / theta[0] == pytest.approx([1, 1, 1.5], rel=1e-3)
    assert rates / rates[0] == pytest.approx(RATES / RATES[0], rel=1e-3)
    pooled = sum(s.close_h.sum() for s in sites[2:]) / (sites[2].person_h.sum(axis=0) @ RATES)
    assert pooled > 1.4


def test_a_site_as_crowded_as_no_other_is_not_known() -> None:
    sites = [site([9, 9, 1, 0], 1.0), site([9, 9, 0, 0], 1.0), site([9, 9, 0, 0], 1.0), site([0, 0, 2, 30], 1.0)]
    assert known_shares(sites).round(2).tolist() == [0.95, 1, 1, 0]


def test_a_few_sites_that_differ_do_not_widen_the_limits() -> None:
    assert quad(lambda z: min(z * z, CUT**2) * norm.pdf(z), -9, 9)[0] == pytest.approx(BETA)
    rng = np.random.default_rng(5)
    v = np.full(400, 0.05**2)
    y = rng.normal(0, math.hypot(0.05, 0.1), 400)
    assert usual(y, v)[1] == pytest.approx(0.1**2, rel=0.2)
    y[:40] = 1.0
    assert usual(y, v)[1] < 2.2 * 0.1**2
    assert np.var(y) > 6 * 0.1**2
    assert funnel(y[:3], v[:3], v[:3] + 9) is None


def test_one_in_twenty_of_the_sites_named_may_be_false_not_one_page_in_twenty() -> None:
    """Eight of 40 differ by four and a half standard deviations; Holm's step-down would name fewer of them."""
    rng = np.random.default_rng(8)
    v, df = np.full(40, 0.06**2), np.full(40, 60.0)
    n_false = n_named = n_differ = n_holm = 0
    for _ in range(200):
        y = rng.normal(0, math.hypot(0.06, 0.08), 40)
        y[:8] += 0.45 * np.where(np.arange(8) % 2, 1, -1)
        found = funnel(y, v, df)
        assert found is not None
        n_false, n_named = n_false + int(found.differs[8:].sum()), n_named + int(found.differs.sum())
        n_differ += int(found.differs[:8].sum())
        p = np.sort(found.p)
        n_holm += int(np.argmax(np.append(p * (40 - np.arange(40)), 1) > ERROR))
    assert 0 < n_false / n_named <= 0.05
    assert n_differ / (8 * 200) > 0.6
    assert n_named > 1.05 * n_holm


def test_the_sites_that_differ_are_named_and_a_dead_camera_is_not_blamed() -> None:
    world = SiteWorld(n_sites=16, effects=(1.8, 1 / 1.8), day_sd=(0.1, 0.2), week_sd=(0.0, 0.1))
    floors, truth = site_floors(world, np.random.default_rng(11))
    found = compare_sites(floors, LAST)
    assert found is not None
    by_site = {f.key.site_id: f for f in found.floors}
    assert {k for k, f in by_site.items() if f.differs} == {"site-00", "site-01"}
    for k in (0, 1):
        said = by_site[f"site-{k:02d}"].said
        assert said is not None
        assert said.lo < math.exp(truth[k]) < said.hi
    dead, half_dead = by_site["site-15"], by_site["site-14"]
    assert (dead.status, dead.differs, dead.said) == ("gaps", False, None)
    assert dead.unrecorded == pytest.approx(0.7 / 3)
    assert (half_dead.status, half_dead.n_weeks, half_dead.n_left_out) == ("compared", 7, 3)
    assert [f.name for f in found.floors] == sorted((f.name for f in found.floors), key=str.casefold)


def test_where_nobody_looks_at_the_cameras_a_dead_one_makes_a_calm_site() -> None:
    """The control of the test above: what the rule of silent cameras prevents."""
    world = SiteWorld(n_sites=16, effects=(), day_sd=(0.05, 0.05), week_sd=(0.0, 0.02), own_sd=0.0)
    blind = compare_sites(site_floors(world, np.random.default_rng(12), says_gaps=False)[0], LAST)
    assert blind is not None
    site = next(f for f in blind.floors if f.key.site_id == "site-15")
    assert site.status == "compared"
    assert site.ratio is not None
    assert site.ratio < 0.85


def test_three_floors_do_not_tell_how_floors_usually_differ() -> None:
    floors, _ = site_floors(replace(SiteWorld(), n_sites=3, has_gaps=False), np.random.default_rng(1))
    found = compare_sites(floors, LAST)
    assert found is not None
    assert found.usual_sd is None
    assert not any(f.differs or f.said for f in found.floors)
    assert compare_sites(floors[:1], LAST) is None
