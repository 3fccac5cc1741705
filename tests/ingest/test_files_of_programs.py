"""Files as databases, spreadsheets and other programs write them: read, or refused with what they are."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from walks import project, walks

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

STEPS = walks(n_people=4, seconds=30)


def check(root: Path, capsys: pytest.CaptureFixture[str], name: str, *options: str) -> tuple[int, str]:
    code = run(cli, ["-C", str(root), "--now", "2025-12-01", "check", str(root / name), *options])
    return code, "".join(capsys.readouterr())


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.sql", b"-- dump\nCOPY public.pos (ts, x, y) FROM stdin;\n2025\t1\t2\n", "a dump of a database (SQL)"),
        ("a.sql", b"INSERT INTO `pos` VALUES ('2025-11-10',1,2);\n", "a dump of a database (SQL)"),
        ("a.txt", b"+----+---+\n| ts | x |\n+----+---+\n", "a table drawn with lines"),
        ("a.xml", b'<?xml version="1.0"?><gpx><trk/></gpx>', "XML of a kind that is not known"),
        ("a.csv", b"version https://git-lfs.github.com/spec/v1\noid sha256:abc\nsize 1\n", "a pointer of Git LFS"),
        ("a.dta", b"<stata_dta><header>" + bytes(100), "a Stata file"),
        ("a.pb", bytes([10, 5, 8, 150, 1, 0, 18, 3]) * 300, "binary data of a kind that is not known"),
        ("a.json", b'{"t": 1, "ids": [1, 2], "xs": [1.5, 2.5]}\n', "the first message has t, ids.0 to .1, xs.0 to .1"),
    ],
)
def test_what_cannot_be_read_is_named(
    name: str, data: bytes, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "p")
    (root / name).write_bytes(data)
    code, said = check(root, capsys, name)
    assert (code, "E204" in said) == (2, True)
    assert says in said


@pytest.mark.parametrize(("yes", "no"), [("t", "f"), ("y", "n"), ("ja", "nein"), ("vero", "falso")])
def test_truth_as_databases_and_languages_write_it_marks_rows_that_are_no_person(
    yes: str, no: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{s.at.isoformat()},{s.track},{s.x_m},{s.y_m},{no if s.track == 4 else yes}" for s in STEPS]
    root = project(tmp_path / "p")
    (root / "a.csv").write_text("ts,track_id,x_m,y_m,is_person\n" + "\n".join(rows) + "\n", encoding="utf-8")
    code, said = check(root, capsys, "a.csv")
    assert (code, "W222" in said) == (1, True)
    assert f"is_person = '{yes}'" in said


def test_a_log_may_begin_with_other_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    message = json.dumps({"v": 1, "camera": "cam-1", "ts": "2025-11-25T09:00:00Z", "persons": []})
    root = project(tmp_path / "p")
    (root / "a.log").write_text(f"starting\nmodel loaded in 3 s\nINFO frame {message}\n", encoding="utf-8")
    _, said = check(root, capsys, "a.log")
    assert "[frames]" in said


HEADER = ("Time", "Person", "X", "Y")
ROWS = [(s.at.replace(tzinfo=None), s.track, s.x_m, s.y_m) for s in STEPS]


def titled(sheet: Any) -> None:
    for row in (["People report"], ["Site:", "Hall"], [], HEADER, *ROWS):
        sheet.append(row)


def covered(sheet: Any) -> None:
    sheet.append(["People report"])
    sheet.append(["made", "2025-11-26"])
    table = sheet.parent.create_sheet("Data")
    for row in (HEADER, *ROWS):
        table.append(row)


def of_texts(sheet: Any) -> None:
    for row in (HEADER, *([at, who, *(str(v).replace(".", ",") for v in place)] for at, who, *place in ROWS)):
        sheet.append(row)


@pytest.mark.parametrize("fill", [titled, covered, of_texts])
def test_a_workbook_may_have_titles_a_cover_and_numbers_as_texts(
    fill: Callable[[Any], None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = workbook(tmp_path, fill)
    options = ("--map", "ts=Time,track_id=Person,x_m=X,y_m=Y", "--zone", "UTC")
    code, said = check(root, capsys, "a.xlsx", *options)
    assert (code, f"{len(ROWS)} person records" in said) == (0, True), said


def test_two_sheets_of_rows_are_no_table_and_its_cover(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def both(sheet: Any) -> None:
        covered(sheet)
        sheet.append(["a", "b", "c"])

    code, said = check(workbook(tmp_path, both), capsys, "a.xlsx")
    assert (code, "2 sheets with values" in said) == (2, True)


def workbook(folder: Path, fill: Callable[[Any], None]) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    fill(book.active)
    root = project(folder / "p")
    book.save(root / "a.xlsx")
    return root
