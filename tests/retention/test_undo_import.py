"""`vsd imports` and `vsd purge --import`: what one file alone brought goes, what others brought as well stays."""

from __future__ import annotations

import json
import random
import shutil
from pathlib import Path
from typing import Any

import pytest
from aged_projects import DAYS, TERMS, day, make_project, messages, vsd, write
from purge_crashes import Crash, watched
from store.stored_rows import litter_of

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.retention.purge import purge_older, purge_range
from vsd_analytics.retention.purge_import import purge_import
from vsd_analytics.schema import TABLES
from vsd_analytics.store.imports import holdings, imports_of
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.part_files import read_owned
from vsd_analytics.store.store import Store

CAMERAS = ("cam-1", "cam-2")


def rows_of(root: Path, *, with_owner: bool = True) -> dict[str, list[str]]:
    """Return every stored record, with the import it belongs to."""
    store = Store(root / "store", site_id="shop")
    found = {}
    for table in TABLES:
        rows = [row for part in store.parts(table) for row in read_owned(part.path, table).to_pylist()]
        found[table] = sorted(str(row if with_owner else {k: v for k, v in row.items() if k != OWNER}) for row in rows)
    return found


def put(root: Path, *files: Path) -> list[str]:
    """Import files with one command; return the ids of the imports."""
    found = ingest(load_site(root), files, IngestOptions(), now=TERMS.now)
    assert all(s.error is None for s in found.sources)
    return [s.import_id for s in found.sources]


def taken_back(root: Path, import_id: str) -> None:
    purge_import(load_site(root), import_id, terms=TERMS)


def some_frames(seed: int) -> list[dict[str, Any]]:
    """Return frame messages of a few seconds of two hours: most come with other seeds too, a few with other places."""
    draw = random.Random(seed)
    found = []
    for k in range(24):
        if draw.random() < 0.3:
            continue
        persons = []
        for person in range(3):
            if draw.random() < 0.7:
                has_id = person < 2
                place = {"x_m": person + draw.choice([0.0, 0.0, 0.5]), "y_m": k / 10}
                persons.append({**({"id": f"p{person}"} if has_id else {}), **place})
        pairs = [{"a": 0, "b": 1, "d_m": draw.choice([1.0, 1.2])}] if len(persons) > 1 else []
        ts = f"{DAYS[0]}T{9 + k // 12:02d}:00:{k % 12:02d}Z"
        found.append(
            {"v": 1, "camera": CAMERAS[k % 2], "ts": ts, "engine": "acme 2.1", "persons": persons, "pairs": pairs}
        )
    return found


def files_of(folder: Path, seed: int) -> dict[str, Path]:
    return {name: write(folder / f"{name}.jsonl", some_frames(10 * seed + i)) for i, name in enumerate("ABC")}


@pytest.mark.parametrize("seed", range(4))
def test_after_taking_one_import_back_the_store_is_that_of_the_others_alone(tmp_path: Path, seed: int) -> None:
    """Files that overlap and contradict each other come in any order, some twice, by one command or by several."""
    draw = random.Random(seed)
    files = files_of(tmp_path, seed)
    order = [*"ABC", draw.choice("ABC"), draw.choice("ABC")]
    draw.shuffle(order)
    commands: list[list[str]] = []
    for name in order:
        if commands and draw.random() < 0.4 and name not in commands[-1]:
            commands[-1].append(name)
        else:
            commands.append([name])
    root = make_project(tmp_path / "all")
    ids: dict[str, str] = {}
    for command in commands:
        ids.update(zip(command, put(root, *(files[n] for n in command)), strict=True))
    for n_gone, gone in enumerate(draw.sample("ABC", 3), start=1):
        taken_back(root, ids.pop(gone))
        others = make_project(tmp_path / f"others-{n_gone}")
        for command in commands:
            if left := [n for n in command if n in ids]:
                put(others, *(files[n] for n in left))
        assert rows_of(root) == rows_of(others), (seed, commands, gone)
    assert not any(rows_of(root).values())
    assert list((root / "store" / "again").rglob("*.parquet")) == []
    assert litter_of(root) == []


def test_import_that_comes_again_after_it_was_taken_back_is_as_new(tmp_path: Path) -> None:
    files = files_of(tmp_path, 1)
    root, fresh = make_project(tmp_path / "p"), make_project(tmp_path / "fresh")
    (a,), _ = put(root, files["A"]), put(root, files["B"])
    taken_back(root, a)
    assert put(root, files["A"]) == [a]
    put(fresh, files["B"])
    put(fresh, files["A"])
    assert rows_of(root) == rows_of(fresh)
    assert list(imports_of(root / "store")) == list(imports_of(fresh / "store"))


def test_same_file_read_in_another_way_is_another_import(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    table = tmp_path / "t.csv"
    table.write_text(
        "ts,camera_id,track_id,x,y\n"
        + "".join(f"{DAYS[0]}T09:00:{k:02d}Z,cam-1,7,{1000 + 10 * k},2000\n" for k in range(30)),
        encoding="utf-8",
    )
    how = ("--format", "positions", "--map", "x_m=x,y_m=y")
    vsd(root, "ingest", str(table), *how, "--yes", code=1)
    vsd(root, "ingest", str(table), *how, "--unit", "mm", code=2)
    vsd(root, "ingest", str(table), *how, "--unit", "mm", "--yes", code=1)
    wrong, right = json.loads(vsd(root, "imports", "--json"))["imports"]
    assert wrong["id"] != right["id"]
    assert (wrong["records"]["observations"], right["belonging_to_others"]) == (30, 30)
    said = vsd(root, "purge", "--import", wrong["id"][:8], "--force")
    assert "30 records of it came from elsewhere too: not removed" in said
    assert "'x_mm': 1290," in str(rows_of(root)["observations"])  # millimetres: the first import had 1,290 metres


def test_list_says_when_what_and_of_which_days_and_cameras(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    first = write(tmp_path / "first.jsonl", messages(camera="cam-1", day=DAYS[0], hours=(9,)))
    both = write(tmp_path / "both.jsonl", messages(camera="cam-2", day=DAYS[1], hours=(9, 23)))
    vsd(root, "ingest", str(first))
    vsd(root, "ingest", str(both), str(first))
    one, two = json.loads(vsd(root, "imports", "--json"))["imports"]
    assert (one["source"], one["format"], one["cameras"]) == (str(first), "frames", ["cam-1"])
    assert one["days"] == [DAYS[0]]
    assert one["records"] == {"frames": 90, "observations": 120}
    assert one["at"].startswith("2026-12-20T12:00:00")
    assert two["days"] == [DAYS[1], DAYS[2]]  # 23 UTC is the next day in Rome
    shown = vsd(root, "imports").splitlines()
    assert shown[0] == f"{one['id'][:8]}  2026-12-20 13:00  {first}  [frames]  210 records; {DAYS[0]}; cam-1"


def test_dry_run_removes_nothing_and_says_what_would_go(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    a, b = put(root, *files_of(tmp_path, 2).values())[:2]
    before = rows_of(root)
    told = json.loads(vsd(root, "purge", "--import", a, "--dry-run", "--json"))["import"]
    assert rows_of(root) == before
    done = json.loads(vsd(root, "purge", "--import", a, "--force", "--json"))["import"]
    assert done == told
    n_before, n_after = (sum(map(len, rows.values())) for rows in (before, rows_of(root)))
    assert n_before - n_after == sum(done["records"].values()) > 0
    assert done["staying"] > 0
    entry = json.loads((root / "purge.jsonl").read_text().splitlines()[-1])
    assert entry["import_id"] == a
    assert entry["source"] == str(tmp_path / "A.jsonl")
    assert b in vsd(root, "imports", "--json")


def test_more_than_half_of_the_store_needs_force(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    file = write(tmp_path / "f.jsonl", messages(camera="cam-1", day=DAYS[0]))
    vsd(root, "ingest", str(file))
    (only,) = holdings(Store(root / "store", site_id="shop"))
    with pytest.raises(StoreError, match="1,050 of 1,050 stored records would be removed"):
        vsd(root, "purge", "--import", only)
    assert "450 frames removed" in vsd(root, "purge", "--import", only, "--force")
    assert vsd(root, "imports") == ""
    assert "taken back" in vsd(root, "imports", "--all")


@pytest.mark.parametrize("given", ["abc", "ffffffff", "../../etc", ""])
def test_unknown_or_too_short_ids_are_refused(tmp_path: Path, given: str) -> None:
    root = make_project(tmp_path / "p")
    vsd(root, "ingest", str(write(tmp_path / "f.jsonl", messages(camera="cam-1", day=DAYS[0]))))
    with pytest.raises(UsageError, match="import"):
        purge_import(load_site(root), given, terms=TERMS)


def test_facts_follow(tmp_path: Path) -> None:
    """Hours after a taken back import are those of a project that never saw it, though facts were computed before."""
    right = write(tmp_path / "right.jsonl", messages(camera="cam-1", day=DAYS[0], hours=(9, 10)))
    wrong = write(tmp_path / "wrong.jsonl", messages(camera="cam-2", day=DAYS[0], hours=(9, 11), shift_m=15.0))
    root, never = make_project(tmp_path / "p"), make_project(tmp_path / "never")
    vsd(root, "ingest", str(right), str(wrong))
    vsd(never, "ingest", str(right))
    asked = ("hours", "--range", DAYS[0], "--json")
    assert vsd(root, *asked) != vsd(never, *asked)
    wrong_id = json.loads(vsd(root, "imports", "--json"))["imports"][1]["id"]
    vsd(root, "purge", "--import", wrong_id)
    assert vsd(root, *asked) == vsd(never, *asked)
    assert "the store is whole" in vsd(root, "verify")


def test_quarantined_records_of_the_import_go_and_others_stay(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    good = messages(camera="cam-1", day=DAYS[0])
    one = write(tmp_path / "one.jsonl", [*good, *messages(camera="yard", day=DAYS[0], hours=(9,))])
    two = write(tmp_path / "two.jsonl", messages(camera="attic", day=DAYS[1], hours=(9,)))
    vsd(root, "ingest", str(one), str(two), code=1)
    vsd(root, "purge", "--import", next(iter(imports_of(root / "store"))), "--force")
    listed = vsd(root, "quarantine", "list", code=1)
    assert "two.jsonl" in listed
    assert "one.jsonl" not in listed


def test_records_replayed_from_quarantine_belong_to_their_import(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    vsd(root, "ingest", str(write(tmp_path / "f.jsonl", messages(camera="yard", day=DAYS[0], hours=(9,)))), code=1)
    toml = (root / "vsd.toml").read_text().replace('name = "Stairs"', 'name = "Stairs"\nengine_ids = ["yard"]')
    (root / "vsd.toml").write_text(toml)
    vsd(root, "quarantine", "replay")
    assert len(rows_of(root)["observations"]) == 120
    vsd(root, "purge", "--import", next(iter(imports_of(root / "store"))), "--force")
    assert not any(rows_of(root).values())


def test_record_that_a_broker_sent_as_well_stays(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    files = files_of(tmp_path, 3)
    (a,) = put(root, files["A"])
    live, copy = Store(root / "store", site_id="shop"), make_project(tmp_path / "copy")
    put(copy, files["B"])
    for table in reversed(TABLES):
        for part in Store(copy / "store", site_id="shop").parts(table):
            live.append(table, read_owned(part.path, table).drop_columns([OWNER]))
    live.fold()
    taken_back(root, a)
    assert rows_of(root, with_owner=False) == rows_of(copy, with_owner=False)


def test_purges_by_range_and_by_age_reach_the_noted_repeats(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    put(root, *files_of(tmp_path, 4).values())
    again = root / "store" / "again"
    assert list(again.rglob("*.parquet"))
    aged = Path(shutil.copytree(root, tmp_path / "aged"))
    first_ms = (day(DAYS[0]).toordinal() - day("1970-01-01").toordinal()) * 86_400_000
    purge_range(load_site(root), camera_id="cam-1", first_ms=first_ms, after_ms=first_ms + 86_400_000, terms=TERMS)
    left = [row for p in again.rglob("*.parquet") for row in read_owned(p, p.parents[2].name).to_pylist()]
    assert {row["camera_id"] for row in left} == {"cam-2"}
    purge_older(load_site(aged), before=day(DAYS[1]), terms=TERMS)
    assert not list((aged / "store" / "again").rglob("*.parquet"))


def test_import_with_sealed_hours_is_refused_until_their_sums_are_removed(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    found = [*messages(camera="cam-1", day=DAYS[0], hours=(9,)), *messages(camera="cam-1", day=DAYS[2], hours=(9,))]
    other = messages(camera="cam-2", day=DAYS[2])
    a, _ = put(root, write(tmp_path / "a.jsonl", found), write(tmp_path / "b.jsonl", other))
    purge_older(load_site(root), before=day(DAYS[1]), terms=TERMS)
    with pytest.raises(StoreError, match="1 of its hours is sealed") as error:
        taken_back(root, a)
    assert error.value.code == "E314"
    assert "--range 2026-11-09T09:00Z..2026-11-09T10:00Z" in str(error.value.fix)
    vsd(root, "purge", "--camera", "cam-1", "--range", "2026-11-09T09:00Z..2026-11-09T10:00Z", "--force")
    taken_back(root, a)
    assert {r.split("'camera_id': '")[1][:5] for r in rows_of(root)["frames"]} == {"cam-2"}


@pytest.mark.parametrize("seed", [5])
def test_crash_anywhere_and_the_same_command_again_is_the_same_end(tmp_path: Path, seed: int) -> None:
    start = make_project(tmp_path / "start")
    a = put(start, *files_of(tmp_path, seed).values())[0]
    unharmed = Path(shutil.copytree(start, tmp_path / "unharmed"))
    with watched(None) as calls:
        taken_back(unharmed, a)
    expected = rows_of(unharmed)
    for at in range(len(calls)):
        root = Path(shutil.copytree(start, tmp_path / f"crash-{at}"))
        with watched(at), pytest.raises(Crash):
            taken_back(root, a)
        taken_back(root, a)
        assert rows_of(root) == expected, at
        assert [p.name for p in (root / "store" / "again").rglob("*.parquet")] == [
            p.name for p in (unharmed / "store" / "again").rglob("*.parquet")
        ], at
        assert litter_of(root) == []
