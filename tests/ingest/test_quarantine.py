"""The quarantine: what is stored, what is counted, that nothing is stored twice, and who may read it."""

from __future__ import annotations

import json
import stat
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from raw_reading import NOW, small_site

from vsd_analytics.errors import StoreError
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.intake.quarantine_writer import Quarantine, SourceReading, summarise
from vsd_analytics.ingest.reading.adapter import IngestOptions, Rejected
from vsd_analytics.ingest.reading.raw import row_json, rows_table
from vsd_analytics.store.quarantine import QuarantineEntry, drop, entries, files, rewrite, tidy

HEADER = "ts,camera_id,track_id,x_m,y_m\n"
LATER = NOW + timedelta(days=1)


def kept(folder: Path) -> list[QuarantineEntry]:
    return [e for path in files(folder) for _, e in entries(path) if e is not None]


def test_an_entry_says_when_it_came_and_how_it_was_read(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    path = tmp_path / "a.csv"
    path.write_text(
        "when,camera_id,x_m,y_m,note\n2026-11-09T09:00:00Z,cam-1,abc,2,ü\n2026-11-09T09:00:00Z,cam-9,1,2,\n"
    )
    ingest(site, [path], IngestOptions(map={"ts": "when"}, period_s=0.5), now=NOW)
    line, row = sorted(kept(site.root / "quarantine"), key=lambda e: e.line)
    assert (line.at, line.source, line.line, line.reason) == (NOW, str(path), 2, "not-a-number")
    assert (line.text, line.is_whole) == ("2026-11-09T09:00:00Z,cam-1,abc,2,ü", True)
    assert (line.format, line.first_line) == ("table", "when,camera_id,x_m,y_m,note")
    assert line.options == {"map": {"ts": "when"}, "period_s": 0.5}
    assert (row.line, row.reason, row.table) == (3, "unknown-camera", "observations")
    assert row.row is not None
    assert (row.row["camera"], row.row["ts_ms"], row.row["x_m"]) == ("cam-9", 1794214800000, 1.0)
    assert line.can_be_replayed
    assert row.can_be_replayed


NUMBERS = st.none() | st.floats(width=64)


@given(
    rows=st.lists(
        st.fixed_dictionaries(
            {
                "camera": st.none() | st.text(st.characters(codec="utf-8"), max_size=20),
                "ts_ms": st.none() | st.integers(-(2**63), 2**63 - 1),
                "zone": st.sampled_from([None, "Asia/Tokyo"]),
                "person": st.integers(0, 2**31 - 1),
                "track": st.none() | st.text(st.characters(codec="utf-8"), max_size=20),
                "x_m": NUMBERS,
                "y_m": NUMBERS,
                "u_px": NUMBERS,
                "v_px": NUMBERS,
                "quality": st.just("metric"),
                "is_staff": st.sampled_from([None, True, False]),
            }
        ),
        max_size=5,
    )
)
def test_a_raw_row_comes_back_as_it_was_nan_and_infinity_as_well(rows: list[dict[str, Any]]) -> None:
    kept_rows = [json.loads(row_json({k: v for k, v in row.items() if v is not None}) or "") for row in rows]
    lines = list(range(len(rows)))
    back = rows_table("observations", kept_rows, lines=lines)
    expected = [{c: {**row, "line": i}[c] for c in back.column_names} for i, row in enumerate(rows)]
    assert repr(back.to_pylist()) == repr(expected)


def test_the_same_bad_file_at_another_time_is_stored_once_with_its_first_instant(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    path = tmp_path / "a.csv"
    path.write_text(HEADER + "2026-11-09T09:00:00Z,cam-9,a,1,2\n")
    ingest(site, [path], IngestOptions(), now=NOW)
    (first,) = files(site.root / "quarantine")
    content = first.read_bytes()
    ingest(site, [path], IngestOptions(), now=LATER)
    assert files(site.root / "quarantine") == [first]
    assert first.read_bytes() == content
    assert [e.at for e in kept(site.root / "quarantine")] == [NOW]


def test_nobody_else_may_read_it(tmp_path: Path) -> None:
    quarantine = Quarantine(tmp_path / "q", source="a", at=NOW)
    quarantine.add([Rejected(1, "no-time", "why", "text")])
    quarantine.close()
    (path,) = files(tmp_path / "q")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE((tmp_path / "q").stat().st_mode) == 0o700


def test_what_is_beyond_the_cap_is_counted_and_said(tmp_path: Path) -> None:
    bad = [Rejected(k, "no-time" if k % 3 else "no-camera", "why", str(k)) for k in range(30)]
    quarantine = Quarantine(tmp_path / "q", source="a", at=NOW, stored_max=12)
    for at in (NOW, LATER):  # a span of a live source, and the next one
        for start in range(0, 30, 7):
            quarantine.add(bad[start : start + 7], at=at)
        quarantine.close()
    by_reason = {s.reason: (s.n_stored, s.n_not_kept, s.sources["a"]) for s in summarise(tmp_path / "q")}
    # numbers 0 to 11 are stored: four times no-camera; of 30 there are ten. The second span holds the same.
    assert by_reason == {"no-time": (8, 12, 20), "no-camera": (4, 6, 10)}
    assert sum(quarantine.counts.values()) == 60


def test_a_live_source_keeps_each_span_and_its_small_files_are_put_together(tmp_path: Path) -> None:
    quarantine = Quarantine(tmp_path / "q", source="mqtt:a", is_live=True, stored_max=5)
    n = 0
    for _span in range(3):
        for _ in range(5):
            at = NOW + timedelta(seconds=n)
            quarantine.add(
                [Rejected(n, "bad-json", "why", f"{n}", whole=f"{n}")], reading=SourceReading("frames"), at=at
            )
            quarantine.flush()
            n += 1
        with pytest.raises(StoreError, match="full for this day"):
            quarantine.add([Rejected(n, "bad-json", "why")], at=NOW)
        quarantine.close()
    (summary,) = summarise(tmp_path / "q")
    assert (summary.n_stored, summary.n_not_kept) == (15, 0)
    before = sorted((e.line, e.at, e.is_live, e.n_not_kept) for e in kept(tmp_path / "q"))
    assert len(files(tmp_path / "q")) == 15
    tidy(tmp_path / "q")
    assert len(files(tmp_path / "q")) == 1
    assert sorted((e.line, e.at, e.is_live, e.n_not_kept) for e in kept(tmp_path / "q")) == before
    assert all(e.is_live for e in kept(tmp_path / "q"))
    tidy(tmp_path / "q")
    assert len(files(tmp_path / "q")) == 1


def test_a_record_that_is_too_long_or_no_text_is_stored_in_part_and_cannot_be_replayed(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    path = tmp_path / "a.csv"
    row = b"2026-11-09T09:00:00Z,cam-1,%s,x,2\n"
    path.write_bytes(HEADER.encode() + row % (b"a" * 20_000) + row % b"\xff" + row % b"b")
    (tmp_path / "b.csv").write_text(HEADER + f"2026-11-09T09:00:00Z,cam-9,{'a' * 20_000},1,2\n")
    ingest(site, [path, tmp_path / "b.csv"], IngestOptions(), now=NOW)
    found = {(Path(e.source).name, e.line): e for e in kept(site.root / "quarantine")}
    assert {k: e.can_be_replayed for k, e in found.items()} == {
        ("a.csv", 2): False,
        ("a.csv", 3): False,
        ("a.csv", 4): True,
        ("b.csv", 2): False,
    }
    assert all(len(e.text) <= 500 for k, e in found.items() if k != ("a.csv", 4))


def test_a_line_that_is_no_entry_is_left_where_it_is(tmp_path: Path) -> None:
    quarantine = Quarantine(tmp_path / "q", source="a", at=NOW)
    quarantine.add([Rejected(k, "no-time", "why", str(k)) for k in range(4)])
    quarantine.close()
    (path,) = files(tmp_path / "q")
    path.write_bytes(path.read_bytes() + b'{"source": 7}\n{"torn')
    drop(tmp_path / "q", lambda _, e: e is not None and e.line < 3)
    (new,) = files(tmp_path / "q")
    lines = new.read_bytes().splitlines()
    assert [json.loads(lines[0])["line"], *lines[1:]] == [3, b'{"source": 7}', b'{"torn']


def test_entries_of_an_age_can_be_dropped(tmp_path: Path) -> None:
    for days in range(4):
        quarantine = Quarantine(tmp_path / "q", source=f"{days}", at=NOW + timedelta(days=days), stored_max=1)
        quarantine.add([Rejected(k, "no-time", "why") for k in range(5)])
        quarantine.close()
    before = datetime(2026, 11, 22, tzinfo=UTC)
    drop(tmp_path / "q", lambda _, e: e is not None and e.at is not None and e.at < before)
    assert sorted({e.source for e in kept(tmp_path / "q")}) == ["2", "3"]
    drop(tmp_path / "q", lambda *_: True)
    assert files(tmp_path / "q") == []
    drop(tmp_path / "none", lambda *_: True)
    assert not (tmp_path / "none").exists()


def test_a_disk_that_refuses_loses_nothing_that_is_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quarantine = Quarantine(tmp_path / "q", source="a", at=NOW)
    quarantine.add([Rejected(1, "no-time", "why")])

    def refuse(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("vsd_analytics.store.durable.publish", refuse)
        with pytest.raises(OSError, match="No space"):
            quarantine.flush()
    quarantine.flush()
    assert [e.line for e in kept(tmp_path / "q")] == [1]


def test_a_crash_between_the_new_file_and_the_end_of_the_old_one_is_repaired_by_the_next_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    quarantine = Quarantine(tmp_path / "q", source="a", at=NOW)
    quarantine.add([Rejected(k, "no-time", "why") for k in range(4)])
    quarantine.close()
    (path,) = files(tmp_path / "q")
    left = [line for line, e in entries(path) if e is not None and e.line > 1]
    with monkeypatch.context() as patched:

        def die(path: Path) -> None:
            raise KeyboardInterrupt

        patched.setattr("vsd_analytics.store.durable.remove", die)
        with pytest.raises(KeyboardInterrupt):
            rewrite(path, left)
    assert len(files(tmp_path / "q")) == 2
    rewrite(path, left)
    assert sorted(e.line for e in kept(tmp_path / "q")) == [2, 3]
