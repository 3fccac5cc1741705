"""`[[plane]]` in calibration/<camera>.toml: every mistake at once, each with its line in that file."""

from __future__ import annotations

from pathlib import Path

import pytest
from site_text import site_text

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError

POINTS = "u,v,x,y\n0,500,0,10\n900,500,9,10\n900,1000,9,5\n0,1000,0,5\n"
GOOD = 'id = "ramp"\npolygon_px = [[0, 500], [900, 500], [900, 1000], [0, 1000]]\npoints = "p.csv"\n'


def write(folder: Path, planes: str) -> Path:
    (folder / "vsd.toml").write_text(site_text())
    (folder / "p.csv").write_text(POINTS)
    (folder / "tilted.txt").write_text("1 0 0\n0 1 0\n0 0.01 -7\n")  # its horizon is at v = 700
    (folder / "calibration").mkdir()
    (folder / "calibration" / "cam-1.toml").write_text(planes)
    return folder


def mistakes(folder: Path, planes: str) -> list[tuple[int, str, str]]:
    with pytest.raises(ConfigError) as caught:
        load_site(write(folder, planes))
    found = [(p.where.line, p.code, f"{p.what} {p.fix}") for p in caught.value.problems if p.where]
    assert all(p.where.file == "calibration/cam-1.toml" for p in caught.value.problems if p.where)
    return sorted((line or 0, code, text) for line, code, text in found)


def test_planes_are_read_in_order_with_polygon_homography_and_height(tmp_path: Path) -> None:
    slope = "height_m = [[0, 10, 1.0], [9, 10, 1.0], [0, 5, 0.0]]\n"
    write(tmp_path, f"[[plane]]\n{GOOD}{slope}[[plane]]\n{GOOD.replace('ramp', 'stage')}height_m = -0.5\n")
    camera = load_site(tmp_path).cameras[0]
    assert [p.plane_id for p in camera.planes] == ["ramp", "stage"]
    assert camera.planes[0].height_m == pytest.approx((-1.0, 0.0, 0.2))
    assert camera.planes[1].height_m == (-0.5, 0.0, 0.0)
    assert camera.planes[0].polygon_px[2] == (900, 1000)
    assert camera.view is not None
    corners = sorted((round(x, 2), round(y, 2)) for x, y in camera.view)
    assert corners == [(0, 5), (0, 10), (9, 5), (9, 10)]
    assert camera.calibrations == ()


def test_all_mistakes_of_planes_are_noted_at_their_lines(tmp_path: Path) -> None:
    text = (
        f"[[plane]]\n{GOOD}colour = 3\n"  # 1 to 5
        '[[plane]]\nid = "A b"\npolygon_px = [[0, 0], [1, 1]]\n'  # 6 to 8
        f"[[plane]]\n{GOOD}[[plane]]\n{GOOD}"  # 9 to 16: two more ramps
        f"[[plane]]\n{GOOD.replace('ramp', 'steep').replace('p.csv', 'q.csv')}"  # 17 to 20
        f"[[plane]]\n{GOOD.replace('ramp', 'bent')}height_m = [[0, 0, 0], [1, 1, 1], [2, 2, 0]]\n"  # 21 to 25
        '[[plane]]\nid = "high"\npolygon_px = [[0, 500], [900, 500], [0, 900]]\nhomography = "tilted.txt"\n'  # 26 to 29
        '[[plane]]\nid = "knot"\npolygon_px = [[0, 0], [9, 9], [9, 0], [0, 9]]\npoints = "p.csv"\n'  # 30 to 33
    )
    expected = [
        (5, "E122", "colour"),
        (6, "E123", "no points"),
        (7, "E125", "cannot be an id"),
        (8, "E128", "needs at least 3"),
        (10, "E129", ""),
        (14, "E129", "begin at the same instant"),
        (20, "E126", "no file 'q.csv'"),
        (25, "E124", "lie on a line"),
        (28, "E128", "horizon"),
        (32, "E128", "crosses"),
    ]
    found = mistakes(tmp_path, text)
    assert [(line, code) for line, code, _ in found] == [(line, code) for line, code, _ in expected]
    assert all(words in text for (_, _, text), (_, _, words) in zip(found, expected, strict=True))
