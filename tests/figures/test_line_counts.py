"""Crossings of counting lines (M57): every crossing of a known world, unknown where not recorded, small ones hidden."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from report import ingested_worlds as w
from warehouse.small_projects import DAY, HOUR, T0, Frame, Person, beats, put

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site

LINE = '[[line]]\nid = "door"\nname = "<b>Door</b>"\npoints = [[0, 0], [2, 0]]\nleft = "Shop"\nright = "Street"\n'
QUARTER = HOUR // 4
NOW = "2026-11-20T12:00:00Z"


def through(start_ms: int, track: str | None, *, way: int = 1) -> list[Person]:
    """Return somebody who walks through the door, to the left (1) or to the right (-1)."""
    return [Person(start_ms + i * 1000, track, 1000, way * (-1500 + i * 600)) for i in range(6)]


def shop(root: Path, records: Sequence[Person | Frame], *, lines: str = LINE) -> Path:
    text = w.toml(cameras=("cam",), opening='{ mon-sun = "09:00-10:00" }') + lines
    (root / "vsd.toml").write_text(text, encoding="utf-8")
    put(load_site(root), records)
    return root


def printed(
    root: Path,
    capsys: pytest.CaptureFixture[str],
    *arguments: str,
    code: int = 0,
    week: str = "2026-W46",
    now: str = NOW,
) -> dict[str, list[dict[str, Any]]]:
    capsys.readouterr()
    options = ["-C", str(root), "--now", now, "--quiet", "lines", "--json", *arguments]
    assert run(cli, [*options, "--week", week]) == code
    answers = json.loads(capsys.readouterr().out)["answers"]
    return {name: answer["rows"] for name, answer in answers.items()}


def week(*, in_: int, out: int, but: tuple[int, int] | None = None) -> list[Person | Frame]:
    """Return a week with so many people in and out a day; the day and quarter-hour of `but` are not recorded."""
    records: list[Person | Frame] = []
    for d in range(7):
        day = T0 + d * DAY
        for k in range(in_):
            records += through(day + k * 60_000, f"in-{d}-{k}")
        for k in range(out):
            records += through(day + 30_000 + k * 60_000, f"out-{d}-{k}", way=-1)
        records += beats(day, day + HOUR)
    if but is None:
        return records
    first = T0 + but[0] * DAY + but[1] * QUARTER
    return [r for r in records if not first <= r.ts < first + QUARTER]


def test_every_crossing_of_a_week_is_counted_by_direction_day_and_hour(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = printed(shop(tmp_path, week(in_=20, out=12)), capsys)
    (whole,) = found["lines"]
    assert (whole["left"], whole["right"]) == ("Shop", "Street")
    assert [whole[n]["value"] for n in ("n_to_left", "n_to_right", "net_to_left")] == [140, 84, 56]
    assert (whole["recorded_h"], whole["unrecorded_open_h"]) == (7, 0)
    assert [row["n_to_left"]["value"] for row in found["line_days"]] == [20] * 7
    by_hour = {row["local_hour"]: row["n_to_right"]["value"] for row in found["line_hours"]}
    assert (len(by_hour), by_hour[9], by_hour[10]) == (24, 84, None)


def test_where_a_camera_was_down_the_net_number_is_unknown_and_no_zero(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = printed(shop(tmp_path, week(in_=20, out=12, but=(2, 3))), capsys)
    (whole,) = found["lines"]
    assert whole["net_to_left"]["value"] is None
    assert whole["net_to_left"]["reason"].startswith("0.25 opening hours were not recorded in full")
    assert whole["unrecorded_open_h"] == 0.25
    assert whole["n_to_left"]["value"] == 140, "nobody came in the last quarter-hour"
    assert [row["net_to_left"]["value"] for row in found["line_days"]] == [8, 8, None, 8, 8, 8, 8]


def test_a_line_that_nobody_recorded_is_unknown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = shop(tmp_path, week(in_=20, out=12))
    (row,) = printed(root, capsys, "--exact", week="2026-W47", code=1)["lines"]
    assert [row[n]["value"] for n in ("n_to_left", "n_to_right", "net_to_left")] == [None] * 3


def test_days_to_come_of_a_week_that_goes_on_are_not_days_without_a_record(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    records = [r for r in week(in_=20, out=12) if r.ts < T0 + 2 * DAY + HOUR]
    root = shop(tmp_path, records, lines=LINE + 'inside = "left"\n[doors]\nempty_at = "08:00"\n')
    found = printed(root, capsys, "--exact", now="2026-11-11T09:30:00Z")
    (whole,) = found["lines"]
    assert (whole["unrecorded_open_h"], whole["open_h"], whole["net_to_left"]["value"]) == (0, 3, 24)
    assert [row["local_date"] for row in found["line_days"]] == ["2026-11-09", "2026-11-10", "2026-11-11"]
    (doors,) = found["doors"]
    assert (doors["open_h"], doors["n_days"], doors["n_in"]["value"]) == (3, 3, 60)
    assert [row["local_date"] for row in found["door_days"]] == [row["local_date"] for row in found["line_days"]]


def test_people_without_ids_cannot_be_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records = [*(r for d in range(7) for r in through(T0 + d * DAY, None)), *beats(T0, T0 + HOUR)]
    (row,) = printed(shop(tmp_path, records), capsys, code=1)["lines"]
    assert (row["n_to_left"]["value"], row["n_to_left"]["state"]) == (None, "not_measurable")


def test_few_people_are_hidden_and_what_tells_them_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records = [*week(in_=20, out=0), *through(T0 + 2 * DAY, "one", way=-1)]
    root = shop(tmp_path, records)
    found = printed(root, capsys)
    (whole,) = found["lines"]
    assert whole["n_to_right"]["value"] is None
    assert whole["net_to_left"]["value"] is None
    assert whole["n_to_left"]["value"] == 140
    assert [row["n_to_right"]["value"] for row in found["line_days"]] == [None] * 7
    (exact,) = printed(root, capsys, "--exact")["lines"]
    assert (exact["n_to_right"]["value"], exact["net_to_left"]["value"]) == (1, 139)


def test_without_a_line_the_command_says_how_to_draw_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = shop(tmp_path, week(in_=1, out=0), lines="")
    assert run(cli, ["-C", str(root), "--quiet", "lines", "--week", "2026-W46"]) == 2
    assert "[[line]]" in capsys.readouterr().err


def test_text_shows_sides_by_their_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = shop(tmp_path, week(in_=20, out=12))
    capsys.readouterr()
    assert run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", "--quiet", "lines", "--week", "2026-W46"]) == 0
    out = capsys.readouterr().out
    assert "Crossings of counting lines" in out
    head, row = out.splitlines()[2:4]
    assert [part.strip() for part in head.split("  ") if part][:5] == [
        *("name", "left is", "to the left", "right is", "to the right"),
    ]
    assert row.split()[:5] == ["<b>Door</b>", "Shop", "140", "Street", "84"]


def test_the_busiest_quarter_hour_is_put_beside_what_the_width_lets_through(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    records = [*week(in_=20, out=12), *(p for k in range(40) for p in through(T0 + 2 * DAY + k * 10_000, f"more-{k}"))]
    (row,) = printed(shop(tmp_path, records), capsys, "--exact")["line_peaks"]
    n = 40 + 15 + 12  # those who are more, and in the first quarter-hour one a minute in, and out
    assert row["people_per_min"]["value"] == pytest.approx(n / 15, rel=1e-4)
    assert row["per_m_s"]["value"] == pytest.approx(n / 900 / 2, rel=1e-4)
    assert row["of_most_share"]["value"] == pytest.approx(n / 900 / 2 / 1.3, rel=1e-4)
    assert (row["local_date"], row["local_hour"], row["width_m"], row["whole_h"]) == ("2026-11-11", 9, 2, 7)


def test_a_busiest_quarter_hour_that_tells_few_people_is_hidden(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    many = [p for k in range(20) for p in through(T0 + k * 10_000, f"in-{k}")]
    root = shop(tmp_path, [*many, *through(T0 + 2 * QUARTER, "late"), *beats(T0, T0 + HOUR)])
    (row,) = printed(root, capsys)["line_peaks"]
    assert row["people_per_min"]["value"] is None, "21 people on that day less 20 in the quarter-hour is one"
    assert "local_date" not in row
    (exact,) = printed(root, capsys, "--exact")["line_peaks"]
    assert (exact["people_per_min"]["value"], exact["n_least"]["value"]) == (pytest.approx(20 / 15, rel=1e-4), 1)
