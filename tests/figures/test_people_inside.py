"""People inside by the doors (M58): from the empty hour on, unknown after a gap, with the drift of the doors."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from figures.test_line_counts import LINE, shop, through
from hypothesis import given
from hypothesis import strategies as st
from warehouse.small_projects import DAY, HOUR, T0, Frame, Person, beats

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError
from vsd_analytics.figures.doors import drift_of, inside_by_doors

DOORS = LINE + 'inside = "left"\n[doors]\nempty_at = "09:00"\n'
QUARTER = HOUR // 4
MONDAY = date(2026, 11, 9)


def row(
    quarter: int, n_in: int | None, n_out: int | None, *, line: str = "door", is_whole: bool = True
) -> dict[str, Any]:
    """Return a quarter-hour of a door whose left side is inside; quarter 0 begins at 04:00."""
    return {
        "line_id": line,
        "quarter": quarter,
        "local_date": MONDAY,
        "local_hour": 4 + quarter // 4,
        "minute": quarter % 4 * 15,
        "is_open": quarter < 8,
        "is_whole": is_whole,
        "is_over": True,
        "n_to_left": n_in,
        "n_to_right": n_out,
    }


def after(rows: Sequence[dict[str, Any]]) -> list[int | None]:
    return [q.after for q in inside_by_doors(rows, {"door": "left"}, empty_min=240)]


def test_the_number_runs_from_the_empty_hour_on() -> None:
    assert after([row(-1, 9, 0), row(0, 5, 1), row(1, 2, 3), row(2, 0, 3)]) == [4, 3, 0]


def test_after_a_gap_the_number_is_unknown_until_the_next_empty_hour() -> None:
    rows = [row(0, 5, 1), row(1, None, None, is_whole=False), row(2, 1, 1), row(3, 0, 4)]
    assert after(rows) == [4, None, None, None]
    assert after([*rows, {**row(0, 2, 0), "quarter": 96}]) == [4, None, None, None, 2]
    assert after([row(0, 5, 1), row(1, 2, 0, is_whole=False)]) == [4, None], "a part of a quarter-hour is a gap, too"


def test_all_doors_count_each_with_its_own_inside() -> None:
    rows = [row(0, 5, 1), row(0, 2, 7, line="back")]
    (quarter,) = inside_by_doors(rows, {"door": "left", "back": "right"}, empty_min=240)
    assert (quarter.n_in, quarter.n_out, quarter.after) == (12, 3, 9)


def test_the_drift_is_what_is_left_when_the_day_is_over() -> None:
    of_day = [row(k, 3, 3) for k in range(7)] + [row(7, 0, 2), row(8, 0, 1)]
    assert drift_of(list(inside_by_doors(of_day, {"door": "left"}, empty_min=240))) == -3
    unrecorded = [*of_day, row(9, None, None, is_whole=False)]
    assert drift_of(list(inside_by_doors(unrecorded, {"door": "left"}, empty_min=240))) == -3, (
        "nobody is there at night"
    )
    gap = [*of_day[:7], row(7, 0, 2, is_whole=False), *of_day[8:]]
    assert drift_of(list(inside_by_doors(gap, {"door": "left"}, empty_min=240))) is None


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9), st.booleans()), max_size=12))
def test_a_known_number_is_in_less_out_of_whole_quarters(counts: list[tuple[int, int, bool]]) -> None:
    found = after([row(k, n_in, n_out, is_whole=whole) for k, (n_in, n_out, whole) in enumerate(counts)])
    for k, n in enumerate(found):
        is_known = all(whole for _, _, whole in counts[: k + 1])
        assert n == (sum(i - o for i, o, _ in counts[: k + 1]) if is_known else None)


def day_of(d: int, *, in_: int, out: int) -> list[Person | Frame]:
    """Return a recorded hour in whose first half people come in, and in whose second half people go out."""
    day = T0 + d * DAY
    records: list[Person | Frame] = []
    for k in range(in_):
        records += through(day + k * 30_000, f"in-{d}-{k}")
    for k in range(out):
        records += through(day + HOUR // 2 + k * 30_000, f"out-{d}-{k}", way=-1)
    return [*records, *beats(day, day + HOUR)]


def printed(root: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, list[dict[str, Any]]]:
    capsys.readouterr()
    run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", "--quiet", "lines", "--json", "--week", "2026-W46"])
    answers = json.loads(capsys.readouterr().out)["answers"]
    return {name: answer["rows"] for name, answer in answers.items()}


def test_a_week_of_a_shop_has_people_inside_and_the_drift_of_its_door(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    records = [r for d in range(7) for r in day_of(d, in_=50, out=50 if d else 48)]
    found = printed(shop(tmp_path, records, lines=DOORS), capsys)
    (whole,) = found["doors"]
    assert [whole[n]["value"] for n in ("n_in", "n_out", "most_people")] == [350, 348, 50]
    assert whole["drift"]["value"] == pytest.approx(2 / 7, rel=0.01)
    assert whole["drift_per_1000"]["value"] == pytest.approx(1000 * 2 / 698, rel=0.01)
    assert (whole["known_open_h"], whole["open_h"], whole["n_days"]) == (7, 7, 7)
    assert [r["drift"]["value"] for r in found["door_days"]] == [2, *[0] * 6]
    assert 20 < whole["people"]["value"] < 30, "linearly up to 50, and down again"


def test_a_door_that_was_not_recorded_makes_the_rest_of_its_day_unknown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = T0 + 2 * DAY + QUARTER
    records = [r for d in range(7) for r in day_of(d, in_=50, out=50) if not first <= r.ts < first + 300_000]
    days = printed(shop(tmp_path, records, lines=DOORS), capsys)["door_days"]
    assert [r["drift"]["value"] for r in days] == [0, 0, None, 0, 0, 0, 0]
    assert days[2]["known_open_h"] == 0.25
    assert days[2]["n_in"]["value"] == 40, "who was seen"


def test_without_an_empty_hour_the_answer_says_what_lacks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = shop(tmp_path, day_of(0, in_=20, out=20), lines=LINE + 'inside = "left"\n')
    capsys.readouterr()
    run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", "--quiet", "lines", "--week", "2026-W46"])
    assert 'add [doors] empty_at = "04:00"' in capsys.readouterr().out


def test_an_empty_hour_is_a_whole_quarter_hour(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        shop(tmp_path, [], lines='[doors]\nempty_at = "04:10"\n')
    assert "not on a quarter hour" in str(caught.value.problems[0])
    (tmp_path / "vsd.toml").write_text((tmp_path / "vsd.toml").read_text("utf-8").replace("04:10", "04:15"), "utf-8")
    assert load_site(tmp_path).doors_empty_min == 255


def test_sums_over_doors_do_not_tell_the_few_of_one_door(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    back = '[[line]]\nid = "back"\nname = "Back"\npoints = [[4, 0], [6, 0]]\ninside = "left"\n'
    records: list[Person | Frame] = [r for d in range(7) for r in day_of(d, in_=50, out=50)]
    for d, n in ((1, 1), (2, 3), (3, 9)):  # out by the back door: 13 in the week, few on two days
        for k in range(n):
            start = T0 + d * DAY + HOUR // 2 + 15_000 + k * 30_000
            records += [Person(start + i * 1000, f"back-{d}-{k}", 5000, 1500 - i * 600) for i in range(6)]
    root = shop(tmp_path, sorted(records, key=lambda r: r.ts), lines=DOORS.replace("[doors]", back + "[doors]"))
    found = printed(root, capsys)
    back_days = [r["n_to_right"]["value"] for r in found["line_days"] if r["line_id"] == "back"]
    assert back_days == [0, None, None, None, 0, 0, 0]
    assert [r["n_out"]["value"] for r in found["door_days"]] == [None] * 7, "less the other door, it is the back door's"
    assert [r["drift"]["value"] for r in found["door_days"]] == [None] * 7, "people in less this are people out"
    assert [r["n_in"]["value"] for r in found["door_days"]] == [50] * 7
    (whole,) = found["doors"]
    assert (whole["n_in"]["value"], whole["n_out"]["value"]) == (350, 363)
    assert (whole["drift"]["value"], whole["drift_per_1000"]["value"]) == (None, None), "of 0, it would tell each day"
    assert not {"n_in_least", "n_out_least", "n_day_least"} & whole.keys()
