"""The change log: what is added is read back, and a bad line is named."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.changelog import add_entry, read_log
from vsd_analytics.errors import InputError, UsageError
from vsd_analytics.site import Area, Site


def make_site(folder: Path) -> Site:
    square = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
    return Site("s", "S", "Europe/Rome", folder, areas=(Area("entrance", "Entrance", "floor", square),))


def test_no_log_is_an_empty_log(tmp_path: Path) -> None:
    assert read_log(make_site(tmp_path)) == ()


def test_time_without_offset_is_in_the_sites_zone(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    entry = add_entry(site, text="moved", at="2026-11-11T12:00")
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
            added.append(add_entry(site, text=text, at="2026-11-11"))
        except UsageError:
            assert not " ".join(text.split()) or not " ".join(text.split()).isprintable()
    assert read_log(site) == tuple(added)


def test_unknown_area_is_answered_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no area 'entrence'") as caught:
        add_entry(make_site(tmp_path), text="x", at="2026-11-11", area="entrence")
    assert caught.value.mend == "--area entrance"
    assert not (tmp_path / "log.jsonl").exists()


@pytest.mark.parametrize("at", ["yesterday", "2026-13-01", "0001-01-01T00:00", ""])
def test_time_that_is_none_is_refused(tmp_path: Path, at: str) -> None:
    with pytest.raises(UsageError):
        add_entry(make_site(tmp_path), text="x", at=at)


@pytest.mark.parametrize(
    "bad",
    ["{", "[]", "null", '{"at": "2026-11-11"}', '{"text": "x", "at": 3}', '{"at":"2026-11-11","text":"x","area":1}'],
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


def test_entry_after_a_torn_line_stands_on_its_own(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    (tmp_path / "log.jsonl").write_text('{"at": "2026-11', encoding="utf-8")
    add_entry(site, text="whole", at="2026-11-11")
    assert (tmp_path / "log.jsonl").read_text(encoding="utf-8").splitlines()[1].endswith('"whole", "area": null}')
