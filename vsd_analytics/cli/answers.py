"""How commands print answers: as text in a chosen set of columns, or as JSON; small counts hidden unless asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.output import emit_json, plain

if TYPE_CHECKING:
    from vsd_analytics.answer import Answers


def print_answers(
    answers: Answers,
    *,
    title: str,
    days: tuple[date, date],
    shown: Mapping[str, Sequence[Sequence[str]]],
    as_json: bool,
    notes: Sequence[str],
) -> None:
    """Print answers: one JSON object, or a title and the chosen columns of each.

    Args:
        answers: The answers.
        title: Name of what is printed, for text.
        days: First and last local day.
        shown: By name of an answer, the sets of columns that text shows one after the other.
        as_json: Print JSON: `first`, `last`, `answers` by name, and `notes` where there are any.
        notes: Warnings on what does not compare.
    """
    from vsd_analytics.cli.ranges import noted, warn
    from vsd_analytics.render.json_form import as_json as answer_json
    from vsd_analytics.render.significant import rounded
    from vsd_analytics.render.text import text

    first, last = days
    if as_json:
        printed = {answer.name: rounded(answer_json(answer)) for answer in answers}
        emit_json(noted({"first": first, "last": last, "answers": printed}, notes))
        return
    warn(notes)
    lines = [f"{title}, {first} to {last}"]
    for name, column_sets in shown.items():
        if (answer := answers.get(name)) is None:
            continue
        lines += ["", *text(answer, column_sets)]
    click.echo(plain("\n".join(lines)))


def has_value(answers: Answers, name: str, columns: Iterable[str]) -> bool:
    """Tell whether any row of an answer has a value in one of some columns."""
    from vsd_analytics.answer import value_of

    return any(value_of(row, column).state == "ok" for row in answers[name].rows for column in columns)
