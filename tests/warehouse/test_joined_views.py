"""People followed from camera to camera: who is joined, who is not, and what visits make of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from warehouse.small_projects import DAY, T0, Person, beats, fact_files, make_site, open_days, put

from vsd_analytics.site.model import Area, Camera, Floor, Site
from vsd_analytics.warehouse.build import build

LEFT = ((0, 0), (12, 0), (12, 6), (0, 6))
RIGHT = ((8, 0), (20, 0), (20, 6), (8, 6))
HALL = Area("hall", "Hall", "ground", ((2, 0), (18, 0), (18, 6), (2, 6)), has_visits=True)


def site_of(root: Path, *, joins: bool = True, names: tuple[str, str] = ("left", "right")) -> Site:
    """Return a corridor of 20 m; one camera sees the first 12 m of it, the other the last 12 m."""
    cameras = [Camera(name, name, "ground", hz=2.0, view=view) for name, view in zip(names, (LEFT, RIGHT), strict=True)]
    root.mkdir(exist_ok=True)
    return replace(make_site(root, cameras=cameras, join_views=joins), areas=(HALL,))


def walk(name: str, *, at_ms: int = T0, y_mm: int = 3000, late_ms: int = 0, off_mm: int = 0) -> list[Person]:
    """Return somebody who walks from end to end in 20 s, as both cameras see it.

    Args:
        name: Id at both; records of the second have "'" behind it.
        at_ms: When they come in.
        y_mm: How far up they walk.
        late_ms: How late the second camera's clock is.
        off_mm: How far along the corridor the second camera places everybody off.
    """
    rows = []
    for k in range(41):
        x = 500 * k
        if x <= 12_000:
            rows.append(Person(at_ms + 500 * k, name, x, y_mm, "left"))
        if x >= 8_000:
            rows.append(Person(at_ms + 500 * k + late_ms, f"{name}'", x + off_mm, y_mm, "right"))
    return rows


def rows_of(site: Site, relation: str, people: Iterable[Person], last: str | None = None) -> list[dict[str, Any]]:
    """Store people, and heartbeats of the first minute, and return the rows of a relation."""
    put(site, [*people, *(b for c in site.cameras for b in beats(T0, T0 + 60_000, every=500, camera=c.camera_id))])
    with open_days(site, last=last) as warehouse:
        return list(warehouse.rows(f"select * from {relation}"))


def test_a_visit_that_two_cameras_see_in_parts_is_one_with_entry_and_exit(tmp_path: Path) -> None:
    apart = rows_of(site_of(tmp_path / "apart", joins=False), "visits", walk("a"))
    assert [(v["has_entry"], v["has_exit"]) for v in apart] == [(True, False), (False, True)]
    (joined,) = rows_of(site_of(tmp_path / "joined"), "visits", walk("a"))
    assert (joined["has_entry"], joined["has_exit"], joined["is_counted"]) == (True, True, True)
    assert joined["dwell_s"] == pytest.approx(16.0, abs=0.5)


def test_nobody_is_joined_unless_asked_and_no_file_is_made(tmp_path: Path) -> None:
    site = site_of(tmp_path, joins=False)
    assert rows_of(site, "joined_tracks", walk("a")) == []
    build(site)
    before = fact_files(site)
    assert not any(name.startswith("joined_tracks") for name in before)
    build(replace(site, settings=site.settings.with_values({"join_views": True})))
    changed = {n.partition("/")[0] for n, data in fact_files(site).items() if before.get(n) != data}
    assert changed == {"joined_tracks"}, "the setting changes no other fact"


@pytest.mark.parametrize("late_ms", [1500, -1500])
def test_a_clock_that_is_off_joins_nobody_rather_than_the_one_behind(tmp_path: Path, late_ms: int) -> None:
    """People at even distances would be joined wrongly: nothing but the clock tells one from the next."""
    starts_s = (0, 2.1, 3.4, 7, 8.2, 11.9, 13, 15.6)
    queue = [row for s in starts_s for row in walk(f"p{s}", at_ms=T0 + round(1000 * s), late_ms=late_ms)]
    assert rows_of(site_of(tmp_path), "joined_tracks", queue) == []


def test_cameras_that_place_people_half_a_metre_apart_join_nobody(tmp_path: Path) -> None:
    walkers = [row for k in range(3) for row in walk(f"p{k}", at_ms=T0 + 8000 * k, off_mm=500)]
    assert rows_of(site_of(tmp_path), "joined_tracks", walkers) == []


def test_a_couple_is_joined_each_to_itself_or_not_at_all(tmp_path: Path) -> None:
    couple = [*walk("a", y_mm=2700), *walk("b", y_mm=3300)]
    found = rows_of(site_of(tmp_path), "joined_tracks", couple)
    assert {(r["track_id"], r["other_track_id"]) for r in found} == {("a", "a'"), ("b", "b'")}


def test_nobody_is_joined_over_floors(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    left, right = site.cameras
    floors = (Floor("ground", "Ground"), Floor("upper", "Upper"))
    site = replace(site, floors=floors, cameras=(left, replace(right, floor_id="upper")))
    assert rows_of(site, "joined_tracks", walk("a")) == []


def test_persons_end_with_the_day(tmp_path: Path) -> None:
    days = [*walk("a"), *walk("a", at_ms=T0 + DAY)]
    persons = rows_of(site_of(tmp_path), "joined_persons", days, last="2026-11-10")
    assert sorted((str(p["site_day"]), p["track_id"]) for p in persons) == [
        (f"2026-11-{day:02}", track) for day in (9, 10) for track in ("a", "a'")
    ]


walkers = st.lists(st.tuples(st.integers(0, 20), st.integers(0, 20)), min_size=1, max_size=6, unique=True)


@given(walkers)
@settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_the_order_of_cameras_does_not_matter_and_nobody_has_two_tracks_of_one_camera_at_once(
    tmp_path_factory: pytest.TempPathFactory, starts: list[tuple[int, int]]
) -> None:
    people = [
        row for k, (s, y) in enumerate(starts) for row in walk(f"p{k}", at_ms=T0 + 1000 * s, y_mm=300 * y, off_mm=100)
    ]
    swapped = {"left": "right", "right": "left"}
    site = site_of(tmp_path_factory.mktemp("a"))
    other = site_of(tmp_path_factory.mktemp("b"), names=("right", "left"))
    persons = []
    for own, rows in ((site, people), (other, [replace(r, camera=swapped[r.camera]) for r in people])):
        found = rows_of(own, "joined_persons", rows)
        groups: dict[object, set[str]] = {}
        for p in found:
            groups.setdefault((p["person_camera_id"], p["person_track_id"]), set()).add(p["track_id"])
        persons.append(sorted(map(sorted, groups.values())))
    assert persons[0] == persons[1]
    assert all(tracks == [tracks[0], f"{tracks[0]}'"] for tracks in persons[0])


def shop_with_cashier(root: Path, **settings: object) -> tuple[Site, list[Person]]:
    """Return a corridor whose left end is a counter, a cashier who serves there and fetches from the right, a visitor.

    The left camera's tracker gives the cashier a new id on the way back: neither of the two is behind the counter for
    as long as staff is.
    """
    counter = Area("counter", "Counter", "ground", ((0, 0), (4, 0), (4, 6), (0, 6)), is_staff=True)
    site = site_of(root, joins=bool(settings.pop("join_views", True)))
    given = {"staff_in_area_s": 30.0, "staff_in_area_share": 0.1, **settings}
    site = replace(site, areas=(counter,), settings=site.settings.with_values(given))
    serves = [Person(T0 - 500 * k, "a", 0, 3000, "left") for k in range(1, 41)]
    fetches = [Person(T0 + 20_500 + 500 * k, "a'", 20_000, 3000, "right") for k in range(40)]
    back = [replace(r, ts=T0 + 41_000 + 20_000 - (r.ts - T0)) for r in walk("a")]
    back = [replace(r, track="a2") if r.camera == "left" else r for r in back]
    serves_again = [Person(T0 + 61_500 + 500 * k, "a2", 0, 3000, "left") for k in range(40)]
    visitor = walk("v", at_ms=T0 + 100_000)
    return site, [*serves, *walk("a"), *fetches, *back, *serves_again, *visitor]


@pytest.mark.parametrize(
    ("joins", "staff"), [(True, {("left", "a"), ("left", "a2"), ("right", "a'")}), (False, set[tuple[str, str]]())]
)
def test_pieces_of_staff_that_views_join_are_judged_together(
    tmp_path: Path, joins: bool, staff: set[tuple[str, str]]
) -> None:
    site, people = shop_with_cashier(tmp_path / "shop", join_views=joins, people="visitors")
    put(site, [*people, *(b for c in site.cameras for b in beats(T0, T0 + 150_000, every=500, camera=c.camera_id))])
    with open_days(site) as warehouse:
        tracks = {(r["camera_id"], r["track_id"]) for r in warehouse.rows("select * from track_lives")}
    everybody = {(r.camera, str(r.track)) for r in people}
    assert everybody - tracks == staff
    with open_days(site.with_settings(people="staff")) as warehouse:
        assert {(r["camera_id"], r["track_id"]) for r in warehouse.rows("select * from track_lives")} == staff


def test_one_piece_that_is_staff_makes_its_person_staff_on_the_other_camera(tmp_path: Path) -> None:
    for joins, left in ((True, {"v", "v'"}), (False, {"a'", "v", "v'"})):
        site, people = shop_with_cashier(
            tmp_path / str(joins), join_views=joins, people="visitors", staff_in_area_s=10.0
        )
        put(site, [*people, *(b for c in site.cameras for b in beats(T0, T0 + 150_000, every=500, camera=c.camera_id))])
        with open_days(site) as warehouse:
            assert {r["track_id"] for r in warehouse.rows("select * from track_lives")} == left
