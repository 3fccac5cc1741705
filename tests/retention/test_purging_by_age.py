"""Purge by age: records go, figures stay to the byte, and nothing of those hours is accepted any more."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from aged_projects import (
    DAYS,
    NOW,
    TERMS,
    as_an_older_version_sealed,
    audit,
    day,
    litter,
    make_project,
    messages,
    seals_of,
    vsd,
    write,
)

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.figures.week.stored_records import StoredRecords, stored_records
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.live.watch import watch
from vsd_analytics.retention.purge import Terms, purge_older
from vsd_analytics.warehouse import sqlfiles, warehouse
from vsd_analytics.warehouse.build import build

ALL = f"{DAYS[0]}..{DAYS[2]}"


def without_stored(twin: str) -> str:
    """Return a report's JSON without its sentence on what is stored, which a purge is meant to change."""
    return json.dumps({k: v for k, v in json.loads(twin).items() if k != "stored"})


def counts(root: Path) -> dict[str, str]:
    """Return what three commands count, to the byte."""
    return {
        "hours": vsd(root, "hours", "--range", ALL, "--json"),
        "cameras": vsd(root, "hours", "--range", ALL, "--by", "camera", "--json"),
        "heatmap": vsd(root, "heatmap", "--range", ALL, "--cell", "0.25", "--json"),
    }


def figures(root: Path) -> dict[str, str]:
    """Return what the figures print, to the byte."""
    found = {
        **counts(root),
        "coverage": vsd(root, "coverage", "--range", ALL, "--json"),
    }
    out = root.parent / f"{root.name}-report"
    vsd(root, "report", "--week", "2026-W46", "--format", "json", "--out", str(out))
    found["report"] = without_stored(next(out.rglob("*.json")).read_text(encoding="utf-8"))
    shutil.rmtree(out)
    return found


def raw_days(root: Path) -> set[str]:
    return {p.parent.name for p in (root / "store").glob("*/site=shop/date=*/*.parquet")}


def test_records_go_and_every_figure_stays_to_the_byte(project: Path) -> None:
    before = figures(project)
    vsd(project, "purge", "--older-than", DAYS[2], "--force")
    assert raw_days(project) == {f"date={DAYS[2]}"}
    assert figures(project) == before
    assert not (project / "facts" / "days").exists()  # no day has many small files
    shutil.rmtree(project / "facts")  # what can be made again is made again; what is sealed does not stand there
    assert counts(project).items() <= before.items()
    assert litter(project) == []


def test_a_purge_leaves_the_marts_whose_rows_stay(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = figures(project)
    weeks = {p: p.read_bytes() for p in (project / "facts" / "weeks").rglob("*.parquet")}
    monkeypatch.setattr(warehouse.Warehouse, "_rows_of_days", lambda *_: pytest.fail("a mart is computed"))
    for cut in DAYS[1:]:
        vsd(project, "purge", "--older-than", cut, "--force")
        assert figures(project) == before
    assert {p: p.read_bytes() for p in weeks} == weeks


def test_marts_that_do_not_follow_from_sealed_facts_go_with_the_records(project: Path) -> None:
    """Those of other settings, and those that were stale."""
    figures(project)
    toml = (project / "vsd.toml").read_text()
    (project / "vsd.toml").write_text(toml + "[rule]\npair_max_m = 3.0\n")
    vsd(project, "purge", "--older-than", DAYS[2], "--force")
    names = {p.parents[2].name for p in (project / "facts" / "weeks").rglob("*.parquet")}
    assert "camera_hours" not in names
    (project / "vsd.toml").write_text(toml)


def test_purging_day_by_day_gives_what_purging_at_once_gives(project: Path) -> None:
    before = figures(project)
    for cut in DAYS[1:]:
        vsd(project, "purge", "--older-than", cut, "--force")
        assert figures(project) == before
    vsd(project, "purge", "--older-than", "2026-11-12", "--force")
    assert raw_days(project) == set()
    assert figures(project) == before
    assert [e["utc_days"][0] for e in audit(project)] == list(DAYS)


def test_a_day_whose_only_hour_was_sealed_before_is_sealed_whole(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    hours = {DAYS[0]: (9, 23), DAYS[1]: (0,), DAYS[2]: (9,)}
    found = [m for d, some in hours.items() for m in messages(camera="cam-1", day=d, hours=some)]
    vsd(root, "ingest", str(write(root / "f.jsonl", found)))
    before = vsd(root, "hours", "--range", ALL, "--by", "camera", "--json")
    for cut in DAYS[1:]:
        vsd(root, "purge", "--older-than", cut, "--force")
        assert vsd(root, "hours", "--range", ALL, "--by", "camera", "--json") == before
    assert raw_days(root) == {f"date={DAYS[2]}"}
    assert litter(root) == []


def test_the_audit_line_says_what_when_and_why(purged: Path) -> None:
    (entry,) = audit(purged)
    assert entry["at"] == NOW.isoformat(timespec="seconds")
    assert entry["records"] == {"frames": 1800, "observations": 2400, "pairs": 0}
    assert (entry["older_than"], entry["utc_days"], entry["reason"]) == (DAYS[2], [DAYS[0], DAYS[1]], "retention")


def test_where_single_people_were_is_not_stored(purged: Path) -> None:
    facts = {p.parents[2].name for p in (purged / "sealed").rglob("*.parquet")}
    assert "exposure" in facts
    assert "pairs" not in facts
    computed = {p.parent.name for p in (purged / "facts").rglob("*.parquet")}
    assert computed == {f"date={DAYS[2]}"}


def test_the_first_hour_that_stays_is_sealed_with_its_records(purged: Path) -> None:
    """Its facts were computed from the hour before as well, which is gone."""
    seal = seals_of(purged).read(day_number(DAYS[2]))
    assert seal is not None
    assert (seal.is_whole, sorted(seal.hours)) == (False, [day_number(DAYS[2]) * 24])
    assert list((purged / "store" / "observations" / "site=shop" / f"date={DAYS[2]}").glob("00-*.parquet"))
    assert build(load_site(purged)).n_built == 0


def day_number(text: str) -> int:
    return (day(text) - day("1970-01-01")).days


def test_late_records_of_sealed_hours_are_quarantined_and_others_stored(purged: Path) -> None:
    before = counts(purged)
    late = messages(camera="cam-1", day=DAYS[0], hours=(9,), shift_m=0.5)
    quiet = messages(
        camera="cam-1", day=DAYS[1], hours=(15,)
    )  # no record of that hour was ever stored: its day is sealed
    edge = messages(camera="cam-1", day=DAYS[2], hours=(0,), shift_m=0.5)
    good = messages(camera="cam-1", day="2026-11-12", hours=(9,))
    told = json.loads(
        vsd(purged, "ingest", str(write(purged / "late.jsonl", [*late, *quiet, *edge, *good])), "--json", code=1)
    )
    (source,) = told["sources"]
    assert source["quarantined"] == {"sealed-hour": 3 * (90 + 120)}
    assert told["stored"]["frames"] == {"new": 90, "known": 0, "second_sightings": 0, "sealed": 0, "erased": 0}
    assert counts(purged) == before


def test_changed_settings_leave_sealed_figures_and_say_so(purged: Path) -> None:
    before = json.loads(vsd(purged, "hours", "--range", DAYS[0], "--json"))
    with (purged / "vsd.toml").open("a") as file:
        file.write("[rule]\npair_max_m = 3.0\n")
    after = json.loads(vsd(purged, "hours", "--range", DAYS[0], "--json"))
    (note,) = after.pop("notes")
    assert after == before
    assert "settings changed" in note
    assert "purge" in note
    assert "notes" not in json.loads(vsd(purged, "hours", "--range", "2026-11-12", "--json"))
    assert vsd(purged, "coverage", "--range", DAYS[0]), "the warning goes to standard error"
    out = purged / "out"
    vsd(purged, "report", "--week", "2026-W46", "--out", str(out))
    assert "sealed by a purge, and since then: settings changed" in next(out.rglob("*.html")).read_text(
        encoding="utf-8"
    )
    reasons = build(load_site(purged)).reasons
    assert reasons == {}, "hours that have records were computed for the report, sealed ones never"


def test_dry_run_removes_nothing(project: Path) -> None:
    before = sorted(p.relative_to(project) for p in project.rglob("*.parquet"))
    told = json.loads(vsd(project, "purge", "--older-than", DAYS[2], "--dry-run", "--json"))
    assert told["dry_run"]
    assert told["older_than"]["records"] == {"frames": 1800, "observations": 2400, "pairs": 0}
    assert told["older_than"]["sealed_hours"] == 11
    assert sorted(p.relative_to(project) for p in project.rglob("*.parquet")) == before
    assert audit(project) == []


def test_more_than_half_needs_force(project: Path) -> None:
    with pytest.raises(StoreError) as caught:
        vsd(project, "purge", "--older-than", DAYS[2])
    assert caught.value.code == "E310"
    assert len(raw_days(project)) == 3
    vsd(project, "purge", "--older-than", DAYS[1])
    assert len(raw_days(project)) == 2


def test_nothing_to_remove_writes_nothing(purged: Path) -> None:
    lines = audit(purged)
    assert "nothing to remove" in vsd(purged, "purge", "--older-than", DAYS[2])
    assert "nothing to remove" in vsd(purged, "purge", "--older-than", "30000d")
    assert audit(purged) == lines


@pytest.mark.parametrize(
    ("age", "first_kept"), [("38d", "2026-11-12"), ("retention", "2026-11-20"), ("2026-11-10", "2026-11-10")]
)
def test_ages(project: Path, age: str, first_kept: str) -> None:
    assert f"before {first_kept} (UTC days)" in vsd(project, "purge", "--older-than", age, "--dry-run")


@pytest.mark.parametrize("age", ["30", "soon", "-3d", "2026-13-01", "2026-12-21"])
def test_wrong_ages_are_refused(project: Path, age: str) -> None:
    with pytest.raises(UsageError):
        vsd(project, "purge", "--older-than", age)


def test_old_quarantine_goes_with_the_records(project: Path) -> None:
    bad = project / "bad.jsonl"
    bad.write_text('{"v":1,"camera":"cam-1","ts":"nonsense"}\n')
    vsd(project, "ingest", str(bad), code=1)
    assert list((project / "quarantine").glob("*.jsonl"))
    assert purge_older(load_site(project), before=day(DAYS[1]), terms=TERMS).n_quarantined == 0
    later = Terms(now=NOW.replace(year=2027), is_forced=True)
    assert purge_older(load_site(project), before=day("2027-01-01"), terms=later).n_quarantined == 1
    assert not list((project / "quarantine").glob("*.jsonl"))


def test_read_files_of_every_watched_folder_go_with_the_records(project: Path, tmp_path: Path) -> None:
    site, other = load_site(project), tmp_path / "other"
    kept = [project / "inbox" / "waits.csv", other / "done" / "sub" / "a.csv", project / "answers" / "done" / "a.eml"]
    read = [folder / place / name for folder in (project / "inbox", other) for place, name in READ]
    for path in (*kept, *read):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("a person's positions")
    for folder in (project / "inbox", other):
        watch(site, folder, IngestOptions(), clock=lambda: NOW, stop=lambda: True)
    tomorrow, soon = (datetime.now(tz=UTC).date() + timedelta(days=n) for n in (1, 40))
    terms = Terms(now=NOW, is_forced=True)
    assert purge_older(site, before=day(DAYS[1]), terms=terms).n_files == 0, "they were read after that day"
    assert purge_older(site, before=tomorrow, terms=replace(terms, is_dry_run=True)).n_files == len(read)
    assert all(path.exists() for path in read)
    assert purge_older(site, before=tomorrow, terms=terms).n_files == len(read)
    assert not any(path.exists() for path in read)
    assert all(path.exists() for path in kept)
    assert audit(project)[-1]["read_files"] == len(read)
    assert purge_older(site, before=soon, terms=terms).n_files == 0


READ = (("done", "a.csv"), ("failed", "b.csv"), ("failed", "b.csv.why.txt"))


@pytest.mark.parametrize("victim", ["days/exposure", "exposure", "seals"])
def test_damage_to_what_is_stored_is_reported(purged: Path, victim: str) -> None:
    path = next(p for p in (purged / "sealed" / victim).rglob("*") if p.is_file())
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(StoreError) as caught:
        vsd(purged, "hours", "--range", ALL, "--json")
    assert caught.value.code == "E313"
    assert str(path) in str(caught.value.where)
    assert seals_of(purged).damaged() == [path]


def test_the_hours_of_a_purged_day_are_one_file_of_each_fact_with_the_bytes_of_a_build(project: Path) -> None:
    built = {p.parent.relative_to(project / "facts"): p.read_bytes() for p in (project / "facts").rglob("*.parquet")}
    vsd(project, "purge", "--older-than", DAYS[1], "--force")
    of_days = sorted((project / "sealed" / "days").rglob("*.parquet"))
    assert len(of_days) == len({p.parents[2].name for p in of_days}) > 15
    for path in of_days:
        assert path.read_bytes() == built[path.parent.relative_to(project / "sealed" / "days")]
    alone = list((project / "sealed").rglob(f"date={DAYS[1]}/*.parquet"))
    assert {p.name[:2] for p in alone} == {"00"}
    assert len(alone) == len(of_days)
    vsd(project, "purge", "--older-than", DAYS[2], "--force")
    again = sorted((project / "sealed").rglob(f"date={DAYS[1]}/*.parquet"))
    assert set(alone) < set(again)  # what was sealed before stays as it is
    assert len(again) == 2 * len(of_days) + 1  # and `camera_days`
    (day_rows,) = (pq.ParquetFile(p).read() for p in again if p.parts[-5:-3] == ("days", "exposure"))
    assert 0 not in {hour % 24 for hour in day_rows["hour"].to_pylist()}


@pytest.mark.parametrize("is_older", [False, True])
@pytest.mark.parametrize("days", [(0, 2), (0, 0), (1, 1), (2, 2)])
def test_every_relation_has_the_rows_of_before_of_ranges_that_cut_sealed_days(
    project: Path, days: tuple[int, int], is_older: bool
) -> None:
    """A range reads 25 hours of facts on either side, so it begins and ends within a day."""

    def rows() -> dict[str, list[dict[str, Any]]]:
        with warehouse.Warehouse(load_site(project), *(day(DAYS[k]) for k in days)) as opened:
            names = sorted(sqlfiles.relations("facts", "marts"))
            return {name: opened.rows(f"select * from {name} order by all") for name in names}

    before = rows()
    assert len(before["exposure"]) > 0
    vsd(project, "purge", "--older-than", DAYS[1], "--force")
    if is_older:
        as_an_older_version_sealed(project)
    vsd(project, "purge", "--older-than", DAYS[2], "--force")
    assert rows() == before


def test_hours_of_an_older_version_beside_days_give_the_same_figures(project: Path) -> None:
    before = figures(project)
    vsd(project, "purge", "--older-than", DAYS[1], "--force")
    as_an_older_version_sealed(project)
    old = {p: p.read_bytes() for p in (project / "sealed").rglob("*.parquet")}
    assert figures(project) == before
    vsd(project, "purge", "--older-than", DAYS[2], "--force")
    assert {p: p.read_bytes() for p in old} == old
    assert set((project / "sealed" / "days").rglob("*.parquet")) - old.keys()
    assert figures(project) == before
    assert vsd(project, "verify")
    assert litter(project) == []


def test_seals_before_and_after_this_version_say_the_same_of_each_hour(purged: Path) -> None:
    seals = seals_of(purged)
    before = {day: seals.read(day) for day in seals.days()}
    as_an_older_version_sealed(purged)
    for number, now in before.items():
        old = seals.read(number)
        assert now is not None
        assert old is not None
        assert [u.is_in_day for u in now.hours.values()] == [now.is_whole] * len(now.hours)
        assert not any(u.is_in_day for u in old.hours.values())
        same = {h: replace(u, facts=old.hours[h].facts, is_in_day=False) for h, u in now.hours.items()}
        assert replace(now, hours=same) == old


def test_a_version_that_knows_no_days_names_a_file_it_misses(purged: Path) -> None:
    """It reads a seal without `is_in_day`, and so looks for a file of each hour."""
    seals = seals_of(purged)
    number = day_number(DAYS[0])
    seal = seals.read(number)
    assert seal is not None
    looked_for = [
        seals.fact_path(r, hour, replace(unit, is_in_day=False))
        for hour, unit in seal.hours.items()
        for r in unit.facts
    ]
    assert looked_for
    assert not any(path.exists() for path in looked_for)


def test_a_link_in_the_place_of_read_files_leads_a_purge_nowhere(project: Path) -> None:
    site, soon = load_site(project), datetime.now(tz=UTC).date() + timedelta(days=1)
    (project / "inbox").mkdir()
    watch(site, project / "inbox", IngestOptions(), clock=lambda: NOW, stop=lambda: True)
    for place in ("done", "failed"):
        if (project / "inbox" / place).exists():
            (project / "inbox" / place).rmdir()
        (project / "inbox" / place).symlink_to(project, target_is_directory=True)
    assert purge_older(site, before=soon, terms=Terms(now=NOW, is_forced=True)).n_files == 0
    assert (project / "vsd.toml").exists()


@pytest.mark.parametrize("listed", ["", "[", "7", '{"a": 1}', "null"])
def test_a_damaged_list_of_watched_folders_stops_no_purge(listed: str, project: Path) -> None:
    site, soon = load_site(project), datetime.now(tz=UTC).date() + timedelta(days=1)
    (project / "inbox").mkdir()
    watch(site, project / "inbox", IngestOptions(), clock=lambda: NOW, stop=lambda: True)
    (project / "status" / "watched.json").write_text(listed, encoding="utf-8")
    (project / "inbox" / "done").mkdir(exist_ok=True)
    (project / "inbox" / "done" / "a.csv").write_text("positions", encoding="utf-8")
    assert purge_older(site, before=soon, terms=Terms(now=NOW, is_forced=True)).n_files == 1


def test_facts_sealed_before_a_column_was_known_are_read_with_nulls(
    purged: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another version of the SQL may know more columns of a fact than its sealed files have."""
    from vsd_analytics.warehouse import relations as warehouse_relations

    known = dict(sqlfiles.relations("facts"))
    wider = replace(known["coverage"], columns={**dict.fromkeys(known["coverage"].columns, ""), "n_dropped": ""})
    queried = {**sqlfiles.queried_relations(), "coverage": wider}
    monkeypatch.setattr(warehouse_relations, "queried_relations", lambda: queried)
    with warehouse.Warehouse(load_site(purged), day(DAYS[0]), day(DAYS[0])) as opened:
        (row,) = opened.rows("select count(*) as n, count(n_dropped) as n_known from coverage")
    assert row["n"] > 0
    assert row["n_known"] == 0


def test_a_report_says_what_is_stored_and_when_the_rest_went(project: Path, purged: Path) -> None:
    before = stored_records(load_site(project), at=date(2026, 12, 10))
    after = stored_records(load_site(purged), at=date(2026, 12, 10))
    first, last = (date.fromisoformat(d) for d in (DAYS[0], DAYS[2]))
    assert before == StoredRecords(first_day=first, n_overdue_days=1, has_pseudonyms=False)  # 9 November: 31 days old
    purged_on = NOW.astimezone(UTC).date()
    assert after == StoredRecords(first_day=last, purged_before=last, purged_on=purged_on, has_pseudonyms=False)
