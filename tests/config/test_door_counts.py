"""Counts of door counters: good lines of a file are stored once, a doubtful one is refused with a reason and a fix."""

from __future__ import annotations

import json
import shlex
from contextlib import suppress
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.site_text import site_text
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.context_file import ContextColumns
from vsd_analytics.config.door_counts import (
    Way,
    add_counts,
    counted_days,
    counted_lines,
    door_counts,
    remove_counts,
)
from vsd_analytics.config.interval_rows import AddedIntervals
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, InputError, StoreError, UsageError, VsdError
from vsd_analytics.site.model import Site

LINES = (
    '[[line]]\nid = "entrance"\nname = "Entrance"\ncounted_by = "counter"\nleft = "Shop"\nright = "Street"\n'
    '[[line]]\nid = "aisle"\nname = "Aisle"\npoints = [[1, 2], [3, 2]]\n'
)
BOTH_SIDES: dict[Way, str] = {"left": "in", "right": "out"}


@pytest.fixture
def site(tmp_path: Path) -> Site:
    (tmp_path / "vsd.toml").write_text(site_text(more=LINES), encoding="utf-8")
    return load_site(tmp_path)


def added(
    site: Site, *lines: str, every: str | None = "15min", columns: dict[Way, str] = BOTH_SIDES, line: str = "entrance",
    is_replacing: bool = False, header: str = "time,in,out",
) -> AddedIntervals:  # fmt: skip
    file = site.root / "doors.csv"
    file.write_text("\n".join([header, *lines]), encoding="utf-8")
    times = ContextColumns("time", "", "end", every, site.zone)
    return add_counts(site, file, line, columns, times=times, is_replacing=is_replacing)


def stored(site: Site, line: str = "entrance") -> list[tuple[int | None, int | None, int | None]]:
    return [(r["n_to_left"], r["n_to_right"], r["n_both"]) for r in door_counts(site, line).to_pylist()]


def test_a_file_is_stored_once_in_order_of_time(site: Site) -> None:
    lines = ["2026-11-09T08:15,3,0", "2026-11-09T08:00,5,1"]
    assert (added(site, *lines).n_new, stored(site)) == (2, [(5, 1, None), (3, 0, None)])
    again = added(site, *lines, "2026-11-09T08:30,7,7")
    assert (again.n_new, again.n_known, stored(site)[2]) == (1, 2, (7, 7, None))


def test_the_same_counts_are_the_same_bytes_in_whatever_order_they_came(site: Site) -> None:
    path = site.root / "counts" / "entrance.parquet"
    added(site, "2026-11-09T08:00,5,1")
    added(site, "2026-11-09T08:15,3,0")
    one_by_one = path.read_bytes()
    remove_counts(site, "entrance")
    added(site, "2026-11-09T08:15,3,0", "2026-11-09T08:00,5,1")
    assert path.read_bytes() == one_by_one


def test_a_counter_may_have_one_number_for_both_ways(site: Site) -> None:
    added(site, "2026-11-09T08:00,12", header="time,count", columns={"both": "count"}, every="1h")
    assert stored(site) == [(None, None, 12)]
    assert counted_days(site) == (date(2026, 11, 9), date(2026, 11, 9))
    assert counted_lines(site) == [("entrance", (date(2026, 11, 9), date(2026, 11, 9)), 1)]


@pytest.mark.parametrize(
    ("line", "every", "why"),
    [
        ("2026-11-09T09:00,2.5,1", "15min", "2.5 is no number of people"),
        ("2026-11-09T09:00,-3,1", "15min", "-3 is no number of people"),
        ("2026-11-09T09:00,,1", "15min", "the value is missing"),
        ("2026-11-09T09:00,4,1", "2h", "longer than an hour"),
        ("2026-11-09T09:30,4,1", "1h", "begins in one local hour and ends in the next"),
        ("2026-11-09,4,1", "1d", "longer than an hour"),
        ("2026-10-25T02:30,4,1", "15min", "comes twice"),
        ("noon,4,1", "15min", "is no date and time"),
        ("2026-11-09T08:10,4,1", "15min", "overlaps"),
        ("2026-11-09T08:00,4,1", "15min", "the series has 5 and 1 for this interval, and the line says 4 and 1"),
    ],
)
def test_a_line_that_cannot_be_right_is_refused_alone(site: Site, line: str, every: str, why: str) -> None:
    added(site, "2026-11-09T08:00,5,1")
    good = "2026-11-09T18:00,1,0"
    result = added(site, good, line, every=every) if every in ("15min", "1h") else None
    if result is None:  # no line of such a file is short enough
        with pytest.raises(InputError, match=why):
            added(site, line, every=every)
        return
    (refused,) = result.refused
    assert refused.line == 3
    assert why in refused.why
    assert refused.fix
    assert result.n_new == 1
    assert stored(site) == [(5, 1, None), (1, 0, None)]


def test_replace_takes_the_counts_of_the_file(site: Site) -> None:
    added(site, "2026-11-09T08:00,5,1")
    result = added(site, "2026-11-09T08:00,4,1", is_replacing=True)
    assert (result.n_new, result.n_replaced, stored(site)) == (1, 1, [(4, 1, None)])


def test_what_contradicts_the_line_is_refused_before_anything_is_stored(site: Site) -> None:
    with pytest.raises(UsageError, match="not counted by a counter"):
        added(site, "2026-11-09T08:00,5,1", line="aisle")
    with pytest.raises(UsageError, match="there is no line") as caught:
        added(site, "2026-11-09T08:00,5,1", line="entrence")
    assert caught.value.fix == "--line entrance"
    with pytest.raises(UsageError, match="--both stands beside"):
        added(site, "2026-11-09T08:00,5,1", columns={**BOTH_SIDES, "both": "in"})
    with pytest.raises(UsageError, match="columns of people are missing"):
        added(site, "2026-11-09T08:00,5,1", columns={})
    assert counted_days(site) is None
    added(site, "2026-11-09T08:00,5,1")
    with pytest.raises(UsageError, match="other directions: left, right"):
        added(site, "2026-11-09T09:00,5,1", columns={"both": "in"})


@pytest.mark.parametrize("damage", [b"", b"PAR1 not a file", b"\0" * 400])
def test_a_damaged_file_is_named_and_its_printed_fix_works(site: Site, damage: bytes) -> None:
    added(site, "2026-11-09T08:00,5,1")
    (site.root / "counts" / "entrance.parquet").write_bytes(damage)
    with pytest.raises(StoreError, match="counts of a door counter are damaged") as caught:
        door_counts(site, "entrance")
    assert run(cli, ["-C", str(site.root), *shlex.split(str(caught.value.fix))[1:]]) == 0
    added(site, "2026-11-09T08:00,5,1")
    assert stored(site) == [(5, 1, None)]


def test_counts_of_no_line_cannot_be_removed(site: Site) -> None:
    with pytest.raises(UsageError, match="nothing was added yet"):
        remove_counts(site, "exit")
    assert not remove_counts(site, "entrance"), "the line is there, and has no counts"
    added(site, "2026-11-09T08:00,5,1")
    assert remove_counts(site, "entrance")
    assert not remove_counts(site, "entrance"), "a removal that was stopped is typed again"
    added(site, "2026-11-09T08:00,5,1")
    with pytest.raises(UsageError, match="there are counts of entrance"):
        remove_counts(site, "../vsd")


def test_a_removal_that_was_stopped_goes_on_where_vsd_toml_has_the_line_no_more(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    added(site, "2026-11-09T08:00,5,1")
    without = replace(site, lines=())

    def stop(folder: Path) -> None:
        if folder.name == "counts":
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("vsd_analytics.store.durable.fsync_dir", stop)
        with suppress(KeyboardInterrupt):
            remove_counts(without, "entrance")
    assert not (site.root / "counts" / "entrance.parquet").exists(), "stopped behind the unlink"
    synced: list[Path] = []
    with monkeypatch.context() as patch:
        patch.setattr("vsd_analytics.store.durable.fsync_dir", synced.append)
        assert not remove_counts(without, "entrance")
    assert site.root / "counts" in synced
    with pytest.raises(UsageError):
        remove_counts(without, "exit")


def test_the_command_says_what_was_added_and_what_was_not(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    file = site.root / "doors.csv"
    file.write_text("time,in,out\n2026-11-09T08:00,5,2\n2026-11-09T08:15,\x1b[2Jx,1\n", encoding="utf-8")
    project = ["-C", str(site.root), "--now", "2026-11-16T09:00Z", "counts"]
    words = ["add", str(file), "--line", "entrance", "--left", "in", "--right", "out", "--every", "15min"]
    assert run(cli, [*project, *words]) == 1
    shown = capsys.readouterr()
    assert shown.out == "entrance: 1 interval added\n"
    assert shown.err.startswith("line 3 not added: ")
    assert "\x1b" not in shown.err
    assert run(cli, [*project, "list", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["counts"] == [
        {"line_id": "entrance", "first": "2026-11-09", "last": "2026-11-09", "n_intervals": 1}
    ]
    assert run(cli, [*project, "remove", "entrance"]) == 0
    assert run(cli, [*project, "list"]) == 0


def the_problem(folder: Path, text: str) -> VsdError:
    (folder / "vsd.toml").write_text(site_text(more=text), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_site(folder)
    (problem,) = caught.value.problems
    return problem


def test_a_line_that_cameras_count_needs_its_points_and_a_misspelt_counter_is_named(tmp_path: Path) -> None:
    assert "points" in str(the_problem(tmp_path, '[[line]]\nid = "door"\nname = "Door"\n'))
    wrong = '[[line]]\nid = "door"\nname = "Door"\npoints = [[1, 2], [3, 2]]\ncounted_by = "countr"\n'
    assert "counted_by" in str(the_problem(tmp_path, wrong))


def test_a_site_of_counters_alone_needs_no_camera(tmp_path: Path) -> None:
    head = '[site]\nid = "city"\nname = "City"\ntimezone = "Pacific/Auckland"\n'
    text = '[[line]]\nid = "street"\nname = "Street"\ncounted_by = "counter"\n'
    (tmp_path / "vsd.toml").write_text(head + text, encoding="utf-8")
    (line,) = load_site(tmp_path).lines
    assert (line.points, line.is_by_counter) == (None, True)


@given(data=st.data())
def test_whatever_is_added_no_two_stored_intervals_overlap_and_no_count_is_lost(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.mktemp("counts")
    (folder / "vsd.toml").write_text(site_text(more=LINES), encoding="utf-8")
    site = load_site(folder)
    n_added = 0
    for every in data.draw(st.lists(st.sampled_from(["5min", "15min", "1h"]), min_size=1, max_size=3)):
        minutes = data.draw(st.lists(st.integers(0, 23).map(lambda k: 5 * k), min_size=1, max_size=6, unique=True))
        lines = [f"2026-11-09T{8 + m // 60:02}:{m % 60:02},{m},1" for m in minutes]
        try:
            n_added += added(site, *lines, every=every).n_new
        except InputError:  # no line of it could be used
            continue
    counts = door_counts(site, "entrance")
    assert len(counts) == n_added
    begins, ends = counts["from_ts"].to_pylist(), counts["to_ts"].to_pylist()
    assert all(end <= begin for end, begin in zip(ends, begins[1:], strict=False))
