"""What a calibration states about its error: beside its matrix, and only for that matrix."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from site_text import site_text

from vsd_analytics.config.calibrate import calibrate
from vsd_analytics.config.project import load_site
from vsd_analytics.geometry.stated_errors import beside, position_error_m, read_stated


def test_error_of_a_position_counts_what_the_fit_took_up() -> None:
    assert position_error_m(0.1, 8) == pytest.approx(0.1 * math.sqrt(2))
    assert position_error_m(0.1, 5) is None


def test_points_leave_their_error_beside_the_matrix(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text(site_text())
    spots = [(u, v, u / 100 + off, v / 100) for (u, v), off in zip(
        [(0, 0), (900, 0), (0, 700), (900, 700), (450, 300), (200, 600)], [0.1, -0.1, 0.1, -0.1, 0.1, -0.1], strict=True
    )]  # fmt: skip
    points = tmp_path / "points.csv"
    points.write_text("u,v,x,y\n" + "".join(f"{','.join(map(str, row))}\n" for row in spots))
    done = calibrate(load_site(tmp_path), camera_id="cam-1", points=points)
    assert done.error_m is not None
    (used,) = load_site(tmp_path).cameras[0].calibrations
    assert used.error_m == pytest.approx(done.error_m * math.sqrt(3), abs=1e-4)
    points.write_text("\n".join(points.read_text().splitlines()[:6]) + "\n")  # five points
    calibrate(load_site(tmp_path), camera_id="cam-1", points=points)
    assert load_site(tmp_path).cameras[0].calibrations[0].error_m is None


@pytest.mark.parametrize("text", ["", "[]", "{", '{"calibration_id": "x"}', '{"calibration_id": "x", "map": [[1, 2]]}',
                                  '{"calibration_id": "x", "map": [[1, 2, NaN]]}'])  # fmt: skip
def test_damaged_file_states_nothing(text: str, tmp_path: Path) -> None:
    matrix = tmp_path / "cam-1.txt"
    beside(matrix, "people").write_text(text)
    beside(matrix, "points").write_text(text)
    assert read_stated(matrix, calibration_id="x") == (None, ())


def test_cells_are_those_of_the_named_matrix(tmp_path: Path) -> None:
    matrix = tmp_path / "cam-1.txt"
    beside(matrix, "people").write_text(json.dumps({"calibration_id": "x", "map": [[0.5, 1.5, 0.3, 0.1]]}))
    assert read_stated(matrix, calibration_id="x") == (None, ((0.5, 1.5, 0.3),))
    assert read_stated(matrix, calibration_id="y") == (None, ())
