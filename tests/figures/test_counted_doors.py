"""Lines that door counters count (M57, M58): their sums, hidden where small, unknown where missing."""

from __future__ import annotations

from pathlib import Path

import pytest
from figures.test_line_counts import printed
from report import ingested_worlds as w

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

COUNTED = '[[line]]\nid = "{0}"\nname = "{0}"\ncounted_by = "counter"\nleft = "Shop"\nright = "Street"\n'
DOOR = COUNTED.format("door")
DAYS = [f"2026-11-{day:02}" for day in range(9, 16)]


def site(root: Path, *, more: str = "", text: str = DOOR) -> Path:
    config = w.toml(cameras=("cam",), opening='{ mon-sun = "08:00-10:00" }') + text + more
    (root / "vsd.toml").write_text(config, encoding="utf-8")
    return root


def add(root: Path, rows: list[str], *columns: str, line: str = "door", every: str = "1h") -> None:
    file = root / "doors.csv"
    file.write_text("\n".join(["time,in,out", *rows]), encoding="utf-8")
    assert (
        run(cli, ["-C", str(root), "counts", "add", str(file), "--line", line, *columns, "--every", every, "--yes"])
        == 0
    )


SIDES = ("--left", "in", "--right", "out")


def test_sums_of_a_counter_are_printed_without_any_camera_record(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = site(tmp_path)
    add(root, [f"{day}T{hour:02}:00,20,12" for day in DAYS for hour in (8, 9)], *SIDES)
    answers = printed(root, capsys)
    (whole,) = answers["lines"]
    values = [whole[n]["value"] for n in ("n_to_left", "n_to_right", "n_both", "net_to_left")]
    assert values == [280, 168, 448, 112]
    assert (whole["recorded_h"], whole["unrecorded_open_h"], whole["recorded_open_share"]) == (14, 0, 1)
    by_hour = {row["local_hour"]: row["n_both"]["value"] for row in answers["line_hours"]}
    assert (by_hour[8], by_hour[9], by_hour[10]) == (224, 224, None)


def test_an_hour_that_was_not_sent_makes_the_net_number_unknown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = site(tmp_path)
    rows = [f"{day}T{hour:02}:00,20,12" for day in DAYS for hour in (8, 9)]
    add(root, rows[:-1], *SIDES)
    (whole,) = printed(root, capsys)["lines"]
    assert whole["net_to_left"]["value"] is None
    assert (whole["n_to_left"]["value"], whole["unrecorded_open_h"]) == (260, 1)


def test_a_counter_with_one_number_has_no_sides_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = site(tmp_path)
    add(root, [f"{day}T{hour:02}:00,20,0" for day in DAYS for hour in (8, 9)], "--both", "in")
    (whole,) = printed(root, capsys)["lines"]
    assert whole["n_both"]["value"] == 280
    assert whole["n_to_left"]["reason"] == "the counter of this line has one number for both ways"
    assert whole["net_to_left"]["value"] is None


def test_few_people_are_hidden_and_the_sum_that_tells_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = site(tmp_path)
    add(root, [f"{day}T08:00,20,{int(day == DAYS[2])}" for day in DAYS], *SIDES)
    (whole,) = printed(root, capsys)["lines"]
    assert [whole[n]["value"] for n in ("n_to_left", "n_to_right", "n_both", "net_to_left")] == [140, None, None, None]


def test_people_inside_are_told_by_counters_and_unknown_with_one_that_has_one_number(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    doors = 'inside = "left"\n[doors]\nempty_at = "08:00"\n'
    root = site(tmp_path, text=DOOR + doors)
    hours = range(24)
    add(root, [f"{day}T{h:02}:00,{40 if h == 8 else 0},{40 if h == 9 else 0}" for day in DAYS for h in hours], *SIDES)
    (whole,) = printed(root, capsys)["doors"]
    assert (whole["most_people"]["value"], whole["drift"]["value"], whole["known_open_h"]) == (40, 0, 14)
    other = COUNTED.format("gate") + 'inside = "left"\n'
    root = site(root, text=DOOR + doors.replace("[doors]", other + "[doors]"))
    add(root, [f"{day}T{h:02}:00,9,0" for day in DAYS for h in hours], "--both", "in", line="gate")
    (whole,) = printed(root, capsys)["doors"]
    assert (whole["people"]["value"], whole["known_open_h"]) == (None, 0)


@pytest.mark.parametrize(("early", "is_told"), [(0, True), (3, False), (6, True)])
def test_people_before_the_empty_hour_are_not_told_by_doors_beside_their_lines(
    early: int, is_told: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = site(tmp_path, text=DOOR + 'inside = "left"\n[doors]\nempty_at = "08:00"\n')
    n_in = {(DAYS[0], 6): early, **{(day, 8): 40 for day in DAYS}}
    rows = [f"{d}T{h:02}:00,{n_in.get((d, h), 0)},{40 if h == 9 else 0}" for d in DAYS for h in range(24)]
    add(root, rows, *SIDES)
    found = printed(root, capsys)
    assert found["lines"][0]["n_to_left"]["value"] == 280 + early
    assert found["doors"][0]["n_in"]["value"] == (280 if is_told else None)


def test_the_most_people_inside_are_hidden_where_they_are_few(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = site(tmp_path, text=DOOR + 'inside = "left"\n[doors]\nempty_at = "08:00"\n')
    quarters = [f"{h:02}:{m:02}" for h in range(24) for m in range(0, 60, 15)]
    n = {"08:00": (3, 0), "08:15": (30, 30), "09:45": (0, 3)}
    add(
        root, [f"{d}T{q},{','.join(map(str, n.get(q, (0, 0))))}" for d in DAYS for q in quarters], *SIDES, every="15min"
    )
    (whole,) = printed(root, capsys)["doors"]
    assert (whole["n_in"]["value"], whole["most_people"]["value"]) == (231, None)


def test_hours_that_were_not_recorded_are_printed_only_where_the_site_is_open(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = site(tmp_path)
    add(root, [f"{day}T{h:02}:00,20,12" for day in DAYS for h in (6, 8)], *SIDES)
    capsys.readouterr()
    assert run(cli, ["-C", str(root), "--now", "2026-11-20T12:00:00Z", "--quiet", "lines", "--week", "2026-W46"]) == 0
    printed_hours = capsys.readouterr().out.split("hour of the day")[1].split()
    assert [hour for hour in printed_hours if hour.endswith(":00")] == ["06:00", "08:00", "09:00"]


def test_the_busiest_quarter_hour_of_a_counter_is_that_of_its_sums(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = site(tmp_path)
    quarters = [(h, m) for h in (8, 9) for m in range(0, 60, 15)]
    add(root, [f"{d}T{h:02}:{m:02},{45 if (h, m) == (9, 15) else 20},10" for d in DAYS for h, m in quarters], *SIDES,
        every="15min")  # fmt: skip
    (peak,) = printed(root, capsys)["line_peaks"]
    assert peak["people_per_min"]["value"] == pytest.approx(55 / 15, rel=1e-3)
    assert (peak["per_m_s"]["value"], peak["per_m_s"]["reason"]) == (
        None,
        "the line is not drawn, so its width is unknown",
    )
    assert peak["whole_h"] == 14
