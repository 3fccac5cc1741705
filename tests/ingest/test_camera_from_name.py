"""`camera_from_name` of a `[[source]]`: names of files say the camera: ingest, check, watch, folders, archives."""

from __future__ import annotations

import tomllib
import zipfile
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_reading_rules import TOML, project, stored, vsd
from watched_folders import watched

from vsd_analytics.config.camera_in_name import camera_named, cameras_in_name
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError

PROFILE = """
[[source]]
id = "days"
files = "*.csv"
camera_from_name = "{camera}_*.csv"
unit = "m"
"""


def table(path: Path, *, x_m: int = 1, header: str = "ts,track_id,x_m,y_m", cell: str = "") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [f"2025-11-10T09:00:{k:02d}Z,7,{x_m}.{k:02d},2.5{cell}" for k in range(20)]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def places(root: Path) -> dict[str, Counter[int]]:
    found: dict[str, Counter[int]] = {}
    for row in stored(root):
        found.setdefault(row["camera_id"], Counter())[row["x_mm"] // 1000] += 1
    return found


@pytest.mark.parametrize(
    ("pattern", "name", "camera"),
    [
        ("{camera}_*.csv", "in/cam-1_2025-11-10.csv", ["cam-1"]),
        ("{camera}*.csv", "cam-12.csv", ["cam-12"]),
        ("{camera}*.csv", "cam-123.csv", []),
        ("{camera}*", "cam-1front.csv", []),
        ("*{camera}*", "day_cam-1_cam-2.csv", ["cam-1", "cam-2"]),
        ("{camera}/*.csv", "in/tills/day.csv", ["tills"]),
        ("in/{camera}.csv", "in/tills.csv", ["tills"]),
        ("in/{camera}.csv", "out/tills.csv", []),
        ("shop{camera}.csv", "shop3.csv", ["3"]),
        ("{camera}_*.csv", "CAM-1_2025.csv", []),
        ("{camera}_[0-9]*.csv", "tills_2025.csv", ["tills"]),
        ("{camera}_[!0-9]*.csv", "tills_2025.csv", []),
        ("{camera}.csv", "a.b+c.csv", ["a.b+c"]),
    ],
)
def test_names_are_read_as_the_pattern_says(pattern: str, name: str, camera: list[str]) -> None:
    known = ["cam-1", "cam-2", "cam-12", "tills", "3", "a.b+c"]
    assert cameras_in_name(name, pattern, known) == camera


@given(st.text("ab1-_.", min_size=1, max_size=6), st.text("ab1-_.", max_size=5), st.text("ab1-_.", max_size=5))
def test_what_a_saved_pattern_reads_is_the_camera_it_was_made_of(camera: str, front: str, back: str) -> None:
    name = f"{front}{camera}{back}"
    found = camera_named(name, [camera, "other"])
    if found is not None:
        assert found.camera == camera
        assert cameras_in_name(name, found.pattern, [camera, "other"]) == [camera]


def test_each_file_goes_to_the_camera_that_its_name_says(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML + PROFILE)
    files = [table(tmp_path / "cam-1_2025-11-10.csv", x_m=1), table(tmp_path / "tills_2025-11-10.csv", x_m=5)]
    said = vsd(root, "ingest", *map(str, files))
    assert said.exit_code == 0, said.output
    assert places(root) == {"cam-1": Counter({1: 20}), "cam-2": Counter({5: 20})}


@pytest.mark.parametrize(
    ("name", "says", "fix"),
    [
        ("cam-3_2025.csv", "says camera 'cam-3', which vsd.toml does not have", 'engine_ids = ["cam-3"]'),
        ("export.csv", "the name of export.csv says no camera", "--camera cam-1"),
    ],
)
def test_a_name_without_a_known_camera_is_refused_and_the_others_are_read(
    name: str, says: str, fix: str, tmp_path: Path
) -> None:
    root = project(tmp_path / "p", TOML + PROFILE)
    wrong, right = table(tmp_path / name), table(tmp_path / "cam-1_2025.csv")
    for command in ("check", "ingest"):
        said = vsd(root, command, str(wrong), str(right))
        assert said.exit_code == 2
        assert "error[E213]" in said.output
        assert says in said.output
        assert fix in said.output
        assert 'camera_from_name = "{camera}_*.csv"' in said.output
    assert places(root) == {"cam-1": Counter({1: 20})}
    assert vsd(root, "explain", "E213").exit_code == 0
    # cam-1 has seen the same people, so the user has to be sure
    said = vsd(root, "ingest", str(wrong), "--camera", "cam-2", "--yes")
    assert set(places(root)) == {"cam-1", "cam-2"}, f"the command's own word wins: {said.output}"
    assert places(root) == {"cam-1": Counter({1: 20}), "cam-2": Counter({1: 20})}


def test_a_site_of_one_camera_does_not_take_the_files_of_others(tmp_path: Path) -> None:
    one = TOML.replace(TOML[TOML.index('[[camera]]\nid = "cam-2"') : TOML.index("[privacy]")], "")
    root = project(tmp_path / "p", one + PROFILE)
    files = [table(tmp_path / f"cam-{k}_2025.csv", x_m=k) for k in (1, 2)]
    assert vsd(root, "ingest", *map(str, files)).exit_code == 2
    assert places(root) == {"cam-1": Counter({1: 20})}


def test_a_column_of_cameras_wins_over_the_name(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML + PROFILE)
    file = table(tmp_path / "cam-1_2025.csv", header="ts,track_id,x_m,y_m,camera_id", cell=",cam-2")
    assert vsd(root, "ingest", str(file)).exit_code == 0
    assert places(root) == {"cam-2": Counter({1: 20})}


@pytest.mark.parametrize("kind", ["folder", "zip"])
def test_files_of_a_folder_or_archive_are_read_one_by_one(kind: str, tmp_path: Path) -> None:
    toml = TOML + PROFILE.replace('"*.csv"', '"export*"').replace("{camera}_*.csv", "{camera}/*.csv")
    root = project(tmp_path / "p", toml)
    source = tmp_path / "export"
    files = [table(source / f"{name}" / "day.csv", x_m=k) for k, name in enumerate(("cam-1", "tills"), start=1)]
    if kind == "zip":
        source = tmp_path / "export.zip"
        with zipfile.ZipFile(source, "w") as packed:
            for file in files:
                packed.write(file, file.relative_to(tmp_path / "export"))
    said = vsd(root, "ingest", str(source))
    assert said.exit_code == 0, said.output
    assert places(root) == {"cam-1": Counter({1: 20}), "cam-2": Counter({2: 20})}
    table(tmp_path / "export" / "cam-9" / "day.csv")
    said = vsd(root, "ingest", str(tmp_path / "export"))
    assert said.exit_code == 2
    assert "says camera 'cam-9'" in said.output


def test_a_watched_folder_puts_a_name_without_a_camera_aside_with_its_reason(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML + PROFILE + "[ingest]\nwatch_settle_s = 0.0\n")
    folder = tmp_path / "in"
    for name in ("cam-1_a.csv", "tills_a.csv", "cam-3_a.csv"):
        table(folder / name)
    status = watched(root, folder)
    assert (status.n_done, status.n_failed) == (2, 1)
    assert set(places(root)) == {"cam-1", "cam-2"}
    (reason,) = [p for p in (folder / "failed").iterdir() if p.suffix == ".txt"]
    assert "says camera 'cam-3'" in reason.read_text()


def test_check_saves_where_the_name_says_the_camera(tmp_path: Path) -> None:
    root = project(tmp_path / "p")
    said = vsd(root, "check", str(table(tmp_path / "cam-1_2025-11-10.csv")), "--save", "days")
    assert "the name says the camera: {camera}_*.csv" in said.output, said.output
    (source,) = tomllib.loads((root / "vsd.toml").read_text())["source"]
    assert source == {
        "id": "days",
        "files": ["cam-*_*.csv", "tills_*.csv"],
        "format": "table",
        "camera_from_name": "{camera}_*.csv",
    }
    assert vsd(root, "ingest", str(table(tmp_path / "tills_2025-11-11.csv", x_m=4))).exit_code == 0
    assert places(root) == {"cam-2": Counter({4: 20})}


def test_check_saves_no_name_where_the_records_say_the_camera(tmp_path: Path) -> None:
    root = project(tmp_path / "p")
    file = table(tmp_path / "cam-1_2025.csv", header="ts,track_id,x_m,y_m,camera_id", cell=",cam-2")
    vsd(root, "check", str(file), "--save", "days")
    (source,) = tomllib.loads((root / "vsd.toml").read_text())["source"]
    assert "camera_from_name" not in source
    assert "camera" not in source


@pytest.mark.parametrize(
    "lines",
    [
        'files = "*.csv"\ncamera_from_name = "*_cam.csv"',
        'files = "*.csv"\ncamera_from_name = "{camera}_{camera}.csv"',
        'files = "*.csv"\ncamera_from_name = "/data/{camera}.csv"',
        'files = "*.csv"\ncamera = "cam-1"\ncamera_from_name = "{camera}.csv"',
        'topics = ["acme"]\npersons = "p"\nmap = { ts = "t", x_m = "x", y_m = "y" }\ncamera_from_name = "{camera}.csv"',
    ],
)
def test_a_pattern_that_cannot_be_used_is_a_mistake_with_its_line(lines: str, tmp_path: Path) -> None:
    root = project(tmp_path / "p", f'{TOML}\n[[source]]\nid = "days"\n{lines}\n')
    with pytest.raises(ConfigError) as error:
        load_site(root)
    (problem,) = error.value.problems
    assert problem.code == "E124"
    assert "camera_from_name" in problem.what


def test_the_import_of_a_file_has_the_id_that_it_has_with_the_camera_said(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML + PROFILE)
    file = table(tmp_path / "cam-1_2025.csv")
    vsd(root, "ingest", str(file))
    assert "20 were known already" in vsd(root, "ingest", str(file), "--camera", "cam-1").output
    assert len((root / "store" / "imports.jsonl").read_text().splitlines()) == 2
    assert vsd(root, "imports").output.count("[table]") == 1


def test_a_file_that_names_its_camera_is_refused_with_the_camera_and_the_profile(tmp_path: Path) -> None:
    root = project(tmp_path / "p")
    said = vsd(root, "ingest", str(table(tmp_path / "tills_2025-11-10.csv")))
    assert "fix: --camera tills; vsd check tills_2025-11-10.csv --save NAME makes a profile" in said.output
