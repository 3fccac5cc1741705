"""The mask: what of some answers may leave together, for any counts and any sums of them."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace
from datetime import date

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.answer import Answer, Answers, Column, HoldsFor, Reason, Row, Sum, Value, value_of
from vsd_analytics.figures.share.answers import COUNTS_IN_REASONS, share
from vsd_analytics.figures.share.counts import is_small
from vsd_analytics.resources import shipped

HOLDS = HoldsFor("shop", "ground", date(2026, 11, 9), date(2026, 11, 15))
BELOW = 5
AREA = Column("area_id", "key")
TOTALS = (
    AREA,
    Column("n_entered", "count"),
    Column("n_left", "count", audience="operator"),
    Column("n_stayed", "count", audience="operator"),
    Column("left_share", "share", "share", tells=("n_left", "n_stayed", "n_entered")),
    Column("wait_s", "seconds", "s", tells=("n_entered",)),
)
HOURS = (AREA, Column("local_hour", "key"), Column("n_entered", "count"))
NUMBERS_OF_OTHER_THINGS = {
    "change.pairs",
    "change.person_hours",
    "clusters.short",
    "compare.compared",
    "context.incomplete",
    "context.weeks",
    "flow.days",
    "forecast.weeks",
    "hidden.hotspots",
    "hotspots.days",
    "hotspots.left_out",
    "level.days",
    "level.interval_person_hours",
    "level.person_hours",
    "logged_change.counted_weeks",
    "logged_change.days_after",
    "logged_change.days_before",
    "logged_change.few_areas",
    "logged_change.not_yet_lasting",
    "logged_change.pairs",
    "logged_change.person_hours_after",
    "logged_change.person_hours_before",
    "logged_change.reference_weeks",
    "logged_change.stored",
    "logged_change.unseen_trend",
    "mixing.days",
    "routes.days",
    "selfcheck.weeks",
    "switchback.event",
    "switchback.few_days",
    "switchback.not_recorded",
    "today.days",
    "today.whole_days",
    "trend.weeks",
    "unusual.weeks",
    "violations.days",
    "visits.days",
    "waits.days",
    "whatif.few_days",
    "whatif.little_time",
    "whatif.no_way",
    "whatif.said_around",
    "whatif.said_blocked",
    "whatif.said_door_refused",
    "whatif.said_entrance",
    "whatif.said_exit",
    "whatif.said_hours",
    "whatif.said_hours_refused",
    "whatif.said_one_way",
    "whatif.said_removed",
    "whatif.search_alike",
    "whatif.search_best",
    "whatif.stays",
    "whatif.stays_unknown",
}
"""Reasons whose number is one of days, weeks, hours, cameras, places or rows that are left out: nobody is in it."""
COUNTS = st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=1, max_size=5)


def answers(days: list[tuple[int, int]]) -> list[Answer]:
    """Return totals and hours of one area: by hour, how many left and how many stayed."""
    n_left, n_stayed = (sum(hour[k] for hour in days) for k in (0, 1))
    n = n_left + n_stayed
    total: Row = {
        "area_id": "queue",
        "n_entered": Value(n),
        "n_left": Value(n_left),
        "n_stayed": Value(n_stayed),
        "left_share": Value(n_left / n if n else 0.0),
        "wait_s": Value(30.0, 20.0, 40.0),
    }
    hours = tuple({"area_id": "queue", "local_hour": 8 + k, "n_entered": Value(a + b)} for k, (a, b) in enumerate(days))
    sums = (Sum("n_entered", ("n_left", "n_stayed")), Sum("n_entered", ("hours.n_entered",)))
    return [Answer("totals", TOTALS, (total,), HOLDS, sums), Answer("hours", HOURS, hours, HOLDS)]


def counts(answer: Answer, column: str) -> list[float | None]:
    return [value_of(row, column).value for row in answer.rows]


@given(COUNTS)
def test_no_small_count_leaves_and_a_zero_stays_unless_the_total_is_small(days: list[tuple[int, int]]) -> None:
    exact = Answers(answers(days))
    for shared in share(exact, below=BELOW):
        before = counts(exact[shared.name], "n_entered")
        after = counts(shared, "n_entered")
        assert not any(is_small(n or 0, below=BELOW) for n in after)
        if not is_small(sum(map(sum, days)), below=BELOW):
            assert all(now == 0 for now, then in zip(after, before, strict=True) if then == 0)
        assert all(now in (None, then) for now, then in zip(after, before, strict=True)), "no count is changed"


@given(COUNTS)
def test_a_value_that_tells_a_hidden_count_is_hidden_and_others_stay(days: list[tuple[int, int]]) -> None:
    exact = Answers(answers(days))
    (row,), (before,) = share(exact, below=BELOW)["totals"].rows, exact["totals"].rows
    is_hidden = [is_small(value_of(before, n).value or 0, below=BELOW) for n in ("n_left", "n_stayed", "n_entered")]
    assert (value_of(row, "left_share").value is None) is any(is_hidden)
    assert (value_of(row, "wait_s").value is None) is is_hidden[2]
    assert (value_of(row, "wait_s").lo is None) is is_hidden[2]


@given(COUNTS)
def test_of_a_sum_with_a_hidden_part_no_part_but_zeros_is_left(days: list[tuple[int, int]]) -> None:
    """One hidden part would be the total less the others; two of one each would be a total of two."""
    shared = share(answers(days), below=BELOW)
    by_hour = counts(shared["hours"], "n_entered")
    if None in by_hour:
        assert set(by_hour) <= {None, 0}


@given(COUNTS)
def test_of_a_small_total_no_part_leaves_nor_a_zero_that_says_when_the_few_came(days: list[tuple[int, int]]) -> None:
    exact = Answers(answers(days))
    shared = share(exact, below=BELOW)
    if is_small(sum(map(sum, days)), below=BELOW):
        assert set(counts(shared["hours"], "n_entered")) == {None}


def test_where_the_parts_are_the_operator_s_a_hidden_one_hides_no_other() -> None:
    """How many entered in an hour never leaves, so nobody can take the others from the total."""
    columns = (
        AREA,
        HOURS[1],
        replace(HOURS[2], audience="operator"),
        Column("wait_s", "seconds", "s", tells=("n_entered",)),
    )
    totals, hours = answers([(3, 0), (20, 0)])
    rows = tuple({**row, "wait_s": Value(30.0)} for row in hours.rows)
    shared = share([totals, Answer("hours", columns, rows, HOLDS)], below=BELOW)
    assert counts(shared["hours"], "wait_s") == [None, 30.0]


@pytest.mark.parametrize("column", ["wait_s", "left_share"])
def test_neither_a_reason_nor_a_note_of_a_row_tells_a_small_count(column: str) -> None:
    totals, _ = answers([(2, 2)])
    few = Reason("level.events", least=10, has=4)
    row = {**totals.rows[0], column: Value.missing(few)}
    shared = share(
        [Answer("totals", TOTALS, (row,), HOLDS, notes=((0, few), (None, Reason("note.visits"))))], below=BELOW
    )
    assert value_of(shared["totals"].rows[0], column).reason == Reason("hidden.few_counted", least=BELOW)
    assert shared["totals"].notes == ((None, Reason("note.visits")),)


def test_columns_of_the_operator_never_leave_nor_do_sums_over_them() -> None:
    shared = share(answers([(20, 30)]), below=BELOW)["totals"]
    assert [c.name for c in shared.columns] == ["area_id", "n_entered", "left_share", "wait_s"]
    assert [row.keys() for row in shared.rows] == [{"area_id", "n_entered", "left_share", "wait_s"}]
    assert shared.sums == (Sum("n_entered", ("hours.n_entered",)),)


def test_a_reason_says_which_kind_of_mask_it_is_and_not_the_count() -> None:
    shared = share(answers([(3, 0), (20, 0)]), below=BELOW)
    few, rest = (value_of(row, "n_entered") for row in shared["hours"].rows)
    assert few == Value.missing(Reason("hidden.few_counted", least=BELOW))
    assert rest == Value.missing(Reason("hidden.gives_away"))


def test_what_is_unknown_keeps_its_reason() -> None:
    unknown = Value.missing(Reason("engine.no_track_ids"), "not_measurable")
    answer = Answer("hours", HOURS, ({"area_id": "q", "local_hour": 8, "n_entered": unknown},), HOLDS)
    assert share([answer], below=BELOW)["hours"].rows == answer.rows


def test_a_sum_that_does_not_hold_is_refused_because_the_mask_relies_on_it() -> None:
    totals, hours = answers([(10, 10), (10, 10)])
    with pytest.raises(ValueError, match="n_entered is 40, not 20"):
        share([totals, Answer("hours", HOURS, hours.rows[:1], HOLDS)], below=BELOW)


def test_operators_own_answers_are_exact() -> None:
    exact = answers([(1, 2)])
    assert share(exact, below=1) == Answers(
        Answer(a.name, tuple(c for c in a.columns if c.audience == "anybody"),
               tuple({c.name: row[c.name] for c in a.columns if c.audience == "anybody"} for row in a.rows),
               a.holds_for, tuple(s for s in a.sums if s.parts == ("hours.n_entered",)))
        for a in exact
    )  # fmt: skip


@given(st.sampled_from(sorted(COUNTS_IN_REASONS)), st.integers(0, 12))
def test_no_reason_that_is_shared_names_a_small_count(code: str, n: int) -> None:
    """Of a value, of a row's note and of a whole answer; also where the reason is part of another."""
    word = COUNTS_IN_REASONS[code]
    bare = Reason(code, **{"least": 30, word: n})
    nested = Reason("logged_change.not_yet", why=bare)
    row: Row = {"area_id": "queue", "wait_s": Value.missing(nested)}
    columns = (AREA, Column("wait_s", "seconds", "s"))
    exact = [
        Answer("waits", columns, (row,), HOLDS, notes=((None, bare),)),
        Answer("nobody", columns, (), HOLDS, nothing=bare),
    ]
    waits, nobody = share(exact, below=BELOW)
    few = Reason("hidden.few_counted", least=BELOW)
    shown = few if is_small(n, below=BELOW) else bare
    assert value_of(waits.rows[0], "wait_s").reason == Reason("logged_change.not_yet", why=shown)
    assert waits.notes == ((None, shown),)
    assert nobody.nothing == shown


def test_every_reason_that_names_a_number_is_known_to_be_a_count_of_people_or_not() -> None:
    """Whoever adds a reason decides whether a small number in it may be told."""
    wording = tomllib.loads((shipped("reports") / "wording" / "en.toml").read_text(encoding="utf-8"))["reason"]
    named = {
        f"{group}.{code}"
        for group, codes in wording.items()
        if isinstance(codes, dict)
        for code, text in codes.items()
        if isinstance(text, str) and re.search(r"\{(?:has|n)\b", text)
    }
    assert named - COUNTS_IN_REASONS.keys() == NUMBERS_OF_OTHER_THINGS
    assert COUNTS_IN_REASONS.keys() <= named
