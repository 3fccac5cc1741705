"""Answers that have no rows: text says why, JSON keeps why and which lack it is, frames have their columns."""

from __future__ import annotations

import json
from datetime import date

import pytest

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Value
from vsd_analytics.figures.share.answers import share
from vsd_analytics.render.frame import arrow
from vsd_analytics.render.json_form import as_json, from_json
from vsd_analytics.render.text import TableLayout, number_text, remarks, text
from vsd_analytics.wording.reasons import reason_text

HOLDS = HoldsFor("shop", "ground", date(2026, 11, 9), date(2026, 11, 15))
COLUMNS = (Column("area_id", "key"), Column("n_violations", "count", "violations"), Column("lost_messages", "number"))
WHY = Reason("engine.no_positions")
SHOWN = (TableLayout(("area_id", "n_violations")),)


def test_text_says_why_there_is_nothing_and_is_silent_where_there_is_truly_nothing_to_list() -> None:
    lacking = Answer("areas", COLUMNS, (), HOLDS, nothing=WHY, state="not_measurable")
    assert remarks(lacking, SHOWN) == [reason_text(WHY)]
    noted = Answer("areas", COLUMNS, (), HOLDS, notes=((None, WHY),))
    assert remarks(noted, SHOWN) == [reason_text(WHY)]
    assert remarks(Answer("areas", COLUMNS, (), HOLDS), SHOWN) == []
    assert text(lacking, SHOWN) == []


def test_json_and_the_mask_keep_which_lack_it_is() -> None:
    lacking = Answer("areas", COLUMNS, (), HOLDS, nothing=WHY, state="not_measurable")
    for answer in (lacking, *share([lacking], below=5)):
        read = from_json(json.loads(json.dumps(as_json(answer))))
        assert (read.state, read.rows) == ("not_measurable", ())
        assert read.nothing is not None
        assert reason_text(read.nothing) == reason_text(WHY)


@pytest.mark.parametrize("n", [0, 1, 3])
def test_a_number_of_things_that_tell_of_nobody_is_whole_and_never_hidden(n: int) -> None:
    row = {"area_id": "door", "n_violations": Value(3), "lost_messages": Value(n)}
    [shared] = share([Answer("areas", COLUMNS, (row,), HOLDS)], below=5)
    assert shared.value("lost_messages", area_id="door").value == n
    assert shared.value("n_violations", area_id="door").value is None
    assert arrow(shared).column("lost_messages").to_pylist() == [n]
    assert number_text(float(n), COLUMNS[2]) == str(n)
