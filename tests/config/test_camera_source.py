"""`source` of a camera: what loads, what is refused, and that vsd.toml never holds its password."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from site_text import site_text

from vsd_analytics.config.camera_source import password_variable
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, LiveError, VsdError
from vsd_analytics.live.passwords import source_password
from vsd_analytics.site.model import Camera
from vsd_analytics.site.routes import CameraSource

SECRET = "sw0rd-fish"


def camera(folder: Path, *lines: str) -> Camera:
    (folder / "vsd.toml").write_text(site_text(more="".join(f"{line}\n" for line in lines)), encoding="utf-8")
    return load_site(folder).cameras[0]


def the_problem(folder: Path, *lines: str) -> VsdError:
    with pytest.raises(ConfigError) as caught:
        camera(folder, *lines)
    (problem,) = caught.value.problems
    return problem


@pytest.mark.parametrize(
    "address",
    [
        "rtsp://10.0.0.5/stream1",
        "rtsps://camera.example:322/a",
        "http://10.0.0.5/video?size=small&pwd={password}",
        "https://[fd00::5]/v",
        "/dev/video0",
        "films/door.mp4",
    ],
)
def test_addresses_devices_and_files_are_sources(address: str, tmp_path: Path) -> None:
    assert camera(tmp_path, f'source = "{address}"').source == CameraSource(address)


def test_a_camera_without_a_source_has_none(tmp_path: Path) -> None:
    assert camera(tmp_path).source is None


@pytest.mark.parametrize(
    "address",
    [
        f"rtsp://viewer:{SECRET}@10.0.0.5/stream1",
        f"rtsp://{SECRET}@10.0.0.5/stream1",
        f"http://10.0.0.5/video?user=viewer&pwd={SECRET}",
        f"http://10.0.0.5/video?Password={SECRET}",
        f"http://10.0.0.5/video#token={SECRET}",
        f"http://10.0.0.5/video?auth={SECRET}",
    ],
)
def test_a_password_in_vsd_toml_is_refused_with_a_fix_that_does_not_repeat_it(address: str, tmp_path: Path) -> None:
    problem = the_problem(tmp_path, f'source = "{address}"')
    assert problem.code == "E124"
    assert "a password does not belong in vsd.toml" in problem.what
    assert problem.fix is not None
    assert "source_password_file" in problem.fix
    assert "VSD_SOURCE_PASSWORD_CAM_1" in problem.fix
    with pytest.raises(ConfigError) as caught:
        load_site(tmp_path)
    assert SECRET not in repr(problem) + str(problem) + str(caught.value)


@pytest.mark.parametrize(
    "address", ["ftp://10.0.0.5/v", "rtsp://", "http://:80/x", "rtsp://host:port/x", "rtsp://[::1/x"]
)
def test_what_is_no_address_of_pictures_is_refused(address: str, tmp_path: Path) -> None:
    assert the_problem(tmp_path, f'source = "{address}"').code == "E124"


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (('source_username = "viewer"',), "and no source"),
        (('source = "door.mp4"', 'source_username = "viewer"'), "needs no login"),
        (('source = "rtsp://10.0.0.5/a"', 'source_password_file = "password"'), "source_username"),
    ],
)
def test_an_option_that_is_not_used_is_refused(lines: tuple[str, ...], says: str, tmp_path: Path) -> None:
    (tmp_path / "password").write_text("x\n")
    assert says in the_problem(tmp_path, *lines).what


def test_the_environment_goes_before_the_file(tmp_path: Path) -> None:
    (tmp_path / "password").write_text(f"{SECRET}\nmore\n")
    lines = ('source = "rtsp://10.0.0.5/a"', 'source_username = "viewer"', 'source_password_file = "password"')
    used = camera(tmp_path, *lines)
    assert source_password(used, environ={}) == SECRET
    assert source_password(used, environ={"VSD_SOURCE_PASSWORD_CAM_1": "other"}) == "other"


def test_a_login_without_a_password_and_an_empty_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "password").write_text("\n")
    lines = ['source = "http://10.0.0.5/a?pwd={password}"']
    for more in ([], ['source_password_file = "password"']):
        with pytest.raises(LiveError) as caught:
            source_password(camera(tmp_path, *lines, *more), environ={})
        assert caught.value.code == "E704"
        assert "VSD_SOURCE_PASSWORD_CAM_1" in str(caught.value.fix)


def test_a_source_without_a_login_needs_no_password(tmp_path: Path) -> None:
    assert source_password(camera(tmp_path, 'source = "rtsp://10.0.0.5/a"'), environ={}) is None


@given(st.text(max_size=40))
def test_any_text_is_a_source_or_refused(text: str) -> None:
    import json
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        try:
            camera(Path(folder), f"source = {json.dumps(text)}")
        except ConfigError:
            return


def test_names_of_variables_have_no_other_characters() -> None:
    assert password_variable("entrance-left.2") == "VSD_SOURCE_PASSWORD_ENTRANCE_LEFT_2"
