"""The built wheel, installed where nothing of the checkout can be seen, ingests engine output and makes a report."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import msgspec
import pytest
from simulate.small_scenes import make_week
from site_text import site_text

from vsd_analytics.version import VERSION

REPOSITORY = Path(__file__).resolve().parents[2]
SHIPPED = {"sql": "*", "reports": "*", "docs": "*.md"}
SITE = site_text(site='opening = { mon-sun = "09:00-12:00" }\n')


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the wheel, built by the tool that builds releases, without a network."""
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(REPOSITORY)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = out.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def scripts(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of programs of an environment that holds the wheel, and borrows only its dependencies.

    A folder of links to the running environment's packages stands in for downloading them; the project itself, in
    whatever way it is installed here, is not among them.
    """
    root = tmp_path_factory.mktemp("empty")
    venv.create(root / "env", with_pip=False, symlinks=True)
    borrowed = root / "borrowed"
    borrowed.mkdir()
    own = ("vsd_analytics", "vsd-analytics", "__editable__")
    for folder in dict.fromkeys((sysconfig.get_path("purelib"), sysconfig.get_path("platlib"))):
        for entry in Path(folder).iterdir():
            if not entry.name.startswith(own) and entry.suffix != ".pth":
                link = borrowed / entry.name
                if not link.exists():
                    link.symlink_to(entry)
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    (root / "env" / "lib" / version / "site-packages" / "borrowed.pth").write_text(f"{borrowed}\n", encoding="utf-8")
    bin_ = root / "env" / "bin"
    _run(bin_ / "python", "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", str(wheel), folder=root)
    return bin_


def _run(program: Path, *arguments: str, folder: Path) -> str:
    """Run a program of the empty environment in a folder outside the checkout and return what it printed."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VSD_", "VIRTUAL_ENV", "COV_"))}
    done = subprocess.run(
        [str(program), *arguments], cwd=folder, env=kept, capture_output=True, text=True, check=False, timeout=240
    )
    assert done.returncode == 0, f"{program.name} {' '.join(arguments)}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def test_wheel_carries_every_sql_and_report_file_and_page_of_the_manual(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    for folder, pattern in SHIPPED.items():
        found = (p for p in (REPOSITORY / folder).rglob(pattern) if p.is_file() and not p.name.startswith("."))
        files = [p for p in found if p.parent.name != "__pycache__"]  # templates that a report compiled
        missing = {f"vsd_analytics/_shipped/{p.relative_to(REPOSITORY).as_posix()}" for p in files} - names
        assert files, folder
        assert not missing, missing
    assert "vsd_analytics/py.typed" in names
    assert any(n.endswith("licenses/LICENSE") for n in names)


def test_an_environment_of_the_wheel_has_the_units_where_the_page_on_installing_says(scripts: Path) -> None:
    deploy = scripts.parent / "share" / "vsd-analytics" / "deploy"
    units = REPOSITORY / "deploy" / "systemd"
    assert {p.name for p in (deploy / "systemd").iterdir()} == {p.name for p in units.iterdir()}
    page = (REPOSITORY / "docs" / "install.md").read_text(encoding="utf-8")
    assert "cd /opt/vsd/share/vsd-analytics/deploy/systemd" in page


def test_wheel_carries_no_tests_and_no_data(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        tops = {n.split("/")[0] for n in archive.namelist()}
    assert tops == {"vsd_analytics", f"vsd_analytics-{VERSION}.dist-info", f"vsd_analytics-{VERSION}.data"}


def test_installed_package_is_the_wheels(scripts: Path, tmp_path: Path) -> None:
    told = _run(scripts / "python", "-c", "import vsd_analytics; print(vsd_analytics.__file__)", folder=tmp_path)
    place = Path(told.strip())
    assert place.is_relative_to(scripts.parent), place
    assert not place.is_relative_to(REPOSITORY), place
    assert _run(scripts / "vsd", "--version", folder=tmp_path).strip() == f"vsd, version {VERSION}"


def test_installed_wheel_makes_a_report(scripts: Path, tmp_path: Path) -> None:
    week = make_week(interval_s=10.0, per_hour=6, places=((3.0, 3.0), (9.0, 7.0)), hotspot=None)
    (tmp_path / "vsd.toml").write_text(SITE, encoding="utf-8")
    lines = b"\n".join(msgspec.json.encode(message) for message in week.messages) + b"\n"
    (tmp_path / "frames.jsonl").write_bytes(lines)
    vsd = scripts / "vsd"

    _run(vsd, "--now", "2026-11-17T12:00", "ingest", "frames.jsonl", folder=tmp_path)
    _run(vsd, "report", "--week", "2026-W46", "--format", "html,json", "--out", "reports", folder=tmp_path)

    page, text = ((tmp_path / "reports" / f"2026-W46.{form}").read_text(encoding="utf-8") for form in ("html", "json"))
    assert "Riverside Store" in page
    assert "<style" in page, "the style sheet of the wheel stands in the page"
    assert json.loads(text)["level"]["violations"] == sum(week.violations.values())
