"""Opening hours that hold from a day on: written and taken back without a trace, and never in weeks that are over."""

from __future__ import annotations

import re
import shlex
from datetime import date, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.opening_changes import change_opening, take_opening_back
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, UsageError
from vsd_analytics.site.calendar import Opening
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.dimensions import bucket_quarters, calendar, is_open

TODAY = date(2026, 11, 18)
TOML = """# The shop.
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
opening = {{ mon-sat = "08:00-21:00" }}   # since 2019

[[floor]]
id = "hall"
name = "Hall"

[[camera]]
id = "cam-1"
name = "Camera"
floor = "hall"
{more}"""

quarters = st.integers(0, 96).map(lambda k: 15 * k)


@st.composite
def days(draw: st.DrawFn) -> tuple[tuple[int, int], ...]:
    edges = sorted(draw(st.sets(quarters, max_size=6)))
    return tuple(zip(edges[::2], edges[1::2], strict=False))


weeks: st.SearchStrategy[Opening] = st.tuples(*[days()] * 7)


def project(root: Path, more: str = "", *, end: str = "\n", mark: str = "") -> Site:
    (root / "vsd.toml").write_bytes((mark + TOML.format(more=more)).replace("\n", end).encode())
    return load_site(root)


def every_day(start: str, end: str) -> Opening:
    minutes = [int(clock[:2]) * 60 + int(clock[3:]) for clock in (start, end)]
    return (((minutes[0], minutes[1]),),) * 7


@settings(max_examples=60, deadline=None)
@given(
    weeks, weeks, st.integers(0, 30), st.integers(1, 30), st.sampled_from(["\n", "\r\n"]),
    st.sampled_from(["", "\ufeff"]),
    st.one_of(st.none(), st.sampled_from(["Anna", 'An"na\\', "Zoë ]]", "[[opening]]", "#"])), st.booleans(),
)  # fmt: skip
def test_what_is_written_holds_from_its_day_on_and_is_taken_back_without_a_trace(
    one: Opening, two: Opening, first: int, later: int, end: str, mark: str, by: str | None, is_first_gone_first: bool
) -> None:
    with TemporaryDirectory() as folder:
        root = Path(folder)
        before = project(root, end=end, mark=mark)
        text = (root / "vsd.toml").read_bytes()
        days_ = [TODAY + timedelta(days=first), TODAY + timedelta(days=first + later)]
        written = []
        for day, week in zip(days_, (one, two), strict=True):
            if change_opening(load_site(root), week, first=day, today=TODAY, by=by) is not None:
                written.append((day, week))
        site = load_site(root)
        assert [(c.first, c.opening, c.by) for c in site.opening_changes] == [(d, w, by) for d, w in written]
        assert site.hours.on(days_[0] - timedelta(days=1)) == before.opening
        assert site.hours.on(days_[0]) == one
        assert site.hours.on(days_[1]) == two
        for day, _ in written if is_first_gone_first else reversed(written):
            assert take_opening_back(load_site(root), day, today=TODAY) is not None
            assert take_opening_back(load_site(root), day, today=TODAY) is None
        assert (root / "vsd.toml").read_bytes() == text


@pytest.mark.parametrize("last", ["", "\n", "\n\n\n", "\r\n", "  # no line end", "\n# one\r\n# of two kinds\n"])
def test_other_lines_stay_as_they_are_however_the_file_ends(tmp_path: Path, last: str) -> None:
    text = (TOML.format(more="").rstrip("\n") + last).encode()
    (tmp_path / "vsd.toml").write_bytes(text)
    assert change_opening(load_site(tmp_path), every_day("08:00", "12:00"), first=TODAY, today=TODAY) is not None
    assert (tmp_path / "vsd.toml").read_bytes().startswith(text)
    take_opening_back(load_site(tmp_path), TODAY, today=TODAY)
    assert (tmp_path / "vsd.toml").read_bytes() == text + (b"" if last.endswith("\n") else b"\n")


@given(weeks, weeks, st.integers(0, 13))
@settings(max_examples=25, deadline=None)
def test_the_calendar_has_each_day_open_as_its_hours_say(one: Opening, two: Opening, first: int) -> None:
    with TemporaryDirectory() as folder:
        root = Path(folder)
        project(root)
        for day, week in ((TODAY + timedelta(days=first), one), (TODAY + timedelta(days=first + 3), two)):
            change_opening(load_site(root), week, first=day, today=TODAY)
        site = load_site(root)
        for row in calendar(site, TODAY, TODAY + timedelta(days=20)).to_pylist():
            minute = row["local_hour"] * 60 + row["quarter"] % 4 * 15  # Rome is whole hours from UTC
            opening = site.hours.on(row["local_date"])
            assert opening is not None
            expected = any(start <= minute < end for start, end in opening[row["local_date"].weekday()])
            assert row["is_open"] is expected
            assert is_open(site, row["local_date"], minute) is expected
        is_whole = all(m % 60 == 0 for o in site.hours.weeks for day in o for span in day for m in span)
        assert bucket_quarters(site) == (4 if is_whole else 1)


def test_weeks_that_are_over_keep_their_hours(tmp_path: Path) -> None:
    site, later = project(tmp_path), every_day("10:00", "12:00")
    monday = date(2026, 11, 16)
    with pytest.raises(UsageError, match="cannot change in the past"):
        change_opening(site, later, first=monday - timedelta(days=1), today=TODAY)
    assert change_opening(site, later, first=monday, today=TODAY) is not None
    with pytest.raises(UsageError, match="change on 2026-11-16 already"):
        change_opening(load_site(tmp_path), every_day("09:00", "12:00"), first=monday, today=TODAY)
    with pytest.raises(UsageError, match="cannot be taken back"):
        take_opening_back(load_site(tmp_path), monday, today=TODAY + timedelta(days=7))
    assert change_opening(load_site(tmp_path), later, first=TODAY, today=TODAY) is None, "they hold already"


@pytest.mark.parametrize(
    "more",
    [
        '\n[[opening]]\nhours = { mon = "08:00-20:00" }\nfrom = "2026-11-20"\n',
        '\n[[opening]]  # by hand\nfrom = 2026-11-20\n[opening.hours]\nmon = "08:00-20:00"\n',
    ],
)
def test_what_was_written_by_hand_is_left_to_the_hand(tmp_path: Path, more: str) -> None:
    site = project(tmp_path, more)
    text = (tmp_path / "vsd.toml").read_bytes()
    assert [c.first for c in site.opening_changes] == [date(2026, 11, 20)]
    with pytest.raises(ConfigError, match="cannot be written"):
        take_opening_back(site, date(2026, 11, 20), today=TODAY)
    assert (tmp_path / "vsd.toml").read_bytes() == text


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("\n[[opening]]\nfrom = '2026-11-20'\n", "has no hours"),
        ("\n[[opening]]\nhours = {}\n", "has no from"),
        ("\n[[opening]]\nfrom = 'soon'\nhours = {}\n", "from"),
        ("\n[[opening]]\nfrom = '2026-11-20'\nhours = { mo = '08:00-09:00' }\n", "no day of the week"),
        ("\n[[opening]]\nfrom = '2026-11-20'\nhours = {}\n" * 2, "two \\[\\[opening\\]\\] begin"),
        ("\n[[opening]]\nfrom = '2026-11-20'\nhours = {}\nuntil = 3\n", "until"),
    ],
)
def test_a_mistake_in_the_file_is_named_with_its_line(tmp_path: Path, more: str, said: str) -> None:
    with pytest.raises(ConfigError) as raised:
        project(tmp_path, more)
    assert any(re.search(said, problem.what) for problem in raised.value.problems)
    assert all(problem.where is not None and problem.where.line for problem in raised.value.problems)


def test_the_command_writes_lists_and_takes_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project(tmp_path)

    def vsd(*words: str) -> tuple[int, str]:
        code = run(cli, ["-C", str(tmp_path), "--now", "2026-11-18T10:00+01:00", "opening", *words])
        said = capsys.readouterr()
        return code, said.out + said.err

    assert vsd("mon-sat 08:00-20:00, sun 10:00-13:00 15:00-18:00", "--from", "2026-11-23", "--by", "Anna")[0] == 0
    code, text = vsd()
    assert code == 0
    assert "sun 10:00-13:00 15:00-18:00  (Anna)" in text
    for words in (("mon 08:00-20:00",), ("--from", "2026-11-30"), ("--take-back", "2026-11-23", "--by", "Anna")):
        code, text = vsd(*words)
        assert code == 2
        (fix,) = re.findall(r"fix: vsd opening (.*)", text)
        assert vsd(*shlex.split(fix))[0] == 0, "what it proposes works"
    vsd("--take-back", "2026-11-18")
    assert vsd("mon-sat 08:00-20:00, sun 10:00-13:00 15:00-18:00", "--from", "2026-11-23", "--by", "Anna")[0] == 0
    assert vsd("mon 08:10-20:00", "--from", "2026-11-24")[0] == 2
    assert vsd("--take-back", "2026-11-23") == (0, "taken back\n")
    assert vsd("--take-back", "2026-11-23") == (0, "no opening hours begin on that day\n")
