"""The grammar of opening hours in `vsd.toml`: `{ mon-sat = "08:00-21:00", sun = ["10:00-13:00", "15:00-18:00"] }`."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any

WEEKDAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
DAY_MIN = 24 * 60
STEP_MIN = 15
"""Opening is counted in quarter hours, the steps of the calendar."""

Spans = tuple[tuple[int, int], ...]

_CLOCK = re.compile(r"([0-9]{1,2}):([0-9]{2})")


class OpeningError(ValueError):
    """A value is not of this grammar.

    Args:
        what: What is wrong, in words.
        fix: What to write instead.
    """

    def __init__(self, what: str, fix: str) -> None:
        super().__init__(what)
        self.fix = fix


def parse_clock(text: str) -> int:
    """Return minutes after midnight of "HH:MM"; "24:00" is 1440.

    Raises:
        OpeningError: Not a time of day on a quarter hour.
    """
    match = _CLOCK.fullmatch(text.strip())
    minutes = int(match[1]) * 60 + int(match[2]) if match and int(match[2]) < 60 else None
    if minutes is None or minutes > DAY_MIN:
        raise OpeningError(f"{text!r} is not a time of day", 'write hours and minutes, such as "08:00" or "24:00"')
    if minutes % STEP_MIN:
        low = minutes - minutes % STEP_MIN
        raise OpeningError(
            f"{text!r} is not on a quarter hour",
            f'time is counted in quarter hours: write "{show_clock(low)}" or "{show_clock(low + STEP_MIN)}"',
        )
    return minutes


def show_clock(minutes: int) -> str:
    """Return "HH:MM" of minutes after midnight."""
    return f"{minutes // 60:02d}:{minutes % 60:02d}"


def parse_days(key: str) -> tuple[int, ...]:
    """Return the weekdays (0 = Monday) of a key such as "mon" or "tue-fri"; "sat-mon" goes over the weekend.

    Raises:
        OpeningError: Not a weekday or a range of them.
    """
    ends = key.strip().lower().split("-")
    if len(ends) > 2 or any(day not in WEEKDAYS for day in ends):
        raise OpeningError(f"{key!r} is no day of the week", f"use {', '.join(WEEKDAYS)} or a range such as mon-fri")
    first, last = WEEKDAYS.index(ends[0]), WEEKDAYS.index(ends[-1])
    return tuple((first + step) % 7 for step in range((last - first) % 7 + 1))


def parse_spans(value: Any, *, day: str) -> Spans:
    """Return the (start, end) spans of one day in minutes after local midnight, in order.

    Args:
        value: "08:00-21:00", a list of such, or "closed" (also an empty list).
        day: The key it belongs to, for the fix.

    Raises:
        OpeningError: Not a span, a span over midnight, or spans that overlap.
    """
    if value == "closed":
        return ()
    texts = value if isinstance(value, list) else [value]
    spans = []
    for text in texts:
        if not isinstance(text, str) or text.count("-") != 1:
            raise OpeningError(f"{text!r} is no span of time", 'write a start and an end, such as "08:00-21:00"')
        start, end = (parse_clock(part) for part in text.split("-"))
        if end <= start:
            raise OpeningError(f"{text!r} goes past midnight or is empty", _midnight_fix(start, end, day=day))
        spans.append((start, end))
    spans.sort()
    for (_, end), (start, _) in pairwise(spans):
        if start < end:
            raise OpeningError(
                f"two spans overlap at {show_clock(start)}", "join them into one, such as " + repr(_joined(spans))
            )
    return tuple(spans)


def _midnight_fix(start: int, end: int, *, day: str) -> str:
    if start in {DAY_MIN, end}:
        return 'write the start first, such as "08:00-21:00"; around the clock is "00:00-24:00"'
    night = f"{show_clock(start)}-24:00"
    if end == 0:
        return f'midnight at the end of a day is 24:00: {day} = "{night}"'
    early = f"00:00-{show_clock(end)}"
    return f'end this day at 24:00 and begin the next one early: {day} = "{night}", and "{early}" on the day after'


def _joined(spans: list[tuple[int, int]]) -> str:
    return f"{show_clock(min(s for s, _ in spans))}-{show_clock(max(e for _, e in spans))}"


def parse_opening(table: dict[str, Any]) -> tuple[tuple[Spans, ...], list[tuple[str, OpeningError]]]:
    """Return the spans of the seven weekdays and the mistakes by key.

    A day that is not named is closed.

    Args:
        table: The value of `opening`.

    Returns:
        Seven tuples of (start, end) in minutes after local midnight, Monday first; and (key, error) per mistake.
    """
    week: list[Spans] = [()] * 7
    named: dict[int, str] = {}
    mistakes: list[tuple[str, OpeningError]] = []
    for key, value in table.items():
        try:
            days = parse_days(key)
            spans = parse_spans(value, day=key)
        except OpeningError as error:
            mistakes.append((key, error))
            continue
        for day in days:
            if day in named:
                twice = OpeningError(
                    f"{WEEKDAYS[day]} stands in both {named[day]!r} and {key!r}",
                    "name each day once; list several spans with [...]",
                )
                mistakes.append((key, twice))
                break
            named[day], week[day] = key, spans
    return tuple(week), mistakes
