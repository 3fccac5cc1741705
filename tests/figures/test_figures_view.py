"""Figures by catalogue id are a view of answers: what they say of each, and that nothing else makes a figure."""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.figures.catalogue.view import figure_of
from vsd_analytics.figures.week.results import Figure

PACKAGE = Path(__file__).resolve().parent.parent.parent / "vsd_analytics"
HOLDS = HoldsFor("shop", "ground", date(2026, 11, 9), date(2026, 11, 15))
UNIT = Reason("unit.violations")
FLOOR = Column("floor_id", "key")
RATE = Column("violation_rate", "rate", "per_open_hour", "M0", per="recorded_h")
HOURS = Column("recorded_h", "fact", "h")
FEW = Reason("hidden.few", least=5)


def of_floor(*columns: Column, **cells: Value | float | str | None) -> Answer:
    return Answer("violations", (FLOOR, *columns), ({"floor_id": "ground", **cells},), HOLDS)


def test_the_only_column_of_the_floor_is_the_value() -> None:
    verdict = Column("violation_rate_verdict", "fact")
    answer = of_floor(
        *(RATE, verdict, HOURS),
        violation_rate=Value(2.0, 1.0, 3.0),
        violation_rate_verdict="about_same",
        recorded_h=84.0,
    )
    made = figure_of("M0", [answer], unit=UNIT)
    assert made == Figure(unit=UNIT, value=2.0, lo=1.0, hi=3.0, verdict="about_same", denominator=84.0)


def test_several_columns_of_the_floor_are_rows() -> None:
    columns = [Column(f"duration_{name}_s", "seconds", "s", "M10") for name in ("median", "p90")]
    answer = of_floor(*columns, duration_median_s=Value(8.0), duration_p90_s=Value(30.0, 20.0, 40.0))
    made = figure_of("M10", [answer], unit=UNIT)
    assert (made.value, made.state) == (None, "ok")
    assert [(r["column"], r["value"], r["lo"]) for r in made.rows or ()] == [
        ("duration_median_s", 8.0, None),
        ("duration_p90_s", 30.0, 20.0),
    ]


def test_a_value_of_the_floor_has_the_rows_of_other_answers_beside_it() -> None:
    floor = of_floor(Column("close_time_share", "share", "share", "M6"), close_time_share=Value(0.4))
    readings = (FLOOR, Column("reading", "key"), Column("close_time_share", "share", "share", "M6"))
    rows: tuple[Row, ...] = tuple(
        {"floor_id": "ground", "reading": reading, "close_time_share": value}
        for reading, value in (("all", Value(0.4)), ("between_groups", Value.missing(FEW)))
    )
    made = figure_of("M6", [floor, Answer("readings", readings, rows, HOLDS)], unit=UNIT)
    assert made.value == 0.4
    assert [(r["reading"], r["value"], r["reason"]) for r in made.rows or ()] == [
        ("all", 0.4, None),
        ("between_groups", None, FEW),
    ]


def test_a_missing_value_says_why_and_has_no_rows() -> None:
    made = figure_of("M0", [of_floor(RATE, HOURS, violation_rate=Value.missing(FEW), recorded_h=84.0)], unit=UNIT)
    assert made == Figure(unit=UNIT, state="not_enough_data", reason=FEW)


def test_a_list_without_entries_is_empty_and_one_that_is_not_known_says_which_lack() -> None:
    columns = (FLOOR, Column("outage", "key"), Column("open_h", "rate", "h", "M2"))
    assert figure_of("M2", [Answer("outages", columns, (), HOLDS)], unit=UNIT) == Figure(unit=UNIT, rows=())
    why = Reason("engine.no_positions")
    lacking = Answer("outages", columns, (), HOLDS, nothing=why, state="not_measurable")
    assert figure_of("M2", [lacking], unit=UNIT) == Figure(unit=UNIT, state="not_measurable", reason=why)


def test_notes_of_a_figure_are_those_of_its_answers() -> None:
    notes = (Reason("note.met"), Reason("note.contacts"))
    columns = (FLOOR, Column("n_contacts", "count", "pairs", "M12"))
    row: Row = {"floor_id": "ground", "n_contacts": Value(7)}
    answer = Answer("contacts", columns, (row,), HOLDS, notes=((None, notes[0]), (None, notes[1])))
    assert figure_of("M12", [answer], unit=UNIT).note == Reason("joined", reasons=notes)


def test_only_the_view_makes_figures() -> None:
    texts = {path.name: path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")}
    importing = {name: text for name, text in texts.items() if re.search(r"results import .*\bFigure\b", text)}
    assert {name for name, text in importing.items() if re.search(r"(?<![\w.])Figure\(", text)} == {"view.py"}


def test_no_answer_of_the_catalogue_builds_json() -> None:
    for path in (PACKAGE / "figures/catalogue").glob("*.py"):
        if path.name != "view.py":
            assert "isoformat" not in path.read_text(encoding="utf-8"), path.name
