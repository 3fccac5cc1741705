"""The whole camera behind a homography, against planted ones."""

from __future__ import annotations

import numpy as np
import pytest
from planted_cameras import SIZE, look

from vsd_analytics.geometry.homography import projection, to_image

CAMERAS = [
    {"at": (3.0, -2.0), "pan_deg": 30.0, "tilt_deg": 40.0, "height_m": 3.2, "f_px": 700.0},
    {"at": (0.0, 0.0), "pan_deg": -110.0, "tilt_deg": 20.0, "height_m": 6.0, "f_px": 1500.0},
    {"at": (-20.0, 50.0), "pan_deg": 200.0, "tilt_deg": 70.0, "height_m": 2.5, "f_px": 500.0},
]


@pytest.mark.parametrize("planted", CAMERAS)
@pytest.mark.parametrize("scale", [1.0, -3.7])
def test_the_planted_camera_is_found_whatever_the_scale_of_its_homography(
    planted: dict[str, float], scale: float
) -> None:
    homography = scale * look(**planted)  # type: ignore[arg-type]
    matrix = projection(homography, picture_px=SIZE)
    assert matrix is not None
    x, y = planted["at"]  # type: ignore[misc]
    centre = np.linalg.solve(matrix[:, :3], -matrix[:, 3])
    assert centre == pytest.approx([x, y, planted["height_m"]])
    assert np.linalg.norm(matrix[2, :3]) == pytest.approx(1), "w is the depth in metres"
    p = np.radians(planted["pan_deg"])
    ahead = np.array([x - 4 * np.sin(p), y + 4 * np.cos(p)])
    u, v, w = matrix @ [*ahead, 0.0, 1.0]
    assert [u / w, v / w] == pytest.approx(to_image(homography, [ahead], picture_px=SIZE)[0])
    assert w > 0
    _, higher, depth = matrix @ [*ahead, 1.0, 1.0]
    assert higher / depth < v / w, "what stands up stands up in the picture"


def test_a_camera_that_looks_straight_down_tells_no_focal_length() -> None:
    assert projection(np.array([[0.01, 0, 0], [0, -0.01, 8], [0, 0, 1.0]]), picture_px=SIZE) is None
