"""Gatherings, cluster sizes, durations, distances and tracks of planted days, through store and warehouse."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import pyarrow as pa
import pytest

import vsd_analytics
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.gatherings import PURGED
from vsd_analytics.figures.groups import NOTHING
from vsd_analytics.retention import sealing
from vsd_analytics.retention.purge import Terms, purge_older
from vsd_analytics.schema import SCHEMAS
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording.reasons import reason_text

DAY = date(2026, 11, 9)
START = 1_794_211_200_000  # 2026-11-09 08:00 UTC
MIDNIGHT = START + 16 * 3_600_000
Row = tuple[str, int, int, str | None, int, int]


def site_of(root: Path, *, n_cameras: int = 1) -> Site:
    views = ((0, 0), (12, 0), (12, 10), (0, 10)), ((8, 0), (20, 0), (20, 10), (8, 10))
    cameras = tuple(Camera(f"cam-{i}", f"Cam {i}", "ground", hz=1.0, view=views[i]) for i in range(n_cameras))
    settings = Settings().with_values({"pseudonyms": False})
    return Site("shop", "Shop", "UTC", root, floors=(Floor("ground", "Ground"),), cameras=cameras, settings=settings)


def stand(
    camera: str, places_m: list[tuple[float, float]], *, start_ms: int, n_s: int, ids: str | None = "p"
) -> list[Row]:
    """Return rows of people who stand still, one a second."""
    return [
        (camera, start_ms + 1000 * s, i, None if ids is None else f"{ids}{i}", round(1000 * x), round(1000 * y))
        for s in range(n_s)
        for i, (x, y) in enumerate(places_m)
    ]


def put(site: Site, rows: list[Row]) -> None:
    """Store rows, and a frame of every camera each second of the hours they lie in."""
    store = Store(site.root / "store", site_id=site.site_id)
    hours = sorted({ts // 3_600_000 for _, ts, *_ in rows})
    beats = [(c.camera_id, h * 3_600_000 + 1000 * s) for c in site.cameras for h in hours for s in range(3600)]
    persons = {n: [r[i] for r in rows] for i, n in enumerate(("camera_id", "ts", "person", "track_id", "x_mm", "y_mm"))}
    frames = {"camera_id": [c for c, _ in beats], "ts": [t for _, t in beats], "n_persons": [0] * len(beats)}
    for name, columns in {"observations": {**persons, "quality": ["metric"] * len(rows)}, "frames": frames}.items():
        schema, n = SCHEMAS[name], len(columns["ts"])  # type: ignore[index]
        arrays = [pa.array(columns.get(f.name, [None] * n)) for f in schema]
        cast = [
            a.cast(pa.int64()).cast(f.type) if f.name == "ts" else a.cast(f.type)
            for a, f in zip(arrays, schema, strict=True)
        ]
        store.append(name, pa.table(cast, schema=schema))  # type: ignore[arg-type]
    store.fold()


TRIANGLE = [(2.0, 2.0), (3.5, 2.0), (5.0, 2.0)]
"""Three in a row: the first and the third are not close to each other."""


def test_three_people_for_a_minute_are_one_gathering(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    rows = stand("cam-0", TRIANGLE, start_ms=START, n_s=60)
    put(site, [*rows, *stand("cam-0", TRIANGLE, start_ms=START + 120_000, n_s=9)])
    with Warehouse(site, DAY, DAY) as warehouse:
        found = vsd_analytics.gatherings(warehouse)
    (floor,) = found.floors
    (one,) = floor.gatherings
    assert (found.state, floor.n, floor.top) == ("ok", 1, (one,))
    assert (one.duration_s, one.n_people, one.person_s, one.is_open) == (60.0, 3, 180.0, True)
    assert (one.x_m, one.y_m, one.diameter_m) == pytest.approx((3.5, 2.0, 3.0))
    assert one.start.isoformat() == "2026-11-09T08:00:00+00:00"
    assert floor.per_100_h.value == pytest.approx(100.0)
    assert (floor.per_100_h.lo, floor.per_100_h.state) == (None, "not_enough_data")
    assert reason_text(floor.per_100_h.reason) == "an interval needs at least 5 recorded days, has 1"
    assert [s.person_s for s in floor.sizes.sizes] == [0.0, 207.0, 0.0, 0.0, 0.0]
    assert {s.share for s in floor.sizes.sizes} == {None}


def test_a_short_absence_joins_and_a_long_one_parts(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    starts = (0, 14_000, 33_000)  # 10 s each: gaps of 5 s and 10 s from last to first record
    put(site, [r for s in starts for r in stand("cam-0", TRIANGLE, start_ms=START + s, n_s=10)])
    with Warehouse(site, DAY, DAY) as warehouse:
        found = vsd_analytics.gatherings(warehouse).floors[0].gatherings
    assert [(g.duration_s, g.person_s) for g in found] == [(24.0, 60.0), (10.0, 30.0)]


def test_a_gathering_over_midnight_is_whole_and_of_the_day_it_began_on(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    put(site, stand("cam-0", TRIANGLE, start_ms=MIDNIGHT - 30_000, n_s=90))
    for day, expected in ((DAY, [90.0]), (DAY + timedelta(days=1), [])):
        with Warehouse(site, day, day) as warehouse:
            assert [g.duration_s for g in vsd_analytics.gatherings(warehouse).floors[0].gatherings] == expected


def test_of_two_cameras_that_see_a_gathering_one_counts(tmp_path: Path) -> None:
    site = site_of(tmp_path, n_cameras=2)
    places = [(9.2, 5.0), (10.2, 5.0), (11.2, 5.0)]
    seen = [stand(f"cam-{k}", places, start_ms=START, n_s=30, ids="ab"[k]) for k in range(2)]
    put(site, [*seen[0], *seen[1]])
    with Warehouse(site, DAY, DAY) as warehouse:
        (floor,) = vsd_analytics.gatherings(warehouse).floors
    assert floor.n == 1
    assert floor.sizes.person_s == 90.0


def test_without_track_ids_there_are_sizes_and_no_gatherings(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    put(site, stand("cam-0", TRIANGLE, start_ms=START, n_s=2000, ids=None))
    with Warehouse(site, DAY, DAY) as warehouse:
        found = vsd_analytics.gatherings(warehouse)
        figures = vsd_analytics.episode_figures(warehouse)
    (floor,) = found.floors
    assert (floor.n, floor.per_100_h.state, found.state) == (None, "not_measurable", "not_measurable")
    assert "track ids" in reason_text(floor.per_100_h.reason)
    assert [s.share for s in floor.sizes.sizes] == [0.0, 1.0, 0.0, 0.0, 0.0]
    assert (figures.durations.state, figures.contacts.state) == ("not_measurable", "not_measurable")
    assert (figures.tracks.n, figures.tracks.without_id_share) == (None, 1.0)
    assert [s.share for s in figures.distances.shares] == [0.0, 0.0, 0.0, 1.0]


def test_figures_of_planted_episodes(tmp_path: Path) -> None:
    """Thirty-five pairs, one after another: 5 s at 0.4 m, then ten of them for 40 s at 1.2 m; ends unseen."""
    site = site_of(tmp_path)
    rows = []
    for k in range(35):
        n_s, apart_m = (40, 1.2) if k >= 25 else (5, 0.4)
        rows += stand("cam-0", [(2.0, 2.0), (2.0 + apart_m, 2.0)], start_ms=START + 60_000 * k, n_s=n_s, ids=f"{k}-")
    put(site, rows)
    with Warehouse(site, DAY, DAY) as warehouse:
        found = vsd_analytics.episode_figures(warehouse)
    times = found.durations
    assert (times.n, times.median.value, times.p90.value) == (35, 5.0, 40.0)
    assert times.long_share.value == pytest.approx(10 / 35)
    assert (times.cut_share, times.is_at_least, times.state) == (1.0, True, "not_enough_data")
    assert [s.person_s for s in found.distances.shares] == [250.0, 0.0, 800.0, 0.0]
    assert found.distances.shares[0].share == pytest.approx(250 / 1050)
    assert (found.contacts.n, found.contacts.n_pairs, found.contacts.state) == (None, 35, "not_measurable")
    assert (found.tracks.n, found.tracks.median_life_s, found.tracks.without_id_share) == (70, 5.0, 0.0)


def test_a_quarter_of_an_hour_in_parts_is_one_close_contact(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    couple, others = [(2.0, 2.0), (3.0, 2.0)], [(8.0, 8.0), (9.0, 8.0)]
    rows = [r for k in range(3) for r in stand("cam-0", couple, start_ms=START + 1_000_000 * k, n_s=300, ids="c")]
    rows += [r for k in range(3) for r in stand("cam-0", others, start_ms=START + 1_000_000 * k, n_s=299, ids="o")]
    put(site, rows)
    with Warehouse(site, DAY, DAY) as warehouse:
        found = vsd_analytics.episode_figures(warehouse).contacts
    assert (found.n, found.n_pairs, found.state) == (1, 2, "ok")


def test_time_counts_as_long_lived_where_both_ids_of_a_pair_live_long(tmp_path: Path) -> None:
    """A couple for 900 s in three parts, and each of them for 60 s with somebody whose id lives no longer."""
    site = site_of(tmp_path)
    places = [(2.0, 2.0), (3.0, 2.0)]
    rows = [r for k in range(3) for r in stand("cam-0", places, start_ms=START + 1_000_000 * k, n_s=300, ids="c")]
    for start_ms, ids in ((START + 400_000, ("a", "c1")), (START + 600_000, ("c0", "z"))):
        rows += [(c, ts, i, ids[i], x, y) for c, ts, i, _, x, y in stand("cam-0", places, start_ms=start_ms, n_s=60)]
    put(site, rows)
    with Warehouse(site, DAY, DAY) as warehouse:
        found = vsd_analytics.episode_figures(warehouse).contacts
    assert (found.n, found.n_pairs, found.state) == (1, 3, "ok")
    assert found.long_lived_share == pytest.approx(900 / 1020)


def test_what_was_not_recorded_is_not_zero(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    put(site, stand("cam-0", TRIANGLE, start_ms=START, n_s=60))
    empty = DAY + timedelta(days=3)
    with Warehouse(site, empty, empty) as warehouse:
        (floor,) = vsd_analytics.gatherings(warehouse).floors
        figures = vsd_analytics.episode_figures(warehouse)
    assert (floor.n, floor.per_100_h.value, floor.per_100_h.reason) == (None, None, NOTHING)
    assert (floor.sizes.state, floor.sizes.reason) == ("not_enough_data", NOTHING)
    for part in (figures.durations, figures.distances, figures.contacts, figures.tracks):
        assert (part.state, part.reason) == ("not_enough_data", NOTHING)


def test_gatherings_and_distances_outlive_the_records(tmp_path: Path) -> None:
    """Three people over the hour, then all records purged: what was reported of them is reported again."""
    site = site_of(tmp_path)
    put(site, stand("cam-0", TRIANGLE, start_ms=START + 3_590_000, n_s=1900))

    def told() -> tuple[object, ...]:
        with Warehouse(site, DAY, DAY) as warehouse:
            found = vsd_analytics.gatherings(warehouse)
            sure = vsd_analytics.threshold_sensitivity(warehouse)
            (company,) = warehouse.rows("select sum(violation_s)::double as s from company_hours")
            return found, sure, vsd_analytics.episode_figures(warehouse).distances, company["s"]

    before = told()
    purge_older(site, before=DAY + timedelta(days=1), terms=Terms(now=datetime(2027, 1, 1, tzinfo=UTC), is_forced=True))
    with Warehouse(site, DAY, DAY) as warehouse:
        assert warehouse.rows("select count(*) as n from pairs") == [{"n": 0}]
    assert told() == before
    assert [g.duration_s for g in before[0].floors[0].gatherings] == [1900.0]  # type: ignore[attr-defined]
    assert before[3] == 5700.0


def test_hours_sealed_without_clusters_are_not_taken_for_no_gatherings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = site_of(tmp_path)
    put(site, stand("cam-0", TRIANGLE, start_ms=START, n_s=60))
    before = {name: fact for name, fact in relations("facts").items() if name != "cluster_times"}
    monkeypatch.setattr(sealing, "relations", lambda _layer: before)
    terms = Terms(now=datetime(2027, 1, 1, tzinfo=UTC), is_forced=True)
    purge_older(site, before=DAY + timedelta(days=1), terms=terms)
    with Warehouse(site, DAY, DAY) as warehouse:
        assert vsd_analytics.gatherings(warehouse).floors[0].per_100_h.reason == PURGED


def test_an_unknown_floor_is_an_error(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    put(site, stand("cam-0", TRIANGLE, start_ms=START, n_s=3))
    with Warehouse(site, DAY, DAY) as warehouse:
        for ask in (vsd_analytics.gatherings, vsd_analytics.episode_figures):
            with pytest.raises(UsageError, match="no floor"):
                ask(warehouse, floor_id="roof")
