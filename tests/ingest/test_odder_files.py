"""More odd files are stored right, or refused with the reason; single bad rows cost themselves and no others."""

from __future__ import annotations

from pathlib import Path

import pytest
from marked_files import MARKED
from odd_files import STEPS, Odd, stored
from odder_files import ODDER, ODDER_WORKBOOKS, csv_text
from oddest_files import ODDEST
from test_odd_files import by_identity, in_store, ingest
from walks import project

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run


@pytest.mark.parametrize("odd", ODDER, ids=lambda odd: odd.name)
def test_an_odder_file_is_stored_right_or_refused_with_the_reason(
    odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ingest(odd, tmp_path, capsys)


@pytest.mark.parametrize("odd", ODDER_WORKBOOKS, ids=lambda odd: odd.name)
def test_an_odder_workbook_is_stored_right_or_refused_with_the_reason(
    odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("openpyxl")
    ingest(odd, tmp_path, capsys)


@pytest.mark.parametrize("odd", [*ODDEST, *MARKED], ids=lambda odd: odd.name)
def test_a_file_that_looks_right_and_is_not_is_seen_without_a_plan(
    odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "project")
    toml = (root / "vsd.toml").read_text().replace('plan = "plan.svg"\nplan_m_per_px = 0.1\n', "")
    (root / "vsd.toml").write_text(toml.replace("picture_px = [1280, 720]\n", "") + "[privacy]\npseudonyms = false\n")
    code = run(cli, ["-C", str(root), "--now", "2025-12-01", "ingest", str(odd.write(tmp_path)), *odd.options])
    said = "".join(capsys.readouterr())
    assert by_identity(in_store(root)) == by_identity(list(odd.rows or ())), said
    assert odd.says in said
    assert code == 0 if odd.rows is not None and not odd.says else code in (1, 2), said


@pytest.mark.parametrize(
    "bad",
    [
        "2025-11-25T09:00:60Z,1,5,5",
        "2025-11-25T24:00:00Z,1,5,5",
        "ts,track_id,x_m,y_m",
        "Total,,123,",
        "2025-11-25T09:00:59Z,1,5",
        "2025-11-25T09:00:59Z,1,5,5,5",
        "2025-11-25T09:00:59Z,1,#DIV/0!,5",
        "2025-11-25T09:00:59Z,1,inf,5",
        '2025-11-25T09:00:59Z,"1,5,5',
    ],
)
def test_a_row_that_cannot_be_used_is_quarantined_and_all_others_are_stored(
    bad: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "project")
    with (root / "vsd.toml").open("a", encoding="utf-8") as toml:
        toml.write("[privacy]\npseudonyms = false\n")
    path = tmp_path / "a.csv"
    head, _, rest = csv_text().rpartition("\n2025")
    path.write_text(f"{head}\n{bad}\n2025{rest}")
    assert run(cli, ["-C", str(root), "--now", "2025-12-01", "ingest", str(path)]) == 1
    assert "1 quarantined" in capsys.readouterr().out
    assert by_identity(in_store(root)) == by_identity(stored(STEPS))
