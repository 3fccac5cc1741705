"""The target of a floor is one line of vsd.toml: set, changed and taken away, and everything else stays as it was."""

from __future__ import annotations

import tomllib
from datetime import datetime
from pathlib import Path

import pytest

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.floor_targets import FILE, read_target_changes, set_target
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, InputError, UsageError

AT = datetime.fromisoformat("2026-11-17T09:30:00+01:00")
TOML = """# The shop.
[site]
id = "shop"   # its id
name = "Shop"
timezone = "Europe/Rome"

[[floor]]
name = "Cellar"   # target_per_open_h = 7
id = "cellar"

[[floor]]  # the hall
id = "hall"
{line}name = "Hall"
notes = '''x'''

[[camera]]
id = "cam-1"
name = "Camera"
floor = "hall"
""".replace("notes = '''x'''\n", "")


def project(root: Path, line: str = "", *, end: str = "\n", mark: str = "") -> Path:
    (root / "vsd.toml").write_bytes((mark + TOML.format(line=line)).replace("\n", end).encode())
    return root / "vsd.toml"


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("line", ["", "target_per_open_h = 80   # asked by Bea\n", '"target_per_open_h" = 80\n'])
def test_a_target_changes_its_own_line_alone(tmp_path: Path, line: str, end: str, mark: str) -> None:
    path = project(tmp_path, line, end=end, mark=mark)
    before = path.read_bytes().decode().split("\n")
    change = set_target(load_site(tmp_path), "hall", 120, at=AT, by="Anna")
    assert change is not None
    assert (change.before, change.after) == (80 if line else None, 120)
    assert {f.floor_id: f.target_per_open_h for f in load_site(tmp_path).floors} == {"cellar": None, "hall": 120}
    after = path.read_bytes().decode().split("\n")
    assert len(after) == len(before) + (not line)
    assert [one for one in before if one not in after] == ([] if not line else [line.rstrip("\n") + end[:-1]])
    assert "# asked by Bea" in path.read_text(encoding="utf-8") or "asked" not in line
    set_target(load_site(tmp_path), "hall", None, at=AT)
    assert load_site(tmp_path).floors[1].target_per_open_h is None
    assert [(c.before, c.after, c.by) for c in read_target_changes(load_site(tmp_path))][1:] == [(120, None, None)]
    if not line:
        assert path.read_bytes().decode().split("\n") == before


def test_the_same_target_again_changes_nothing(tmp_path: Path) -> None:
    path = project(tmp_path, "target_per_open_h = 80\n")
    before = path.read_bytes()
    assert set_target(load_site(tmp_path), "hall", 80.0, at=AT) is None
    assert path.read_bytes() == before
    assert not (tmp_path / FILE).exists()


@pytest.mark.parametrize("value", [0, -1, 1e7, float("nan"), float("inf")])
def test_what_is_no_target_is_refused(tmp_path: Path, value: float) -> None:
    path = project(tmp_path)
    before = path.read_bytes()
    with pytest.raises(UsageError):
        set_target(load_site(tmp_path), "hall", value, at=AT)
    with pytest.raises(UsageError):
        set_target(load_site(tmp_path), "attic", 100, at=AT)
    with pytest.raises(UsageError):
        set_target(load_site(tmp_path), "hall", 100, at=AT, by="a\nb")
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "floors",
    [
        'floor = [{ id = "hall", name = "Hall" }]\n',
        'floor = [\n  { id = "hall", name = "Hall" },\n]\n',
        "",
    ],
)
def test_a_file_that_is_written_in_another_way_is_left_alone(tmp_path: Path, floors: str) -> None:
    site, camera = TOML.split("[[floor]]")[0], TOML[TOML.index("[[camera]]") :]
    text = floors + site + (camera if floors else camera.replace('"hall"', '"floor"'))
    (tmp_path / "vsd.toml").write_text(text, encoding="utf-8")
    found = load_site(tmp_path)
    with pytest.raises(ConfigError, match="cannot be written into"):
        set_target(found, found.floors[0].floor_id, 100, at=AT)
    assert (tmp_path / "vsd.toml").read_text(encoding="utf-8") == text
    assert tomllib.loads(text)


def test_a_disk_that_refuses_leaves_the_file_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = project(tmp_path)
    before, site = path.read_bytes(), load_site(tmp_path)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("vsd_analytics.store.durable.os.fsync", full)
        with pytest.raises(OSError, match="full"):
            set_target(site, "hall", 100, at=AT)
    assert path.read_bytes() == before


def test_the_command_sets_lists_and_takes_away(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project(tmp_path)
    words = ["-C", str(tmp_path), "--now", "2026-11-17T08:30Z", "target"]
    assert run(cli, [*words, "120", "--floor", "hall", "--by", "Anna"]) == 0
    assert run(cli, [*words, "--none", "--floor", "hall"]) == 0
    assert run(cli, words) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[:2] == ["hall  120 violations per open hour", "hall  no target"]
    assert out[2:] == [
        "2026-11-17T09:30:00+01:00  hall  none -> 120  (Anna)",
        "2026-11-17T09:30:00+01:00  hall  120 -> none",
    ]
    (tmp_path / FILE).write_text("nonsense\n")
    with pytest.raises(InputError, match="is no change of a target"):
        read_target_changes(load_site(tmp_path))
