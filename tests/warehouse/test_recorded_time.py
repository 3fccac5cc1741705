"""Recorded time second by second, hours over clock changes, hour states, closed days."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from site_text import site_text
from warehouse.small_projects import DAY, HOUR, T0, Person, at, beats, make_site, open_days, put

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.figures import operator_counts
from vsd_analytics.site.model import Camera

STEP = 100


@given(seed=st.integers(0, 2**32 - 1), has_heartbeat=st.booleans())
@settings(max_examples=3, deadline=None)
def test_recorded_time_equals_brute_force(seed: int, has_heartbeat: bool) -> None:
    """Every tenth of a second is looked at: within one interval after a frame, or within a silence short enough."""
    rng = np.random.default_rng(seed)
    gaps = rng.choice([5, 9, 10, 15, 20, 21, 60, 2_000, 6_000, 6_001, 9_000], size=400, p=[0.1] * 6 + [0.08] * 5) * STEP
    instants = T0 - 7 * 60_000 + np.cumsum(gaps)
    with TemporaryDirectory() as folder:
        site = make_site(Path(folder))
        frames = [r for ts in instants for r in beats(int(ts), int(ts) + 1)]
        put(site, frames if has_heartbeat else [Person(int(ts), "a", 0, 0) for ts in instants])
        with open_days(site) as warehouse:
            rows = warehouse.rows("select quarter, n_frames, recorded_ms, is_inferred from coverage")
    first = int(instants[0]) // HOUR * HOUR
    slots = np.zeros((int(instants[-1]) - first) // STEP + 7200, dtype=bool)
    silence = 2000 if has_heartbeat else 600_000
    for ts, following in zip(instants, [*instants[1:], None], strict=True):
        is_whole = following is not None and following - ts <= silence
        slots[(ts - first) // STEP : ((following if is_whole else ts + 1000) - first) // STEP] = True
    with_frames = {int(ts) // HOUR for ts in instants}
    expected = Counter()
    for slot in np.flatnonzero(slots):
        ts = first + int(slot) * STEP
        if ts // HOUR in with_frames:
            expected[ts // 900_000] += STEP
    assert {r["quarter"]: r["recorded_ms"] for r in rows} == dict(expected)
    assert sum(r["n_frames"] for r in rows) == len(instants)
    assert {r["is_inferred"] for r in rows} == {not has_heartbeat}


WEEKS = [
    ("Europe/Rome", "2026-03-23", "2026-03-29", 167, 167.0),
    ("Europe/Rome", "2026-10-19", "2026-10-25", 169, 169.0),
    ("Europe/Rome", "2026-11-09", "2026-11-15", 168, 168.0),
    ("Asia/Kathmandu", "2026-03-23", "2026-03-29", 168, 168.0),
    ("Australia/Lord_Howe", "2026-03-30", "2026-04-05", 169, 168.5),
    ("Australia/Lord_Howe", "2026-09-28", "2026-10-04", 168, 167.5),
]


@pytest.mark.parametrize(("zone", "first", "last", "n_hours", "length_h"), WEEKS)
def test_hours_of_a_week_have_the_right_labels_and_sums(
    tmp_path: Path, zone: str, first: str, last: str, n_hours: int, length_h: float
) -> None:
    """A pair is close every five minutes, day and night; python's zoneinfo is the oracle."""
    site = make_site(tmp_path, timezone=zone, cameras=[Camera("cam", "Cam", "ground", hz=1 / 300)])
    instants = range(at(first) - DAY, at(last) + 2 * DAY, 300_000)
    put(site, [Person(ts, t, x, 0) for ts in instants for t, x in (("a", 0), ("b", 1000))])
    with open_days(site, first, last, heat_cell_m=1.0) as warehouse:
        rows = warehouse.rows("select * from hours")
        starts = [operator_counts.local_iso(warehouse.site.zone, r["hour_start_ms"]) for r in rows]
        heat = operator_counts.heatmap(warehouse)
    local = [datetime.fromtimestamp(ts / 1000, tz=ZoneInfo(zone)) for ts in instants]
    week = [d for d in local if date.fromisoformat(first) <= d.date() <= date.fromisoformat(last)]
    counts = Counter((d.date(), d.hour, d.fold) for d in week)
    assert len(rows) == n_hours == len(set(starts))
    assert sum(r["length_s"] for r in rows) / 3600 == length_h
    assert {(r["local_date"], r["local_hour"], r["fold"]): r["person_records"] for r in rows} == {
        k: 2 * n for k, n in counts.items()
    }
    assert all(r["recorded_s"] == r["length_s"] for r in rows)
    assert sum(r["violation_records"] for r in rows) == len(week) == heat["records"].sum()
    assert sum(r["exposure_s"] for r in rows) == length_h * 3600 * 2
    for row, start in zip(rows, starts, strict=True):
        told = datetime.fromisoformat(start)
        assert (told.date(), told.hour) == (row["local_date"], row["local_hour"])
        assert told.isoweekday() == row["weekday"]
        assert told.timestamp() * 1000 == row["hour_start_ms"]


def test_sum_over_local_hours_is_sum_over_utc(tmp_path: Path) -> None:
    site = make_site(tmp_path, timezone="Asia/Kathmandu")
    rng = np.random.default_rng(1)
    first = at("2026-11-09") - 6 * HOUR
    instants = np.unique(rng.integers(first, first + 60 * HOUR, size=5000))
    put(site, [Person(int(ts), "a", 0, 0) for ts in instants])
    with open_days(site, "2026-11-08", "2026-11-12") as warehouse:
        local = warehouse.rows(
            "select sum(person_records) as n, sum(exposure_s) as s, sum(recorded_s) as r from hours"
        )[0]
        utc = warehouse.rows("select sum(person_records) as n, sum(exposure_ms) / 1000 as s from exposure")[0]
        recorded = warehouse.rows("select sum(recorded_ms) / 1000 as r from coverage")[0]
    assert local["n"] == utc["n"] == len(instants)
    assert local["s"] == pytest.approx(utc["s"])
    assert local["r"] == pytest.approx(recorded["r"])


def test_hour_state_follows_recorded_share(tmp_path: Path) -> None:
    states = {3600: "full", 3312: "full", 3311: "partial", 1800: "partial", 1799: "low_data", 1: "low_data"}
    site = make_site(tmp_path)
    starts = range(T0, T0 + 12 * HOUR, 2 * HOUR)  # an empty hour after each
    put(site, [beat for start, s in zip(starts, states, strict=True) for beat in beats(start, start + s * 1000)])
    with open_days(site) as warehouse:
        rows = warehouse.rows("select * from hours where recorded_s > 0 order by hour_start_ms")
    assert [(r["hour_start_ms"], r["recorded_s"], r["state"]) for r in rows] == [
        (start, s, state) for start, (s, state) in zip(starts, states.items(), strict=True)
    ]
    assert {r["person_records"] for r in rows} == {0}


def test_missing_hour_is_not_zero(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, beats(T0, T0 + HOUR))
    with open_days(site) as warehouse:
        frame = operator_counts.hours(warehouse).set_index(operator_counts.hours(warehouse)["start"].str[11:13])
        by_camera = operator_counts.hours(warehouse, by="camera")
    counts = ["person_records", "violation_records", "n_violations", "exposure_s", "violation_s"]
    assert frame.loc["08", counts].tolist() == [0, 0, 0, 0, 0]
    assert frame.loc["08", "state"] == "full"
    assert frame.loc["09", counts].isna().all()
    assert frame.loc["09", "state"] == "no_data"
    assert by_camera["person_records"].notna().sum() == 1


def test_a_camera_that_stops_just_after_the_hour_leaves_the_next_hours_unknown(tmp_path: Path) -> None:
    """The rest of the last frame's interval reaches into the next hour, which must not become an hour with 0 people."""
    site = make_site(tmp_path, cameras=[Camera("cam", "Cam", "ground", hz=1.0), Camera("b", "B", "ground", hz=1.0)])
    put(site, [*beats(T0 + 500, T0 + HOUR), *beats(T0, T0 + 2 * HOUR, camera="b")])
    with open_days(site) as warehouse:
        rows = warehouse.rows("select * from camera_hours where camera_id = 'cam' and local_hour = 9")
    assert (rows[0]["recorded_s"], rows[0]["person_records"]) == (0, None)


def test_closed_days_and_hours_are_closed_not_missing(tmp_path: Path) -> None:
    opening = tuple(((8 * 60, 20 * 60),) for _ in range(7))
    site = make_site(tmp_path, opening=opening, closed=[date(2026, 11, 10)])
    put(site, [*beats(T0, T0 + 2 * HOUR), Person(T0 - HOUR, "a", 0, 0), Person(T0 + DAY, "a", 0, 0)])
    with open_days(site, "2026-11-09", "2026-11-10") as warehouse:
        states = warehouse.rows("select local_date, local_hour, state, person_records from hours")
        coverage = operator_counts.coverage(warehouse)
    monday = {r["local_hour"]: r for r in states if r["local_date"] == date(2026, 11, 9)}
    assert [monday[h]["state"] for h in (7, 8, 9, 10, 19, 20)] == [
        "closed",
        "full",
        "full",
        "no_data",
        "no_data",
        "closed",
    ]
    assert monday[7]["person_records"] == 1
    assert {r["state"] for r in states if r["local_date"] == date(2026, 11, 10)} == {"closed"}
    assert coverage["share"] == pytest.approx(2 / 12)
    assert [(o["start"][11:16], o["end"][11:16], o["open_h"]) for o in coverage["outages"]] == [
        ("10:00", "20:00", 10.0)
    ]
    assert coverage["cameras"][0]["days"][1]["share"] is None


def test_hour_labels_need_no_machine_zone(tmp_path: Path) -> None:
    site = make_site(tmp_path, timezone="America/New_York")
    put(site, beats(T0, T0 + 1000))
    with open_days(site) as warehouse:
        row = warehouse.rows("select * from hours where recorded_s > 0")[0]
    assert datetime.fromtimestamp(row["hour_start_ms"] / 1000, tz=UTC).hour == 8
    assert row["local_hour"] == 3


def test_hours_to_come_are_neither_recorded_nor_missing(tmp_path: Path) -> None:
    opening = tuple(((8 * 60, 20 * 60),) for _ in range(7))
    site = make_site(tmp_path, opening=opening)
    put(site, beats(T0, T0 + 2 * HOUR))
    noon_and_a_bit = datetime.fromtimestamp((T0 + 4.5 * HOUR) / 1000, tz=UTC)
    with open_days(site, "2026-11-09", "2026-11-10") as warehouse:
        until_ms = operator_counts.begun_until_ms(warehouse, now=noon_and_a_bit)
        so_far = operator_counts.coverage(warehouse, until_ms=until_ms)
        shown = operator_counts.hours(warehouse, until_ms=until_ms)
        assert operator_counts.begun_until_ms(warehouse, now=noon_and_a_bit + timedelta(days=2)) is None
        assert operator_counts.begun_until_ms(warehouse, now=noon_and_a_bit - timedelta(days=9)) is None
    assert until_ms == T0 + 4 * HOUR
    assert so_far["cameras"][0]["scheduled_h"] == pytest.approx(4)
    assert so_far["share"] == pytest.approx(0.5)
    assert [(o["end"][11:16], o["open_h"]) for o in so_far["outages"]] == [("12:00", pytest.approx(2))]
    assert shown["start"].iloc[-1].startswith("2026-11-09T11")


def test_an_hour_that_runs_is_shown_once_it_has_records(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, beats(T0, T0 + HOUR // 2))
    with open_days(site) as warehouse:
        until_ms = operator_counts.begun_until_ms(warehouse, now=datetime.fromtimestamp((T0 + HOUR / 2) / 1000, tz=UTC))
        shown = operator_counts.hours(warehouse, until_ms=until_ms)
    assert until_ms == T0
    assert shown.iloc[-1][["recorded_s", "state"]].tolist() == [1800, "partial"]


def test_a_camera_that_recorded_nothing_is_named_beside_the_mean_over_cameras(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "vsd.toml").write_text(site_text("cam-1", "cam-2"))
    table = tmp_path / "a.csv"
    table.write_text("ts,track_id,x_m,y_m\n" + "".join(f"2026-11-09T09:00:{s:02}Z,1,{s / 10},2\n" for s in range(60)))
    vsd = ["-C", str(tmp_path), "--now", "2026-11-20"]
    assert run(cli, [*vsd, "ingest", str(table), "--camera", "cam-2"]) == 0
    capsys.readouterr()
    assert run(cli, [*vsd, "hours", "--range", "2026-11-09"]) == 0
    out, err = capsys.readouterr()
    assert "cam-1 recorded nothing; recorded_s is the mean over cameras, 1 of 2 with 0 s" in err
    assert out.splitlines()[0].split()[-2:] == ["cameras_down", "state"]
    assert run(cli, [*vsd, "hours", "--range", "2026-11-09", "--json"]) == 0
    assert "cam-1 recorded nothing" in capsys.readouterr().out
