"""Camera files of other programs: the planted camera comes back, and what a lens distortion leaves is stated."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from engine.simulated_people import SIZE, SimulatedCamera
from engine.vsd_in_a_shop import shop

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry.camera_files import CameraFile, floor_fit, read_camera
from vsd_analytics.geometry.homography import to_floor

PLANTED = SimulatedCamera(height_m=5, tilt_deg=35, roll_deg=3, f_widths=0.8)
FLOOR = np.array([(0.0, 5.0), (1.5, 6.0), (-2.0, 8.0), (3.0, 12.0)])


def parts(camera: SimulatedCamera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    """Return camera matrix, rotation and translation of a simulated camera."""
    f = camera.f_widths * SIZE[0]
    lens = np.array([[f, 0, SIZE[0] / 2], [0, f, SIZE[1] / 2], [0, 0, 1]])
    view = np.linalg.inv(lens) @ camera.matrix()
    return lens, view[:, :3], view[:, 3]


def numbers(values: np.ndarray) -> str:  # type: ignore[type-arg]
    return " ".join(repr(float(value)) for value in values.ravel())


def matrix_xml(name: str, values: np.ndarray) -> str:  # type: ignore[type-arg]
    rows, cols = values.shape
    head = f'<{name} type_id="opencv-matrix"><rows>{rows}</rows><cols>{cols}</cols><dt>d</dt>'
    return f"{head}<data>{numbers(values)}</data></{name}>"


def write_xml(folder: Path, camera: SimulatedCamera, *, unit_m: float = 1.0, k1: float = 0.0) -> list[Path]:
    """Write lens and place as WILDTRACK does, in two files."""
    lens, rotation, translation = parts(camera)
    lens_xml = matrix_xml("camera_matrix", lens) + matrix_xml(
        "distortion_coefficients", np.array([[k1], [0], [0], [0]])
    )
    rvec = cv2.Rodrigues(rotation)[0]
    place = f"<rvec>{numbers(rvec)}</rvec><tvec>{numbers(translation / unit_m)}</tvec>"
    files = [folder / "intr.xml", folder / "extr.xml"]
    for path, text in zip(files, (lens_xml, place), strict=True):
        path.write_text(f'<?xml version="1.0"?>\n<opencv_storage>\n{text}\n</opencv_storage>\n')
    return files


def write_json(folder: Path, camera: SimulatedCamera) -> list[Path]:
    lens, rotation, translation = parts(camera)
    path = folder / "camera.json"
    path.write_text(json.dumps({"K": lens.tolist(), "R": rotation.tolist(), "t": translation.tolist()}))
    return [path]


def write_oxford(folder: Path, camera: SimulatedCamera) -> list[Path]:
    lens, rotation, translation = parts(camera)
    turn = cv2.Rodrigues(rotation)[0].ravel()
    angle = float(np.linalg.norm(turn))
    x, y, z = turn / angle * np.sin(angle / 2)
    values = {"FocalLengthX": lens[0, 0], "FocalLengthY": lens[1, 1], "PrincipalPointX": lens[0, 2]}
    values |= {"PrincipalPointY": lens[1, 2], "RotationX": x, "RotationY": y, "RotationZ": z}
    values |= {"RotationW": np.cos(angle / 2)}
    values |= {f"Translation{axis}": value for axis, value in zip("XYZ", translation, strict=True)}
    path = folder / "calibration.ci"
    path.write_text("".join(f"{name} = {float(value)!r}\n" for name, value in values.items()))
    return [path]


@pytest.mark.parametrize("write", [write_xml, write_json, write_oxford])
def test_planted_camera_comes_back_from_each_format(write: Callable[..., list[Path]], tmp_path: Path) -> None:
    fit = floor_fit(read_camera(write(tmp_path, PLANTED)), picture_px=SIZE)
    spots = PLANTED.project(np.column_stack([FLOOR, np.zeros(len(FLOOR))]))
    np.testing.assert_allclose(to_floor(fit.homography, spots, picture_px=SIZE), FLOOR, atol=1e-6)
    assert (fit.error_m, fit.worst_m) == (0, 0)


def test_lens_distortion_is_fitted_and_what_it_leaves_is_stated(tmp_path: Path) -> None:
    bent = SimulatedCamera(height_m=5, tilt_deg=35, f_widths=0.8, k1=-0.15)
    camera = read_camera(write_xml(tmp_path, bent, k1=-0.15))
    fit = floor_fit(camera, picture_px=SIZE)
    straight = floor_fit(CameraFile(camera.lens, np.empty(0), camera.rotation, camera.translation), picture_px=SIZE)
    grid = np.column_stack([axis.ravel() for axis in np.meshgrid(np.linspace(-8, 8, 17), np.linspace(3, 15, 17))])
    spots = bent.project(np.column_stack([grid, np.zeros(len(grid))]))
    spots, grid = (values[((spots > 0) & (spots < SIZE)).all(axis=1)] for values in (spots, grid))
    off, off_straight = (
        np.sqrt(np.mean(np.sum((to_floor(h, spots, picture_px=SIZE) - grid) ** 2, axis=1)))
        for h in (fit.homography, straight.homography)
    )
    assert off < 0.7 * off_straight
    assert 0 < off < 2 * fit.error_m
    assert fit.error_m < fit.worst_m


def test_command_reads_two_files_in_centimetres(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vsd = shop(tmp_path, capsys)
    intr, extr = write_xml(tmp_path, PLANTED, unit_m=0.01)
    files = ["--camera-file", str(intr), "--camera-file", str(extr)]
    code, printed, err = vsd("calibrate", "cam-1", *files, "--unit", "cm")
    assert (code, err) == (0, "")
    assert "given camera without lens distortion" in printed
    (used,) = load_site(tmp_path).cameras[0].calibrations
    spots = PLANTED.project(np.column_stack([FLOOR, np.zeros(len(FLOOR))]))
    np.testing.assert_allclose(to_floor(used.homography, spots, picture_px=SIZE), FLOOR, atol=1e-4)
    write_xml(tmp_path, PLANTED, unit_m=0.01, k1=-0.1)
    code, printed, _ = vsd("calibrate", "cam-1", *files, "--unit", "cm", "--json")
    left = json.loads(printed)["lens_error_m"]
    assert left > 0.01
    assert load_site(tmp_path).cameras[0].calibrations[0].error_m == pytest.approx(left, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.xml", '<?xml version="1.0"?><opencv_storage><a>1</a></opencv_storage>', "camera_matrix"),
        ("a.xml", "no xml at all <", "OpenCV cannot read it"),
        ("a.json", "{", "no JSON"),
        ("a.json", "[]", "camera_matrix"),
        ("a.json", '{"K": [[1, 2], [3, 4]], "R": [0, 0, 0], "t": [0, 0, 1]}', "3x3"),
        ("a.json", '{"K": "wide", "R": [0, 0, 0], "t": [0, 0, 1]}', "no number"),
        ("a.ci", "FocalLengthX = 2000\n", "lacks"),
    ],
)
def test_file_without_a_camera_is_refused_in_words(name: str, text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(CalibrationError) as error:
        read_camera([tmp_path / name])
    assert error.value.code == "E407"
    assert says in str(error.value.why)


@pytest.mark.realdata
def test_wildtrack_s_camera_files_give_its_annotated_places(realdata: Callable[[str], Path]) -> None:
    from engine.prove_engine import wildtrack

    folder = realdata("wildtrack")
    names = ["CVLab1", "CVLab2", "CVLab3", "CVLab4", "IDIAP1", "IDIAP2", "IDIAP3"]
    off = []
    for name, rows in zip(names, wildtrack(folder.parent).values(), strict=True):
        lens = folder / "calibrations" / "intrinsic_zero" / f"intr_{name}.xml"
        place = folder / "calibrations" / "extrinsic" / f"extr_{name}.xml"
        fit = floor_fit(read_camera([lens, place], unit_m=0.01), picture_px=SIZE)
        feet = np.column_stack([(rows[:, 2] + rows[:, 4]) / 2, rows[:, 5]])
        off.append(np.linalg.norm(to_floor(fit.homography, feet, picture_px=SIZE) - rows[:, 6:8], axis=1))
    assert np.nanmedian(np.concatenate(off)) < 0.12
    assert max(np.nanmedian(of_camera) for of_camera in off) < 0.14
