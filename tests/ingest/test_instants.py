"""Times: units of unix numbers, offsets, local clocks through both changes of the year."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.ingest.reading.instants import local_to_utc, parse_instants

MS = timedelta(milliseconds=1)
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def utc(text: str) -> int:
    return (datetime.fromisoformat(text) - EPOCH) // MS


@pytest.mark.parametrize("factor", [1, 1000, 10**6, 10**9], ids=["s", "ms", "us", "ns"])
def test_unix_numbers_of_any_unit(factor: int) -> None:
    seconds = [1794214800, 1794214801, 1794218400]
    for values in (
        [s * factor for s in seconds],
        [str(s * factor) for s in seconds],
        [float(s * factor) for s in seconds],
    ):
        found = parse_instants(pa.array(values), zone="UTC")
        assert found.ms.tolist() == [s * 1000 for s in seconds]


def test_one_wild_value_does_not_change_the_unit() -> None:
    found = parse_instants(pa.array([1e15, 1794214800.0, 1794214801.0, -5.0]), zone="UTC")
    assert found.ms.tolist()[1:3] == [1794214800000, 1794214801000]


@given(st.lists(st.integers(631152000000, 4102444800000), min_size=1, max_size=30))
def test_milliseconds_survive_being_written_in_any_unit(instants: list[int]) -> None:
    texts = [f"{ms // 1000}.{ms % 1000:03}" for ms in instants]
    assert parse_instants(pa.array(texts), zone="UTC").ms.tolist() == instants
    for factor in (1, 1000, 10**6):
        assert parse_instants(pa.array([ms * factor for ms in instants]), zone="UTC").ms.tolist() == instants
    assert parse_instants(pa.array([float(t) for t in texts]), zone="UTC").ms.tolist() == instants


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("2026-11-09T09:00:00Z", "2026-11-09T09:00:00+00:00"),
        ("2026-11-09T09:00:00.123456Z", "2026-11-09T09:00:00.123+00:00"),
        ("2026-11-09 10:00:00+01:00", "2026-11-09T09:00:00+00:00"),
        ("2026-11-09T10:00:00+0100", "2026-11-09T09:00:00+00:00"),
        ("2026-11-09T10:00:00+01", "2026-11-09T09:00:00+00:00"),
        ("2026-11-09 10:00:00 +0100", "2026-11-09T09:00:00+00:00"),
        ("20261109T090000Z", "2026-11-09T09:00:00+00:00"),
        ("2026-11-09T03:30:00-05:30", "2026-11-09T09:00:00+00:00"),
        ("2026-11-09T10:00:00", "2026-11-09T09:00:00+00:00"),
        (" 2026-11-09 10:00 ", "2026-11-09T09:00:00+00:00"),
        ("2026-11-09", "2026-11-08T23:00:00+00:00"),
        ("2026-07-09T11:00:00", "2026-07-09T09:00:00+00:00"),
        ("0001-01-01T00:00:00Z", "0001-01-01T00:00:00+00:00"),
        ("9999-12-31T23:59:59Z", "9999-12-31T23:59:59+00:00"),
    ],
)
def test_iso_times_with_and_without_offset(text: str, meant: str) -> None:
    found = parse_instants(pa.array([text, "2026-11-09T00:00:00Z"]), zone="Europe/Rome")
    assert found.ms.tolist()[0] == utc(meant)
    assert not found.is_wrong.any()
    assert not found.notes


@pytest.mark.parametrize(
    "text", ["", "now", "today", "NaT", "12:30", "09/11/2026", "2026-13-01", "inf", "x", "2026-11-09T25:00"]
)
def test_what_is_no_time_is_wrong_and_never_the_clock(text: str) -> None:
    found = parse_instants(pa.array([text, "2026-11-09T09:00:00Z"]), zone="UTC")
    assert found.is_wrong.tolist() == [True, False]


def test_the_hour_that_comes_twice_is_the_first_and_reported_once() -> None:
    texts = [f"2026-10-25T{h}:00" for h in ("01:59", "02:00", "02:59", "03:00")]
    found = parse_instants(pa.array(texts), zone="Europe/Rome")
    offsets = [2, 2, 2, 1]
    assert found.ms.tolist() == [utc(f"{t}+0{o}:00") for t, o in zip(texts, offsets, strict=True)]
    assert [n[:5] for n in found.notes] == ["W211:"]
    assert "Europe/Rome" in found.notes[0]


def test_the_hour_that_is_skipped_keeps_its_distances() -> None:
    texts = [f"2026-03-29T02:{m:02}:00" for m in (0, 15, 45)]
    found = parse_instants(pa.array(texts), zone="Europe/Rome")
    assert np.diff(found.ms).tolist() == [15 * 60_000, 30 * 60_000]
    assert ["skips" in note for note in found.notes] == [True], "no clock of that zone shows them"


@given(
    seconds=st.integers(631152000, 4102444800),
    zone=st.sampled_from(
        ["Europe/Rome", "Asia/Kolkata", "Australia/Lord_Howe", "America/St_Johns", "Asia/Kathmandu", "UTC"]
    ),
)
def test_local_times_agree_with_the_standard_library(seconds: int, zone: str) -> None:
    wall = datetime(1970, 1, 1) + timedelta(seconds=seconds)
    wanted = (wall.replace(tzinfo=ZoneInfo(zone)) - EPOCH) // MS
    found, is_ambiguous = local_to_utc(np.array([seconds * 1000]), zone)
    assert found.tolist() == [wanted]
    other = (wall.replace(tzinfo=ZoneInfo(zone), fold=1) - EPOCH) // MS
    assert is_ambiguous.tolist() == [other > wanted]
