"""Mirrored axes and yards are seen where a plan has shelves or doors; the card and a picture say the rest."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from walks import START, project

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

WIDTH_M, HEIGHT_M = 20.0, 12.0
SHELVES = [(6.0, 1.5, 9.0, 4.0), (12.0, 1.5, 15.0, 4.0), (6.0, 10.9, 18.0, 11.9)]
DOOR = (0.0, 10.0, 2.0, 12.0)
Turn = Callable[[float, float], tuple[float, float]]
TURNS: dict[str, Turn] = {
    "y": lambda x, y: (x, HEIGHT_M - y),
    "180 degrees": lambda x, y: (WIDTH_M - x, HEIGHT_M - y),
    "yards": lambda x, y: (x / 0.9144, y / 0.9144),
}


def ways(turn: Turn = lambda x, y: (x, y), *, seed: int = 3) -> str:
    """Return people who come by the door at the upper left, walk around the shelves, and leave by it."""
    random = np.random.default_rng(seed)
    lines = ["ts,track_id,x_m,y_m"]
    for track in range(40):
        far = random.uniform(10, 19)
        lane = random.uniform(9.4, 10.6)
        aisles = [
            corner for x in (5.6, 11.5, 17.0) for corner in ((x, lane), (x, 1.0), (x + 0.4, 1.0), (x + 0.2, lane))
        ]
        corners = [(1, 11), (3, lane), *aisles, (far, lane), (3, lane), (1, 11)]
        path: list[tuple[float, float]] = []
        for (ax, ay), (bx, by) in pairwise(corners):
            n = max(1, int(np.hypot(bx - ax, by - ay) / 1.1))
            path += [(ax + (bx - ax) * k / n, ay + (by - ay) * k / n) for k in range(n)]
        for second, place in enumerate(path):
            x, y = turn(*(np.array(place) + random.normal(0, 0.08, 2)))
            ms = (track * 30 + second) * 1000
            at = np.datetime_as_string(np.datetime64(START.replace(tzinfo=None), "ms") + np.timedelta64(ms, "ms"))
            lines.append(f"{at}Z,{track},{x:.3f},{y:.3f}")
    head, *body = lines
    return "\n".join([head, *sorted(body)]) + "\n"


def polygon(box: tuple[float, float, float, float]) -> str:
    left, low, right, high = box
    return f"polygon = [[{left}, {low}], [{right}, {low}], [{right}, {high}], [{left}, {high}]]"


def hall(folder: Path, *, has_shelves: bool = True, has_door: bool = False) -> Path:
    root = project(folder)
    more = "".join(
        f'[[fixture]]\nid = "s{n}"\nname = "Shelf"\nfloor = "ground"\n{polygon(box)}\n'
        for n, box in enumerate(SHELVES if has_shelves else [])
    )
    if has_door:
        more += f'[[area]]\nid = "d"\nname = "Door"\nfloor = "ground"\ndoor = true\n{polygon(DOOR)}\n'
    with (root / "vsd.toml").open("a", encoding="utf-8") as toml:
        toml.write(more)
    return root


def ingest(root: Path, text: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    (root / "a.csv").write_text(text)
    code = run(cli, ["-C", str(root), "--now", "2025-12-01", "ingest", str(root / "a.csv")])
    return code, "".join(capsys.readouterr())


@pytest.mark.parametrize("name", TURNS)
def test_people_inside_shelves_are_refused_with_the_turn_that_fits(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = ingest(hall(tmp_path), ways(TURNS[name]), capsys)
    assert code == 2
    assert "inside fixtures" in said
    assert {"y": "y seems to point down", "180 degrees": "upper right corner", "yards": "--unit yd"}[name] in said
    assert not list(tmp_path.glob("store/**/*.parquet"))


def test_ways_that_begin_at_no_door_are_warned_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = ingest(hall(tmp_path, has_shelves=False, has_door=True), ways(TURNS["y"]), capsys)
    assert code == 1
    assert list(tmp_path.glob("store/**/*.parquet"))
    assert "begin and end at a door" in said
    assert "y seems to point down" in said


@pytest.mark.parametrize("has_shelves", [True, False])
@pytest.mark.parametrize("has_door", [True, False])
def test_positions_on_their_plan_are_not_doubted(
    has_shelves: bool, has_door: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = ingest(hall(tmp_path, has_shelves=has_shelves, has_door=has_door), ways(), capsys)
    assert code == 0
    assert "warning" not in said


def test_one_person_who_sits_on_a_shelf_all_day_is_one_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sits = "".join(f"2025-11-25T09:{s // 60:02}:{s % 60:02}Z,99,7.{s % 3},2.{s % 2}\n" for s in range(1800))
    code, said = ingest(hall(tmp_path), ways() + sits, capsys)
    assert code == 0
    assert "W220" not in said


def test_the_card_says_what_is_taken_for_granted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, said = ingest(hall(tmp_path, has_shelves=False), ways(TURNS["y"]), capsys)
    assert "x grows to the right, y upwards; vsd check --picture where.svg" in said
    assert "yards and metres (9 %) cannot be distinguished" in said


def test_a_picture_shows_positions_upwards_on_plan_fixtures_and_areas(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = hall(tmp_path / "site", has_door=True)
    (tmp_path / "<b>.csv").write_text("ts,track_id,x_m,y_m\n2025-11-25T09:00:00Z,1,5,2\n2025-11-25T09:00:01Z,1,5,10\n")
    out = tmp_path / "where.svg"
    assert run(cli, ["-C", str(root), "check", str(tmp_path / "<b>.csv"), "--picture", str(out)]) == 0
    assert f"wrote {out}" in "".join(capsys.readouterr())
    drawing = ElementTree.fromstring(out.read_text())
    dots = [e for e in drawing.iter() if e.tag.endswith("circle") and e.get("r") == "2.2"]
    low, high = (float(str(dot.get("cy"))) for dot in dots)
    assert high < low  # 10 m is drawn above 2 m
    words = {e.text for e in drawing.iter() if e.tag.endswith("text")}
    assert {"Shelf", "Door", "y ↑"} <= words
    assert any("positions of <b>.csv" in str(word) for word in words)
    assert any(e.tag.endswith("image") for e in drawing.iter())


def test_a_picture_of_pixels_points_down(tmp_path: Path) -> None:
    root = project(tmp_path / "site")
    (tmp_path / "a.csv").write_text(
        "ts,track_id,u_px,v_px\n2025-11-25T09:00:00Z,1,5,20\n2025-11-25T09:00:01Z,1,5,700\n"
    )
    out = tmp_path / "where.svg"
    run(cli, ["-C", str(root), "check", str(tmp_path / "a.csv"), "--picture", str(out)])
    dots = [
        e for e in ElementTree.fromstring(out.read_text()).iter() if e.tag.endswith("circle") and e.get("r") == "2.2"
    ]
    first, second = (float(str(dot.get("cy"))) for dot in dots)
    assert first < second


@pytest.mark.parametrize(
    ("arguments", "says"),
    [(["a.csv", "--picture", "where.png"], ".svg"), (["a.csv", "b.csv", "--picture", "w.svg"], "one file")],
)
def test_a_picture_that_cannot_be_drawn_says_why(
    arguments: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(cli, ["-C", str(project(tmp_path)), "check", *arguments]) == 2
    assert says in capsys.readouterr().err
