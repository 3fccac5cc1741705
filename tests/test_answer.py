"""The form of an answer: what it refuses, and how its cells are found."""

from __future__ import annotations

from datetime import date

import pytest

from vsd_analytics.answer import Answer, Answers, Cell, Column, HoldsFor, Reason, Sum, Value, check_sums, value_of
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.stats.estimates import no_rate

HOLDS = HoldsFor("shop", "ground", date(2026, 11, 9), date(2026, 11, 15))
COLUMNS = (Column("area_id", "key"), Column("name", "fact"), Column("n", "count"), Column("n_cut", "count"))


def row(area: str = "door", n: float | None = 12, n_cut: float | None = 2) -> dict[str, Cell]:
    return {"area_id": area, "name": "Door", "n": Value(n), "n_cut": Value(n_cut)}


def test_a_row_has_exactly_the_columns() -> None:
    assert len(Answer("visits", COLUMNS, (row(),), HOLDS).rows) == 1
    without = {name: cell for name, cell in row().items() if name != "n_cut"}
    for other in (without, {**row(), "n_more": Value(1)}):
        with pytest.raises(ValueError, match="other columns"):
            Answer("visits", COLUMNS, (other,), HOLDS)


@pytest.mark.parametrize(("column", "cell"), [("n", 12), ("n", None), ("name", Value(1)), ("area_id", Value(1))])
def test_a_cell_of_the_wrong_type_is_refused(column: str, cell: Cell) -> None:
    with pytest.raises(ValueError, match=f"wrong type: {column}"):
        Answer("visits", COLUMNS, ({**row(), column: cell},), HOLDS)


def test_keys_and_columns_are_unique() -> None:
    with pytest.raises(ValueError, match="two rows for one key"):
        Answer("visits", COLUMNS, (row(), row()), HOLDS)
    with pytest.raises(ValueError, match="a column twice"):
        Answer("visits", (*COLUMNS, COLUMNS[0]), (), HOLDS)


def test_a_declared_sum_holds_or_has_an_unknown_part() -> None:
    columns = (*COLUMNS, Column("n_whole", "count"))
    declared = (Sum("n", ("n_cut", "n_whole")),)
    for n_whole in (10, None):
        Answer("visits", columns, ({**row(), "n_whole": Value.of(Estimate(value=n_whole))},), HOLDS, declared)
    with pytest.raises(ValueError, match="n of visits is 12, its parts are"):
        Answer("visits", columns, ({**row(), "n_whole": Value(11)},), HOLDS, declared)


def test_a_sum_over_another_answer_is_of_the_rows_with_the_same_keys() -> None:
    hours_of = (Column("area_id", "key"), Column("local_hour", "key"), Column("n", "count"))
    cells = [("door", 8, 5), ("door", 9, 7), ("till", 8, 1)]
    hours = Answer("hours", hours_of, tuple({"area_id": a, "local_hour": h, "n": Value(n)} for a, h, n in cells), HOLDS)
    totals = Answer("visits", COLUMNS, (row(), row("till", 1)), HOLDS, (Sum("n", ("hours.n",)),))
    check_sums([totals, hours])
    check_sums([totals])
    with pytest.raises(ValueError, match=r"visits, \('till',\): n is 2, not 1"):
        check_sums([Answer("visits", COLUMNS, (row(), row("till", 2)), HOLDS, (Sum("n", ("hours.n",)),)), hours])


def test_a_value_is_found_by_its_keys() -> None:
    answer = Answer("visits", COLUMNS, (row(), row("till", 3)), HOLDS)
    assert answer.value("n", area_id="till") == Value(3)
    for keys, n in (({"area_id": "wall"}, 0), ({"name": "Door"}, 2)):
        with pytest.raises(KeyError, match=f"{n} rows of visits"):
            answer.value("n", **keys)
    with pytest.raises(TypeError, match="name holds no values"):
        value_of(answer.rows[0], "name")
    with pytest.raises(KeyError, match="no column"):
        answer.column("speed")


def test_the_state_of_a_value_is_that_of_its_number_and_a_missing_interval_says_why() -> None:
    why = Reason("engine.no_track_ids")
    assert Value.of(no_rate(why)).state != "ok"
    assert Value.of(Estimate(value=None)).state == "not_enough_data"
    bare = Value.of(Estimate(value=1.0), state="not_enough_data", reason=why)
    assert (bare, bare.is_uncertain) == (Value(1.0, reason=why), True)
    assert not Value(1.0, 0.5, 2.0).is_uncertain
    assert not Value(3).is_uncertain, "a count has no interval"
    with pytest.raises(ValueError, match="cannot have the state"):
        Value(1.0, state="not_enough_data")
    with pytest.raises(ValueError, match="cannot have the state"):
        Value(None)


def test_answers_are_found_by_name() -> None:
    answer = Answer("visits", COLUMNS, (row(),), HOLDS)
    several = Answers([answer])
    assert ("visits" in several, len(several), several["visits"], several.get("flow")) == (True, 1, answer, None)
    assert several == Answers([answer])
