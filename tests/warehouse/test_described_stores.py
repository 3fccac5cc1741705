"""No figure is made while vsd.toml does not describe what is stored; what the message prints repairs it."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest
from retention.aged_projects import DAYS, TOML, make_project, messages, three_days, vsd, write

import vsd_analytics
from vsd_analytics.cli.output import render_error
from vsd_analytics.errors import ConfigError

RANGE = ("--range", f"{DAYS[0]}..{DAYS[2]}")
WEEK = ("--week", "2026-W46")
AREA = """
[[area]]
id = "stairs"
name = "Stairs"
floor = "ground"
polygon = [[0, 0], [3, 0], [3, 3], [0, 3]]
visits = true
"""
CAM_2 = TOML[TOML.index('[[camera]]\nid = "cam-2"') : TOML.index("[privacy]")]
COMMANDS = {
    "hours": ("hours", *RANGE),
    "coverage": ("coverage", *RANGE),
    "report": ("report", *WEEK),
    "planner": ("planner", *WEEK),
    "today": ("today",),
    "visits": ("visits", *RANGE, "--exact"),
    "hotspots": ("hotspots", *RANGE),
    "heatmap": ("heatmap", *RANGE),
    "groups": ("groups", *RANGE),
    "forecast": ("forecast",),
    "sql": ("sql", "select * from area_hours", *RANGE),
    "duckdb": ("export", "--duckdb", "figures.duckdb", *RANGE),
    "build": ("build",),
    "compare": ("compare", "2026-W45", "2026-W46"),
}


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = make_project(tmp_path_factory.mktemp("described") / "p", toml=TOML + AREA)
    vsd(root, "ingest", str(three_days(root)), code=None)
    vsd(root, "build")
    return root


@pytest.fixture
def root(stored: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(stored, tmp_path / "p"))


def change(root: Path, old: str, new: str) -> None:
    text = (root / "vsd.toml").read_text(encoding="utf-8")
    assert text.count(old) == 1
    (root / "vsd.toml").write_text(text.replace(old, new), encoding="utf-8")


def refusal(root: Path, *command: str) -> str:
    """Return what a command prints instead of figures."""
    with pytest.raises(ConfigError) as refused:
        vsd(root, *command)
    assert refused.value.code == "E321"
    return render_error(refused.value)


def printed_lines(text: str, first: str) -> str:
    """Return the lines of a message that are made to be pasted, from the one that begins with `first`."""
    lines = [line.strip() for line in text.splitlines()]
    start = next(k for k, line in enumerate(lines) if line.startswith(first))
    end = next(k for k, line in enumerate(lines[start:], start) if not re.match(r"\[\[|\w+ = ", line))
    return "\n".join(lines[start:end]) + "\n"


@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_makes_a_figure_without_a_camera_whose_block_was_deleted(root: Path, command: str) -> None:
    change(root, CAM_2, "")
    assert "no [[camera]] describes it" in refusal(root, *COMMANDS[command])


def test_nor_does_python_or_the_service(root: Path) -> None:
    change(root, CAM_2, "")
    with pytest.raises(ConfigError, match="does not describe what is stored"):
        vsd_analytics.open(root).days(DAYS[0], DAYS[2]).hours()
    pytest.importorskip("starlette", reason="the extra serve is not installed")
    pytest.importorskip("httpx", reason="the extra test is not installed")
    from service.test_service import WEEK as ADDRESS
    from service.test_service import client_of

    answer = client_of(root).get(f"{ADDRESS}/report")
    assert answer.status_code >= 400
    assert "does not describe what is stored" in answer.text


def test_doctor_verify_and_coverage_name_the_camera(root: Path) -> None:
    change(root, CAM_2, "")
    refusal(root, *COMMANDS["coverage"])
    doctor = json.loads(vsd(root, "doctor", "--json", code=None))
    (found,) = [f for f in doctor["findings"] if "describes it" in f["detail"]]
    assert found["state"] == "needs you"
    verified = json.loads(vsd(root, "verify", "--json", code=1))
    assert [f["code"] for f in verified["findings"] if not f["is_note"]] == ["E321"]
    assert "damaged" not in vsd(root, "verify", code=1)  # no file of the store is


def test_the_printed_block_pasted_brings_the_figures_back(root: Path) -> None:
    before = vsd(root, "hours", *RANGE, "--json")
    change(root, CAM_2, "")
    pasted = printed_lines(refusal(root, "hours"), "[[camera]]")
    text = (root / "vsd.toml").read_text(encoding="utf-8")
    (root / "vsd.toml").write_text(f"{text}\n{pasted}hz = 0.1\n", encoding="utf-8")
    assert json.loads(vsd(root, "hours", *RANGE, "--json"))["hours"] == json.loads(before)["hours"]
    vsd(root, "verify")


def test_the_printed_purge_makes_the_deletion_good(root: Path) -> None:
    change(root, CAM_2, "")
    command = re.search(r"vsd (purge [^\n]+)", refusal(root, "hours"))
    assert command is not None
    vsd(root, *shlex.split(command[1]))
    vsd(root, "hours", *RANGE)
    vsd(root, "verify")


def test_a_renamed_camera_is_refused_and_the_block_pasted_keeps_its_past(root: Path) -> None:
    before = json.loads(vsd(root, "hours", *RANGE, "--json"))["hours"]
    change(root, 'id = "cam-2"', 'id = "stairs-cam"')
    text = refusal(root, "hours")
    assert "'cam-2'" in text
    block = printed_lines(text, "[[camera]]")
    with (root / "vsd.toml").open("a", encoding="utf-8") as file:
        file.write(f"\n{block}hz = 0.1\n")
    change(root, 'id = "stairs-cam"', f'id = "stairs-cam"\nfrom = "{DAYS[2]}"')
    after = json.loads(vsd(root, "hours", *RANGE, "--json"))["hours"]
    columns = ("start", "person_records", "violation_records", "n_violations")
    assert [[h[k] for k in columns] for h in after] == [[h[k] for k in columns] for h in before]


def test_a_camera_moved_to_another_floor_is_refused_and_the_printed_lines_repair_it(root: Path) -> None:
    before = vsd(root, "hours", *RANGE, "--by", "camera")
    change(root, CAM_2, CAM_2.replace('floor = "ground"', 'floor = "first"'))
    change(root, '[[camera]]\nid = "cam-1"', '[[floor]]\nid = "first"\nname = "First"\n[[camera]]\nid = "cam-1"')
    lines = printed_lines(refusal(root, "hours"), 'floor = "ground"')
    change(root, 'floor = "first"\n', lines)
    assert vsd(root, "hours", *RANGE, "--by", "camera") == before


@pytest.mark.parametrize(("key", "wrong"), [("to", DAYS[1]), ("from", DAYS[1])])
def test_a_life_that_leaves_out_records_is_refused_and_the_printed_day_fits(root: Path, key: str, wrong: str) -> None:
    before = json.loads(vsd(root, "hours", *RANGE, "--json"))["hours"]
    change(root, 'id = "cam-2"\n', f'id = "cam-2"\n{key} = "{wrong}"\n')
    line = re.search(rf'fix: ({key} = "[\d-]+")', refusal(root, "hours"))
    assert line is not None
    change(root, f'{key} = "{wrong}"', line[1])
    after = json.loads(vsd(root, "hours", *RANGE, "--json"))["hours"]
    assert [h["n_violations"] for h in after] == [h["n_violations"] for h in before]


def test_an_area_in_centimetres_is_refused_and_the_printed_corners_are_its_own(root: Path) -> None:
    before = vsd(root, "visits", *RANGE, "--exact", code=None)
    change(root, "[[0, 0], [3, 0], [3, 3], [0, 3]]", "[[1, 1], [300, 1], [300, 300], [1, 300]]")
    text = refusal(root, "visits", *RANGE, "--exact")
    assert "centimetres" in text
    change(root, "polygon = [[1, 1], [300, 1], [300, 300], [1, 300]]", printed_lines(text, "polygon").strip())
    assert "Stairs" in before
    after = vsd(root, "visits", *RANGE, "--exact", code=None)
    assert [line for line in after.splitlines() if "Stairs" in line] == [
        line for line in before.splitlines() if "Stairs" in line
    ]


def test_records_from_outside_a_life_go_to_quarantine_and_come_back_when_it_is_corrected(
    root: Path, tmp_path: Path
) -> None:
    change(root, 'id = "cam-2"\n', 'id = "cam-2"\nto = "2026-11-12"\n')
    late = write(tmp_path / "late.jsonl", messages(camera="cam-2", day="2026-11-12", hours=(9,)))
    output = json.loads(vsd(root, "ingest", str(late), "--json", code=1))
    n = output["sources"][0]["quarantined"]["camera-not-there"]
    assert n == 90 + 120
    change(root, 'to = "2026-11-12"\n', "")
    replayed = json.loads(vsd(root, "quarantine", "replay", "--reason", "camera-not-there", "--json"))
    assert sum(replayed["records"].values()) == n
