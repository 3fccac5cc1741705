"""Purge of a camera and time: as if those records had never come, so that the right ones can."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from aged_projects import DAYS, TERMS, as_an_older_version_sealed, audit, litter, messages, seals_of, vsd, write

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.retention.purge import purge_range
from vsd_analytics.schema import TABLES

ALL = f"{DAYS[0]}..2026-11-12"  # 23 UTC is the next day in Rome
MORNING = f"{DAYS[0]}T10:00..{DAYS[0]}T12:00"  # Rome is an hour ahead: 9 and 10 UTC


def table(root: Path) -> dict[str, list[str]]:
    """Return every stored record, read by a plain glob as anybody would."""
    return {
        name: sorted(
            str(r) for p in (root / "store" / name).rglob("*.parquet") for r in pq.ParquetFile(p).read().to_pylist()
        )
        for name in TABLES
    }


def figures(root: Path) -> tuple[str, str]:
    return vsd(root, "hours", "--range", ALL, "--by", "camera", "--json"), vsd(
        root, "heatmap", "--range", ALL, "--json"
    )


def test_wrong_camera_undone_and_right_one_ingested_is_as_if_never_wrong(project: Path, tmp_path: Path) -> None:
    """The file of cam-2 was ingested as cam-1 and mixed with what is right there: purge, ingest the right files."""
    before, shown = table(project), figures(project)
    wrong = messages(camera="cam-1", day=DAYS[0], hours=(9, 10), shift_m=7.0)
    for message in wrong:
        message["persons"] = [{**p, "id": f"w{p['id']}"} for p in message["persons"]]
    vsd(project, "ingest", str(write(tmp_path / "wrong.jsonl", wrong)))
    assert table(project) != before
    figures(project)
    vsd(project, "purge", "--camera", "cam-1", "--range", MORNING)
    assert not any("'camera_id': 'cam-1'" in r and "2026, 11, 9, 9" in r for r in table(project)["observations"])
    right = messages(camera="cam-1", day=DAYS[0], hours=(9, 10))
    vsd(project, "ingest", str(write(tmp_path / "right.jsonl", right)))
    assert table(project) == before
    assert figures(project) == shown
    assert litter(project) == []
    (entry,) = audit(project)
    assert entry["camera_id"] == "cam-1"
    assert entry["from"] == "2026-11-09T09:00:00.000+00:00"


def test_minutes_may_be_named_and_all_cameras_meant(project: Path) -> None:
    before = table(project)
    told = json.loads(vsd(project, "purge", "--range", f"{DAYS[0]}T10:05:00..{DAYS[0]}T10:06:00", "--json"))
    assert told["range"]["records"]["frames"] == 12  # 5 and 6 minutes past: one a minute edge, two cameras, six each
    left = table(project)
    gone = [r for r in before["frames"] if r not in left["frames"]]
    assert len(gone) == 12
    assert all("9, 9, 5" in r for r in gone)


def test_facts_of_what_went_are_gone_at_once(project: Path) -> None:
    """Also of an hour of which nothing is left, which no build would look at again."""
    vsd(project, "purge", "--range", f"{DAYS[0]}T10:00..{DAYS[0]}T11:00")
    assert not list((project / "facts").rglob(f"date={DAYS[0]}/*.parquet"))
    hours = json.loads(vsd(project, "hours", "--range", DAYS[0], "--json"))["hours"]
    assert [h["state"] for h in hours if h["start"].startswith(f"{DAYS[0]}T10")] == ["no_data"]


def test_a_camera_that_vsd_toml_does_not_know_any_more_can_be_purged(project: Path) -> None:
    toml = (project / "vsd.toml").read_text(encoding="utf-8")
    (project / "vsd.toml").write_text(toml.replace('"cam-2"', '"cam-9"'), encoding="utf-8")
    vsd(project, "purge", "--camera", "cam-2", "--range", ALL)
    assert not any("cam-2" in r for rows in table(project).values() for r in rows)


def test_dry_run_guard_and_wrong_words(project: Path) -> None:
    before = table(project)
    told = json.loads(vsd(project, "purge", "--range", ALL, "--dry-run", "--json"))
    assert told["range"]["records"] == {"frames": 2700, "observations": 3600, "pairs": 0}
    with pytest.raises(StoreError) as caught:
        vsd(project, "purge", "--range", ALL)
    assert caught.value.code == "E310"
    wrong: tuple[tuple[str, ...], ...] = (
        (),
        ("--camera", "cam-1"),
        ("--range", ALL, "--older-than", "30d"),
        ("--range", ALL, "--camera", "../cam"),
        ("--range", f"{DAYS[0]}T10:00"),
        ("--range", f"{DAYS[0]}T10:00..{DAYS[0]}T10:00"),
    )
    for arguments in wrong:
        with pytest.raises(UsageError):
            vsd(project, "purge", *arguments)
    assert table(project) == before
    assert audit(project) == []


def by_camera(root: Path) -> dict[str, list[dict[str, Any]]]:
    rows = json.loads(vsd(root, "hours", "--range", ALL, "--by", "camera", "--json"))["hours"]
    return {c: [r for r in rows if r["camera_id"] == c] for c in ("cam-1", "cam-2")}


def sealed_rows(root: Path) -> dict[str, pa.Table]:
    """Return the rows of the hourly facts of the first day by fact, sealed in whatever files."""
    found: dict[str, pa.Table] = {}
    for path in sorted((root / "sealed").rglob(f"date={DAYS[0]}/*.parquet")):
        name = path.parents[2].name
        rows = pq.ParquetFile(path).read()
        found[name] = pa.concat_tables([found[name], rows]) if name in found else rows
    del found["camera_days"]
    return found


def of_hours(rows: pa.Table, *hours: int, but: bool = False) -> pa.Table:
    """Return the rows of some hours of the day, or those of all others."""
    is_in = pc.is_in(pc.subtract(rows["hour"], first_hour()), pa.array(hours, pa.int64()))
    return rows.filter(pc.invert(is_in) if but else is_in)


def first_hour() -> int:
    return (date.fromisoformat(DAYS[0]) - date(1970, 1, 1)).days * 24


@pytest.mark.parametrize("is_older", [False, True])
def test_a_camera_goes_out_of_sealed_facts_and_the_other_stays(purged: Path, is_older: bool) -> None:
    if is_older:
        as_an_older_version_sealed(purged)
    before, rows_before = by_camera(purged), sealed_rows(purged)
    assert of_hours(rows_before["area_counts"], 9).num_rows
    others = {p: p.read_bytes() for p in (purged / "sealed").rglob("*.parquet") if f"date={DAYS[0]}" not in p.parts}
    told = json.loads(vsd(purged, "purge", "--camera", "cam-1", "--range", MORNING, "--json"))
    assert told["range"]["sealed_hours"] == 2
    after = by_camera(purged)
    assert after["cam-2"] == before["cam-2"]
    changed = [b["start"] for b, a in zip(before["cam-1"], after["cam-1"], strict=True) if a != b]
    assert changed == [f"{DAYS[0]}T10:00:00+01:00", f"{DAYS[0]}T11:00:00+01:00"]
    assert all(r["person_records"] is None for r in after["cam-1"] if r["start"] in changed)
    for name, rows in sealed_rows(purged).items():
        morning = of_hours(rows, 9, 10)
        if "camera_id" in rows.column_names:
            assert "cam-1" not in morning["camera_id"].to_pylist()
        else:
            assert morning.num_rows == 0, "a sum over all cameras still holds the one that is gone"
        assert of_hours(rows, 9, 10, but=True).equals(of_hours(rows_before[name], 9, 10, but=True))
    assert all(path.read_bytes() == data for path, data in others.items())
    assert litter(purged) == []
    assert seals_of(purged).damaged() == []
    assert "nothing to remove" in vsd(purged, "purge", "--camera", "cam-1", "--range", MORNING)


def test_everybody_goes_out_of_sealed_facts(purged: Path) -> None:
    vsd(purged, "purge", "--range", f"{DAYS[0]}T01:00..{DAYS[1]}T01:00")
    hours = json.loads(vsd(purged, "hours", "--range", DAYS[0], "--json"))["hours"]
    assert {h["state"] for h in hours} == {"no_data"}
    late = write(purged / "late.jsonl", messages(camera="cam-1", day=DAYS[0], hours=(9,)))
    assert "sealed-hour" in json.loads(vsd(purged, "ingest", str(late), "--json", code=1))["sources"][0]["quarantined"]


def test_a_range_that_cuts_a_sealed_hour_is_refused_whole(purged: Path) -> None:
    before = by_camera(purged)
    with pytest.raises(StoreError) as caught:
        purge_range(load_site(purged), camera_id="cam-1", first_ms=ms(9, 30), after_ms=ms(11, 0), terms=TERMS)
    assert caught.value.code == "E312"
    assert "09:00Z" in str(caught.value.fix)
    assert by_camera(purged) == before


def ms(hour: int, minute: int) -> int:
    from datetime import UTC, datetime

    return round(datetime(2026, 11, 9, hour, minute, tzinfo=UTC).timestamp() * 1000)
