"""Names in other scripts, arrays in arrays, pictures that were scaled down: once stored wrongly without a word."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from odd_files import NAMES, STEPS, Odd, plain, raw, rows, stored, text
from test_odd_files import by_identity, in_store
from walks import Step, project

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

FEW = STEPS[:120]


def with_class(name: str, person: str, other: str) -> object:
    def row(step: Step) -> list[object]:
        return [*plain(step), person if step.track < 4 else other]

    return text("a.csv", (*NAMES, name), rows(row, FEW))


def message(step: Step) -> dict[str, object]:
    return dict(zip(NAMES, plain(step), strict=True))


def as_json(make: Callable[[], str]) -> object:
    return raw("a.json", make().encode())


ABROAD = [
    Odd("classes in Chinese", with_class("类别", "人", "汽车"), says="类别"),
    Odd("classes in Russian", with_class("класс", "человек", "машина"), says="W222"),
    Odd("types of objects in German", with_class("Objekttyp", "Mensch", "Fahrzeug"), says="Objekttyp = 'Mensch'"),
    Odd("arrays in an array", as_json(lambda: json.dumps([[message(s)] for s in FEW])), says="no table"),
    Odd(
        "an array a line",
        as_json(lambda: "".join(f"[{json.dumps(message(s))}]\n" for s in FEW)),
        rows=stored(FEW),
    ),
    Odd(
        "one array after the other",
        as_json(lambda: json.dumps([message(s) for s in FEW[:60]]) + json.dumps([message(s) for s in FEW[60:]])),
        rows=stored(FEW),
    ),
]


@pytest.mark.parametrize("odd", ABROAD, ids=lambda odd: odd.name)
def test_a_file_from_abroad_is_stored_right_or_refused(
    odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = project(tmp_path / "project")
    with (root / "vsd.toml").open("a", encoding="utf-8") as toml:
        toml.write("[privacy]\npseudonyms = false\n")
    code = run(cli, ["-C", str(root), "--now", "2025-12-01", "ingest", str(odd.write(tmp_path)), *odd.options])
    said = "".join(capsys.readouterr())
    assert by_identity(in_store(root)) == by_identity(list(odd.rows or ())), said
    assert odd.says in said
    assert code == (2 if odd.rows is None else 0), said


@pytest.mark.parametrize(("scale", "is_doubted"), [(4, True), (2, True), (1, False)])
def test_feet_in_one_quarter_of_the_picture_are_warned_of(
    scale: int, is_doubted: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def row(step: Step) -> list[object]:
        return [step.at.isoformat(), step.track, (100 + 55 * step.x_m) / scale, (100 + 50 * step.y_m) / scale]

    path = text("a.csv", ("ts", "track_id", "u_px", "v_px"), rows(row, FEW))(tmp_path)
    run(cli, ["-C", str(project(tmp_path / "project")), "--now", "2025-12-01", "ingest", str(path)])
    assert ("upper left" in "".join(capsys.readouterr())) == is_doubted
