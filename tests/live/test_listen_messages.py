"""From payloads to rows: the live rule of times, what is quarantined, and that no payload stops the others."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live.local_broker import frame, write_project

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.normalise import NORMALISED
from vsd_analytics.live.batches import ReceivedMessage
from vsd_analytics.live.decode import Prepared, Preparer

NOW = datetime(2026, 11, 20, 12, tzinfo=UTC)


@pytest.fixture(scope="module")
def preparer(tmp_path_factory: pytest.TempPathFactory) -> Preparer:
    root = write_project(tmp_path_factory.mktemp("site"), port=1883)
    return Preparer(load_site(root), now=NOW)


def delivery(payload: bytes, *, topic: str = "vsd/cam-1/frames", is_retained: bool = False) -> ReceivedMessage:
    return ReceivedMessage(topic, payload, len(payload), is_retained=is_retained)


def at(preparer: Preparer, ago: timedelta) -> Prepared:
    return preparer.prepare([delivery(frame(0, at=NOW - ago, n_persons=1)[1])], now=NOW)


def reasons(prepared: Prepared) -> list[str]:
    return [r.reason for r in prepared.rejected]


def test_messages_become_rows_of_the_three_tables(preparer: Preparer) -> None:
    pairs = [{"a": "0", "b": "1", "distance_m": 1.5}]
    got = preparer.prepare([delivery(frame(7, at=NOW, pairs=pairs, engine="acme 2")[1])], now=NOW)
    assert {n: t.num_rows for n, t in got.tables.items()} == {"frames": 1, "observations": 2, "pairs": 1}
    assert all(t.schema == NORMALISED[n] for n, t in got.tables.items())
    assert got.tables["frames"]["seq"].to_pylist() == [7]
    assert got.engines == ["acme 2"]
    assert not got.rejected


@pytest.mark.parametrize(
    ("ago", "is_kept"),
    [
        (timedelta(0), True),
        (timedelta(hours=23, minutes=59), True),
        (timedelta(hours=24, seconds=1), False),
        (timedelta(minutes=-4, seconds=-59), True),
        (timedelta(minutes=-5, seconds=-1), False),
        (timedelta(days=20_000), False),
    ],
)
def test_the_live_clock_accepts_a_day_back_and_five_minutes_ahead(
    preparer: Preparer, ago: timedelta, is_kept: bool
) -> None:
    got = at(preparer, ago)
    assert got.tables["frames"].num_rows == int(is_kept)
    assert reasons(got) == ([] if is_kept else ["time-out-of-range"])


def test_a_message_of_another_time_is_quarantined_whole_and_one_too_long_for_that_in_rows(preparer: Preparer) -> None:
    short, long = (delivery(frame(0, at=NOW - timedelta(days=9), n_persons=n)[1]) for n in (3, 300))
    got = preparer.prepare([short, long], now=NOW)
    assert [(r.line, r.whole) for r in got.rejected if r.row is None] == [
        (got.rejected[0].line, short.payload.decode())
    ]
    assert len([r for r in got.rejected if r.row is not None]) == 1 + 300
    assert [camera for camera, _ in got.apart] == ["cam-1"] * 2


def test_the_clock_moves(preparer: Preparer) -> None:
    message = [delivery(frame(0, at=NOW, n_persons=0)[1])]
    assert not preparer.prepare(message, now=NOW + timedelta(hours=23)).rejected
    assert reasons(preparer.prepare(message, now=NOW + timedelta(hours=25))) == ["time-out-of-range"]


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (delivery(b"{nope"), "bad-json"),
        (delivery(b""), "bad-json"),
        (delivery(b" \n"), "bad-json"),
        (delivery(b"\xff\xfe"), "bad-json"),
        (delivery(b'{"v":1,"more":' + b"[" * 100_000), "bad-json"),
        (delivery(b'{"v":2,"camera":"cam-1","ts":"2026-11-20T12:00:00Z"}'), "bad-message"),
        (delivery(frame(0, at=NOW, camera="elsewhere", n_persons=0)[1]), "unknown-camera"),
        (delivery(frame(0, at=NOW)[1], is_retained=True), "retained"),
        (ReceivedMessage("vsd/cam-1/frames", b"{", 1_000_001), "line-too-long"),
    ],
)
def test_bad_messages_are_rejected_with_reason_and_topic_and_the_good_beside_them_stored(
    preparer: Preparer, bad: ReceivedMessage, reason: str
) -> None:
    good = delivery(frame(1, at=NOW)[1])
    got = preparer.prepare([good, bad, delivery(frame(2, at=NOW)[1])], now=NOW)
    assert reasons(got) == [reason]
    assert got.rejected[0].detail.endswith("topic vsd/cam-1/frames")
    assert got.tables["frames"]["seq"].to_pylist() == [1, 2]


def test_a_message_that_breaks_the_reading_is_quarantined_alone(
    preparer: Preparer, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vsd_analytics.ingest.formats.frames import MessageRows

    add = MessageRows.add

    def explodes(rows: MessageRows, number: int, line: bytes) -> None:
        if b"bomb" in line:
            raise ZeroDivisionError("nobody foresaw this")
        add(rows, number, line)

    monkeypatch.setattr(MessageRows, "add", explodes)
    messages = [frame(1, at=NOW)[1], b'{"bomb":1}', frame(2, at=NOW)[1]]
    got = preparer.prepare([delivery(m) for m in messages], now=NOW)
    assert reasons(got) == ["bad-message"]
    assert "ZeroDivisionError" in got.rejected[0].detail
    assert got.tables["frames"]["seq"].to_pylist() == [1, 2]
    assert got.tables["observations"].num_rows == 4


@settings(max_examples=80, deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=60), st.integers(0, 300)), max_size=6), st.data())
def test_no_payload_raises_or_harms_its_neighbours(
    preparer: Preparer, parts: list[bytes | int], data: st.DataObject
) -> None:
    """Bytes at random, and good messages with one byte changed, beside a good one."""
    good = frame(5, at=NOW)[1]
    payloads = []
    for part in parts:
        if isinstance(part, int):
            place = part % len(good)
            payloads.append(good[:place] + bytes([data.draw(st.integers(0, 255))]) + good[place + 1 :])
        else:
            payloads.append(part)
    got = preparer.prepare([delivery(p) for p in [*payloads, good]], now=NOW)
    assert 5 in got.tables["frames"]["seq"].to_pylist()
    assert all(isinstance(t, pa.Table) and t.schema == NORMALISED[n] for n, t in got.tables.items())


def test_ids_are_pseudonyms_and_stay_the_same_over_restarts(tmp_path: Path) -> None:
    root = write_project(tmp_path, port=1883)
    message = [delivery(frame(0, at=NOW)[1])]
    first, second = (
        Preparer(load_site(root), now=NOW).prepare(message, now=NOW).tables["observations"] for _ in range(2)
    )
    assert first.equals(second)
    assert "0" not in first["track_id"].to_pylist()
