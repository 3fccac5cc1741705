"""Series of what else happened: good lines are stored once, a doubtful one is refused with its reason."""

from __future__ import annotations

import json
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.site_text import site_text
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.context_file import ContextColumns, read_context_file
from vsd_analytics.config.context_series import add_context, context_series, remove_context
from vsd_analytics.config.interval_rows import AddedIntervals, IntervalRow, RefusedRow
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import InputError, UsageError
from vsd_analytics.site.model import Site

AT = datetime(2026, 11, 16, 9, tzinfo=UTC)


@pytest.fixture
def site(tmp_path: Path) -> Site:
    (tmp_path / "vsd.toml").write_text(site_text(), encoding="utf-8")
    return load_site(tmp_path)


def read(
    folder: Path, text: str, *, every: str | None = "1h", zone: str = "Europe/Rome"
) -> tuple[list[IntervalRow[float]], list[RefusedRow]]:
    file = folder / "series.csv"
    file.write_text(text, encoding="utf-8")
    return read_context_file(file, ContextColumns("time", "value", "end", every, ZoneInfo(zone)))


def added(
    site: Site, *lines: str, name: str = "sales", unit: str | None = "EUR", every: str = "1h", at: datetime = AT,
    is_replacing: bool = False,
) -> AddedIntervals:  # fmt: skip
    file = site.root / "series.csv"
    file.write_text("\n".join(["time,value", *lines]), encoding="utf-8")
    columns = ContextColumns("time", "value", "end", every, site.zone)
    _, result = add_context(
        site, file, columns, name=name, at=at, unit=unit, adds="sum" if unit else None, is_replacing=is_replacing
    )
    return result


def utc(ms: int) -> str:
    return datetime.fromtimestamp(ms / 1000, tz=UTC).strftime("%d %H:%M")


def test_times_without_offset_are_of_the_zone_given_and_offsets_hold_in_any(tmp_path: Path) -> None:
    text = "time,value\n2026-11-09T08:00,1\n2026-11-09T10:00+01:00,2\n"
    assert [utc(row.from_ms) for row in read(tmp_path, text)[0]] == ["09 07:00", "09 09:00"]
    assert [utc(row.from_ms) for row in read(tmp_path, text, zone="UTC")[0]] == ["09 08:00", "09 09:00"]
    assert [utc(row.from_ms) for row in read(tmp_path, text, zone="Asia/Kolkata")[0]] == ["09 02:30", "09 09:00"]


def test_an_hour_that_comes_twice_or_not_at_all_is_refused_and_says_so(tmp_path: Path) -> None:
    rows, refused = read(tmp_path, "time,value\n2026-10-25T01:00,1\n2026-10-25T02:00,2\n2026-03-29T02:30,3\n")
    assert [row.line for row in rows] == [2]
    assert [(row.line, row.why) for row in refused] == [
        (3, "2026-10-25T02:00:00 comes twice in Europe/Rome: the clocks change"),
        (4, "2026-03-29T02:30:00 does not exist in Europe/Rome: the clocks change"),
    ]
    assert {row.fix for row in refused} == {
        "give times with their offset, or export them in UTC and add --zone UTC",
    }
    both = "time,value\n2026-10-25T02:00+02:00,1\n2026-10-25T02:00+01:00,2\n"
    assert [row.value for row in read(tmp_path, both)[0]] == [1, 2]


def test_days_are_local_days_of_23_to_25_hours(tmp_path: Path) -> None:
    text = "time,value\n2026-03-29,1\n2026-10-25,2\n2026-11-09,3\n2026-11-10T06:00,4\n"
    rows, refused = read(tmp_path, text, every="1d")
    assert [(row.to_ms - row.from_ms) / 3_600_000 for row in rows] == [23, 25, 24]
    assert [row.line for row in refused] == [5]


def test_equal_lines_count_once_and_contradictory_ones_not_at_all(tmp_path: Path) -> None:
    lines = ["2026-11-09T08:00,5", "2026-11-09T08:00,5", "2026-11-09T09:00,1", "2026-11-09T09:00,2"]
    rows, refused = read(tmp_path, "\n".join(["time,value", *lines]))
    assert [row.value for row in rows] == [5]
    assert [(row.line, row.why) for row in refused] == [
        (n, "lines 4, 5 have different values for one interval") for n in (4, 5)
    ]


def test_an_interval_that_overlaps_another_is_refused(tmp_path: Path) -> None:
    rows, refused = read(tmp_path, "time,value\n2026-11-09T08:00,1\n2026-11-09T08:30,2\n2026-11-09T09:00,3\n")
    assert [row.line for row in rows] == [2, 4]
    assert [row.why for row in refused] == ["its interval overlaps that of line 2"]


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999", "", "=1+1", "1_000", "1.234,50", "five"])
def test_what_is_no_finite_number_is_refused(tmp_path: Path, value: str) -> None:
    rows, refused = read(tmp_path, f"time;value\n2026-11-09T08:00;{value}\n2026-11-09T09:00;-12.5\n")
    assert [row.value for row in rows] == [-12.5]
    assert [row.line for row in refused] == [2]


def test_a_decimal_comma_is_read_unless_it_may_separate_thousands(tmp_path: Path) -> None:
    rows, refused = read(tmp_path, "time;value\n2026-11-09T08:00;12,5\n2026-11-09T09:00;1,234\n")
    assert [row.value for row in rows] == [12.5]
    assert [row.why for row in refused] == ["'1,234' can be read in two ways"]


def test_ends_of_a_file_are_exclusive_and_lie_after_starts(tmp_path: Path) -> None:
    lines = ["2026-11-09T08:00,2026-11-09T12:00,1", "2026-11-09T13:00,2026-11-09T13:00,2", "2026-11-09T14:00,,3"]
    rows, refused = read(tmp_path, "\n".join(["time,end,value", *lines]), every=None)
    assert [(row.to_ms - row.from_ms) // 3_600_000 for row in rows] == [4]
    assert [row.line for row in refused] == [3, 4]


@pytest.mark.parametrize(
    ("text", "code"),
    [("", "E202"), ("when,value\n", "E203"), ("time,amount\n", "E203")],
    ids=["empty", "time", "value"],
)
def test_a_file_that_lacks_what_it_needs_is_refused(tmp_path: Path, text: str, code: str) -> None:
    with pytest.raises(InputError) as refused:
        read(tmp_path, text)
    assert refused.value.code == code


def test_a_file_without_a_usable_line_stores_nothing(site: Site) -> None:
    with pytest.raises(InputError, match=r"no line of .* can be used"):
        added(site, "2026-11-09T08:00,nan")
    assert context_series(site) == {}


def test_the_same_file_again_adds_nothing(site: Site) -> None:
    lines = ("2026-11-09T08:00,5", "2026-11-09T09:00,7")
    assert added(site, *lines).n_new == 2
    before = (site.root / "context.jsonl").read_bytes()
    again = added(site, *lines, "2026-11-09T09:00,7")
    assert (again.n_new, again.n_known, again.refused) == (0, 2, ())
    assert (site.root / "context.jsonl").read_bytes() == before


def test_another_value_of_a_stored_interval_needs_replace(site: Site) -> None:
    added(site, "2026-11-09T08:00,5")
    refused = added(site, "2026-11-09T08:00,6", "2026-11-09T09:00,7").refused
    assert [row.why for row in refused] == ["the series has 5 for this interval, and the line says 6"]
    assert context_series(site)["sales"].values.tolist() == [5, 7]
    assert added(site, "2026-11-09T08:00,6", is_replacing=True).n_replaced == 1
    assert context_series(site)["sales"].values.tolist() == [6, 7]


@given(st.integers(0, 23), st.sampled_from(["15min", "30min", "1h", "2h", "5h"]))
def test_no_two_intervals_of_a_series_overlap(tmp_path_factory: pytest.TempPathFactory, hour: int, every: str) -> None:
    root = tmp_path_factory.mktemp("site")
    (root / "vsd.toml").write_text(site_text(), encoding="utf-8")
    site = load_site(root)
    added(site, *(f"2026-11-09T{h:02}:30,{h}" for h in (3, 9, 10, 22)))
    n_new = 0
    with suppress(InputError):  # the line is refused
        n_new = added(site, f"2026-11-09T{hour:02}:00,-1", every=every, is_replacing=True).n_new
    series = context_series(site)["sales"]
    assert (series.from_ms[1:] >= series.to_ms[:-1]).all()
    assert len(series.values) == 4 + n_new


def test_a_series_has_one_unit(site: Site) -> None:
    added(site, "2026-11-09T08:00,5")
    with pytest.raises(UsageError, match="the series sales has --unit EUR, and not USD"):
        added(site, "2026-11-09T09:00,5", unit="USD")
    added(site, "2026-11-09T09:00,5", unit=None)
    assert context_series(site)["sales"].unit == "EUR"


@pytest.mark.parametrize("name", ["Sales", "=cmd()", "../x", "a" * 41, "", "sales\n"])
def test_a_name_that_could_do_harm_is_refused(site: Site, name: str) -> None:
    with pytest.raises(UsageError, match="is no name of a series"):
        added(site, "2026-11-09T08:00,5", name=name)


def test_a_removed_series_is_gone_and_can_be_added_again(site: Site) -> None:
    added(site, "2026-11-09T08:00,5")
    assert remove_context(site, "sales", at=AT)
    assert context_series(site) == {}
    assert not remove_context(site, "sales", at=AT.replace(hour=10))
    added(site, "2026-11-09T09:00,8", unit="USD", at=AT.replace(hour=11))
    assert context_series(site)["sales"].unit == "USD"
    assert context_series(site)["sales"].values.tolist() == [8]
    assert remove_context(site, "sales", at=AT.replace(hour=12))
    with pytest.raises(UsageError, match="there is no series 'weather'"):
        remove_context(site, "weather", at=AT)


def test_a_file_that_was_edited_by_hand_is_refused_with_its_line(site: Site) -> None:
    added(site, "2026-11-09T08:00,5")
    with (site.root / "context.jsonl").open("a", encoding="utf-8") as file:
        file.write('{"at": "2026-11-16T09:00:00Z", "name": "sales", "from_ms": [1], "to_ms": [], "values": [2]}\n')
    with pytest.raises(InputError, match=r"line 2 of context\.jsonl is not a series of context"):
        context_series(site)


def test_the_command_says_what_was_added_and_what_was_not(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    file = site.root / "sales.csv"
    file.write_text("time,value\n2026-11-09T08:00,5\n2026-11-09T09:00,\x1b[2Jx\n", encoding="utf-8")
    project = ["-C", str(site.root), "--now", "2026-11-16T09:00Z", "context"]
    words = ["add", str(file), "--name", "sales", "--unit", "EUR", "--sum", "--every", "1h"]
    assert run(cli, [*project, *words]) == 1
    shown = capsys.readouterr()
    assert shown.out == "sales: 1 interval added\n"
    assert shown.err.startswith("line 3 not added: ")
    assert "\x1b" not in shown.err
    assert run(cli, [*project, "list", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["series"]
    assert (row["name"], row["first"], row["last"], row["n_intervals"]) == ("sales", "2026-11-09", "2026-11-09", 1)
    assert run(cli, [*project, "remove", "sales"]) == 0
    assert run(cli, [*project, "remove", "sales"]) == 0
    assert capsys.readouterr().out == "removed  sales\nwas removed before  sales\n"


def test_a_series_is_added_and_taken_back_again_at_one_instant(site: Site) -> None:
    """A clock that stands still, as `--now` does, makes no line pass for one that is there."""
    for _ in range(3):
        added(site, "2026-11-09T09:00,8")
        assert context_series(site)["sales"].values.tolist() == [8]
        assert remove_context(site, "sales", at=AT)
        assert context_series(site) == {}


def test_a_folder_is_no_series(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    (site.root / "sales").mkdir()
    assert run(cli, ["-C", str(site.root), "context", "add", str(site.root / "sales"), "--name", "sales"]) == 2
    assert "sales is a folder" in capsys.readouterr().err
