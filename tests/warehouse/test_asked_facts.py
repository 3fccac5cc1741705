"""Only facts that somebody asks for are computed; the others do not look as if they were there, and miss nothing."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.made_up_site import write_site
from warehouse.small_projects import (
    ASKED_FACTS,
    FACTS_WITHOUT_AREAS,
    HOUR,
    T0,
    Frame,
    Person,
    beats,
    fact_files,
    make_site,
    open_days,
    put,
)

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse import warehouse as warehouse_module
from vsd_analytics.warehouse.build import build, build_plan
from vsd_analytics.warehouse.sqlfiles import facts_behind, relations
from vsd_analytics.warehouse.verify_facts import verify

FACTS = sorted(FACTS_WITHOUT_AREAS)
HOURS = 4


def records(seed: int, hours: range = range(HOURS)) -> list[Person | Frame]:
    rng = np.random.default_rng(seed)
    people = [
        Person(T0 + hour * HOUR + s * 1000, f"t{i}", *map(int, rng.integers(-2500, 2500, size=2)))
        for hour in hours
        for s in range(0, 3600, 40)
        for i in range(4)
    ]
    return [*people, *(beat for h in hours for beat in beats(T0 + h * HOUR, T0 + (h + 1) * HOUR, every=5000))]


def folders(site: Site) -> set[str]:
    """Return the facts with a file."""
    root = site.root / "facts"
    return {p.relative_to(root).parts[0] for p in root.rglob("*.parquet")} - {"days", "weeks"}


def whole(site: Site, elsewhere: Path) -> dict[str, bytes]:
    """Return the files of a first build of everything stored."""
    again = make_site(elsewhere, **({"distance_m": site.settings.distance_m}))
    shutil.copytree(site.root / "store", again.root / "store")
    build(again)
    return fact_files(again)


@pytest.mark.parametrize("seed", range(4))
def test_any_order_of_requests_gives_the_bytes_of_a_whole_build(tmp_path: Path, seed: int) -> None:
    """Random facts of random hours, between them late records and other settings."""
    rng, root = np.random.default_rng(seed), tmp_path / "site"
    site = make_site(root)
    put(site, records(seed))
    for step in range(6):
        if step % 3 == 2:
            put(site, [Person(T0 + int(rng.integers(0, HOURS * HOUR)), "late", int(rng.integers(-500, 500)), 0)])
        if step % 4 == 3:
            site = make_site(root, distance_m=float(rng.choice([1.0, 1.5, 2.0])))
        asked = set(rng.choice(FACTS, size=int(rng.integers(0, 5)), replace=False))
        first = T0 // HOUR + int(rng.integers(0, HOURS))
        build(site, first_hour=first, last_hour=first, facts=asked)
        expected, found = whole(site, tmp_path / f"whole-{step}"), fact_files(site)
        assert {name for name in expected if name.split("/")[0] in asked} <= found.keys()
        assert {n: b for n, b in found.items() if n in expected} == {n: expected[n] for n in expected.keys() & found}
        of_asked = {name for name in found if name.split("/")[0] in asked}
        assert of_asked <= expected.keys(), "what is out of date of these is removed"
    build(site)
    assert fact_files(site) == whole(site, tmp_path / "whole")
    assert build(site).n_built == 0


def test_facts_that_nobody_asked_for_do_not_look_present(tmp_path: Path) -> None:
    site = make_site(tmp_path / "site")
    put(site, records(1))
    with open_days(site, relations=("heatmap",)) as warehouse:
        assert warehouse.rows("select sum(person_records) as n from heatmap")[0]["n"] == HOURS * 360
    assert folders(site) == {"camera_days", "floor_cells"}
    plan = build_plan(site)
    assert (len(plan.fresh), len(plan.stale), len(plan.missing)) == (0, 0, HOURS)
    checked = verify(site)
    assert (checked.n_fresh, checked.n_stale, checked.n_missing) == (0, 0, HOURS)
    assert checked.is_whole
    result = build(site)
    assert dict(result.reasons) == {"incomplete": HOURS}
    assert result.facts == dict.fromkeys(set(FACTS) - {"floor_cells"}, HOURS)


def test_a_relation_that_was_not_announced_has_its_rows_all_the_same(tmp_path: Path) -> None:
    site, other = make_site(tmp_path / "site"), make_site(tmp_path / "other")
    for each in (site, other):
        put(each, records(2))
    query = "select * from company_hours order by all"
    with open_days(site, relations=("heatmap",)) as warehouse, open_days(other) as expected:
        warehouse.rows("select * from heatmap")
        assert warehouse.rows(query) == expected.rows(query)
        assert warehouse.rows("select * from pairs order by all") == expected.rows("select * from pairs order by all")
    assert folders(site) == {"camera_days", *FACTS}


def test_files_of_facts_that_nobody_asked_for_stay_and_are_used_again(tmp_path: Path) -> None:
    site = make_site(tmp_path / "site")
    put(site, records(3))
    build(site)
    before = fact_files(site)
    put(site, [Person(T0 + HOUR // 2, "late", 0, 0)])
    result = build(site, facts=("exposure",))
    assert (dict(result.reasons), dict(result.facts)) == ({"late data": 1}, {"exposure": 1})
    now = fact_files(site)
    assert {n for n in before.keys() - now.keys() if not n.startswith("camera_days")} == {
        n for n in before if n.startswith("exposure/")
    }
    assert build_plan(site).stale == {T0 // HOUR}
    assert set(build(site).facts.values()) == {1}, "one hour of each: the others are taken from the older files"
    assert fact_files(site) == whole(site, tmp_path / "whole")


def test_a_torn_file_of_an_asked_fact_is_made_again_alone(tmp_path: Path) -> None:
    site = make_site(tmp_path / "site")
    put(site, records(4))
    build(site, facts=("floor_cells",))
    (path,) = (site.root / "facts" / "floor_cells").rglob("*.parquet")
    whole_file = path.read_bytes()
    with open_days(site, relations=("heatmap",)) as warehouse:
        path.write_bytes(whole_file[:-20])
        warehouse.rows("select * from heatmap")
    assert path.read_bytes() == whole_file
    assert folders(site) == {"camera_days", "floor_cells"}


def test_facts_behind_a_mart_are_those_whose_files_are_read() -> None:
    assert facts_behind(["heatmap"]) == {"floor_cells"}
    assert facts_behind(["outages", "exposure"]) == {"recorded_spans", "exposure"}
    assert facts_behind(["calendar", "camera_days"]) == set()
    assert facts_behind([*relations("facts", "marts")]) == {*FACTS, *ASKED_FACTS}


COMMANDS = {
    "heatmap": ["heatmap"],
    "heatmap --at person": ["heatmap"],
    "hours": ["hours"],
    "hours --by camera": ["camera_hours"],
    "hours --by area": ["camera_hours", "area_hours"],
    "coverage": ["hours", "outages", "message_gaps"],
    "today --json": ["camera_slots", "track_hours"],
    "sql": ["exposure"],
}


@pytest.fixture(scope="module")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return write_site(tmp_path_factory.mktemp("made-up"), n_records=1_000, n_cameras=2, open_h=1)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_computes_the_facts_it_reads_and_no_others(
    made_up: Site, tmp_path: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = replace(made_up, root=Path(shutil.copytree(made_up.root, tmp_path, dirs_exist_ok=True)))
    n_builds = 0

    def counted(*args: object, **options: object) -> object:
        nonlocal n_builds
        n_builds += 1
        return build(*args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(warehouse_module, "build", counted)
    words = [command, "select sum(exposure_ms) from internal.exposure"] if command == "sql" else command.split()
    now = ["--now", "2026-11-09T18:00+00:00"]
    assert run(cli, ["--quiet", *now, "-C", str(tmp_path), *words]) in (0, 1)
    assert folders(site) - {"camera_days"} == facts_behind(COMMANDS[command])
    assert n_builds <= 2, "the range, and the days whose files of marts are missing"
