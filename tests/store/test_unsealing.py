"""A camera is taken out of some hours of a day that were sealed together, whatever row groups its files have."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from vsd_analytics.store.seals import DaySeal, Seals, UnitSeal
from vsd_analytics.store.unsealing import unseal

DAY = 20_000
HOURS = (9, 10, 11)
CAMERAS = ("door", "yard")


def rows(n_of_each: int) -> pa.Table:
    keys = [(DAY * 24 + hour, camera, k) for hour in HOURS for camera in CAMERAS for k in range(n_of_each)]
    hours, cameras, numbers = zip(*keys, strict=True)
    return pa.table({"hour": pa.array(hours, pa.int64()), "camera_id": cameras, "n": numbers})


@pytest.fixture
def seals(tmp_path: Path) -> Seals:
    """Return a day whose hours were sealed together: a fact of row groups of 4 rows, a sum, and one without rows."""
    found = Seals(tmp_path / "sealed", site_id="shop")
    every = rows(3)
    tables = {"exposure": every, "sums": every.drop_columns("camera_id"), "quiet": every.slice(0, 0)}
    facts = {}
    for name, table in tables.items():
        sink = pa.BufferOutputStream()
        pq.write_table(table, sink, row_group_size=4)
        facts[name] = found.put(name, DAY * 24, sink.getvalue().to_pybytes(), is_in_day=True)
    units = {}
    for hour in HOURS:
        last_ms = dict.fromkeys(CAMERAS, hour)
        units[DAY * 24 + hour] = UnitSeal(fingerprint="f", causes={}, facts=facts, is_in_day=True, last_ms=last_ms)
    found.write(DaySeal(day=DAY, is_whole=True, sealed_on="2026-01-01", hours=units))
    return found


def read(seals: Seals, name: str, hour: int) -> pa.Table:
    seal = seals.read(DAY)
    assert seal is not None
    return pq.ParquetFile(seals.fact_path(name, DAY * 24 + hour, seal.hours[DAY * 24 + hour])).read()


def test_only_rows_of_the_camera_and_of_these_hours_go(seals: Seals) -> None:
    quiet = {p: p.read_bytes() for p in (seals.root / "days" / "quiet").rglob("*.parquet")}
    unseal(seals, [DAY * 24 + 10, DAY * 24 + 12, DAY * 24 + 50], "yard")
    expected = [r for r in rows(3).to_pylist() if (r["hour"] - DAY * 24, r["camera_id"]) != (10, "yard")]
    for hour in HOURS:
        assert read(seals, "exposure", hour).to_pylist() == expected
        assert {h - DAY * 24 for h in read(seals, "sums", hour)["hour"].to_pylist()} == {9, 11}
    seal = seals.read(DAY)
    assert seal is not None
    assert [sorted(unit.last_ms) for unit in seal.hours.values()] == [["door", "yard"], ["door"], ["door", "yard"]]
    assert len({unit.facts["exposure"] for unit in seal.hours.values()}) == 1
    assert {p: p.read_bytes() for p in (seals.root / "days" / "quiet").rglob("*.parquet")} == quiet
    assert len(list(seals.root.rglob("*.parquet"))) == 3


def test_everybody_goes_out_of_an_hour_and_the_same_again_changes_nothing(seals: Seals) -> None:
    unseal(seals, [DAY * 24 + 9], None)
    assert {h - DAY * 24 for h in read(seals, "exposure", 9)["hour"].to_pylist()} == {10, 11}
    after = {p: p.read_bytes() for p in seals.root.rglob("*.*") if p.is_file()}
    unseal(seals, [DAY * 24 + 9], None)
    assert {p: p.read_bytes() for p in seals.root.rglob("*.*") if p.is_file()} == after
    unseal(seals, [DAY * 24 + h for h in HOURS], None)
    assert read(seals, "exposure", 9).num_rows == 0
    assert read(seals, "exposure", 9).schema.equals(rows(1).schema)
