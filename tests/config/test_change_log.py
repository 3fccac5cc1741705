"""The change log: what is added is read back, and a bad line is named."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.config.change_log import add_entry, read_log, torn_lines
from vsd_analytics.errors import DiskError, InputError, UsageError
from vsd_analytics.site.model import Area, Site


def make_site(folder: Path) -> Site:
    square = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
    return Site("s", "S", "Europe/Rome", folder, areas=(Area("entrance", "Entrance", "floor", square),))


def test_no_log_is_an_empty_log(tmp_path: Path) -> None:
    assert read_log(make_site(tmp_path)) == ()


def test_time_without_offset_is_in_the_sites_zone(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    entry = add_entry(site, text="moved", at="2026-11-11T12:00").entry
    assert entry.at == datetime(2026, 11, 11, 11, tzinfo=UTC)
    assert read_log(site) == (entry,)
    assert (tmp_path / "log.jsonl").read_text(encoding="utf-8").startswith('{"at": "2026-11-11T12:00:00+01:00"')


def test_entries_come_by_time_whatever_the_order_of_adding(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    for day in (3, 1, 2):
        add_entry(site, text=f"day {day}", at=f"2026-11-0{day}", area="entrance")
    assert [entry.text for entry in read_log(site)] == ["day 1", "day 2", "day 3"]


@given(texts=st.lists(st.text(min_size=1, max_size=40), min_size=1, max_size=5))
def test_what_is_added_is_read_back(tmp_path_factory: pytest.TempPathFactory, texts: list[str]) -> None:
    site = make_site(tmp_path_factory.mktemp("log"))
    added = []
    for text in texts:
        try:
            added.append(add_entry(site, text=text, at="2026-11-11").entry)
        except UsageError:
            assert not " ".join(text.split()) or not " ".join(text.split()).isprintable()
    assert read_log(site) == tuple(dict.fromkeys(added))


def test_unknown_area_is_answered_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no area 'entrence'") as caught:
        add_entry(make_site(tmp_path), text="x", at="2026-11-11", area="entrence")
    assert caught.value.fix == "--area entrance"
    assert not (tmp_path / "log.jsonl").exists()


@pytest.mark.parametrize("at", ["yesterday", "2026-13-01", "0001-01-01T00:00", ""])
def test_time_that_is_none_is_refused(tmp_path: Path, at: str) -> None:
    with pytest.raises(UsageError):
        add_entry(make_site(tmp_path), text="x", at=at)


@pytest.mark.parametrize(
    "bad",
    [
        "{ ",
        '{"text": "x"',
        "[]",
        "null",
        '{"at": "2026-11-11"}',
        '{"text": "x", "at": 3}',
        '{"at":"2026-11-11","text":"x","area":1}',
    ],
)
def test_bad_line_is_named(tmp_path: Path, bad: str) -> None:
    site = make_site(tmp_path)
    add_entry(site, text="good", at="2026-11-11")
    with (tmp_path / "log.jsonl").open("a", encoding="utf-8") as f:
        f.write(bad + "\n")
    with pytest.raises(InputError) as caught:
        read_log(site)
    assert caught.value.code == "E110"
    assert caught.value.where is not None
    assert (caught.value.where.line, caught.value.where.text) == (2, bad)


@pytest.mark.parametrize("torn", [b"{", b'{"at": "2026-11', '{"at": "2026-11-11", "text": "caf\u00e9'.encode()[:-1]])
@pytest.mark.parametrize("end", [b"", b"\n", b'\n{"at": "2026-11-12", "text": "after", "area": null}\n'])
def test_a_line_that_broke_off_is_reported_and_every_other_entry_is_read(
    tmp_path: Path, torn: bytes, end: bytes
) -> None:
    site = make_site(tmp_path)
    add_entry(site, text="before", at="2026-11-10")
    with (tmp_path / "log.jsonl").open("ab") as f:
        f.write(torn + end)
    assert [e.text for e in read_log(site)] == ["before", "after"][: 1 + (b"after" in end)]
    (warning,) = torn_lines(site)
    assert warning.code == "W110"
    assert warning.where is not None
    assert warning.where.line == 2
    assert len(add_entry(site, text="again", at="2026-11-13").removed) == 1
    assert torn_lines(site) == ()
    assert read_log(site)[-1].text == "again"
    assert (tmp_path / "log.jsonl").read_bytes().count(b"\n") == len(read_log(site))


def test_the_same_entry_again_is_one(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    for text, at in (("moved", "2026-11-11T12:00"), (" moved ", "2026-11-11T11:00Z")):
        added = add_entry(site, text=text, at=at, area="entrance")
    assert not added.is_new
    assert read_log(site) == (added.entry,)
    for other in ({"text": "moved back"}, {"at": "2026-11-11T13:00"}, {"area": None}):
        assert add_entry(site, **{"text": "moved", "at": "2026-11-11T12:00", "area": "entrance", **other}).is_new
    assert len(read_log(site)) == 4


def test_an_entry_that_version_0_1_wrote_twice_is_one(tmp_path: Path) -> None:
    line = '{"at": "2026-11-11T12:00:00+01:00", "text": "moved", "area": null}\n'
    (tmp_path / "log.jsonl").write_text(line * 2, encoding="utf-8")
    assert len(read_log(make_site(tmp_path))) == 1


@pytest.mark.parametrize("n_before", [0, 1])
@pytest.mark.parametrize("refused", [1, 2])  # the sync of the file, that of the folder
def test_a_disk_that_refuses_leaves_the_log_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, n_before: int, refused: int
) -> None:
    site = make_site(tmp_path)
    (tmp_path / "status").mkdir()
    for day in range(n_before):
        add_entry(site, text="before", at=f"2026-11-0{day + 1}")
    real, n_synced = os.fsync, 0

    def fsync(fd: int) -> None:
        nonlocal n_synced
        n_synced += 1
        if n_synced == refused:
            raise OSError(28, "No space left on device")
        real(fd)

    with monkeypatch.context() as disk:
        disk.setattr(os, "fsync", fsync)
        with pytest.raises(DiskError):
            add_entry(site, text="moved", at="2026-11-11")
    assert len(read_log(site)) == n_before
    add_entry(site, text="moved", at="2026-11-11T00:01")  # run again a minute later
    assert len(read_log(site)) == n_before + 1
    assert list(tmp_path.glob(".*.tmp")) == []


_ADD = """
import sys
from pathlib import Path
from vsd_analytics.config.change_log import add_entry
from vsd_analytics.site.model import Site
for n in range(20):
    add_entry(Site("s", "S", "UTC", Path(sys.argv[1])), text=f"{sys.argv[2]} {n}", at="2026-11-11")
"""


def test_two_who_add_at_once_lose_no_entry(tmp_path: Path) -> None:
    adders = [subprocess.Popen([sys.executable, "-c", _ADD, tmp_path, name]) for name in ("anna", "ben")]
    assert [adder.wait() for adder in adders] == [0, 0]
    assert len(read_log(make_site(tmp_path))) == 40


def test_a_log_that_is_a_link_and_private_stays_both(tmp_path: Path) -> None:
    (elsewhere := tmp_path / "elsewhere.jsonl").touch(mode=0o600)
    (tmp_path / "log.jsonl").symlink_to(elsewhere)
    add_entry(make_site(tmp_path), text="moved", at="2026-11-11")
    assert (tmp_path / "log.jsonl").is_symlink()
    assert stat.S_IMODE(elsewhere.stat().st_mode) == 0o600
    assert len(read_log(make_site(tmp_path))) == 1
