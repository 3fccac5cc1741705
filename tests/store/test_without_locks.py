"""A platform without flock(2), such as Windows: a project can be read there, and nothing be written into its store."""

from __future__ import annotations

import ast
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "vsd_analytics"
HIDING = 'import sys\nsys.modules["fcntl"] = sys.modules["resource"] = None\n'
READING = """
import json
import vsd_analytics as vsd
week = vsd.open(sys.argv[1]).week("2026-W46")
report = vsd.week_report(week.site, week.first)
print(json.dumps([json.loads(week.hours.df().to_json()), len(vsd.render_html(report))]))
"""
WRITERS = {
    "append": "Store(root / 'store', site_id=site.site_id).append('frames', rows)",
    "fold": "Store(root / 'store', site_id=site.site_id).fold()",
    "secrets": "DayKeys(root / 'secrets').key(date(2031, 1, 1))",
    "removal": "removing(root / 'store').__enter__()",
    "listen": "single_instance(root / 'lock', refusal=ValueError).__enter__()",
    "mail": "SentLog(root / 'sent').__enter__()",
}
WRITING = """
from datetime import UTC, date, datetime
from pathlib import Path
import pyarrow as pa
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import VsdError
from vsd_analytics.live.single_instance import single_instance
from vsd_analytics.report.send.sent_mails import SentLog
from vsd_analytics.schema import SCHEMAS
from vsd_analytics.store.removal import removing
from vsd_analytics.store.secrets import DayKeys
from vsd_analytics.store.store import Store
root = Path(sys.argv[1])
site = load_site(root)
record = {"camera_id": "cam-1", "ts": datetime(2025, 11, 10, 8, tzinfo=UTC)}
rows = pa.Table.from_pylist([record], schema=SCHEMAS["frames"])
try:
    CALL
except VsdError as error:
    print(error.code, error.fix)
"""


@pytest.fixture
def project(demo_project: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(demo_project, tmp_path / "shop", symlinks=True))


def in_child(script: str, project: Path) -> str:
    done = subprocess.run([sys.executable, "-c", script, str(project)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def files(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("has_facts", [True, False])
def test_hours_and_report_are_read_as_with_locks(project: Path, *, has_facts: bool) -> None:
    with_locks = json.loads(in_child("import sys\n" + READING, project))
    if not has_facts:
        shutil.rmtree(project / "facts")
        shutil.rmtree(project / "published", ignore_errors=True)
    before = files(project / "store")
    assert json.loads(in_child(HIDING + READING, project)) == with_locks
    assert files(project / "store") == before
    assert not [name for name in files(project) if name.endswith(".tmp")]


@pytest.mark.parametrize("writer", WRITERS)
def test_a_writer_is_refused_and_leaves_nothing(project: Path, writer: str) -> None:
    before = files(project)
    told = in_child(HIDING + WRITING.replace("CALL", WRITERS[writer]), project)
    assert told.startswith("E130")
    assert "vsd_analytics.open" in told
    assert files(project) == before


def test_nothing_imports_the_locks_but_the_functions_that_take_them() -> None:
    places = {
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Import) and any(alias.name == "fcntl" for alias in node.names)
    }
    assert places == {"store/file_locks.py"}
