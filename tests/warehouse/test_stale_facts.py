"""What a change makes stale, exactly: which hours, which facts of them, and why; all other bytes stay as they are."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from warehouse.small_projects import (
    DAY,
    FACTS_WITHOUT_AREAS,
    HOUR,
    T0,
    Frame,
    Person,
    fact_files,
    fact_hours,
    make_site,
    open_days,
    put,
)

from vsd_analytics.resources import shipped
from vsd_analytics.site.model import Area, Calibration, Camera, Floor, Site
from vsd_analytics.warehouse import sqlfiles
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.sqlfiles import relations

HOURS = range(T0 // HOUR - 4, T0 // HOUR + 6)
CHANGE_MS = T0 + HOUR // 2
CLUSTERS = {"cluster_times", "gathering_parts", "gathering_joins", "company_times", "neighbour_times", "episode_cells"}
OF_PAIRS = {*CLUSTERS, "distance_times", "same_pairs", "same_tracks"}


def scaled(metres_per_px: float, *, since_ms: int | None = None, shift_m: float = 0.0) -> Calibration:
    rows = ((metres_per_px, 0.0, shift_m), (0.0, metres_per_px, 0.0), (0.0, 0.0, 1.0))
    since = None if since_ms is None else datetime.fromtimestamp(since_ms / 1000, tz=UTC)
    return Calibration(rows, since, f"{round(metres_per_px * 1e6):08x}")


def camera(camera_id: str, *calibrations: Calibration, floor: str = "ground") -> Camera:
    return Camera(camera_id, camera_id, floor, hz=1.0, calibrations=calibrations, picture_px=(640, 480))


OLD, SIDE = scaled(0.01), scaled(0.012, shift_m=3.0)


def project(root: Path, *cameras: Camera, **settings: float) -> Site:
    site = make_site(root, cameras=cameras or (camera("cam", OLD), camera("side", SIDE)), **settings)
    return replace(site, floors=(Floor("ground", "Ground"), Floor("upper", "Upper")))


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten hours of two people in view of two cameras in pixels, with heartbeats, all facts built."""
    people = [
        Person(hour * HOUR + s * 1000, track, camera=c, u=float(u), v=200.0)
        for hour in HOURS
        for s in range(0, 3600, 60)
        for c in ("cam", "side")
        for track, u in (("a", 250 + s % 300), ("b", 350 + s % 300))
    ]
    instants = range(HOURS[0] * HOUR, (HOURS[-1] + 1) * HOUR, 60_000)
    hearts = [Frame(ts, c, seq=i) for c in ("cam", "side") for i, ts in enumerate(instants)]
    folder = tmp_path_factory.mktemp("built")
    put(project(folder), [*people, *hearts])
    build(project(folder))
    return folder


@pytest.fixture
def root(built: Path, tmp_path: Path) -> Path:
    """Return a copy of the project, for one test to change."""
    return Path(shutil.copytree(built, tmp_path / "site"))


def rebuilt(site: Site, elsewhere: Path) -> Site:
    """Return the same project with all facts made anew."""
    shutil.copytree(site.root / "store", elsewhere / "store")
    again = replace(site, root=elsewhere)
    build(again)
    return again


def changed(site: Site, tmp_path: Path) -> tuple[BuildResult, set[int], Counter[str]]:
    """Build, and return what was said, the hours in which a fact has other rows or inputs, and their number by fact.

    The result must be what a build of everything gives, and nothing in the store may be touched.
    """
    before, store = fact_hours(site), {p: p.stat().st_mtime_ns for p in (site.root / "store").rglob("*.parquet")}
    result = build(site)
    after = fact_hours(site)
    assert after.keys() >= before.keys()
    assert fact_files(site) == fact_files(rebuilt(site, tmp_path / "again"))
    assert store == {p: p.stat().st_mtime_ns for p in (site.root / "store").rglob("*.parquet")}
    other = [key for key in after if after[key] != before.get(key)]
    assert build(site).n_built == 0
    return result, {hour for _, hour in other}, Counter(name for name, _ in other)


def test_calibration_from_now_on_leaves_history_as_it_is(root: Path, tmp_path: Path) -> None:
    now = project(root, camera("cam", OLD, scaled(0.015, since_ms=CHANGE_MS)), camera("side", SIDE))
    result, hours, facts = changed(now, tmp_path)
    first = CHANGE_MS // HOUR - 1
    assert hours == set(range(first, HOURS[-1] + 1))
    assert dict(result.reasons) == {"calibration changed": len(hours)}
    assert result.facts == facts
    assert facts.keys() == {
        *("exposure", "floor_cells", "cell_tracks", "violation_time", "episode_segments", "calibrations_used"),
        *("track_lives", "track_pairs", "crowding", "standing_groups"),
        *OF_PAIRS,
    }, "recorded time and running numbers do not depend on where people stood"


def test_an_area_that_asks_for_visits_recomputes_its_stays_only(root: Path, tmp_path: Path) -> None:
    area = Area("till", "Till", "ground", ((0, 0), (4, 0), (4, 4), (0, 4)))
    silent = replace(project(root), areas=(area,))
    drawn, _, facts = changed(silent, tmp_path / "silent")
    assert (set(drawn.reasons), set(facts)) == ({"areas changed"}, {"area_tracks"}), "who was in it, and nothing else"
    asking = replace(silent, areas=(replace(area, has_visits=True),))
    result, _, facts = changed(asking, tmp_path / "asking")
    assert set(result.reasons) == {"areas changed"}
    assert set(facts) == {"area_stays", "walk_cells", "track_ends"}


def test_facts_of_areas_go_when_nothing_is_asked_of_areas_any_more(root: Path) -> None:
    area = Area("till", "Till", "ground", ((0, 0), (4, 0), (4, 4), (0, 4)), has_visits=True)
    silent = project(root)
    before = fact_files(silent)
    assert not {name.split("/")[0] for name in before} & {"area_stays", "walk_cells", "track_ends"}
    build(replace(silent, areas=(area,)))
    assert {name.split("/")[0] for name in fact_files(silent)} > {"area_stays", "walk_cells", "track_ends"}
    build(silent)
    assert fact_files(silent) == before
    with open_days(silent) as warehouse:
        assert warehouse.rows("select count(*) as n from area_stays") == [{"n": 0}]


def test_positions_and_owners_are_those_of_their_time(root: Path) -> None:
    turned = project(root, camera("cam", OLD, scaled(0.015, since_ms=CHANGE_MS)), camera("side", SIDE))
    with open_days(turned) as warehouse:
        used = warehouse.rows(
            "select calibration_id, min(first_ms) as a, max(last_ms) as b from calibrations_used "
            "where camera_id = 'cam' group by 1 order by 2"
        )
        owned = "select x_a_mm, is_owned, count(*) as n from pairs where camera_id = 'cam'"
        after = warehouse.rows(f"{owned} and ts_ms >= {CHANGE_MS} group by 1, 2 order by 1, 2")
        before = warehouse.rows(f"{owned} and ts_ms < {CHANGE_MS} group by 1, 2 order by 1, 2")
        spans = warehouse.rows("select distinct from_ms, to_ms from owner_cells order by 1")
    assert [(u["calibration_id"], u["a"] < CHANGE_MS, u["b"] < CHANGE_MS) for u in used] == [
        (OLD.calibration_id, True, True),
        (scaled(0.015).calibration_id, False, False),
    ]
    assert [s["to_ms"] for s in spans][:1] == [s["from_ms"] for s in spans][1:] == [CHANGE_MS]
    alone = {}
    for name, calibration in (("old", OLD), ("new", scaled(0.015))):
        other = project(root, camera("cam", calibration), camera("side", SIDE))
        with open_days(other) as warehouse:
            alone[name] = [
                warehouse.rows(f"{owned} and ts_ms {o} {CHANGE_MS} group by 1, 2 order by 1, 2") for o in ("<", ">=")
            ]
    assert before == alone["old"][0]
    assert after == alone["new"][1]
    owners = [{r["is_owned"] for r in alone[name][1]} for name in ("old", "new")]
    assert owners == [{True}, {False}], "the new calibration is the coarser one: the other camera owns what both see"


def test_calibration_replaced_for_all_time_makes_all_stale(root: Path, tmp_path: Path) -> None:
    result, hours, _ = changed(project(root, camera("cam", scaled(0.015)), camera("side", SIDE)), tmp_path)
    assert hours == set(HOURS)
    assert dict(result.reasons) == {"calibration changed": len(HOURS)}


def test_calibration_taken_back_makes_its_hours_stale_again(root: Path, tmp_path: Path) -> None:
    first = fact_files(project(root))
    build(project(root, camera("cam", OLD, scaled(0.015, since_ms=CHANGE_MS)), camera("side", SIDE)))
    result = build(project(root))
    assert fact_files(project(root)) == first
    assert dict(result.reasons) == {"calibration changed": HOURS[-1] - CHANGE_MS // HOUR + 2}


@pytest.mark.parametrize(
    "cameras",
    [
        (camera("cam", OLD), camera("side", SIDE), camera("new", OLD, floor="upper")),
        (camera("cam", OLD, scaled(0.01, since_ms=CHANGE_MS)), camera("side", SIDE)),
        (camera("cam", OLD, scaled(0.02, since_ms=T0 + 9 * HOUR)), camera("side", SIDE)),
        (camera("cam", scaled(0.02), scaled(0.01, since_ms=T0 - 9 * HOUR)), camera("side", SIDE)),
    ],
    ids=["a camera elsewhere", "the same numbers again", "not yet in force", "no longer in force"],
)
def test_what_changes_nothing_makes_nothing_stale(root: Path, cameras: tuple[Camera, ...]) -> None:
    before = fact_files(project(root))
    assert build(project(root, *cameras)).n_built == 0
    assert {f: b for f, b in fact_files(project(root)).items() if "camera_days" not in f} == {
        f: b for f, b in before.items() if "camera_days" not in f
    }


def test_camera_that_sees_the_same_floor_changes_owners_and_says_views(root: Path, tmp_path: Path) -> None:
    near = replace(camera("near", scaled(0.005, shift_m=2.0)), name="Near")
    result, hours, _ = changed(project(root, camera("cam", OLD), camera("side", SIDE), near), tmp_path)
    assert dict(result.reasons) == {"views changed": len(HOURS)}
    assert hours == set(HOURS)


def test_camera_on_another_floor_says_cameras(root: Path, tmp_path: Path) -> None:
    moved = project(root, camera("cam", OLD), camera("side", SIDE, floor="upper"))
    (root / "store" / "floors.json").unlink()  # else the past would go to the other floor, which is refused
    result, _, _ = changed(moved, tmp_path)
    assert dict(result.reasons) == {"cameras changed": len(HOURS)}


@pytest.mark.parametrize(
    ("record", "kept", "stale"),
    [
        (Person(T0 + HOUR // 2, "late", camera="cam", u=10.0, v=10.0), {"sequence_runs"}, (0,)),
        (Frame(T0 + HOUR // 2 + 1, "cam", seq=10_000), {"calibrations_used"}, (0,)),
        (Person(T0 + 299_999, "late", camera="cam", u=10.0, v=10.0), {"sequence_runs"}, (-1, 0)),
        (Person(T0 + 300_000, "late", camera="cam", u=10.0, v=10.0), {"sequence_runs"}, (0,)),
        (Person(T0 + HOUR - 300_000, "late", camera="cam", u=10.0, v=10.0), {"sequence_runs"}, (0, 1)),
        (Person(T0 + HOUR - 300_001, "late", camera="cam", u=10.0, v=10.0), {"sequence_runs"}, (0,)),
    ],
    ids=["a person", "a heartbeat", "near the hour before", "not near", "near the hour after", "not near that"],
)
def test_late_record_recomputes_its_hour_and_one_beside_it_if_that_is_near(
    root: Path, tmp_path: Path, record: Person | Frame, kept: set[str], stale: tuple[int, ...]
) -> None:
    """Five minutes: `sequence_runs` looks back so far, and all other gaps of these cameras are shorter."""
    put(project(root), [record])
    result, hours, facts = changed(project(root), tmp_path)
    assert hours == {T0 // HOUR + k for k in stale}
    assert dict(result.reasons) == {"late data": len(stale)}
    assert result.facts == Counter(dict.fromkeys(set(FACTS_WITHOUT_AREAS) - kept, len(stale)))
    assert facts == result.facts, "a fact that was computed again notes what it was computed from"


def test_changed_setting_recomputes_the_facts_that_use_it(root: Path, tmp_path: Path) -> None:
    result, hours, facts = changed(project(root, distance_m=1.5), tmp_path)
    assert hours == set(HOURS)
    assert dict(result.reasons) == {"settings changed": len(HOURS)}
    assert set(facts) == {
        "floor_cells",
        "violation_time",
        "episode_segments",
        "track_pairs",
        "crowding",
        "same_pairs",
        *CLUSTERS,
    }
    assert result.facts == facts


def test_the_rule_for_groups_concerns_only_facts_of_groups(root: Path, tmp_path: Path) -> None:
    result, _, facts = changed(project(root, together_m=0.5), tmp_path)
    of_groups = {"track_pairs", "standing_groups", "company_times"}
    assert set(result.facts) == of_groups
    assert set(facts) <= of_groups


@pytest.fixture
def sql(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str, str, str], None]]:
    """Return what edits an SQL file for the time of a test."""
    folder = tmp_path / "shipped" / "sql"
    shutil.copytree(shipped("sql"), folder)

    def edit(name: str, old: str, new: str) -> None:
        text = (folder / name).read_text(encoding="utf-8")
        assert old in text
        (folder / name).write_text(text.replace(old, new), encoding="utf-8")
        monkeypatch.setattr(sqlfiles, "shipped", lambda _: folder)
        relations.cache_clear()

    yield edit
    monkeypatch.undo()
    relations.cache_clear()


@pytest.mark.parametrize(
    ("name", "old", "new", "expected"),
    [
        ("facts/exposure.sql", "count(*) filter (where x_mm", "0 + count(*) filter (where x_mm", {"exposure"}),
        (
            "staging/pairs.sql",
            "having count(*) > 40",
            "having count(*) > 41",
            {
                "violation_time",
                "episode_segments",
                "floor_cells",
                "track_pairs",
                "crowding",
                "standing_groups",
                *OF_PAIRS,
            },
        ),
        (
            "staging/located.sql",
            "left join cameras on p.camera_id = cameras.camera_id",
            "left join cameras on cameras.camera_id = p.camera_id",
            {
                "exposure",
                "violation_time",
                "episode_segments",
                "floor_cells",
                "cell_tracks",
                "track_lives",
                "track_pairs",
                "crowding",
                "standing_groups",
                *OF_PAIRS,
            },
        ),
    ],
    ids=["a fact nothing reads", "what is near", "where people are"],
)
def test_changed_sql_file_recomputes_what_reads_it(
    root: Path, tmp_path: Path, sql: Callable[[str, str, str], None], name: str, old: str, new: str, expected: set[str]
) -> None:
    sql(name, old, new)
    result, hours, facts = changed(project(root), tmp_path)
    assert hours == set(HOURS)
    assert dict(result.reasons) == {"SQL changed": len(HOURS)}
    assert set(facts) == expected
    assert result.facts == facts


def test_comment_in_an_sql_file_changes_nothing(root: Path, sql: Callable[[str, str, str], None]) -> None:
    sql("staging/pairs.sql", "-- One row per unordered pair", "-- One row for each unordered pair")
    assert build(project(root)).n_built == 0


def test_new_fact_is_computed_beside_the_others(
    root: Path, tmp_path: Path, sql: Callable[[str, str, str], None]
) -> None:
    """As after an upgrade: one more relation does not make the others again."""
    sql("facts/exposure.sql", "name: facts/exposure", "name: facts/exposure")  # nothing yet
    exposure = (tmp_path / "shipped/sql/facts/exposure.sql").read_text(encoding="utf-8")
    added = exposure.replace("facts/exposure", "facts/presence")
    (tmp_path / "shipped/sql/facts/presence.sql").write_text(added, encoding="utf-8")
    relations.cache_clear()
    result = build(project(root))
    assert dict(result.reasons) == {"incomplete": len(HOURS)}
    assert result.facts == {"presence": len(HOURS)}


def test_facts_of_a_whole_project_are_exactly_what_changes_asked_for(root: Path, tmp_path: Path) -> None:
    """One change after the other, each over the last: the files are always those a first build would make."""
    site = project(root)
    steps: list[tuple[Site, list[Person | Frame]]] = [
        (project(root, camera("cam", OLD, scaled(0.015, since_ms=CHANGE_MS)), camera("side", SIDE)), []),
        (project(root, distance_m=1.0), [Person(T0 + 2 * HOUR, "late", camera="side", u=300.0, v=200.0)]),
        (project(root, camera("cam", OLD), camera("side", SIDE, scaled(0.02, since_ms=T0 + 3 * HOUR))), []),
        (site, [Frame(T0 + DAY, "cam")]),
    ]
    for step, (changed_site, late) in enumerate(steps):
        if late:
            put(changed_site, late)
        build(changed_site)
        assert fact_files(changed_site) == fact_files(rebuilt(changed_site, tmp_path / f"again-{step}"))
