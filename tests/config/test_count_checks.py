"""Counts of another door, unit, clock or direction are noticed at the door, and what a message advises settles it."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.site_text import site_text
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.count_checks import count_warnings
from vsd_analytics.config.door_counts import door_counts
from vsd_analytics.config.project import load_site

MONDAY = datetime(2026, 8, 31)
N_WEEKS = 6
HOUR_MS = 3_600_000
LINES = "".join(f'[[line]]\nid = "{line}"\nname = "{line}"\ncounted_by = "counter"\n' for line in ("door", "side"))
Row = tuple[datetime, int, int]
IN_OUT = "--left in --right out"


def hours(first_week: int, last_week: int, *, seed: int = 1, busy: float = 1.0) -> list[Row]:
    """Return people in and out of each hour of some weeks: in by noon, out in the evening, nobody at night."""
    rng = np.random.default_rng([seed, first_week])
    rows = []
    for k in range(first_week * 168, last_week * 168):
        at = MONDAY + timedelta(hours=k)
        into, out = (busy * 80 * np.exp(-((at.hour - peak) ** 2) / 8) for peak in (11, 17))
        rows.append((at, int(rng.poisson(into)), int(rng.poisson(out))))
    return rows


def written(folder: Path, rows: Sequence[Row]) -> Path:
    file = folder / "doors.csv"
    lines = (f"{at:%Y-%m-%dT%H:%M},{into},{out}\n" for at, into, out in rows)
    file.write_text("time,in,out\n" + "".join(lines), encoding="utf-8")
    return file


@pytest.fixture
def add(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str]]:
    """Return a function that adds rows and returns exit code and messages; six weeks are stored."""
    (tmp_path / "vsd.toml").write_text(site_text(more=LINES), encoding="utf-8")

    def added(rows: Sequence[Row], *options: str, line: str = "door", ways: str = IN_OUT) -> tuple[int, str]:
        words = ["-C", str(tmp_path), "counts", "add", str(written(tmp_path, rows)), "--line", line, "--every", "1h"]
        code = run(cli, [*words, *ways.split(), *options])
        return code, capsys.readouterr().err

    assert added(hours(0, N_WEEKS)) == (0, "")
    return added


THIS = hours(N_WEEKS, N_WEEKS + 1)


def totals(rows: Sequence[Row]) -> list[Row]:
    return [(at, sum(into for _, into, _ in rows[: k + 1]), 0) for k, (at, _, _) in enumerate(rows)]


def test_a_usual_week_and_a_busy_one_are_added_without_a_word(add: Callable[..., tuple[int, str]]) -> None:
    assert add(THIS) == (0, "")
    assert add(hours(N_WEEKS, N_WEEKS + 1, seed=2, busy=2.5), "--replace") == (0, "")


@pytest.mark.parametrize(
    ("rows", "ways", "said"),
    [
        ([(t, 10 * i, 10 * o) for t, i, o in THIS], IN_OUT, "times as many people"),
        ([(t, 0, 0) for t, _, _ in THIS], IN_OUT, "times fewer people"),
        (THIS, "--left out --right in", "the other way round"),
        ([(t, 37, 37) if t.day > 15 else (t, i, o) for t, i, o in THIS], IN_OUT, "in a row have 74 people"),
    ],
)
def test_unlike_the_weeks_before_is_a_warning_and_the_right_file_replaces_it(
    add: Callable[..., tuple[int, str]], rows: Sequence[Row], ways: str, said: str
) -> None:
    code, err = add(rows, ways=ways)
    assert (code, "warning[W232]" in err, said in err) == (1, True, True), err
    assert add(THIS, "--replace") == (0, "")


@pytest.mark.parametrize(
    ("rows", "line", "said"),
    [
        (totals(THIS), "door", "as totals do"),
        ([row for day in range(7) for row in totals(THIS[24 * day : 24 * day + 24])], "door", "as totals do"),
        ([(t + timedelta(days=7), i, o) for t, i, o in hours(0, N_WEEKS)[-168:]], "door", "those of 7 days before"),
        (hours(0, N_WEEKS)[-24:], "side", "are those of line 'door'"),
        ([(t - timedelta(hours=9), i, o) for t, i, o in THIS[24:]], "door", "if its times are 9 hours later"),
    ],
)
def test_what_cannot_be_is_not_added_unless_the_user_says_so(
    add: Callable[..., tuple[int, str]], tmp_path: Path, rows: Sequence[Row], line: str, said: str
) -> None:
    site = load_site(tmp_path)
    before = door_counts(site, line)
    code, err = add(rows, line=line)
    assert (code, "error[E211]" in err, said in err) == (2, True, True), (code, err)
    assert door_counts(site, line).equals(before)
    code, err = add(rows, "--yes", line=line)
    assert code == 0
    assert len(door_counts(site, line)) > len(before)
    assert said in err, "it is added, and still said"


def test_times_of_another_zone_are_right_with_the_zone_that_the_message_asks_for(
    add: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    zone = load_site(tmp_path).zone
    far = [(t.replace(tzinfo=zone) + timedelta(hours=9), i, o) for t, i, o in THIS[:96]]
    assert add(far)[0] == 2
    ahead = [(t.replace(tzinfo=None), i, o) for t, i, o in far]
    code, err = add(ahead, "--zone", "Asia/Tokyo")
    assert code == 0, err


def test_json_has_the_warnings(add: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    file = written(tmp_path, [(t, 10 * i, 10 * o) for t, i, o in THIS])
    words = f"-C {tmp_path} counts add {file} --line door {IN_OUT} --every 1h --json"
    result = CliRunner().invoke(cli, words.split())
    assert [w["code"] for w in json.loads(result.output)["warnings"]] == ["W232"]


@settings(max_examples=40, deadline=None)
@given(st.dictionaries(st.integers(0, 400), st.integers(0, 300), max_size=200), st.integers(0, 400))
def test_any_counts_are_judged_without_an_error(people: dict[int, int], first: int) -> None:
    new = {(k * HOUR_MS, (k + 1) * HOUR_MS): (None, None, n) for k, n in people.items() if k >= first}
    old = {(k * HOUR_MS, (k + 1) * HOUR_MS): (None, None, n) for k, n in people.items() if k < first}
    count_warnings("door", new, old, {"side": old}, timezone="Europe/Rome")
