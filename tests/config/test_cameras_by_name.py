"""Cameras by a name that is no id: the fix that is printed names the right one, and only where one is meant."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.cli import cli
from vsd_analytics.site.cameras_by_name import camera_meant, nearest_camera_id
from vsd_analytics.site.model import Camera

DOOR = Camera("cam-1", "Main Door", "ground", engine_ids=("AXIS 17",))
TILL = Camera("cam-2", "Till", "ground")
OTHER_TILL = Camera("cam-3", "till", "ground")


@pytest.mark.parametrize("text", ["Main Door", "main door", "MAIN-DOOR", "maindoor", "CAM-1", "cam_1", "axis-17"])
def test_a_camera_is_meant_by_its_names_in_any_case(text: str) -> None:
    assert camera_meant(text, [DOOR, TILL]) is DOOR
    assert nearest_camera_id(text, [DOOR, TILL]) == "cam-1"


def test_a_name_of_two_cameras_means_neither() -> None:
    assert camera_meant("TILL", [DOOR, TILL, OTHER_TILL]) is None


@given(st.text(max_size=20))
def test_a_camera_is_meant_by_letters_only(text: str) -> None:
    meant = camera_meant(text, [DOOR])
    letters = "".join(letter for letter in text.casefold() if letter not in " -_")
    assert (meant is DOOR) == (letters in {"cam1", "maindoor", "axis17"})


def test_the_fix_of_an_unknown_camera_is_the_line_that_is_missing(tmp_path: Path) -> None:
    """What is printed is written into vsd.toml as it stands, and the records come in."""
    (tmp_path / "vsd.toml").write_text(
        '[site]\nid = "shop"\nname = "Shop"\ntimezone = "UTC"\nopening = { mon-sun = "00:00-24:00" }\n'
        '[[floor]]\nid = "ground"\nname = "Ground"\n'
        '[[camera]]\nid = "cam-1"\nname = "Main Door"\nfloor = "ground"\n'
        '[[camera]]\nid = "cam-2"\nname = "Till"\nfloor = "ground"\n'
    )
    rows = "".join(f"2026-11-20T10:00:{s:02d}Z,TILL,3.{s},4,1\n" for s in range(30))
    (tmp_path / "people.csv").write_text("ts,camera_id,x_m,y_m,track_id\n" + rows)
    vsd = ["-C", str(tmp_path), "--now", "2026-11-21T00:00"]
    first = CliRunner().invoke(cli, [*vsd, "ingest", str(tmp_path / "people.csv"), "--yes"])
    line = 'engine_ids = ["TILL"]'
    assert f'fix: add {line} to [[camera]] id = "cam-2" in vsd.toml' in first.output
    text = (tmp_path / "vsd.toml").read_text()
    (tmp_path / "vsd.toml").write_text(text.replace('id = "cam-2"', f'id = "cam-2"\n{line}'))
    again = CliRunner().invoke(cli, [*vsd, "quarantine", "replay"])
    assert again.exit_code == 0, again.output
    assert "30" in again.output
