"""A floor plan from an architect's drawing: every line is where the drawing has it; what is not said is asked."""

from __future__ import annotations

import json
import math
import re
import shlex
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.drawing import M_PER_PX, is_drawing, read_drawing
from vsd_analytics.config.file_columns import METRES
from vsd_analytics.config.project import load_site
from vsd_analytics.config.row_filter import parse_filter
from vsd_analytics.errors import InputError
from vsd_analytics.geometry.picture_size import picture_size

ezdxf: Any = pytest.importorskip("ezdxf")
CODES = {"mm": 4, "cm": 5, "m": 6, "ft": 2, "in": 1}
WALLS = ((0.0, 0.0), (14.0, 0.0), (14.0, 9.0), (0.0, 9.0))


def drawing(path: Path, *, unit: str = "mm", code: int | None = None, at: tuple[float, float] = (0, 0)) -> Path:
    """Write a hall of 14 x 9 m with a pillar in a block, a text, and a layer of furniture that is off."""
    metres, (x0, y0) = METRES[unit], at
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = CODES[unit] if code is None else code
    space = document.modelspace()
    place = [((x0 + x) / metres, (y0 + y) / metres) for x, y in WALLS]
    space.add_lwpolyline(place, close=True, dxfattribs={"layer": "A-WALL"})
    block = document.blocks.new("PILLAR")
    block.add_circle((0, 0), 0.25 / metres, dxfattribs={"layer": "A-COLS"})
    space.add_blockref("PILLAR", ((x0 + 7) / metres, (y0 + 4) / metres), dxfattribs={"layer": "A-COLS"})
    space.add_text("Hall 14 x 9", dxfattribs={"layer": "A-TEXT"})
    document.layers.add("FURNITURE").off()
    space.add_line((0, 0), (1e6, 1e6), dxfattribs={"layer": "FURNITURE"})
    document.saveas(path)
    return path


def in_metres(svg: str, origin_m: tuple[float, float]) -> dict[str, list[list[tuple[float, float]]]]:
    """Return the lines of each layer, read back from the SVG by the rule of `vsd.toml`."""
    root = ET.fromstring(svg)
    height = float(root.get("viewBox", "").split()[3])
    lines = {}
    for group in root.iter():
        if (layer := group.get("id")) is not None:
            points = [[tuple(map(float, p.split(","))) for p in line.get("points", "").split()] for line in group]
            lines[layer] = [
                [(origin_m[0] + u * M_PER_PX, origin_m[1] + (height - v) * M_PER_PX) for u, v in line]
                for line in points
            ]
    return lines


@given(st.sampled_from(sorted(CODES)), st.tuples(st.floats(-500, 500), st.floats(-500, 500)))
def test_every_line_is_where_the_drawing_has_it(
    tmp_path_factory: pytest.TempPathFactory, unit: str, at: tuple[float, float]
) -> None:
    plan = read_drawing(drawing(tmp_path_factory.mktemp("dxf") / "a.dxf", unit=unit, at=at))
    assert (plan.unit, plan.is_stated) == (unit, True)
    lines = in_metres(plan.svg(), plan.origin_m)
    (walls,) = lines.pop("A-WALL")
    for found, (x, y) in zip(walls, (*WALLS, WALLS[0]), strict=True):
        assert found == pytest.approx((at[0] + x, at[1] + y), abs=0.002)
    (pillar,) = lines.pop("A-COLS")
    assert {round(math.dist(p, (at[0] + 7, at[1] + 4)), 1) for p in pillar} <= {0.2, 0.3}
    assert lines == {}
    assert sum(plan.left_out.values()) == 2  # the text, and the furniture that is off


def test_a_filter_chooses_layers_also_those_that_are_off(tmp_path: Path) -> None:
    path = drawing(tmp_path / "a.dxf", unit="m")
    assert [*read_drawing(path, where=parse_filter("layer = 'a-wall'")).lines] == ["A-WALL"]
    assert [*read_drawing(path, where=parse_filter("layer != 'FURNITURE'")).lines] == ["A-COLS", "A-WALL"]


def checked(
    folder: Path, capsys: pytest.CaptureFixture[str], *arguments: str, command: str = "check"
) -> tuple[int, dict[str, Any]]:
    code = run(cli, ["-C", str(folder), command, "--json", *arguments])
    output: dict[str, Any] = json.loads(capsys.readouterr().out)
    return code, output


@pytest.mark.parametrize("unit", ["m", "mm", "cm"])
def test_a_drawing_without_a_unit_asks_for_it_and_its_fix_works(
    unit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(drawing(tmp_path / "a.dxf", unit=unit, code=0))
    code, output = checked(tmp_path, capsys, path)
    assert (code, output["code"]) == (2, "E204")
    assert re.search(rf"\b{unit}\b", output["fix"])
    code, output = checked(tmp_path, capsys, path, "--unit", unit)
    assert code == 0
    assert output["bounds_m"] == pytest.approx([0, 0, 14, 9])


def test_the_plan_of_a_drawing_is_a_plan_of_vsd_toml(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drawing(tmp_path / "hall.dxf", at=(3, -2))
    code, _ = checked(tmp_path, capsys, "--no-input", "--name", "Hall", "--plan", "hall.dxf", command="init")
    assert code == 0
    (floor,) = load_site(tmp_path).floors
    assert (floor.plan_m_per_px, floor.plan_origin_m) == (M_PER_PX, (2.5, -2.5))
    assert floor.plan is not None
    assert picture_size(floor.plan) == (1500, 1000)
    before = (tmp_path / "hall.svg").read_bytes()
    code, output = checked(tmp_path, capsys, str(tmp_path / "hall.dxf"), "--picture", str(tmp_path / "again.svg"))
    assert (code, output["plan_origin_m"]) == (0, [2.5, -2.5])
    assert (tmp_path / "again.svg").read_bytes() == before


@pytest.mark.parametrize(
    ("content", "options", "code"),
    [
        (b"0\nSECTION\n2\nENTITIES\n0\nENDSEC\n0\nEOF\n", "", "E204"),  # no lines
        (b"0\nSECTION\n2\nENTITIES\n0\nLINE\n8\nW\n10\nx\n", "", "E204"),
        (b"not a drawing\n", "", "E205"),
        (None, "--map ts=time", "E101"),
        (None, "--unit ft", "E101"),
        (None, "--where \"colour = 'red'\"", "E101"),
        (None, "--where \"layer = 'NONE'\"", "E204"),
    ],
)
def test_a_drawing_that_cannot_be_used_is_refused(
    content: bytes | None, options: str, code: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.dxf"
    if content is None:
        drawing(path)
    else:
        path.write_bytes(content)
    exit_code, output = checked(tmp_path, capsys, str(path), *shlex.split(options))
    assert (exit_code, output["code"], bool(output["fix"])) == (2, code, True)


def test_without_the_extra_the_way_to_install_it_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = drawing(tmp_path / "a.dxf")
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    _, output = checked(tmp_path, capsys, str(path))
    assert 'pip install "vsd-analytics[dxf]"' in output["fix"]


def test_a_block_of_blocks_that_would_never_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vsd_analytics.config.drawing._ENTITIES_MAX", 2_000)  # the same refusal a hundred times as soon
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 6
    document.blocks.new("B0").add_line((0, 0), (1, 0))
    for level in range(1, 8):
        block = document.blocks.new(f"B{level}")
        for k in range(10):
            block.add_blockref(f"B{level - 1}", (k, 0))
    document.modelspace().add_blockref("B7", (0, 0))
    document.saveas(tmp_path / "a.dxf")
    with pytest.raises(Exception, match="more than 2,000 parts"):
        read_drawing(tmp_path / "a.dxf")


def test_a_block_that_contains_itself_is_named(tmp_path: Path) -> None:
    document = ezdxf.new("R2010")
    block = document.blocks.new("A")
    block.add_line((0, 0), (1, 0))
    block.add_blockref("A", (1, 0))
    document.modelspace().add_blockref("A", (0, 0))
    document.saveas(tmp_path / "a.dxf")
    with pytest.raises(InputError, match="a block that contains itself"):
        read_drawing(tmp_path / "a.dxf", unit="m")


def test_a_curve_that_reaches_nowhere_is_left_out_at_once(tmp_path: Path) -> None:
    path = drawing(tmp_path / "a.dxf", unit="m")
    document = ezdxf.readfile(path)
    document.modelspace().add_spline([(0, 0), (1e17, 3), (5, 1e17), (7, 7)])
    document.modelspace().add_ellipse((0, 0), (1e300, 0), 0.5)
    document.saveas(tmp_path / "b.dxf")
    assert read_drawing(tmp_path / "b.dxf").bounds_m == read_drawing(path).bounds_m


def test_a_binary_drawing_is_the_same_plan(tmp_path: Path) -> None:
    path = drawing(tmp_path / "a.dxf", unit="m")
    ezdxf.readfile(path).saveas(tmp_path / "b.dxf", fmt="bin")
    assert read_drawing(tmp_path / "b.dxf").lines == read_drawing(path).lines
    whole = (tmp_path / "b.dxf").read_bytes()
    (tmp_path / "c.dxf").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError):
        read_drawing(tmp_path / "c.dxf")


@pytest.mark.parametrize(
    ("name", "head", "words"),
    [
        ("plan.dxf", b"0\nSECTION\n2\nENTITIES\n", "vsd check plan.dxf --picture plan.svg"),
        ("plan.pdf", b"%PDF-1.4\n", "pdftoppm -png -r 150 -singlefile plan.pdf plan"),
        ("plan.dwg", b"AC1032", "save it as DXF"),
    ],
)
def test_a_plan_that_is_no_picture_says_how_it_becomes_one(
    name: str, head: bytes, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_bytes(head)
    floor = f'[[floor]]\nid = "g"\nname = "G"\nplan = "{name}"\nplan_m_per_px = 0.01\n'
    site = '[site]\nid = "h"\nname = "H"\ntimezone = "UTC"\n[[camera]]\nid = "c"\nname = "C"\n'
    (tmp_path / "vsd.toml").write_text(site + floor)
    assert run(cli, ["-C", str(tmp_path), "doctor"]) == 1
    assert words in "".join(capsys.readouterr())
    assert is_drawing(tmp_path / name) == (name == "plan.dxf")
