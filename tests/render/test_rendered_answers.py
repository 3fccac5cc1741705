"""One small answer with a column of every kind, in each form it leaves in."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import jsonschema
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from render.one_of_each import COLUMNS, HOLDS, HOSTILE, one_of_each

from vsd_analytics.answer import VALUES, Answer, Answers, Cell, Column, Reason, Row, Value
from vsd_analytics.render.frame import arrow, csv_text
from vsd_analytics.render.json_form import ANSWERS_SCHEMA, as_json, from_json, rounded_answers
from vsd_analytics.render.text import GridLayout, TableLayout, number_text, remarks, text, title
from vsd_analytics.wording.languages import speaking
from vsd_analytics.wording.reasons import read_reason

NEEDS = "needs at least 10 people who are served, has 1"
SHOWN = (TableLayout(("name", "local_hour", "n_visits", "people", "dwell_median_s", "long_share", "speed")),)


def test_text_has_headings_clock_hours_ranges_and_dashes() -> None:
    lines = text(one_of_each(), SHOWN)
    assert [line.split("  ")[0] for line in lines] == ["name", '=cmd|"/c calc"\ufffd[31m\ufffdnext', "Till"]
    assert lines[0].split()[1:] == ["hour", "visits", "seen", "people", "median", "stay", "long", "visits"]
    assert lines[1].endswith("08:00  1,234        1.2 (<0.001 to 1.4)  2.5 min (at least 45 s)  0.6% (<0.1% to 12%)")
    assert lines[2].split() == ["Till", "09:00", "–", "–", "–", "–"]
    assert title(one_of_each()) == "Visits"


def test_remarks_give_each_reason_once_and_only_of_what_is_shown() -> None:
    entries = "entries that were seen; where tracks begin inside an area, more people came"
    no_end = "Till: the settings do not say where people are served (served_in)"
    assert remarks(one_of_each(), SHOWN) == [f"Till: {NEEDS}", no_end, entries]
    assert remarks(one_of_each(), (TableLayout(("name",)),)) == [no_end, entries]
    again = {
        **one_of_each().rows[1],
        "local_hour": 10,
        "people": Value.missing(Reason("waits.few_served", least=10, has=3)),
    }
    several = replace(one_of_each(), rows=(*one_of_each().rows, again), notes=())
    assert remarks(several, SHOWN) == [f"Till: {NEEDS} (likewise 1 more)"]


def test_an_answer_without_rows_says_why_and_a_table_without_a_value_is_left_out() -> None:
    empty = Answer("visits", COLUMNS, (), HOLDS, nothing=Reason("visits.not_asked"))
    assert (text(empty, SHOWN), remarks(empty, SHOWN)) == ([], ["no area has visits = true in vsd.toml"])
    unknown = replace(one_of_each(), rows=one_of_each().rows[1:], notes=())
    assert (text(unknown, SHOWN), remarks(unknown, SHOWN)) == ([], [f"Till: {NEEDS}"])


def test_a_grid_has_hours_down_and_another_key_across_and_one_for_each_name() -> None:
    columns = (Column("local_date", "key"), Column("local_hour", "key", "hour_of_day"), Column("name", "fact"),
               Column("people", "people", "people", digits=2))  # fmt: skip
    cells = [
        ("11-16", 8, "Queue", 1.0),
        ("11-17", 8, "Queue", 2.25),
        ("11-17", 9, "Queue", 3.0),
        ("11-18", 9, "Till", None),
    ]
    rows = tuple(
        {"local_date": d, "local_hour": h, "name": n, "people": Value.missing(NEEDS) if v is None else Value(v)}
        for d, h, n, v in cells
    )
    lines = text(Answer("visits", columns, rows, HOLDS), (GridLayout("people", down="local_hour", over="local_date"),))
    assert [line.split() for line in lines] == [
        ["Queue:", "people"],
        ["hour", "11-16", "11-17"],
        ["08:00", "1", "2.2"],
        ["09:00", "3"],
    ]


@pytest.mark.parametrize(
    ("value", "column", "written"),
    [
        (0.0, Column("x", "share", "share"), "0%"),
        (0.9996, Column("x", "share", "share"), "100%"),
        (45.4, Column("x", "seconds", "s"), "45 s"),
        (91.0, Column("x", "seconds", "s"), "1.5 min"),
        (0.000323, Column("x", "people", "people"), "<0.001"),
        (0.0, Column("x", "people", "people"), "0"),
        (1234.5, Column("x", "rate", "ratio"), "1,234"),
        (float("inf"), Column("x", "rate", "ratio"), "–"),
    ],
)
def test_a_number_is_written_as_its_unit_is_read(value: float, column: Column, written: str) -> None:
    assert number_text(value, column) == written


def test_json_has_an_object_for_each_value_and_null_is_never_zero() -> None:
    found = json.loads(json.dumps(as_json(one_of_each())))
    known, unknown = found["rows"]
    assert known["people"] == {"value": 1.1666667, "lo": 0.0004, "hi": 1.4, "state": "ok", "reason": None}
    assert unknown["n_visits"] == {"value": None, "lo": None, "hi": None, "state": "not_enough_data", "reason": NEEDS}
    assert (known["silent_cameras"], known["started"], unknown["started"]) == (
        ["cam-1", "cam-2"], "2026-11-09T08:00:00+00:00", None)  # fmt: skip
    assert found["holds_for"]["until"] == "2026-11-12T08:00:00+00:00"
    assert found["notes"][1] == {"row": 1, "text": "the settings do not say where people are served (served_in)"}
    jsonschema.validate({"visits": found}, ANSWERS_SCHEMA)


def test_sentences_of_json_are_in_the_language_spoken() -> None:
    with speaking("it"):
        assert as_json(one_of_each())["nothing"] is None
        assert "servit" in as_json(one_of_each())["rows"][1]["people"]["reason"]


def told(answer: Answer) -> Answer:
    """Return an answer whose reasons are sentences, as they are after they were read."""

    def reread(cell: Cell) -> Cell:
        if not isinstance(cell, Value) or cell.reason is None:
            return cell
        return replace(cell, reason=read_reason(NEEDS))

    rows = tuple({name: reread(cell) for name, cell in row.items()} for row in answer.rows)
    return replace(answer, rows=rows, notes=())


KNOWN = st.floats(allow_nan=False, allow_infinity=False)
NUMBERS = st.none() | KNOWN
CELLS: dict[str, st.SearchStrategy[Any]] = {
    "key": st.text(),
    "fact": st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.text() | st.lists(st.text()).map(tuple),
    "place": st.none() | st.text(),
    "instant": st.none() | st.datetimes(timezones=st.just(UTC)),
}
VALUE = st.builds(Value, KNOWN, NUMBERS, NUMBERS) | st.builds(
    Value.missing, st.none(), st.sampled_from(["not_enough_data", "not_measurable"])
)
ROW = st.fixed_dictionaries({c.name: VALUE if c.kind in VALUES else CELLS[c.kind] for c in COLUMNS})


@given(st.lists(ROW, max_size=3, unique_by=lambda row: (row["area_id"], row["local_hour"])))
def test_what_json_was_made_from_is_read_from_it(rows: list[dict[str, Cell]]) -> None:
    answer = Answer("visits", COLUMNS, tuple(rows), HOLDS)
    assert from_json(json.loads(json.dumps(as_json(answer)))) == answer


def test_reasons_are_read_as_their_sentences() -> None:
    answer = replace(one_of_each(), notes=())
    assert from_json(as_json(answer)) == told(answer)


def test_rounded_answers_have_six_digits_and_keep_reasons() -> None:
    (answer,) = rounded_answers(Answers([one_of_each()]))
    assert answer.rows[0]["visits_per_open_h"] == Value(83.4568, 72.5, 96.0)
    assert answer.rows[1] == one_of_each().rows[1]


def test_arrow_has_typed_columns_null_for_missing_and_units() -> None:
    table = arrow(one_of_each())
    types = {name: str(table.schema.field(name).type) for name in table.column_names}
    assert types["n_visits"] == "int64"
    assert "n_visits_lo" not in types
    assert (types["people"], types["people_lo"], types["people_state"]) == ("double", "double", "string")
    assert types["started"] == "timestamp[ms, tz=UTC]"
    assert types["silent_cameras"] == "list<item: string>"
    assert table.schema.field("people").metadata == {b"unit": b"people", b"figure": b"M41"}
    known, unknown = table.to_pylist()
    assert known["started"] == datetime(2026, 11, 9, 8, tzinfo=UTC)
    assert (unknown["n_visits"], unknown["people"], unknown["people_reason"]) == (None, None, NEEDS)
    assert pa.compute.sum(table["n_visits"], skip_nulls=False).as_py() is None, "unknown does not sum to 0"


def test_csv_has_six_digits_and_no_formula() -> None:
    known, unknown = csv.DictReader(io.StringIO(csv_text(one_of_each())))
    assert known["name"].startswith("'=cmd")
    assert HOSTILE.splitlines()[-1] in known["name"]
    assert (known["people"], known["people_hi"], known["means_agree"]) == ("1.16667", "1.4", "yes")
    assert known["silent_cameras"] == "cam-1 cam-2"
    assert (unknown["n_visits"], unknown["n_visits_state"]) == ("", "not_enough_data")


def test_changes_have_signs_and_codes_have_words_in_the_language_of_the_reader() -> None:
    columns = (Column("name", "key"), Column("speed", "rate", "change"), Column("speed_verdict", "fact", "verdict"))
    rows: tuple[Row, ...] = (
        {"name": "clear_fall", "speed": Value(-0.142, -0.2, 0.05), "speed_verdict": "clear_fall"},
        {"name": "B", "speed": Value(0.42), "speed_verdict": None},
    )
    moved = Answer("visits", columns, rows, HOLDS)
    shown = (TableLayout(("name", "speed", "speed_verdict")),)
    assert [line.split() for line in text(moved, shown)[1:]] == [
        ["clear_fall", "-14%", "(-20%", "to", "+5%)", "clear", "fall"],
        ["B", "+42%", "–"],
    ]
    with speaking("it"):
        assert text(moved, shown)[1].endswith("calo netto")
    assert arrow(moved)["speed_verdict"].to_pylist() == ["clear_fall", None]


def test_rows_that_a_table_leaves_out_have_no_remarks() -> None:
    only = (TableLayout(("name", "people"), only="people"),)
    assert [line.split("  ")[0] for line in text(one_of_each(), only)] == ["name", '=cmd|"/c calc"\ufffd[31m\ufffdnext']
    assert not any(NEEDS in line for line in remarks(one_of_each(), only))
