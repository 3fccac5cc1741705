"""`vsd init`, `calibrate`, `log`, `explain`, `schema`, `doctor`: what they write, print and return."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.cli import cli
from vsd_analytics.cli.calibrate import calibrate
from vsd_analytics.cli.doctor import doctor
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.cli.explain import explain, explanation, explanations
from vsd_analytics.cli.init import init
from vsd_analytics.cli.log import log
from vsd_analytics.cli.schema import schema
from vsd_analytics.config.change_log import read_log
from vsd_analytics.config.first_config import FirstAnswers, render, write_first_config
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, UsageError

PACKAGE = Path(__file__).resolve().parents[2] / "vsd_analytics"
H = np.array([[0.01, 0.001, -2.0], [0.0005, -0.012, 9.0], [0.00001, 0.002, 1.0]])
SPOTS = np.array([[100, 700], [1200, 680], [900, 400], [300, 420], [640, 550], [700, 450]], dtype=float)

Vsd = Callable[..., tuple[int, str, str]]


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    """Return a function that runs `vsd -C tmp_path ...` and gives exit code, stdout, stderr."""

    def call(*arguments: str) -> tuple[int, str, str]:
        code = run(cli, ["-C", str(tmp_path), "--now", "2026-11-20T12:00", *arguments])
        return code, *capsys.readouterr()

    return call


@pytest.fixture
def project(tmp_path: Path) -> Path:
    text = render(FirstAnswers("Shop", "Europe/Rome", cameras=("cam-1=Entrance", "cam-2")))
    area = '[[area]]\nid = "entrance"\nname = "E"\npolygon = [[0, 0], [1, 0], [1, 1]]\n'
    (tmp_path / "vsd.toml").write_text(text + area, encoding="utf-8")
    return tmp_path


def points_csv(path: Path, *, n: int = 6, off_m: float = 0.0) -> Path:
    """Write spots of the homography H; the last one is wrong by `off_m` along x."""
    xyw = np.column_stack([SPOTS, np.ones(len(SPOTS))]) @ H.T
    xy = xyw[:, :2] / xyw[:, 2:]
    xy[n - 1, 0] += off_m
    rows = [",".join(map(repr, map(float, row))) for row in np.column_stack([SPOTS, xy])[:n]]
    path.write_text("\n".join(["u,v,x,y", *rows]) + "\n", encoding="utf-8")
    return path


# init -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("language", "floor"), [("it", "Piano terra"), ("en", "Ground floor"), (None, "Ground floor")])
def test_init_names_the_floor_in_the_language_of_the_site(
    vsd: Vsd, tmp_path: Path, language: str | None, floor: str
) -> None:
    assert vsd("init", "--no-input", *(("--language", language) if language else ()))[0] == 0
    site = load_site(tmp_path)
    assert (site.language, [f.name for f in site.floors]) == (language or "en", [floor])


def test_init_writes_a_site_that_loads(vsd: Vsd, tmp_path: Path) -> None:
    flags = ["--name", "Riverside Store", "--timezone", "Europe/Rome", "--opening", "mon-sat 08:00-21:00"]
    code, out, _ = vsd(
        "init", "--no-input", *flags, "--camera", "cam-1=Entrance", "--camera", "cam-2", "--distance", "3"
    )
    assert (code, out.strip()) == (0, str(tmp_path / "vsd.toml"))
    site = load_site(tmp_path)
    assert (site.site_id, site.name) == ("riverside-store", "Riverside Store")
    assert [(c.camera_id, c.name) for c in site.cameras] == [("cam-1", "Entrance"), ("cam-2", "cam-2")]
    assert [c.engine_ids for c in site.cameras] == [(), ()]
    assert site.opening is not None
    assert site.opening[5:] == (((480, 1260),), ())
    assert site.settings.distance_m == 3.0


def test_init_never_writes_over(vsd: Vsd, project: Path) -> None:
    before = (project / "vsd.toml").read_bytes()
    code, _, err = vsd("init", "--no-input")
    assert code == 2
    assert "E104" in err
    assert (project / "vsd.toml").read_bytes() == before


@pytest.mark.parametrize(
    "flags",
    [
        ["--camera", "../../x"],
        ["--id", "<script>"],
        ["--timezone", "Mars/Base"],
        ["--opening", "fri 18:00-02:00"],
        ["--opening", "nonsense"],
        ["--plan", "nowhere.png", "--plan-m-per-px", "0.1"],
        ["--distance", "nan"],
    ],
)
def test_init_with_an_impossible_answer_writes_nothing(vsd: Vsd, tmp_path: Path, flags: list[str]) -> None:
    code, _, err = vsd("init", "--no-input", *flags)
    assert code == 2
    assert "fix:" in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "hours", ["09:00-11:00", "9:00-10:00 10:15-11:00", "09:00-10:00, 10:15-11:00", "mon-sun 09:00-10:00, 10:15-11:00"]
)
def test_hours_without_days_are_those_of_every_day(vsd: Vsd, tmp_path: Path, hours: str) -> None:
    assert vsd("init", "--no-input", "--opening", hours)[0] == 0
    opening = load_site(tmp_path).opening
    assert opening is not None
    assert len(set(opening)) == 1
    assert (opening[6][0][0], opening[6][-1][1]) == (540, 660)


def test_init_asks_again_after_an_impossible_answer(vsd: Vsd, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import io

    answers = "My shop\nEurope/Berln\nEurope/Berlin\nfri 20:00-02:00\nalways\na, b=Back\n\nmiles\nmm\n"
    monkeypatch.setattr("sys.stdin", io.StringIO(answers))
    code, out, err = vsd("init")
    assert code == 0
    assert "Europe/Berlin" in err  # the nearest zone is proposed
    assert "vsd check FILE --unit mm --save" in err
    assert out.strip() == str(tmp_path / "vsd.toml")  # questions are talk, not result
    site = load_site(tmp_path)
    assert (site.timezone, site.opening, len(site.cameras)) == ("Europe/Berlin", None, 2)


def test_init_without_anybody_to_answer_names_the_option(
    vsd: Vsd, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import io

    monkeypatch.setattr("sys.stdin", io.StringIO("My shop\n"))
    code, _, err = vsd("init")
    assert (code, "--no-input" in err) == (2, True)
    assert not (tmp_path / "vsd.toml").exists()


@given(name=st.text(min_size=1, max_size=60), camera=st.text(max_size=30))
def test_any_name_is_in_the_file_as_it_was_given(
    tmp_path_factory: pytest.TempPathFactory, name: str, camera: str
) -> None:
    answers = FirstAnswers(name, "UTC", cameras=(f"cam-1={camera}",))
    site = None
    with contextlib.suppress(ConfigError, UsageError):
        site = write_first_config(tmp_path_factory.mktemp("p"), answers=answers)
    is_good = bool(name.strip()) and name.isprintable() and camera.strip().isprintable()
    assert (site is not None) == is_good
    if site is not None:
        assert (site.name, site.cameras[0].name) == (name, camera.strip() or "cam-1")


# calibrate ------------------------------------------------------------------------------------------------------------


def test_calibration_from_points_is_in_force_with_its_error_and_picture(vsd: Vsd, project: Path) -> None:
    code, out, err = vsd("calibrate", "cam-1", "--points", str(points_csv(project / "p.csv")), "--json")
    told = json.loads(out)
    assert (code, told["n_points"], told["is_in_force"], err) == (0, 6, True, "")
    assert told["error_m"] < 1e-4
    (calibration,) = load_site(project).camera("cam-1").calibrations
    assert calibration.calibration_id == told["calibration_id"]
    assert np.allclose(calibration.homography, H, rtol=1e-3, atol=1e-6)
    overlay = cv2.imread(str(project / told["overlay"]))
    assert overlay is not None
    assert len(np.unique(overlay.reshape(-1, 3), axis=0)) > 10  # grid, rings, numbers


def test_grid_of_the_overlay_lies_where_the_floor_is(project: Path) -> None:
    from vsd_analytics.geometry.calibration_picture import draw_overlay
    from vsd_analytics.geometry.homography import to_image
    from vsd_analytics.site.model import Camera

    picture = draw_overlay(Camera("c", "c", "f", picture_px=(1280, 720)), homography=H.tolist(), points=())
    image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    u, v = (
        np.rint(to_image(H, [(x + 0.3, y) for x in range(-1, 4) for y in range(1, 4)], picture_px=(1280, 720)))
        .astype(int)
        .T
    )
    inside = (u > 5) & (u < 1275) & (v > 5) & (v < 715)
    assert inside.sum() > 5
    dark = [image[b - 2 : b + 3, a - 2 : a + 3].min() for a, b in zip(u[inside], v[inside], strict=True)]
    assert max(dark) < 200  # the blank page is 245


def test_wrong_point_is_named_and_needs_you(vsd: Vsd, project: Path) -> None:
    code, out, err = vsd("calibrate", "cam-1", "--points", str(points_csv(project / "p.csv", off_m=3.0)))
    assert code == 1
    assert "W402" in err
    assert re.search(r"worst \d+\.\d cm at point \d", out)


def test_four_points_are_warned_of_not_praised(vsd: Vsd, project: Path) -> None:
    code, _, err = vsd("calibrate", "cam-1", "--points", str(points_csv(project / "p.csv", n=4)))
    assert code == 0
    assert "W401" in err
    assert "nothing is checked" in err


def test_later_calibration_leaves_the_earlier_one_in_force_before_it(vsd: Vsd, project: Path) -> None:
    vsd("calibrate", "cam-1", "--points", str(points_csv(project / "p.csv")))
    np.savetxt(project / "new.txt", H + 0.001)
    code, _, err = vsd("calibrate", "cam-1", "--matrix", str(project / "new.txt"), "--from", "2026-11-01T00:00")
    assert (code, err) == (0, "")
    first, second = load_site(project).camera("cam-1").calibrations
    assert first.valid_from is None
    assert str(second.valid_from) == "2026-10-31 23:00:00+00:00"  # midnight in Rome
    assert first.calibration_id != second.calibration_id


def test_replacing_a_calibration_for_all_time_is_warned_of(vsd: Vsd, project: Path) -> None:
    vsd("calibrate", "cam-1", "--points", str(points_csv(project / "p.csv")))
    np.savetxt(project / "new.txt", H + 0.001)
    assert "W404" in vsd("calibrate", "cam-1", "--matrix", str(project / "new.txt"))[2]
    assert len(load_site(project).camera("cam-1").calibrations) == 1
    assert "W404" not in vsd("calibrate", "cam-1")[2]


def test_calibration_that_vsd_toml_hides_says_which_line_to_write(vsd: Vsd, project: Path) -> None:
    np.savetxt(project / "old.txt", H)
    np.savetxt(project / "new.txt", H + 0.001)
    path = project / "vsd.toml"
    path.write_text(path.read_text().replace('name = "Entrance"', 'name = "Entrance"\nhomography = "old.txt"'))
    code, _, err = vsd("calibrate", "cam-1", "--matrix", str(project / "new.txt"))
    assert code == 1
    assert 'homography = "calibration/cam-1.txt"' in err
    path.write_text(path.read_text().replace("old.txt", "calibration/cam-1.txt"))
    assert np.allclose(load_site(project).camera("cam-1").calibrations[0].homography, H + 0.001)


def test_file_that_vsd_toml_names_is_checked_and_left_alone(vsd: Vsd, project: Path) -> None:
    points = points_csv(project / "p.csv")
    path = project / "vsd.toml"
    path.write_text(path.read_text().replace('name = "Entrance"', 'name = "Entrance"\npoints = "p.csv"'))
    for flags in ([], ["--points", str(points)]):
        code, out, err = vsd("calibrate", "cam-1", *flags)
        assert (code, err) == (0, "")
        assert "6 points" in out
        assert [p.name for p in (project / "calibration").iterdir()] == ["cam-1-overlay.png"]


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["cam-9", "--points", "p.csv"], "E101"),
        (["../../x"], "E101"),
        (["cam-1"], "E101"),
        (["cam-1", "--matrix", "p.csv", "--points", "p.csv"], "E101"),
        (["cam-1", "--points", "nowhere.csv"], "E406"),
        (["cam-1", "--points", "p.csv", "--from", "soon"], "E101"),
    ],
)
def test_calibration_that_cannot_be_is_refused_and_writes_nothing(
    vsd: Vsd, project: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], code: str
) -> None:
    monkeypatch.chdir(project)
    points_csv(project / "p.csv")
    exit_code, out, _ = vsd("calibrate", *arguments, "--json")
    assert (exit_code, json.loads(out)["code"]) == (2, code)
    assert not (project / "calibration").exists()


# log ------------------------------------------------------------------------------------------------------------------


def test_log_entries_are_listed_by_time(vsd: Vsd, project: Path) -> None:
    assert vsd("log", "add", "moved the exhibit", "--at", "2026-11-11T12:00", "--area", "entrance")[0] == 0
    assert vsd("log", "add", "now")[0] == 0  # --now is the clock
    code, out, _ = vsd("log", "list", "--json")
    assert code == 0
    entries = json.loads(out)["log"]
    assert all(re.fullmatch("e[0-9a-f]{8}", entry.pop("id")) for entry in entries)
    assert entries == [
        {"at": "2026-11-11T12:00:00+01:00", "text": "moved the exhibit", "area": "entrance"},
        {"at": "2026-11-20T13:00:00+01:00", "text": "now", "area": None},
    ]
    assert len(read_log(load_site(project))) == 2


def test_log_add_says_of_a_repeated_entry_that_the_log_has_it(vsd: Vsd, project: Path) -> None:
    for is_new in (True, False):
        code, _, err = vsd("log", "add", "moved", "--at", "2026-11-11T12:00")
        assert (code, "has this entry already" in err) == (0, not is_new)
    assert len(read_log(load_site(project))) == 1


def test_a_log_line_that_broke_off_is_a_warning_until_the_next_entry_removes_it(vsd: Vsd, project: Path) -> None:
    (project / "log.jsonl").write_text('{"at": "2026-11-11T12:00', encoding="utf-8")
    code, _, err = vsd("log", "list")
    assert (code, "warning[W110]: line 1 of log.jsonl" in err) == (0, True)
    assert 'removed an incomplete line: {"at": "2026-11-11T12:00' in vsd("log", "add", "moved")[2]
    assert "W110" not in vsd("log", "list")[2]


def test_log_of_an_unknown_area_is_answered_with_the_nearest(vsd: Vsd, project: Path) -> None:
    code, _, err = vsd("log", "add", "x", "--area", "entrence")
    assert code == 2
    assert "--area entrance" in err


def test_control_characters_of_a_hand_written_log_do_not_reach_the_terminal(vsd: Vsd, project: Path) -> None:
    line = json.dumps({"at": "2026-11-11", "text": "a\x1b[31mred\nline", "area": None})
    (project / "log.jsonl").write_text(line + "\n", encoding="utf-8")
    code, out, err = vsd("log", "list")
    assert code == 2
    assert "E110" in err
    assert "\x1b" not in out + err


# help -----------------------------------------------------------------------------------------------------------------


def codes_in_the_package() -> set[str]:
    found = set()
    for path in PACKAGE.rglob("*.py"):
        for line in path.read_text(encoding="utf-8").splitlines():
            found |= set(re.findall(r"\b[EW][1-9]\d\d\b", line.partition("# noqa")[0]))
    return found


def test_every_code_is_explained_and_every_explanation_is_used() -> None:
    assert codes_in_the_package() == set(explanations())


@pytest.mark.parametrize("code", sorted(explanations()))
def test_explanation_is_short_and_whole(code: str) -> None:
    text = explanation(code.lower())
    assert 1 <= len(text.splitlines()) <= 6
    assert text.endswith((".", "}", "FILES.", "+01:00", "FILE.csv", "--test"))


def test_unknown_code_is_answered_with_the_nearest(vsd: Vsd) -> None:
    code, _, err = vsd("explain", "E9000")
    assert code == 2
    assert "vsd explain E900" in err
    with pytest.raises(UsageError):
        explanation("")


def test_explain_takes_words_and_shows_where_the_manual_answers(vsd: Vsd) -> None:
    code, out, _ = vsd("explain", "opening", "hours")
    assert code == 0
    assert out.startswith("guide: Opening hours\n")
    sections = json.loads(vsd("explain", "opening", "hours", "--json")[1])["sections"]
    assert [*sections[0]] == ["page", "heading", "text"]
    code, _, err = vsd("explain", "qqqq")
    assert code == 2
    assert "the manual says nothing about 'qqqq'" in err


def test_explain_without_a_code_lists_all(vsd: Vsd) -> None:
    code, out, _ = vsd("explain")
    assert code == 0
    assert [line[:4] for line in out.splitlines()] == sorted(explanations())


def test_schema_of_the_tables_is_that_of_the_store(vsd: Vsd) -> None:
    from vsd_analytics.schema import SCHEMAS

    told = json.loads(vsd("schema", "tables")[1])
    assert {name: [c["name"] for c in t["columns"]] for name, t in told.items()} == {
        n: s.names for n, s in SCHEMAS.items()
    }


def test_schema_of_the_frame_message_accepts_the_house_plans_example(vsd: Vsd) -> None:
    import jsonschema

    message = {
        "v": 1, "camera": "cam-1", "ts": "2026-11-09T08:00:00.200Z", "seq": 28801, "engine": "acme 2.1",
        "quality": "metric",
        "persons": [{"id": "7", "x_m": 1.20, "y_m": 3.41}, {"id": "9", "u_px": 512.0, "v_px": 633.5}],
        "pairs": [{"a": "7", "b": "9", "distance_m": 1.42, "sd_m": 0.15}],
    }  # fmt: skip
    jsonschema.validate(message, json.loads(vsd("schema", "frame")[1]))


@pytest.mark.parametrize(
    "command", [init, calibrate, log, log.commands["add"], log.commands["list"], explain, schema, doctor]
)
def test_every_command_shows_an_example(command: Any) -> None:
    assert re.search(r"\x08\n *Example:\n +vsd ", str(command.help))


def test_init_keeps_what_the_engine_calls_a_camera(vsd: Vsd, tmp_path: Path) -> None:
    named = ("--camera", "Cam 2=Exit", "--camera", "PETS09-S2L1")
    code, _, err = vsd("init", "--no-input", "--name", "Shop", "--timezone", "UTC", *named)
    assert code == 0, err
    cameras = load_site(tmp_path).cameras
    assert [(c.camera_id, c.name, c.engine_ids) for c in cameras] == [
        ("cam-2", "Exit", ("Cam 2",)),
        ("pets09-s2l1", "PETS09-S2L1", ("PETS09-S2L1",)),
    ]


# doctor ---------------------------------------------------------------------------------------------------------------


def findings(vsd: Vsd) -> tuple[int, dict[str, dict[str, str]]]:
    code, out, _ = vsd("doctor", "--json")
    return code, {finding["subject"]: finding for finding in json.loads(out)["findings"]}


def store_something(project: Path) -> None:
    folder = project / "store" / "frames" / "site=shop" / "date=2026-11-09"
    folder.mkdir(parents=True)
    (folder / "part.parquet").write_bytes(b"")


def test_cameras_with_a_view_are_not_called_blind(vsd: Vsd, project: Path) -> None:
    assert "cam-1" in findings(vsd)[1]["camera pictures"]["detail"].partition("unknown")[0]
    path = project / "vsd.toml"
    view = "view = [[0, 0], [8, 0], [8, 6]]"
    path.write_text(path.read_text().replace('name = "Entrance"', f'name = "Entrance"\n{view}'))
    detail = findings(vsd)[1]["camera pictures"]["detail"]
    assert "none for cam-1" in detail
    assert "what cam-1" not in detail


def test_fresh_project_needs_data(vsd: Vsd, project: Path) -> None:
    code, found = findings(vsd)
    assert code == 1
    assert {name for name, f in found.items() if f["state"] == "needs you"} == {"store"}


def test_healthy_project_needs_nothing(vsd: Vsd, project: Path) -> None:
    store_something(project)
    code, found = findings(vsd)
    assert (code, found["store"]["detail"]) == (0, "1 UTC day(s), 2026-11-09 to 2026-11-09")


def test_records_past_their_time_need_you(vsd: Vsd, project: Path) -> None:
    file = project / "a.csv"
    file.write_text("ts,camera_id,track_id,x_m,y_m\n2026-11-09T09:00:00Z,cam-1,1,0.5,0.5\n", encoding="utf-8")
    assert vsd("ingest", str(file))[0] == 0
    assert "retention" not in findings(vsd)[1]
    path = project / "vsd.toml"
    path.write_text(path.read_text() + "[privacy]\nretention_days = 7\n")  # they are eleven days old
    code, found = findings(vsd)
    assert (code, found["retention"]["state"]) == (1, "needs you")
    assert "vsd purge --older-than retention" in found["retention"]["fix"]


def test_old_calibration_broken_config_and_real_track_ids_need_you(vsd: Vsd, project: Path) -> None:
    store_something(project)
    np.savetxt(project / "h.txt", H)
    path = project / "vsd.toml"
    dated = 'name = "Entrance"\nhomography = "h.txt"\ncalibrated_from = 2025-01-01'
    path.write_text(path.read_text().replace('name = "Entrance"', dated) + "[privacy]\npseudonyms = false\n")
    code, found = findings(vsd)
    assert code == 1
    assert {n for n, f in found.items() if f["state"] == "needs you"} == {"privacy", "calibration of cam-1"}
    path.write_text(path.read_text() + "nonsense = 1\n")
    code, found = findings(vsd)
    assert code == 1
    assert "'nonsense'" in found["vsd.toml"]["detail"]


def test_doctor_without_a_project_says_how_to_begin(vsd: Vsd) -> None:
    code, found = findings(vsd)
    assert code == 1
    assert "vsd init" in found["vsd.toml"]["fix"]


def test_settings_are_shown_with_their_source(vsd: Vsd, project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VSD_MASK_BELOW", "7")
    out = json.loads(vsd("doctor", "--show-config", "--json")[1])
    shown = {s["name"]: (s["value"], s["source"]) for s in out["settings"]}
    assert shown["mask_below"] == (7, "VSD_MASK_BELOW")
    assert shown["distance_m"] == (2.0, "vsd.toml line 8")
    assert shown["smoothing_m"] == (0.5, "default")


@pytest.mark.parametrize(
    ("absent", "state"),
    [
        ((), "ok"),
        (("scipy", "opencv-python-headless", "matplotlib"), "note"),
        (("matplotlib",), "needs you"),
        (("duckdb", "scipy", "opencv-python-headless", "matplotlib"), "needs you"),
    ],
)
def test_the_core_is_no_broken_installation(absent: tuple[str, ...], state: str) -> None:
    from importlib.metadata import PackageNotFoundError

    from vsd_analytics.doctor import checks

    def version_of(name: str) -> str:
        if name in absent:
            raise PackageNotFoundError(name)
        return "1.0"

    assert checks._packages(version_of).state == state


def test_network_file_systems_are_distinguished_from_local_ones(tmp_path: Path) -> None:
    from vsd_analytics.doctor import checks as doctors

    mounts = tmp_path / "mounts"
    mounts.write_text("/dev/sda1 / ext4 rw 0 0\nserver:/x /mnt/far\\040away nfs4 rw 0 0\n", encoding="utf-8")
    assert doctors._kind_of_mount(Path("/home/x"), mounts) == "ext4"
    assert doctors._kind_of_mount(Path("/mnt/far away/x"), mounts) == "nfs4"
    assert doctors._kind_of_mount(Path("/home/x"), tmp_path / "none") is None
    assert doctors._platform("win32").state == "needs you"
    assert doctors._platform("darwin").state == "ok"


def test_init_finds_a_plan_from_a_folder_that_is_not_there_yet_and_leaves_none_behind(vsd: Vsd, tmp_path: Path) -> None:
    (tmp_path / "plan.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" width="10" height="10"/>')
    said = ("init", "--no-input", "--name", "Shop", "--timezone", "Europe/Rome", "--plan-m-per-px", "1", "--plan")
    code, _, error = vsd("-C", str(tmp_path / "other"), *said, "../nowhere.svg")
    assert (code, "../nowhere.svg" in error) == (2, True)
    assert not (tmp_path / "other").exists()
    code, _, error = vsd("-C", str(tmp_path / "other"), *said, "../plan.svg")
    assert code == 0, error
    assert (tmp_path / "other" / "vsd.toml").is_file()
