"""The same week a year before, as sentences below the weeks."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from vsd_analytics.answer import Answers, Row, value_of
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text


def year_line(answers: Answers) -> str:
    """Return what the same week a year before was like, and what changed; empty where it was not recorded."""
    answer = answers.get("year_before")
    return "" if answer is None or not answer.rows else " ".join(_sentences(answer.rows[0]))


def _sentences(row: Row) -> Iterator[str]:
    number, year = (int(part) for part in reversed(str(row["week_before"]).split("-W")))
    week = terms.capital(say("words.week_year", number=number, year=year))
    before = value_of(row, "violation_rate_before")
    if before.value is None:
        yield say("year.none", week=week, reason=reason_text(before.reason) or say("words.too_little_data"))
        return
    parts: tuple[tuple[str, str, Callable[[float], str]], ...] = (
        ("rate", "violation_rate", fmt.number),
        ("close", "close_time_share", fmt.percent),
        ("people", "people", fmt.number),
    )
    for key, name, write in parts:
        then, change = value_of(row, f"{name}_before").value, value_of(row, f"{name}_change")
        if then is not None and change.value is not None:
            likely = fmt.likely_between(change.lo, change.hi)
            shown = say("year.likely", likely=likely) if likely else ""
            yield say(f"year.{key}", week=week, before=write(then), change=fmt.signed(change.value), likely=shown)
    if isinstance(row["special_days"], tuple) and row["special_days"]:
        yield say("year.special", days=terms.joined(str(day) for day in row["special_days"]))
