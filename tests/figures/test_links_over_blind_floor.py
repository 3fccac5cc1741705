"""Links over floor where nobody is followed: against planted walkers who vanish, wait unseen, or pass each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from figures.walkers_between_areas import site_with_areas
from warehouse.small_projects import DAY, HOUR, T0, Person, beats, open_days, put

from vsd_analytics.answer import Reason
from vsd_analytics.figures.flow import Flow, flow
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.stats.track_links import TrackEnds, link_counts, linked_share

FIRST = date(2026, 11, 9)


def two_views(root: Path, first_to: float, second_from: float) -> Site:
    """Return areas along a corridor, bread at 4 m under one camera, wine at 8 m and till at 12 m under another."""
    spans = (("cam", -1.0, first_to), ("cam-2", second_from, 16.0))
    views = [Camera(c, c, "ground", hz=1.0, view=((a, -1), (b, -1), (b, 9), (a, 9))) for c, a, b in spans]
    return replace(site_with_areas(root, opening=(((480, 540),),) * 7), cameras=tuple(views))


def passes(site: Site, start_ms: int, name: str, *, unseen_s: int = 0, until_m: int = 14) -> Iterator[Person]:
    """Return somebody who walks 1 m a second from the bread to the till, and waits unseen at 7 m."""
    for x in range(5, until_m):
        y = 1000 if x in (5, 12, 13) else 3000
        for camera in site.cameras:
            assert camera.view is not None
            (lo, _), (hi, _), *_ = camera.view
            if lo <= x < hi:
                at = start_ms + (x + (unseen_s if x > 7 else 0)) * 1000
                yield Person(at, f"{camera.camera_id}-{name}", x * 1000, y, camera.camera_id)


def flow_of(site: Site, n_days: int) -> Flow:
    last = FIRST + timedelta(days=n_days - 1)
    with open_days(site, FIRST.isoformat(), last.isoformat()) as warehouse:
        found = flow(Period(FloorHours(warehouse, floor=site.floors[0]), FIRST, last))
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("first_to", "second_from", "true"), [(7.0, 10.0, 1 / 3), (8.0, 8.0, 1 / 3), (10.0, 8.0, 2 / 3)]
)
def test_walkers_over_blind_floor_a_border_or_an_overlap_are_linked(
    tmp_path: Path, first_to: float, second_from: float, true: float
) -> None:
    """A third of those who leave the bread go to the till in one walk, a third wait at 7 m, a third stay lost.

    Who waits is found again only where both cameras see the floor behind that place.
    """
    site = two_views(tmp_path, first_to, second_from)
    rows: list[object] = []
    rng = np.random.default_rng(3)
    for d in range(5):
        for k in range(24):
            start = T0 + d * DAY + int(rng.uniform(0, 3300)) * 1000
            rows += passes(site, start, f"{d}-{k}", unseen_s=(0, 300, 0)[k % 3], until_m=(14, 14, 7)[k % 3])
        for camera in site.cameras:
            rows += beats(T0 + d * DAY, T0 + d * DAY + HOUR, camera=camera.camera_id)
    put(site, rows)  # type: ignore[arg-type]
    whole = flow_of(site, 5)
    found = whole.links
    (link,) = found.links
    assert (link.origin.area_id, link.to.area_id, link.share.n) == ("bread", "till", 120)
    assert link.share.lo is not None
    assert link.share.hi is not None
    assert link.share.lo <= true <= link.share.hi < true + 0.3
    assert found.recorded_share == pytest.approx(5 / 5)


def test_who_fits_by_chance_is_taken_off() -> None:
    """Ends and starts in a crowd, of which a fifth are the same walkers; in pairs, who must not count twice."""
    rng = np.random.default_rng(1)
    held, alone = [], []
    for _ in range(40):
        n_days, n = 14, 200
        day = np.repeat(np.arange(n_days), n)
        at = rng.uniform(0, 7200, n_days * n) + day * 86_400
        at[1::2] = at[::2] + 0.5  # companions
        zero, where = np.zeros(len(at)), np.zeros(len(at), dtype=np.int64)
        takes = 10 / np.clip(rng.normal(1.34, 0.2, len(at)), 0.8, 2.0)
        takes[1::2] = takes[::2]
        same = np.repeat(rng.random(len(at) // 2) < 0.2, 2)
        begins = np.where(same, at + takes, rng.uniform(0, 7200, len(at)) + day * 86_400)
        ends = TrackEnds(at, zero, zero, where, where, day)
        for starts_at, kept in ((begins, held), (np.where(same, begins + 3600, begins), alone)):
            starts = TrackEnds(starts_at, zero + 10, zero, where + 1, where + 1, day)
            counts = link_counts(ends, starts, n_areas=2, n_days=n_days)
            share = linked_share(counts, 0, 1, np.full(n_days, float(n)))
            assert share.lo is not None
            assert share.hi is not None
            kept.append((share.value, share.lo, share.hi))
    values = [v for v, _, _ in held if v is not None]
    assert len(values) == len(held)
    assert 0.15 <= np.mean(values) <= 0.21, "in a crowd links are too few, not too many"
    assert np.mean([lo <= 0.2 <= hi for _, lo, hi in held]) >= 0.9
    assert np.mean([lo > 0 for _, lo, _ in alone]) <= 0.1


def test_shares_have_no_interval_where_people_go_on_unseen(tmp_path: Path) -> None:
    """Half of those who leave the bread go to the wine in view, half over the border to the till."""
    site = two_views(tmp_path, 10.0, 10.5)
    rows: list[object] = []
    for d in range(5):
        for k in range(30):
            start = T0 + d * DAY + k * 100_000
            if k % 2:
                rows += passes(site, start, f"{d}-{k}")
            else:
                way = [(5, 1), (6, 3), (7, 3), (8, 1), (9, 1), (9, 1)]
                rows += [Person(start + s * 1000, f"w{d}-{k}", x * 1000, y * 1000) for s, (x, y) in enumerate(way)]
        for camera in site.cameras:
            rows += beats(T0 + d * DAY, T0 + d * DAY + HOUR, camera=camera.camera_id)
    put(site, rows)  # type: ignore[arg-type]
    found = flow_of(site, 5)
    (bread,) = [a for a in found.areas if a.area.area_id == "bread"]
    assert bread.following.reason is not None
    assert [(to.areas[0].area_id, to.share.lo) for to in bread.to] == [("wine", None)]
    (link,) = [x for x in found.links.links if x.origin.area_id == "bread"]
    assert (link.to.area_id, link.share.value) == ("till", pytest.approx(0.5, abs=0.1))


def ends_in_waves(rng: np.random.Generator, *, later_s: float, people: int) -> tuple[TrackEnds, TrackEnds]:
    """Return ends at one place and starts 8 m away that one cause brings about, every 12 minutes of five days."""
    waves = np.concatenate([d * 86_400 + np.arange(0, 7200, 720) for d in range(5)]).astype(np.float64)
    at = np.repeat(waves, people)
    day = (at // 86_400).astype(np.int64)
    zero, where = np.zeros(len(at)), np.zeros(len(at), dtype=np.int64)
    left, came = (at + rng.uniform(0, 20, len(at)) for _ in range(2))
    return (
        TrackEnds(left, zero, zero, where, where, day),
        TrackEnds(came + later_s, zero + 8, zero, where + 1, where + 1, day),
    )


@pytest.mark.parametrize(("people", "is_said"), [(6, False), (1, True)])
def test_one_cause_that_empties_two_places_is_no_link(people: int, *, is_said: bool) -> None:
    ends, starts = ends_in_waves(np.random.default_rng(5), later_s=6.0, people=people)
    counts = link_counts(ends, starts, n_areas=2, n_days=5)
    share = linked_share(counts, 0, 1, np.full(5, 10.0 * people))
    assert (share.value is not None) is is_said
    assert share.possible > 0.3, "what may go on unseen still says nothing of those who were followed"
    if not is_said:
        assert share.reason == Reason("flow.waves")
