"""Odd files of everyday life are stored right, or refused with the reason: none is silently wrong."""

from __future__ import annotations

from pathlib import Path

import duckdb
import pytest
from hostile_tables import HOSTILE
from odd_files import ODD, WORKBOOKS, Odd, Row
from odder_files import ODDER, ODDER_WORKBOOKS
from walks import project

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run


def in_store(root: Path) -> list[Row]:
    """Return the rows of the store, read by DuckDB alone; pixels times four, negative."""
    if not list(root.glob("store/**/*.parquet")):
        return []
    query = """
        select camera_id, epoch_ms(ts), track_id,
               coalesce(x_mm, -round(u_px * 4)::int), coalesce(y_mm, -round(v_px * 4)::int)
        from read_parquet($files, hive_partitioning = false)
    """
    files = [str(path) for path in root.glob("store/**/observations/**/*.parquet")]
    return duckdb.execute(query, {"files": files}).fetchall()


def by_identity(rows: list[Row]) -> list[Row]:
    return sorted(rows, key=lambda row: (row[0], row[1], row[2] or "", row[3], row[4]))


def hall(odd: Odd, tmp_path: Path) -> tuple[Path, Path]:
    """Write a project with the cameras of an odd file, and the file; return both."""
    root = project(tmp_path / "project", *odd.cameras, more=odd.more)
    with (root / "vsd.toml").open("a", encoding="utf-8") as toml:
        toml.write("[privacy]\npseudonyms = false\n")
    return root, odd.write(tmp_path)


def ingest(odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ingest an odd file: its rows are in the store, or nothing is and the reason is said."""
    root, path = hall(odd, tmp_path)
    code = run(cli, ["-C", str(root), "--now", "2025-12-01", "ingest", str(path), *odd.options])
    said = "".join(capsys.readouterr())
    assert not [*tmp_path.rglob("escaped.csv"), *tmp_path.parent.glob("escaped.csv")]
    assert odd.says in said, said
    if odd.rows is None:
        assert (code, in_store(root)) in ((1, []), (2, [])), said
    else:
        assert (code, by_identity(in_store(root))) == (0, by_identity(list(odd.rows))), said


@pytest.mark.parametrize("odd", ODD, ids=lambda odd: odd.name)
def test_it_is_stored_right_or_refused_with_the_reason(
    odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ingest(odd, tmp_path, capsys)


@pytest.mark.parametrize("odd", WORKBOOKS, ids=lambda odd: odd.name)
def test_a_workbook_is_stored_right_or_refused_with_the_reason(
    odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("openpyxl")
    ingest(odd, tmp_path, capsys)


def test_a_workbook_without_the_extra_is_refused_with_the_way_to_install_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys
    import zipfile

    monkeypatch.setitem(sys.modules, "openpyxl", None)

    def write(folder: Path) -> Path:
        with zipfile.ZipFile(folder / "a.xlsx", "w") as archive:
            archive.writestr("[Content_Types].xml", "<x/>")
        return folder / "a.xlsx"

    ingest(Odd("workbook", write, says="vsd-analytics[xlsx]"), tmp_path, capsys)


@pytest.mark.parametrize("odd", HOSTILE, ids=lambda odd: odd.name)
def test_a_table_of_many_hands_is_stored_right_or_what_is_wrong_is_said(
    odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root, path = hall(odd, tmp_path)
    code = run(cli, ["-C", str(root), "--now", "2025-12-01", "ingest", str(path), *odd.options])
    said = "".join(capsys.readouterr())
    assert by_identity(in_store(root)) == by_identity(list(odd.rows or ())), said
    assert odd.says in said
    assert code == 0 if odd.rows is not None and not odd.says else code in (1, 2), said


def check(odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Check an odd file: nothing is stored, and what ingest would say is said."""
    root, path = hall(odd, tmp_path)
    code = run(cli, ["-C", str(root), "--now", "2025-12-01", "check", str(path), *odd.options])
    said = "".join(capsys.readouterr())
    assert in_store(root) == []
    assert code in ((1, 2) if odd.rows is None else (int(bool(odd.says)),)), said
    assert odd.says in said, said


@pytest.mark.parametrize("name", ["plain", "HTML", "centimetres as metres", "days that could be months"])
def test_check_says_what_ingest_would_say(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    check(next(odd for odd in ODD if odd.name == name), tmp_path, capsys)


@pytest.mark.parametrize("odd", [*ODD, *WORKBOOKS, *ODDER, *ODDER_WORKBOOKS], ids=lambda odd: odd.name)
def test_check_says_of_any_file_what_ingest_would_say(
    odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    check(odd, tmp_path, capsys)
