"""`vsd verify` finds every damage there is, and none where there is none."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from datetime import UTC, date, datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from site_text import site_text
from stored_rows import HOUR, NINE, frame, pair, person, table

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.retention.purge import Terms, purge_older
from vsd_analytics.schema import KEYS, SCHEMAS, TABLES, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store import durable
from vsd_analytics.store.part_files import part_bytes
from vsd_analytics.store.store import Store
from vsd_analytics.store.verify_files import Check, all_parts, check_parts, check_spool, newest_parts
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.verify_facts import Verification, verify

CONFIG = site_text(timezone="UTC", more="hz = 1\n")
DEAD = 4_194_999  # beyond the greatest process number of Linux


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a project with three tables over three hours, late data, a spool, and fresh facts."""
    root = tmp_path_factory.mktemp("whole")
    (root / "vsd.toml").write_text(CONFIG)
    store = Store(root / "store", site_id="shop")
    for late in (0, 7):
        for k in range(3):
            ts = NINE + k * HOUR + late
            store.append("frames", table("frames", [frame(ts + 1000 * i) for i in range(40)]))
            people = [person(ts + 1000 * i, t, 100 * i, index=i % 2) for i in range(40) for t in ("a", "b", None)]
            store.append("observations", table("observations", people))
            store.append("pairs", table("pairs", [pair(ts + 1000 * i, mm=1500 + i) for i in range(40)]))
        store.fold()
    build(load_site(root))
    store.append("frames", table("frames", [frame(NINE + 5 * HOUR)]))
    return root


@pytest.fixture
def project(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "project"))


def site(root: Path) -> Site:
    return load_site(root)


def found(result: Verification) -> dict[str, list[str]]:
    """Return the names of the damaged files by check."""
    return {c.name: [f.path.name for f in c.damages] for c in result.checks if c.damages}


def check(result: Verification, name: str) -> Check:
    return next(c for c in result.checks if c.name == name)


def a_part(root: Path, name: TableName = "observations", at: int = 0) -> Path:
    return Store(root / "store", site_id="shop").parts(name)[at].path


def put_part(root: Path, name: TableName, rows: pa.Table, *, hour: int = 9) -> Path:
    """Put a part whose hash is right, as a faulty program would."""
    data = part_bytes(name, rows, [])
    folder = root / "store" / name / "site=shop" / "date=2026-11-09"
    path = folder / f"{hour:02d}-{durable.digest(data)}.parquet"
    durable.publish(path, data)
    return path


def flipped(data: bytes, bit: int) -> bytes:
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def test_a_whole_store_is_whole_and_everything_was_looked_at(project: Path) -> None:
    result = verify(site(project))
    assert (result.is_whole, result.notes) == (True, ())
    looked = {c.name: c.n for c in result.checks}
    assert looked["parts"] == looked["columns"] == 18
    assert looked["hours"] == looked["order"] == looked["keys"] == 2 * 3 * (40 + 120 + 40)
    assert looked["spool"] == 1
    assert looked["facts"] == looked["fact names"] == len(list((project / "facts").rglob("*.parquet"))) >= 20
    assert (result.n_fresh, result.n_stale, result.n_missing) == (3, 0, 0)


def test_verifying_changes_nothing(project: Path) -> None:
    def state() -> dict[str, bytes]:
        return {str(p): p.read_bytes() for p in sorted(project.rglob("*")) if p.is_file() and p.suffix == ".parquet"}

    before = state()
    verify(site(project))
    assert state() == before


def test_an_empty_project_is_whole(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text(CONFIG)
    result = verify(site(tmp_path))
    assert result.is_whole
    assert {c.n for c in result.checks if c.name != "vsd.toml"} == {0}
    assert [p.name for p in tmp_path.iterdir()] == ["vsd.toml"]


@pytest.mark.parametrize("name", TABLES)
def test_one_flipped_bit_anywhere_in_a_part_is_found(project: Path, name: TableName) -> None:
    part = Store(project / "store", site_id="shop").parts(name)[0]
    data = part.path.read_bytes()
    bits = range(0, len(data) * 8, 19)
    missed = []
    for bit in bits:
        part.path.write_bytes(flipped(data, bit))
        (finding,) = check_parts([(name, part)])[0].findings or (None,)
        missed += [] if finding is not None and finding.path == part.path else [bit]
    assert (missed, len(bits) > 300) == ([], True)
    assert found(verify(site(project), with_facts=False)) == {"parts": [part.path.name]}


@pytest.mark.parametrize("keep", [0, 1, 12, 0.5, -1])
def test_a_truncated_part_is_found(project: Path, keep: float) -> None:
    path = a_part(project)
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data)) if isinstance(keep, float) else keep])
    assert found(verify(site(project), with_facts=False)) == {"parts": [path.name]}


def test_one_flipped_bit_in_the_spool_is_found(project: Path) -> None:
    store = Store(project / "store", site_id="shop")
    path = next((project / "store" / "live").rglob("*.arrow"))
    data = path.read_bytes()
    for bit in range(0, len(data) * 8, 29):
        path.write_bytes(flipped(data, bit))
        assert [f.path for f in check_spool(store).findings] == [path], bit
    assert found(verify(site(project), with_facts=False)) == {"spool": [path.name]}


def test_every_flipped_bit_of_a_fact_file_is_found(project: Path) -> None:
    from vsd_analytics.store.own_digest import is_undamaged

    data = min((p.read_bytes() for p in (project / "facts" / "exposure").rglob("*.parquet")), key=len)
    assert is_undamaged(data)
    assert [bit for bit in range(len(data) * 8) if is_undamaged(flipped(data, bit))] == []
    assert [n for n in range(len(data)) if is_undamaged(data[:n])] == []
    assert not is_undamaged(data + b"\0")


def test_a_damaged_fact_file_is_named_and_made_again_once_deleted(project: Path) -> None:
    path = next((project / "facts" / "coverage").rglob("*.parquet"))
    path.write_bytes(flipped(path.read_bytes(), 999))
    result = verify(site(project))
    assert found(result) == {"facts": [path.name]}
    assert "vsd build" in result.damages[0].fix
    path.unlink()
    found_now = verify(site(project))
    assert (found_now.n_fresh, found_now.n_stale, found_now.n_missing) == (0, 0, 3), "the file is of a whole day"
    build(site(project))
    assert verify(site(project)).is_whole


def test_a_fact_file_of_another_fact_under_a_right_name_is_found(project: Path) -> None:
    one, other = (next((project / "facts" / name).rglob("*.parquet")) for name in ("exposure", "coverage"))
    one.write_bytes(other.read_bytes())
    assert found(verify(site(project))) == {"facts": [one.name]}


def test_facts_of_changed_settings_are_stale_which_is_no_damage(project: Path) -> None:
    (project / "vsd.toml").write_text(CONFIG + "[rule]\ncoverage_gap_s = 5\n")
    result = verify(site(project))
    assert (result.is_whole, result.n_fresh, result.n_stale, result.n_missing) == (True, 0, 3, 0)
    shutil.rmtree(project / "facts")
    result = verify(site(project))
    assert (result.is_whole, result.n_fresh, result.n_stale, result.n_missing) == (True, 0, 0, 3)


@pytest.mark.parametrize(("first", "last"), [(8, 9), (10, 11), (24, 48)])
def test_any_range_of_whole_facts_is_whole(project: Path, first: int, last: int) -> None:
    midnight = NINE // HOUR // 24 * 24
    result = verify(site(project), first_hour=midnight + first, last_hour=midnight + last)
    assert result.is_whole
    assert result.n_fresh == len({9, 10, 11} & set(range(first, last + 1)))


def test_a_left_over_beside_fresh_facts_is_noted(project: Path) -> None:
    others = []
    for relation in ("camera_days", "coverage"):
        fact = next((project / "facts" / relation).rglob("*.parquet"))
        others.append(fact.with_name(f"{fact.name[:2]}-0123456789abcdef.parquet"))
        shutil.copy(fact, others[-1])
    result = verify(site(project))
    assert (result.is_whole, sorted(f.path for f in result.notes)) == (True, others)


def test_facts_without_records_are_noted(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in TABLES:
        for part in Store(project / "store", site_id="shop").parts(name):
            part.path.unlink()
    result = verify(site(project))
    assert result.is_whole
    assert {f.path for f in result.notes} == set((project / "facts").rglob("*.parquet"))
    assert verify(site(project), with_facts=False).notes == ()
    assert run(cli, ["-C", str(project), "verify"]) == 0
    told = capsys.readouterr().err
    assert told.count("note[E307]") == 1  # one with a path, the others as a number
    assert f"and {len(result.notes) - 1:,} more files like it" in told


def test_facts_of_purged_hours_must_be_there_as_they_were_sealed(project: Path) -> None:
    terms = Terms(now=datetime(2027, 1, 1, tzinfo=UTC), is_forced=True)
    purge_older(site(project), before=date(2026, 11, 10), terms=terms)
    assert parts_left(project) == 0
    result = verify(site(project))
    assert (found(result), result.n_fresh) == ({}, 0)
    assert check(result, "sealed").n > 15
    fact = next((project / "sealed" / "days" / "coverage").rglob("*.parquet"))
    data = fact.read_bytes()
    fact.write_bytes(flipped(data, 1234))
    assert found(verify(site(project))) == {"sealed": [fact.name]}
    fact.unlink()
    assert found(verify(site(project))) == {"sealed": [fact.name]}
    fact.write_bytes(data)
    (seal,) = (project / "sealed" / "seals").rglob("*.json")
    (junk := seal.with_name("mine.json")).write_bytes(b"{}")
    assert found(verify(site(project))) == {"sealed": [junk.name]}
    junk.unlink()
    whole = seal.read_bytes()
    seal.write_bytes(flipped(whole, len(whole) * 4))
    assert found(verify(site(project))) == {"sealed": [seal.name]}
    seal.write_bytes(whole)
    assert verify(site(project)).is_whole


def parts_left(root: Path) -> int:
    return len(all_parts(Store(root / "store", site_id="shop")))


def test_a_damaged_note_of_a_removal_is_named_and_does_not_keep_the_proof_from_being_made(project: Path) -> None:
    note = project / "store" / "purge" / "0123456789abcdef.json"
    note.parent.mkdir()
    note.write_bytes(b"{}")
    assert found(verify(site(project))) == {"removals": [note.name]}


STRANGERS: dict[str, Callable[[Path], Path]] = {
    "junk among the parts": lambda r: a_part(r).parent / "notes.txt",
    "a copy of a part": lambda r: a_part(r).parent / f"{a_part(r).stem} (copy).parquet",
    "a hidden file": lambda r: a_part(r).parent / ".DS_Store",
    "a part of no hour": lambda r: a_part(r).parent / "24-0123456789abcdef.parquet",
    "a date that is none": lambda r: r / "store/frames/site=shop/date=2026-02-30/09-0123456789abcdef.parquet",
    "another site": lambda r: r / "store/frames/site=else/date=2026-11-09/09-0123456789abcdef.parquet",
    "an unknown table": lambda r: r / "store/people/site=shop/date=2026-11-09/09-0123456789abcdef.parquet",
    "junk in the spool": lambda r: r / "store/live/frames/mine.parquet",
    "a spool of no table": lambda r: r / "store/live/people/0123456789abcdef.parquet",
    "a file beside the tables": lambda r: r / "store/part.parquet",
    "a table in a hidden folder": lambda r: r / "store/.trash/frames/09-0123456789abcdef.parquet",
}  # fmt: skip


def test_foreign_files_are_named(project: Path) -> None:
    paths = [place(project) for place in STRANGERS.values()]
    data = a_part(project).read_bytes()
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    (names, foreign) = next(iter(found(verify(site(project))).items()))
    assert (names, sorted(foreign)) == ("names", sorted(path.name for path in paths))
    for path in paths:
        path.unlink()
    assert verify(site(project)).is_whole


def test_a_foreign_file_among_the_facts_is_named(project: Path) -> None:
    fact = next((project / "facts" / "coverage").rglob("*.parquet"))
    unknown = project / "facts" / "guesses" / "site=shop" / "date=2026-11-09" / fact.name
    unknown.parent.mkdir(parents=True)
    paths = (unknown, fact.with_name("mine.parquet"), project / "facts" / "readme.txt")
    for path in paths:
        path.write_bytes(fact.read_bytes())
    result = check(verify(site(project)), "fact names")
    assert sorted(f.path for f in result.findings) == sorted(paths)


def test_a_folder_with_the_name_of_a_part_is_named(project: Path) -> None:
    path = a_part(project).with_name("09-0123456789abcdef.parquet")
    path.mkdir()
    names = found(verify(site(project), with_facts=False))
    assert names == {"parts": [path.name], "names": [path.name]}


def test_half_written_files_of_the_dead_are_noted_and_those_of_the_living_are_not(project: Path) -> None:
    part = a_part(project)
    dead = part.with_name(f".{part.name}.{DEAD}.tmp")
    dead.write_bytes(b"half")
    with durable.temporary(part):
        result = verify(site(project))
    assert result.is_whole
    assert [f.path for f in result.notes] == [dead]


def test_a_record_twice_in_an_hour_is_found_over_parts_and_within_one(project: Path) -> None:
    again = put_part(project, "observations", table("observations", [person(NINE, "a", 1), person(NINE + 1, "z", 1)]))
    result = verify(site(project), with_facts=False)
    assert set(found(result)) == {"keys"}
    (finding,) = result.damages
    assert "1 records of observations" in finding.why
    assert again.name in {finding.path.name, *re.findall(r"\S+\.parquet", finding.why)}
    again.unlink()
    twice = put_part(project, "frames", table("frames", [frame(NINE + 1, 1), frame(NINE + 1, 2)]))
    result = verify(site(project), with_facts=False)
    assert found(result) == {"keys": [twice.name]}


def test_rows_of_another_hour_and_rows_out_of_order_are_found(project: Path) -> None:
    rows = table("frames", [frame(NINE + 1), frame(NINE - 1)])
    path = put_part(project, "frames", rows)
    result = verify(site(project), with_facts=False)
    assert found(result) == {"hours": [path.name], "order": [path.name]}
    assert "2026-11-09T08:59:59.999Z" in check(result, "hours").findings[0].why


def test_columns_that_are_not_those_of_the_table_are_found(project: Path) -> None:
    rows = pq.ParquetFile(a_part(project, "frames")).read()
    nullable = rows.schema.set(0, rows.schema.field(0).with_nullable(True))
    misfits = {
        "lacks the column ts": rows.drop(["ts"]),
        "int64": rows.set_column(2, "n_persons", rows["n_persons"].cast(pa.int64())),
        "a column 'face'": rows.append_column("face", rows["camera_id"]),
        "camera_id is string": rows.cast(nullable),
    }
    for why, wrong in misfits.items():
        sink = pa.BufferOutputStream()
        pq.write_table(wrong, sink)
        data = sink.getvalue().to_pybytes()
        path = a_part(project).parent.parent.parent.parent / "frames/site=shop/date=2026-11-09"
        path = path / f"20-{durable.digest(data)}.parquet"
        path.write_bytes(data)
        result = verify(site(project), with_facts=False)
        assert found(result) == {"columns": [path.name]}
        assert why in result.damages[0].why
        path.unlink()


def test_a_part_written_before_a_column_existed_is_whole(project: Path) -> None:
    path = a_part(project, "frames")
    rows = pq.ParquetFile(path).read().drop(["seq", "n_pairs"])
    sink = pa.BufferOutputStream()
    pq.write_table(rows, sink)
    data = sink.getvalue().to_pybytes()
    path.unlink()
    path.with_name(f"{path.name[:2]}-{durable.digest(data)}.parquet").write_bytes(data)
    assert verify(site(project), with_facts=False).is_whole


def test_a_range_looks_at_its_hours_alone(project: Path) -> None:
    path = a_part(project, at=-1)
    path.write_bytes(path.read_bytes()[:-1])
    last = NINE // HOUR + 2
    assert verify(site(project), last_hour=last - 1).is_whole
    assert not verify(site(project), first_hour=last, last_hour=last).is_whole


def test_audits_look_for_the_keys_and_the_order_of_the_schema() -> None:
    audits = relations("audits")
    for name in TABLES:
        grouped = audits[f"{name}_twice"].sql.partition("group by")[2].partition("having")[0]
        assert [" ".join(k.split()) for k in grouped.split(",")] == list(KEYS[name])
        ordered = re.search(r"order by([^)]*)\) - 1 as sorted_row\s+from part_" + name, audits["rows_unsorted"].sql)
        assert ordered is not None
        assert [k.strip() for k in ordered[1].rpartition("order by")[2].split(",")] == SCHEMAS[name].names


def test_busy_stores_are_audited_hour_by_hour_with_the_same_result(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_part(project, "frames", table("frames", [frame(NINE + 2 * HOUR)]), hour=11)
    at_once = verify(site(project), with_facts=False)
    monkeypatch.setattr("vsd_analytics.warehouse.audits.BATCH_ROWS", 1)
    assert found(verify(site(project), with_facts=False)) == found(at_once)
    assert set(found(at_once)) == {"keys"}


def test_parts_that_go_away_meanwhile_are_no_damage(project: Path) -> None:
    from vsd_analytics.warehouse.audits import audit_rows

    listed = all_parts(Store(project / "store", site_id="shop"))
    sound = check_parts(listed)[2]
    listed[0][1].path.unlink()
    assert [c.findings for c in check_parts(listed)[:2]] == [(), ()]
    assert [c.findings for c in audit_rows(sound)] == [(), (), ()]


def test_the_newest_parts_are_looked_at_first(project: Path) -> None:
    store = Store(project / "store", site_id="shop")
    assert len(newest_parts(store, n_bytes=10**9)) == 18
    assert [p.hour for _, p in newest_parts(store, n_bytes=1)] == [NINE // HOUR + 2]


def test_the_command_says_what_is_whole_and_what_to_do(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, ["-C", str(project), "verify"]) == 0
    out, err = capsys.readouterr()
    assert out.endswith("the store is whole\n")
    assert err == ""
    path = a_part(project)
    path.write_bytes(flipped(path.read_bytes(), 100))
    assert run(cli, ["-C", str(project), "verify", "--range", "2026-11-09"]) == 1
    out, err = capsys.readouterr()
    assert out.endswith("1 thing needs you\n")
    assert f"damaged[E302]: a file with stored records is damaged\n  --> {path.relative_to(project)}" in err
    assert "  fix: restore it from a backup" in err
    assert run(cli, ["-C", str(project), "verify", "--json", "--no-facts"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["ok"] is False
    assert [(f["check"], f["path"]) for f in told["findings"]] == [("parts", str(path.relative_to(project)))]
    assert told["facts"] == {"fresh": None, "stale": None, "missing": None}
    assert run(cli, ["-C", str(project), "verify", "--range", "2026-11-10"]) == 0


def test_doctor_names_a_damaged_part_of_the_newest(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = a_part(project, "pairs", -1)
    path.write_bytes(flipped(path.read_bytes(), 100))
    run(cli, ["-C", str(project), "doctor"])
    assert path.name in capsys.readouterr().out


def test_doctor_stays_quick_and_says_what_it_looked_at(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vsd_analytics.doctor.checks.QUICK_BYTES", 1)
    path = a_part(project, "frames")
    path.write_bytes(b"")
    run(cli, ["-C", str(project), "doctor"])
    assert "checked the newest 1 of 18 files, vsd verify checks all" in capsys.readouterr().out
    assert found(verify(site(project), with_facts=False)) == {"parts": [path.name]}
