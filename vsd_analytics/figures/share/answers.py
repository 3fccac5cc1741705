"""The mask: what of some answers may leave the operator's hands, together. No other module hides a number.

A count of 1 to `mask_below` - 1 is not shared, nor is any value, reason or note of its row that would tell it
(`Column.tells`). Of a declared sum, all parts that are shared stay hidden where one is: a single hidden part is its
total less the others. Of a small total no part leaves, no zero either: it would say when the few were there. Columns of
the operator (`Column.audience`) are left out; where they are small they hide what tells them all the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

from vsd_analytics.answer import Answer, Answers, Cell, Reason, Row, Sum, Value, check_sums, value_of
from vsd_analytics.figures.share.counts import is_small, mask_of
from vsd_analytics.figures.share.crossings import crossings_again
from vsd_analytics.site.model import Site

COUNTS_IN_REASONS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("level.events", "visits.events", "flow.events", "gatherings.events"), "has"),
    **dict.fromkeys(("violations.few", "visits.few", "flow.few", "routes.few", "met.few"), "has"),
    **dict.fromkeys(("waits.few", "waits.few_served"), "has"),
    **dict.fromkeys(("logged_change.events_before", "logged_change.events_after"), "has"),
    **dict.fromkeys(("logged_change.comparison_events_before", "logged_change.comparison_events_after"), "has"),
    **dict.fromkeys(("visits.all_cut", "flow.all_lost", "routes.all_lost", "ids.few_ends"), "n"),
    **dict.fromkeys(("change.small", "change.poisson", "whatif.few_people"), "n"),
    **dict.fromkeys(("violations.none_of", "violations.all_of", "note.gatherings"), "n"),
    **dict.fromkeys(("accuracy.expected", "accuracy.moved", "accuracy.moved_at_least"), "n"),
}
"""Reasons that name a number of people, visits or violations, and under which word: a small one is not shared."""

Place = tuple[str, int, str]
"""A cell: answer, number of the row, column."""


def share(answers: Iterable[Answer], *, below: int) -> Answers:
    """Return what may leave the operator's hands of answers that leave together.

    Args:
        answers: Everything that leaves together; sums are looked for among all of them.
        below: Counts from 1 to `below` - 1 are small.

    Returns:
        The same answers without the operator's columns; hidden values have the state "not_enough_data" and a reason.

    Raises:
        ValueError: A declared sum does not hold.
    """
    every = list(answers)
    check_sums(every)  # a hidden part is safe only if the sums are those that are declared
    by_name = {answer.name: answer for answer in every}
    small = {
        (answer.name, k, c.name)
        for answer in every
        for c in answer.columns
        if c.kind == "count"
        for k, row in enumerate(answer.rows)
        if is_small(value_of(row, c.name).value or 0, below=below)
    }
    hidden = set(small)
    size = -1
    while size != len(hidden):
        size = len(hidden)
        for answer in every:
            for declared in answer.sums:
                hidden |= _parts_to_hide(answer, declared, by_name, small, hidden)
    return Answers(_shared(answer, small, hidden, below) for answer in every)


def audience_answers(answers: Iterable[Answer], site: Site, *, leaves: bool = True) -> Answers:
    """Return what may be shared; where the site hides nothing, all of it.

    Args:
        answers: Everything that leaves together.
        site: The project.
        leaves: They leave the operator's hands: crossings of lines are remembered, and compared with what left before.
    """
    mask = mask_of(site)
    if not mask.is_on:
        return Answers(answers)
    return share(crossings_again(answers, site, below=mask.below) if leaves else answers, below=mask.below)


def _parts_to_hide(
    answer: Answer, declared: Sum, by_name: Mapping[str, Answer], small: set[Place], hidden: set[Place]
) -> set[Place]:
    """Return all parts of small totals, and of other sums with something hidden the shared parts that are not zero."""
    to_hide: set[Place] = set()
    for k, row in enumerate(answer.rows):
        total = (answer.name, k, declared.total)
        parts = [place for part in declared.parts for place in _places(answer, k, row, part, by_name)]
        if total in small:
            to_hide.update(parts)
        elif total in hidden or any(place in hidden for place in parts):
            to_hide.update(place for place in parts if _is_shared_and_some(place, by_name))
    return to_hide


def _is_shared_and_some(place: Place, by_name: Mapping[str, Answer]) -> bool:
    name, k, column = place
    answer = by_name[name]
    return answer.column(column).audience == "anybody" and bool(value_of(answer.rows[k], column).value)


def _places(answer: Answer, k: int, row: Row, part: str, by_name: Mapping[str, Answer]) -> list[Place]:
    name, _, column = part.rpartition(".")
    if not name:
        return [(answer.name, k, column)]
    if name not in by_name:
        return []
    other = by_name[name]
    keys = [key for key in answer.keys if key in other.keys]
    return [(name, i, column) for i, r in enumerate(other.rows) if all(r[key] == row[key] for key in keys)]


def _shared(answer: Answer, small: set[Place], hidden: set[Place], below: int) -> Answer:
    columns = tuple(c for c in answer.columns if c.audience == "anybody")

    def cell(k: int, row: Row, name: str, tells: Sequence[str]) -> Cell:
        value = row[name]
        if not isinstance(value, Value):
            return value
        value = replace(value, reason=without_small_count(value.reason, below=below))
        told = [(answer.name, k, column) for column in (name, *tells)]
        if any(place in small for place in told):
            return Value.missing(Reason("hidden.few_counted", least=below))
        return Value.missing(Reason("hidden.gives_away")) if any(place in hidden for place in told) else value

    rows = tuple({c.name: cell(k, row, c.name, c.tells) for c in columns} for k, row in enumerate(answer.rows))
    names = {c.name for c in columns}
    sums = tuple(s for s in answer.sums if s.total in names and all("." in p or p in names for p in s.parts))
    with_small = {k for name, k, _ in small if name == answer.name}
    told = [(k, without_small_count(note, below=below)) for k, note in answer.notes if k not in with_small]
    notes = tuple((k, note) for k, note in told if note is not None)
    nothing = without_small_count(answer.nothing, below=below)
    return Answer(answer.name, columns, rows, answer.holds_for, sums, notes, nothing, answer.state)


def without_small_count(reason: Reason | None, *, below: int) -> Reason | None:
    """Return a reason, or in its place that few were counted where it, or a reason in it, names a small count."""
    return None if reason is None else _told(reason, below)


def _told(reason: Reason, below: int) -> Reason:
    word = COUNTS_IN_REASONS.get(reason.code)
    if word is not None and is_small(float(str(reason.values[word])), below=below):
        return Reason("hidden.few_counted", least=below)
    inner: dict[str, Reason | tuple[Reason, ...]] = {}
    for key, value in reason.values.items():
        if isinstance(value, Reason):
            inner[key] = _told(value, below)
        elif isinstance(value, tuple):
            inner[key] = tuple(_told(each, below) for each in value)
    return Reason(reason.code, **{**reason.values, **inner}) if inner else reason
