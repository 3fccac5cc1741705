"""Gaps in the engines' running numbers: exactly what was sent and is not stored, whatever clocks and restarts do."""

from __future__ import annotations

import json
import re
from datetime import date, datetime
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from warehouse.small_projects import HOUR, T0, Frame, build_hour_by_hour, make_site, open_days, put, table

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.figures import operator_counts
from vsd_analytics.store.duck import connect
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.dimensions import calendar, register_site
from vsd_analytics.warehouse.sqlfiles import relations

Sent = tuple[int, int, int]
"""Count of the engine, running number, instant (UTC milliseconds)."""


def gaps_of(con: duckdb.DuckDBPyConnection, stored: list[Sent]) -> list[tuple[int | None, int | None]]:
    """Return first and last missing number of each gap, None for restarts, from the SQL relations."""
    site = make_site(Path())
    rows = table("frames", [("cam", ts, 0, None, seq) for _, seq, ts in stored])
    con.register("_frames", rows)
    con.execute("create or replace temp table stored_frames as select * from _frames")
    register_site(con, site)
    con.register("_calendar", calendar(site, date(2026, 11, 9), date(2026, 11, 11)))
    con.execute("create or replace temp table calendar as select * from _calendar")
    con.execute(f"create or replace temp table sequence_runs as {relations('facts')['sequence_runs'].sql}")
    query = f"select first_missing, last_missing from ({relations('marts')['message_gaps'].sql})"
    return con.execute(query).fetchall()


def gaps_by_sets(stored: list[Sent]) -> list[tuple[int, int]]:
    """Return the gaps by the plainest means: the numbers of each count that lie between its ends and are not there."""
    found = []
    for count in sorted({c for c, _, _ in stored}):
        numbers = {seq for c, seq, _ in stored if c == count}
        missing = sorted(set(range(min(numbers), max(numbers))) - numbers)
        starts = [m for m in missing if m - 1 not in missing]
        ends = [m for m in missing if m + 1 not in missing]
        found += list(zip(starts, ends, strict=True))
    return found


@st.composite
def logs(draw: st.DrawFn) -> tuple[list[Sent], list[Sent]]:
    """Draw what an engine sent and what of it is stored.

    Its clock steps by up to eight seconds now and then. It begins a count at 0, or always at 1, after a downtime longer
    than that. Any message may be lost, but for the first ten of a count (else a short count is not told from a clock
    that was set); for some hours none is sent.
    """
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    ts, taken = T0 + draw(st.integers(0, HOUR)), set[int]()
    sent: list[Sent] = []
    start = draw(st.integers(0, 1))
    for count in range(draw(st.integers(1, 4))):
        first = start if count else draw(st.sampled_from([start, 5000]))
        n = draw(st.integers(12, 400))
        shift = 0
        silent = draw(st.integers(0, n))
        for i in range(n):
            ts += 1000 + (draw(st.sampled_from([0, 0, 200_000, 3 * HOUR])) if i == silent else 0)
            if i > 15 and rng.random() < 0.02:
                shift = int(rng.integers(-4000, 4001))
            instant = ts + shift
            while instant in taken:
                instant += 1
            taken.add(instant)
            sent.append((count, first + i, instant))
        ts += draw(st.sampled_from([9_000, 59_000, 61_000, 290_000, 310_000, 5 * HOUR]))
    loss = draw(st.sampled_from([0.0, 0.01, 0.3]))
    first_of = {c: min(seq for d, seq, _ in sent if d == c) for c in {c for c, _, _ in sent}}
    stored = [m for m in sent if m[1] < first_of[m[0]] + 10 or rng.random() >= loss]
    return sent, stored


@pytest.fixture(scope="module")
def con() -> Any:
    with connect(threads=1) as connection:
        yield connection


@settings(max_examples=15, deadline=None)
@given(logs())
def test_gaps_are_what_was_sent_and_is_not_stored(
    con: duckdb.DuckDBPyConnection, log: tuple[list[Sent], list[Sent]]
) -> None:
    sent, stored = log
    found = gaps_of(con, stored)
    assert sorted((a, b) for a, b in found if a is not None and b is not None) == sorted(gaps_by_sets(stored))
    assert sum(a is None for a, _ in found) == max(c for c, _, _ in sent)


def test_sent_minus_stored_is_the_sum_of_the_gaps(tmp_path: Path) -> None:
    """Through store, build and the command's figures, over hours, a silence and a day of loss."""
    rng = np.random.default_rng(3)
    site = make_site(tmp_path)
    sent = [(seq, T0 + seq * 5000) for seq in range(2000)]
    sent += [(seq, T0 + 10 * HOUR + seq * 5000) for seq in range(2000, 2600)]
    lost = {int(s) for s in rng.choice(np.arange(1, 2599), 300, replace=False)} | set(range(1990, 2010))
    put(site, [Frame(ts, seq=seq) for seq, ts in sent if seq not in lost])
    with open_days(site, "2026-11-09", "2026-11-10") as warehouse:
        total = warehouse.rows("select sum(n_missing)::bigint as n from message_gaps")[0]["n"]
        missing = warehouse.rows("select first_missing, last_missing from message_gaps order by 1")
        told = operator_counts.coverage(warehouse)
    assert {n for row in missing for n in range(row["first_missing"], row["last_missing"] + 1)} == lost
    assert total == told["n_missing"] == len(lost)
    assert sum(gap["n_missing"] for gap in told["gaps"]) == len(lost)
    assert told["restarts"] == []
    long = max(told["gaps"], key=lambda gap: gap["n_missing"])
    assert (long["first_missing"], long["last_missing"]) == (1990, 2009) or long["n_missing"] > 20
    assert datetime.fromisoformat(long["end"]) > datetime.fromisoformat(long["start"])
    json.dumps(told)


def test_engine_that_numbers_nothing_has_unknown_gaps_not_none(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [Frame(T0 + s * 1000) for s in range(0, 100, 7)])
    with open_days(site) as warehouse:
        told = operator_counts.coverage(warehouse)
    assert (told["n_missing"], told["gaps"]) == (None, [])


def test_late_message_closes_its_gap(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [Frame(T0 + HOUR - 3000 + s * 1000, seq=s) for s in range(8) if s != 3])
    with open_days(site) as warehouse:
        assert operator_counts.coverage(warehouse)["n_missing"] == 1
    put(site, [Frame(T0 + HOUR, seq=3)])
    with open_days(site) as warehouse:
        assert operator_counts.coverage(warehouse)["n_missing"] == 0


@pytest.mark.parametrize("seed", range(3))
def test_numbers_give_the_same_bytes_built_hour_by_hour(tmp_path: Path, seed: int) -> None:
    """What decides a restart near the end of an hour must not reach farther than the hours beside it are loaded."""
    rng = np.random.default_rng(seed)
    sites = [make_site(tmp_path / name) for name in ("whole", "hourly")]
    ts, seq, records = T0, 0, []
    while ts < T0 + 3 * HOUR:
        ts += int(
            rng.choice([1000, 1500, 70_000, 299_000, 301_000, 1_200_000], p=[0.9, 0.07, 0.01, 0.01, 0.005, 0.005])
        )
        seq = int(rng.integers(0, 3)) if rng.random() < 0.01 else seq + int(rng.integers(-1, 4))
        records.append(Frame(ts, seq=max(seq, 0)))
    for site in sites:
        put(site, records)
    assert len(build(sites[0]).fingerprints) >= 3
    build_hour_by_hour(sites[1])
    whole, hourly = (
        {p.relative_to(s.root): p.read_bytes() for p in (s.root / "facts" / "sequence_runs").rglob("*.parquet")}
        for s in sites
    )
    assert whole == hourly


def test_coverage_says_what_never_arrived(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "vsd.toml").write_text(
        '[site]\nid = "shop"\nname = "Shop"\ntimezone = "Europe/Rome"\n[[floor]]\nid = "ground"\nname = "Ground"\n'
        '[[camera]]\nid = "cam"\nname = "Cam"\nfloor = "ground"\n',
        encoding="utf-8",
    )
    numbers = [*range(10), *range(1200, 1230), *range(1231, 1500), *range(50)]
    put(make_site(tmp_path), [Frame(T0 + i * 61_000, seq=seq) for i, seq in enumerate(numbers)])
    assert run(cli, ["-C", str(tmp_path), "coverage"]) == 0
    page = capsys.readouterr().out
    assert "messages missing" in page
    assert re.search(r"1,190 +10 +1199\n", page)
    assert re.search(r" 1 +1230 +1230\n", page)
    assert run(cli, ["-C", str(tmp_path), "coverage", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    gaps = told["answers"]["message_gaps"]["rows"]
    assert [gap["n_missing"]["value"] for gap in gaps] == [1190, 1]
    assert {k: v for k, v in gaps[0].items() if k != "n_missing"} == {
        "gap": 1,
        "camera_id": "cam",
        "start": "2026-11-09T09:09:09+01:00",
        "end": "2026-11-09T09:10:10+01:00",
        "first_missing": 10,
        "last_missing": 1199,
    }
    assert len(told["answers"]["restarts"]["rows"]) == 1
