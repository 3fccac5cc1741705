"""How commands print answers: as text in a chosen set of columns, or as JSON; small counts hidden unless asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING, Any, TypeVar

import click

from vsd_analytics.cli.output import emit_json, plain

if TYPE_CHECKING:
    from vsd_analytics.answer import Answers

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Across:
    """One column of an answer across a second key.

    Attributes:
        column: The column.
        down: Key with a line each.
        over: Key with a column each.
    """

    column: str
    down: str
    over: str


Shown = Mapping[str, Sequence[Sequence[str] | Across]]
"""By name of an answer: the grids and sets of columns that text shows one after the other."""


def exact_option(command: F) -> F:
    """Add `--exact` to a command that prints answers."""
    return click.option(
        "--exact", "is_exact", is_flag=True, help="Print small counts too: not to be handed on (docs/privacy.md)."
    )(command)


def print_answers(
    answers: Answers,
    *,
    title: str,
    days: tuple[date, date],
    shown: Shown,
    as_json: bool,
    notes: Sequence[str],
    beside: Mapping[str, Any] | None = None,
) -> None:
    """Print answers: one JSON object, or a title and the chosen columns of each.

    Args:
        answers: The answers.
        title: Name of what is printed, for text.
        days: First and last local day.
        shown: How text shows each answer; those that are absent are left out.
        as_json: Print JSON: `first`, `last`, `answers` by name, and `notes` where there are any.
        notes: Warnings on what does not compare.
        beside: What else the JSON object has.
    """
    from vsd_analytics.cli.ranges import noted, warn
    from vsd_analytics.render.json_form import as_json as answer_json
    from vsd_analytics.render.significant import rounded
    from vsd_analytics.render.text import across, head, text

    first, last = days
    if as_json:
        printed = {answer.name: rounded(answer_json(answer)) for answer in answers}
        emit_json(noted({"first": first, "last": last, **(beside or {}), "answers": printed}, notes))
        return
    warn(notes)
    lines = [f"{title}, {first} to {last}"]
    for name, parts in shown.items():
        if (answer := answers.get(name)) is None:
            continue
        for grid in (part for part in parts if isinstance(part, Across) and answer.rows):
            lines += [
                "",
                head(answer.column(grid.column)),
                *across(answer, grid.column, down=grid.down, over=grid.over),
            ]
        if rest := text(answer, [part for part in parts if not isinstance(part, Across)]):
            lines += ["", *rest]
    click.echo(plain("\n".join(lines)))


def has_value(answers: Answers, name: str, columns: Iterable[str]) -> bool:
    """Tell whether any row of an answer has a value in one of some columns."""
    from vsd_analytics.answer import value_of

    return any(value_of(row, column).state == "ok" for row in answers[name].rows for column in columns)
