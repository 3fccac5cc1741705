"""From files to the store: what is counted, stored, refused and never written."""

from __future__ import annotations

import io
import json
import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from raw_reading import NOW, small_site

from vsd_analytics.errors import InputError, UsageError
from vsd_analytics.ingest.formats.adapters import adapter
from vsd_analytics.ingest.formats.recognise import find_adapter
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.intake.quarantine_writer import Quarantine
from vsd_analytics.ingest.reading.adapter import IngestOptions, Rejected, Source
from vsd_analytics.ingest.reading.text_lines import line_blocks
from vsd_analytics.settings import Settings
from vsd_analytics.store.store import Store

GOOD = '{"v":1,"camera":"%s","ts":"2026-11-09T09:00:%02dZ","persons":[{"id":1,"x_m":%d,"y_m":2}]}\n'
TABLE = "ts,camera_id,track_id,x_m,y_m\n"


def messages(path: Path, n: int = 3, camera: str = "cam-1", bad: int = 0) -> Path:
    path.write_text("".join(GOOD % (camera, k, k) for k in range(n)) + "{broken\n" * bad)
    return path


def test_records_are_counted_once_however_often_files_come(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    path = messages(tmp_path / "a.jsonl", bad=1)
    first = ingest(site, [path, path], IngestOptions(), now=NOW)
    assert [dict(s.n_records) for s in first.sources] == [{"frames": 3, "observations": 3}] * 2
    assert {t: (c.n_new, c.n_known) for t, c in first.fold.tables.items()} == {"frames": (3, 0), "observations": (3, 0)}
    again = ingest(site, [path], IngestOptions(), now=NOW)
    assert {t: (c.n_new, c.n_known) for t, c in again.fold.tables.items()} == {"frames": (0, 3), "observations": (0, 3)}
    (kept,) = (site.root / "quarantine").iterdir()
    (entry,) = [json.loads(line) for line in kept.read_text().splitlines()]
    assert (entry["line"], entry["reason"], entry["text"], entry["source"]) == (4, "bad-json", "{broken", str(path))


def test_first_and_last_instant_are_those_of_all_batches_in_any_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vsd_analytics.ingest.formats.frames.BATCH_ROWS", 1)
    path = tmp_path / "a.jsonl"
    path.write_text("".join(GOOD % ("cam-1", k, k) for k in (20, 5, 40, 30)))
    (source,) = ingest(small_site(tmp_path / "site"), [path], IngestOptions(), now=NOW).sources
    nine = 1794214800000
    assert (source.first_ms, source.last_ms) == (nine + 5_000, nine + 40_000)


def test_ids_keys_and_rows_agree_over_formats(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    ingest(site, [messages(tmp_path / "a.jsonl")], IngestOptions(), now=NOW)
    (tmp_path / "b.csv").write_text(TABLE + "".join(f"2026-11-09T09:00:{k:02}Z,left,1.0,{k},2\n" for k in range(3)))
    found = ingest(site, [tmp_path / "b.csv"], IngestOptions(), now=NOW)
    assert found.fold.tables["observations"].n_known == 3


def test_a_dry_run_writes_nothing_at_all(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    path = messages(tmp_path / "a.jsonl", n=5, bad=15_000)
    found = ingest(site, [path], IngestOptions(), now=NOW, is_dry_run=True)
    assert found.n_rejected == 15_000
    assert found.sources[0].n_records["observations"] == 5
    assert [p.name for p in tmp_path.rglob("*")] == ["a.jsonl"]


def test_one_bad_source_does_not_stop_the_others(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    (tmp_path / "empty.csv").touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "odd.txt").write_text("hello\n")
    paths = [tmp_path / n for n in ("none.csv", "empty.csv", "folder", "odd.txt")]
    found = ingest(site, [*paths, messages(tmp_path / "a.jsonl")], IngestOptions(), now=NOW)
    assert [s.error and s.error.code for s in found.sources] == ["E201", "E202", "E202", "E204", None]
    assert "or write an adapter: docs/plugins.md" in str(found.sources[3].error and found.sources[3].error.fix)
    assert found.fold.tables["frames"].n_new == 3


def test_a_file_the_system_refuses_is_that_sources_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    site = small_site(tmp_path / "site")

    def refuse(self: Source) -> io.BytesIO:
        raise PermissionError(13, "Permission denied", str(self.path))

    with monkeypatch.context() as patched:
        patched.setattr(Source, "open", refuse)
        found = ingest(site, [messages(tmp_path / "a.jsonl")], IngestOptions(), now=NOW)
    error = found.sources[0].error
    assert error is not None
    assert (error.code, error.what) == ("E120", "a.jsonl cannot be read: Permission denied")


def test_a_full_disk_is_no_sources_error_but_stops_the_ingest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Store, *arguments: object, **more: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Store, "append", refuse)
    with pytest.raises(OSError, match="No space"):
        ingest(small_site(tmp_path / "site"), [messages(tmp_path / "a.jsonl")], IngestOptions(), now=NOW)


def test_a_camera_that_is_not_of_the_site_is_refused_before_anything_is_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        ingest(small_site(tmp_path), [tmp_path / "none"], IngestOptions(camera="cam-11"), now=NOW)
    assert caught.value.fix == "--camera cam-1"
    assert "cam-2" in str(caught.value.why)


def test_the_settings_of_the_site_reach_the_adapters(tmp_path: Path) -> None:
    settings = Settings().with_values({"line_max_bytes": 1000})
    site = small_site(tmp_path / "site", settings=settings, ingest_map={"ts": "when"})
    path = tmp_path / "a.csv"
    path.write_text(f"when,x_m,y_m\n2026-11-09T10:00:00,1,2\n{'9' * 1001},1,2\n")
    found = ingest(site, [path], IngestOptions(camera="cam-2"), now=NOW)
    assert found.sources[0].n_rejected == {"line-too-long": 1}
    assert found.sources[0].first_ms == 1794186000000  # 01:00 UTC: the camera's clock is in Tokyo


def test_times_without_offset_are_on_the_clock_of_each_camera(tmp_path: Path) -> None:
    site = small_site(tmp_path / "site")
    (tmp_path / "a.csv").write_text(TABLE + "".join(f"2026-11-09T09:00:00,{c},1,1,2\n" for c in ("left", "cam-2")))
    naive = GOOD.replace("Z", "")
    (tmp_path / "b.jsonl").write_text("".join(naive % (c, 0, 1) for c in ("left", "cam-2")))
    found = ingest(site, [tmp_path / "a.csv", tmp_path / "b.jsonl"], IngestOptions(), now=NOW)
    nine, midnight = 1794214800000, 1794182400000  # UTC
    assert [(s.first_ms, s.last_ms) for s in found.sources] == [(midnight, nine)] * 2


def test_a_source_without_any_record_is_reported(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(TABLE)
    (tmp_path / "b.jsonl").write_text("\n\n")
    options = IngestOptions()
    found = ingest(small_site(tmp_path / "site"), [tmp_path / "a.csv"], options, now=NOW)
    assert [n[:4] for n in found.sources[0].notes] == ["W212"]
    found = ingest(small_site(tmp_path / "site"), [tmp_path / "b.jsonl"], IngestOptions(format="frames"), now=NOW)
    assert [n[:4] for n in found.sources[0].notes] == ["W212"]


def test_progress_ends_at_the_size_of_the_files(tmp_path: Path) -> None:
    paths = [messages(tmp_path / "a.jsonl"), messages(tmp_path / "b.jsonl", camera="cam-2")]
    seen: list[int] = []
    stored: list[int] = []
    ingest(small_site(tmp_path / "site"), paths, IngestOptions(), now=NOW, on_bytes=seen.append, on_rows=stored.append)
    assert sum(seen) == sum(p.stat().st_size for p in paths)
    assert sum(stored) == 12


def test_formats_are_found_by_name_or_with_a_hint(tmp_path: Path) -> None:
    assert adapter("pairs").name == "pairs"
    with pytest.raises(UsageError) as caught:
        adapter("position")
    assert caught.value.fix == "--format positions"
    (tmp_path / "x.txt").write_text("1,2,3\n")
    assert find_adapter(Source(tmp_path / "x.txt"), IngestOptions(columns=("ts", "x_m", "y_m"))).name == "table"
    with pytest.raises(InputError) as unknown:
        find_adapter(Source(tmp_path / "x.txt"), IngestOptions())
    assert unknown.value.code == "E204"


def test_quarantine_is_stored_once_and_counted_always(tmp_path: Path) -> None:
    stored_max = 2_000
    bad = [Rejected(k, "bad-json" if k % 2 else "no-time", "why", f"text {k} \ud800") for k in range(stored_max + 50)]
    for _ in range(2):
        quarantine = Quarantine(tmp_path / "q", source="a.csv", stored_max=stored_max)
        for start in range(0, len(bad), 700):
            quarantine.add(bad[start : start + 700])
        quarantine.flush()
        assert sum(quarantine.counts.values()) == len(bad)
    lines = [json.loads(x) for p in (tmp_path / "q").iterdir() for x in p.read_text().splitlines()]
    assert len(lines) == stored_max
    assert {x["line"] for x in lines} == set(range(stored_max))
    assert stat.S_IMODE((tmp_path / "q").stat().st_mode) == 0o700
    assert quarantine.examples["no-time"].line == 0


@given(
    lines=st.lists(
        st.binary(max_size=9).map(lambda b: b.replace(b"\n", b"").replace(b"\r", b"").replace(b"\xef", b""))
    ),
    end=st.sampled_from([b"\n", b"\r\n"]),
    is_ended=st.booleans(),
    block=st.integers(1, 20),
)
def test_blocks_of_lines_are_the_lines_with_long_ones_left_out(
    lines: list[bytes], end: bytes, is_ended: bool, block: int
) -> None:
    text = end.join(lines) + (end if is_ended else b"")
    expected = text.split(end)
    expected = expected[:-1] if expected[-1] == b"" else expected
    found: list[bytes | None] = []
    for first, some in line_blocks(io.BytesIO(text), max_bytes=5, block_bytes=block):
        assert first == len(found) + 1
        found += some
    assert found == [line if len(line) <= 5 else None for line in expected]


class _Endless(io.RawIOBase):
    """A line of 2 GiB without an end, made as it is read."""

    def __init__(self) -> None:
        self.left = 2 << 30

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        n = min(len(buffer), self.left)
        buffer[:n] = b"x" * n
        self.left -= n
        return n


def test_an_endless_line_is_never_held() -> None:
    import tracemalloc

    stream = io.BufferedReader(_Endless(), 1 << 20)
    tracemalloc.start()
    assert list(line_blocks(stream, max_bytes=1_000_000)) == [(1, [None])]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 40 << 20
