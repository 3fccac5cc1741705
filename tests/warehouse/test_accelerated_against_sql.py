"""Facts computed as arrays have the rows, the order and the types of the queries in `sql/`, on random floors."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from warehouse.small_projects import HOUR, T0, Frame, Pair, Person, make_site, put

from vsd_analytics.site.model import Area, Calibration, Camera, Floor, Site
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse import held
from vsd_analytics.warehouse.accelerated import switch
from vsd_analytics.warehouse.accelerated.columns import beside, grouped_by, order_by, rounded
from vsd_analytics.warehouse.compute import day_facts, hour_facts
from vsd_analytics.warehouse.held import NULL
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.stored_records import PartReader
from vsd_analytics.warehouse.units import PartIndex

START = T0 + HOUR - 90_000  # an hour ends in the middle
VIEWS = {"cam": (0.0, 12.0), "cam-2": (8.0, 20.0), "up": (0.0, 20.0)}
HOURLY = [r.name for r in relations("facts").values() if r.unit == "hour"]
MEMBERS = {"located": ["member"], "pairs": ["member_a", "member_b", "distance_mm"], "in_violation": ["member"]}


@dataclass(frozen=True)
class Scene:
    """What the engines of a floor send."""

    seed: int
    n_people: int = 9
    step_ms: int = 1000
    pace: float = 1.0
    has_rate: bool = True
    share_with_ids: float = 1.0
    share_lost: float = 0.1
    has_beats: bool = True
    sends_pixels: bool = False
    sends_persons: bool = True
    sends_pairs: bool = False
    falling_numbers: bool = False
    opens_at_half_past: bool = False
    switches_ids: bool = False


BUSY = Scene(4, n_people=30, share_lost=0.0, sends_pixels=True, switches_ids=True)
STANDING = Scene(7, n_people=14, pace=0.0)


def site_of(scene: Scene, root: Path) -> Site:
    """Return a site of two floors; two cameras of one floor overlap, and a calibration is replaced on the way."""
    hz = 1000 / scene.step_ms if scene.has_rate else None
    shape = ((0.01, 0.001, 0.0), (0.0005, 0.01, 0.0), (0.0, -0.00002, 1.0))
    known = Calibration(shape, None, "b" * 8), Calibration(((0.011, *shape[0][1:]), *shape[1:]), None, "a" * 8)
    later = replace(known[1], valid_from=datetime.fromtimestamp((START + 40_000) / 1000, tz=UTC))
    cameras = [
        Camera(
            name,
            name,
            "upper" if name == "up" else "ground",
            hz=hz,
            view=((x0, 0.0), (x1, 0.0), (x1, 10.0), (x0, 10.0)),
            calibrations=(known[0], later) if name == "up" and scene.sends_pixels else (),
        )
        for name, (x0, x1) in VIEWS.items()
    ]
    opening = (((8 * 60 + 30, 20 * 60),),) * 7 if scene.opens_at_half_past else None
    site = make_site(root, cameras=cameras, opening=opening)
    shapes = (8.0, 2.0, 11.0, 5.0), (10.0, 4.0, 14.0, 7.0), (-40.0, -40.0, -30.0, -30.0)
    day = datetime.fromtimestamp(START / 1000, tz=UTC).date()
    spans = (None, None), (None, day + timedelta(days=1)), (None, day)
    areas = tuple(
        Area(f"area-{k}", "", "ground", ((x0, y0), (x1, y0), (x1, y1), (x0, y1)), first_day=first, end_day=end)
        for k, ((x0, y0, x1, y1), (first, end)) in enumerate(zip(shapes, spans, strict=True))
    )
    return replace(site, floors=(Floor("ground", "Ground"), Floor("upper", "Upper")), areas=areas)


def records_of(scene: Scene) -> Iterator[Person | Pair | Frame]:
    """Yield what engines send of people who walk to and fro in a small part of the floor."""
    rng = np.random.default_rng(scene.seed)
    places = rng.uniform((7_000, 2_000), (13_000, 6_000), (scene.n_people, 2))
    speeds = rng.normal(0, 700, (scene.n_people, 2))
    names = [f"{'zyxba'[i % 5]}{i}" if rng.random() < scene.share_with_ids else None for i in range(scene.n_people)]
    for number, ts in enumerate(range(START, START + 180_000, scene.step_ms)):
        speeds += rng.normal(0, 300, speeds.shape) - 0.1 * (places - (10_000, 4_000))
        places += scene.pace * speeds * scene.step_ms / 1000
        for camera, (x0, x1) in (*VIEWS.items(), ("unknown", (0.0, 20.0))):
            if rng.random() < scene.share_lost:
                continue
            at = ts + (137 if camera == "cam-2" else 0)
            seen = [
                (f"{names[i]}{camera}" if names[i] else None, *(places[i] + rng.normal(0, 80, 2)).round().astype(int))
                for i in range(scene.n_people)
                if x0 * 1000 <= places[i][0] <= x1 * 1000 and rng.random() > 0.05
            ]
            has_pairs = scene.sends_pairs and camera != "cam"
            if scene.switches_ids:  # each id lives for a while, and one person has two
                seen = [
                    (f"{track}{(number + 7 * k) // 25}" if track else None, x, y)
                    for k, (track, x, y) in enumerate(seen)
                ]
                seen += [(f"{track}x", x + 90, y) for track, x, y in seen[:1] if track]
            if scene.has_beats:
                seq = number - (40 if scene.falling_numbers and number > 70 else 0)
                yield Frame(at, camera, n_persons=len(seen), n_pairs=0 if has_pairs else None, seq=seq)
            for k, (track, x, y) in enumerate(seen if scene.sends_persons else ()):
                is_pixel = scene.sends_pixels and camera == "up"
                where = {"u": x / 10, "v": y / 10} if is_pixel else {"x": int(x), "y": int(y)}
                yield Person(at, track, camera=camera, **({} if k == 7 and track else where))
            for k, (track, x, y) in enumerate(seen[:-1] if has_pairs else ()):
                other, x2, y2 = seen[k + 1]
                xy = (int(x), int(y), int(x2), int(y2)) if k % 3 else (None,) * 4
                yield Pair(at, track, other, int(np.hypot(x - x2, y - y2)), camera, xy, (k, k + 1))


def facts_of(site: Site, *, facts: Collection[str] = (*HOURLY, *MEMBERS)) -> dict[str, pa.Table]:
    """Return facts of the two hours, and the relations with a row for each record, in order."""
    index = PartIndex(Store(site.root / "store", site_id=site.site_id), first_hour=None, last_hour=None)
    first, last = index.hours()[0], index.hours()[-1]
    parts = index.between(first, last)
    days = day_facts(site, parts)
    hourly = hour_facts(
        site,
        facts=facts,
        parts=parts,
        camera_days=days,
        first_hour=first,
        last_hour=last,
    )
    found = {"camera_days": days, **{relation.name: with_texts(rows) for relation, rows in hourly}}
    for name, members in MEMBERS.items() if set(MEMBERS) <= found.keys() else ():
        found[name] = found[name].sort_by([(c, "ascending") for c in ("camera_id", "ts_ms", *members)])
    return found


def with_texts(rows: pa.Table) -> pa.Table:
    """Return rows as they are read from their file, with texts in place of dictionaries of ids."""
    fields = (f.with_type(pa.string()) if pa.types.is_dictionary(f.type) else f for f in rows.schema)
    return rows.cast(pa.schema(fields))


def both(scene: Scene) -> tuple[dict[str, pa.Table], dict[str, pa.Table]]:
    with TemporaryDirectory() as folder:
        site = site_of(scene, Path(folder))
        put(site, records_of(scene))
        with patch.dict(os.environ, VSD_ACCELERATED="0"):
            queried = facts_of(site)
        with patch.dict(os.environ, VSD_ACCELERATED="1"):
            return queried, facts_of(site)


@given(
    st.builds(
        Scene,
        seed=st.integers(0, 2**32 - 1),
        n_people=st.sampled_from([2, 6, 14]),
        step_ms=st.sampled_from([500, 1000, 2000, 7000]),
        has_rate=st.booleans(),
        share_with_ids=st.sampled_from([0.0, 0.8, 1.0]),
        share_lost=st.sampled_from([0.0, 0.2]),
        has_beats=st.booleans(),
        sends_pixels=st.booleans(),
        sends_persons=st.sampled_from([True, True, False]),
        sends_pairs=st.booleans(),
        falling_numbers=st.booleans(),
        opens_at_half_past=st.booleans(),
        switches_ids=st.booleans(),
    ).filter(lambda scene: scene.has_beats or scene.sends_persons)
)
@example(BUSY)
@example(STANDING)
@example(Scene(2, n_people=60, step_ms=20_000, pace=0.0, opens_at_half_past=True))
@example(Scene(3, sends_pixels=True, sends_pairs=True, falling_numbers=True, share_with_ids=0.7))
@example(Scene(5, sends_persons=False, sends_pairs=True))
@example(Scene(6, sends_pairs=True, has_beats=False, share_lost=0.0))
@settings(max_examples=1, deadline=None)
def test_arrays_give_the_rows_of_the_queries(scene: Scene) -> None:
    expected, found = both(scene)
    assert found.keys() == expected.keys() == {"camera_days", *HOURLY, *MEMBERS}
    for name, rows in expected.items():
        assert found[name].schema.types == rows.schema.types, name
        assert found[name].equals(rows) or found[name].to_pylist() == rows.to_pylist(), name
    if scene == BUSY:
        # else nothing might be compared with nothing
        assert set(found["area_tracks"]["area_id"].to_pylist()) == {"area-0", "area-1", None}
        assert {name for name, rows in found.items() if not rows.num_rows} == {
            "area_stays",
            "joined_tracks",
            "area_counts",
            "walk_cells",
            "track_ends",
            "line_crossings",
            "standing_groups",  # they walk
            "staff_tags",
        }
    if scene == STANDING:
        assert max(found["track_pairs"]["standing_ms"].to_pylist()) > 0
        assert set(found["company_times"]["is_standing"].to_pylist()) == {True, False}


COUNTS = ("coverage", "recorded_spans", "exposure", "violation_time", "floor_cells")


@given(
    st.builds(
        Scene,
        seed=st.integers(0, 2**32 - 1),
        n_people=st.sampled_from([2, 6, 14]),
        step_ms=st.sampled_from([500, 1000, 2000, 7000]),
        has_rate=st.booleans(),
        share_with_ids=st.sampled_from([0.0, 0.8, 1.0]),
        has_beats=st.booleans(),
        sends_pixels=st.booleans(),
        sends_pairs=st.sampled_from([False, False, True]),
        opens_at_half_past=st.booleans(),
    ),
    st.booleans(),
)
@example(BUSY, False)
@example(Scene(2, n_people=60, step_ms=20_000, pace=0.0, opens_at_half_past=True), True)
@example(Scene(8, sends_pairs=True), True)
@example(Scene(9, has_beats=False), True)
@settings(max_examples=1, deadline=None)
def test_facts_that_only_count_have_the_rows_of_the_queries_without_ids(scene: Scene, by_hour: bool) -> None:
    """Asked for alone, they read no ids; hour by hour, an hour has the frames beside it, and each part is read once."""
    with TemporaryDirectory() as folder:
        site = site_of(scene, Path(folder))
        put(site, records_of(scene))
        with patch.dict(os.environ, VSD_ACCELERATED="0"):
            expected = facts_of(site, facts=COUNTS)
        with patch.dict(os.environ, VSD_ACCELERATED="1"):
            found = counts_by_hour(site) if by_hour else facts_of(site, facts=COUNTS)
    for name in COUNTS:
        assert found[name].schema.types == expected[name].schema.types, name
        assert found[name].to_pylist() == expected[name].to_pylist(), name
    assert expected["violation_time"].num_rows or scene.n_people == 2


def counts_by_hour(site: Site) -> dict[str, pa.Table]:
    index = PartIndex(Store(site.root / "store", site_id=site.site_id), first_hour=None, last_hour=None)
    hours = index.hours()
    days, reader = day_facts(site, index.between(hours[0], hours[-1])), PartReader()
    found = defaultdict(list)
    for hour in hours:
        parts = index.between(hour - 1, hour + 1)
        asked = {"facts": COUNTS, "parts": parts, "camera_days": days, "reader": reader}
        for relation, rows in hour_facts(site, first_hour=hour, last_hour=hour, **asked):
            found[relation.name].append(with_texts(rows))
    return {name: pa.concat_tables(rows) for name, rows in found.items()}


def test_counts_read_no_ids_unless_an_engine_sends_pairs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = []
    monkeypatch.setattr(PartReader, "counted", lambda *a: read.append(1) or counted(*a))
    for number, scene in enumerate([Scene(6, n_people=4), Scene(6, n_people=4, sends_pairs=True)]):
        site = site_of(scene, tmp_path / str(number))
        put(site, records_of(scene))
        assert facts_of(site, facts=COUNTS)["exposure"].num_rows > 0
        assert facts_of(site, facts=[*COUNTS, "cell_tracks"])["cell_tracks"].num_rows > 0
    assert read == [1]


counted = PartReader.counted


def test_facts_of_people_and_pairs_with_ids_need_no_query(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(6, n_people=4, sends_pairs=True)
    site = site_of(scene, tmp_path)
    put(site, records_of(scene))
    monkeypatch.setattr(held, "connect", lambda **_: pytest.fail("a query runs"))
    assert facts_of(site)["track_pairs"].num_rows > 0


def test_without_acceleration_every_fact_comes_from_its_query(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(6, n_people=4, sends_pairs=True)
    site = site_of(scene, tmp_path)
    put(site, records_of(scene))
    monkeypatch.setenv("VSD_ACCELERATED", "0")
    for name in ("Batch", "camera_days"):
        monkeypatch.setattr(switch, name, lambda *_: pytest.fail("numpy computes a fact"))
    assert facts_of(site)["track_pairs"].num_rows > 0


@given(st.lists(st.tuples(st.integers(-3, 3), st.integers(-(2**40), 2**40), st.booleans())))
def test_rows_are_ordered_as_by_a_stable_sort(rows: list[tuple[int, int, bool]]) -> None:
    keys = [np.array([row[i] for row in rows], dtype=np.int64) for i in range(3)]
    expected = sorted(range(len(rows)), key=lambda i: rows[i])
    order, starts = grouped_by(*keys)
    assert order_by(*keys).tolist() == order.tolist() == expected
    assert [rows[i] for i in order[starts]] == sorted(set(rows))
    wide = np.array([row[1] for row in rows] or [0]) * 2**21  # more bits than one integer has
    assert order_by(wide, wide).tolist() == np.argsort(wide, kind="stable").tolist()


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(-9, 9)), max_size=30), st.integers(0, 5))
def test_rows_of_a_group_within_reach_are_paired_once(rows: list[tuple[int, int]], reach: int) -> None:
    rows.sort()
    group, x = (np.array([row[i] for row in rows], dtype=np.int64) for i in range(2))
    found = [pair for a, b in beside(group, x, reach) for pair in zip(a.tolist(), b.tolist(), strict=True)]
    n = len(rows)
    expected = [(i, j) for i in range(n) for j in range(i + 1, n) if rows[i][0] == rows[j][0] and x[j] - x[i] <= reach]
    assert found == expected


@pytest.mark.parametrize(("value", "expected"), [(0.5, 1), (-0.5, -1), (2.5, 3), (0.49999999999999994, 0), (-1.4, -1)])
def test_halves_are_rounded_away_from_zero(value: float, expected: int) -> None:
    assert rounded(np.array([value])).tolist() == [expected]
    assert NULL + 2**40 < NULL // 2
