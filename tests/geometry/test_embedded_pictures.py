"""Floor plans and scenes as small data URIs."""

from __future__ import annotations

import base64
from pathlib import Path

import cv2
import numpy as np
import pytest

from vsd_analytics.errors import ReportError
from vsd_analytics.geometry.embedded_pictures import MAX_BYTES, picture_image, plan_image


def decoded(uri: str) -> np.ndarray:
    data = np.frombuffer(base64.b64decode(uri.split(",")[1]), dtype=np.uint8)
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_UNCHANGED))


def test_white_becomes_clear_and_walls_stay_black(tmp_path: Path) -> None:
    plan = np.full((200, 300), 255, dtype=np.uint8)
    plan[90:110] = 0
    cv2.imwrite(str(tmp_path / "plan.png"), plan)
    uri, size = plan_image(tmp_path / "plan.png")
    assert size == (300, 200)
    image = decoded(uri)
    assert image[10, 10, 3] == 0
    assert list(image[100, 100]) == [0, 0, 0, 255]


def test_a_colour_keeps_its_look_on_white(tmp_path: Path) -> None:
    plan = np.full((50, 50, 3), (80, 160, 240), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "plan.png"), plan)
    ink, alpha = np.split(decoded(plan_image(tmp_path / "plan.png")[0])[25, 25].astype(float), [3])
    on_white = ink * alpha / 255 + 255 - alpha
    np.testing.assert_allclose(on_white, (80, 160, 240), atol=40)


@pytest.mark.parametrize("make", [plan_image, picture_image])
def test_noise_still_fits_the_budget(tmp_path: Path, make) -> None:  # type: ignore[no-untyped-def]
    noise = np.random.default_rng(3).integers(0, 255, (1500, 2000, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "noise.png"), noise)
    uri, size = make(tmp_path / "noise.png")
    assert size == (2000, 1500)
    assert len(base64.b64decode(uri.split(",")[1])) <= MAX_BYTES


@pytest.mark.parametrize("content", [b"", b"not a picture", b"\x89PNG\r\n\x1a\n cut"])
def test_what_is_no_picture_is_named_with_its_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "plan.png"
    path.write_bytes(content)
    with pytest.raises(ReportError, match=r"plan\.png") as caught:
        plan_image(path)
    assert caught.value.code == "E501"
    with pytest.raises(ReportError):
        picture_image(tmp_path / "absent.png")


def test_a_huge_svg_is_refused_with_a_way_out(tmp_path: Path) -> None:
    path = tmp_path / "plan.svg"
    path.write_bytes(b"<svg>" + b" " * 300_000)
    with pytest.raises(ReportError) as caught:
        plan_image(path)
    assert caught.value.code == "E502"
    path.write_bytes(b"<svg xmlns='http://www.w3.org/2000/svg'/>")
    assert plan_image(path)[0].startswith("data:image/svg+xml;base64,")
