"""How commands print answers: as text in a chosen set of columns, or as JSON; small counts hidden unless asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date
from typing import TYPE_CHECKING, Any, TypeVar

import click

from vsd_analytics.cli.output import emit_json, plain

if TYPE_CHECKING:
    from vsd_analytics.answer import Answers
    from vsd_analytics.render.text import Layout

F = TypeVar("F", bound=Callable[..., Any])


def exact_option(command: F) -> F:
    """Add `--exact` to a command that prints answers."""
    return click.option(
        "--exact", "is_exact", is_flag=True, help="Print small counts too: not to be handed on (docs/privacy.md)."
    )(command)


def print_answers(
    answers: Answers,
    *,
    days: tuple[date, date],
    layouts: Mapping[str, Layout],
    as_json: bool,
    notes: Sequence[str],
    beside: Mapping[str, Any] | None = None,
) -> None:
    """Print answers: one JSON object, or each under its title, a remark that several of them make once.

    Args:
        answers: The answers.
        days: First and last local day that were asked for.
        layouts: By name of an answer, what text shows of it.
        as_json: Print JSON: `first`, `last`, `answers` by name, and `notes` where there are any.
        notes: Warnings on what does not compare.
        beside: What else the JSON object has.
    """
    if as_json:
        emit_json(answers_json(answers, days=days, notes=notes, beside=beside))
        return
    from vsd_analytics.cli.ranges import warn

    warn(notes)
    click.echo(answers_text(answers, layouts))


def answers_json(
    answers: Answers, *, days: tuple[date, date], notes: Sequence[str], beside: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the JSON object that `print_answers` prints; arguments as there."""
    from vsd_analytics.cli.ranges import noted
    from vsd_analytics.render.json_form import as_json as answer_json
    from vsd_analytics.render.significant import rounded

    printed = {answer.name: rounded(answer_json(answer)) for answer in answers}
    return noted({"first": days[0], "last": days[1], **(beside or {}), "answers": printed}, notes)


def answers_text(answers: Answers, layouts: Mapping[str, Layout]) -> str:
    """Return the text that `print_answers` prints; arguments as there."""
    from vsd_analytics.render.text import remarks, text, title

    sections, printed_before = [], set[str]()
    for answer, layout in ((answers[name], layouts[name]) for name in layouts if name in answers):
        lines = [line for line in remarks(answer, layout) if line not in printed_before]
        printed_before.update(lines)
        if tables := text(answer, layout):
            lines = [*tables, *([""] if lines else []), *lines]
        if lines:
            holds = answer.holds_for
            sections.append("\n".join([f"{title(answer)}, {holds.first} to {holds.last}", "", *lines]))
    return plain("\n\n".join(sections))


def has_value(answers: Answers, name: str, columns: Iterable[str]) -> bool:
    """Tell whether any row of an answer has a value to rely on in one of some columns."""
    from vsd_analytics.answer import value_of

    return any(not value_of(row, column).is_uncertain for row in answers[name].rows for column in columns)
