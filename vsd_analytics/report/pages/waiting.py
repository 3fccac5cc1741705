"""Queues and capacities as the page shows them: texts made from the answers `queues`, `queue_hours` and `capacity`.

A page shows a row of numbers for each place and what makes them doubtful; the same in words, and by hour, is folded.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from vsd_analytics.answer import Answers, Row, Value, value_of
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

_SHOWN_BELOW_S = 90
_MINUTE_S = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class HourRow:
    """One hour of the day of a queue: texts."""

    hour: str
    people: str
    likely: str
    median_s: str
    left: str


@dataclass(frozen=True, slots=True, kw_only=True)
class QueueView:
    """A queue: its name, what is known of it in sentences, and its hours."""

    name: str
    lines: tuple[str, ...]
    hours: tuple[HourRow, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceNumbers:
    """A queue or a place with a capacity as a row of a table: each number, its likely range, and why some lack."""

    name: str
    cells: tuple[tuple[str, str], ...]
    missing: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class WaitingView:
    """The section.

    Attributes:
        queues: In words, and by hour.
        capacities: A sentence for each place with a capacity.
        queue_rows: People waiting, median and 90 % quantile of waits in seconds, share who leave before the end.
        capacity_rows: Capacity, people on average, share of time at 60 % and at 100 % of it.
        notes: What is not known of them, or doubtful.
    """

    queues: tuple[QueueView, ...]
    capacities: tuple[str, ...]
    queue_rows: tuple[PlaceNumbers, ...]
    capacity_rows: tuple[PlaceNumbers, ...]
    notes: tuple[str, ...]


def waiting(answers: Answers) -> WaitingView | None:
    """Return what is known of queues and capacities; None where no place asks for it.

    Args:
        answers: Of the report.
    """
    queues, hours, use = (answers.get(name) for name in ("queues", "queue_hours", "capacity"))
    if queues is None and use is None:
        return None
    of_queues, of_hours, of_use = ((() if a is None else a.rows) for a in (queues, hours, use))
    queue_rows = [_queue_row(row) for row in of_queues]
    capacity_rows = [_capacity_row(row) for row in of_use]
    return WaitingView(
        queues=tuple(_queue(r, [h for h in of_hours if h["area_id"] == r["area_id"]]) for r in of_queues),
        capacities=tuple(_capacity(row) for row in of_use),
        queue_rows=tuple(queue_rows),
        capacity_rows=tuple(capacity_rows),
        notes=tuple(_notes(of_queues, of_use, [*queue_rows, *capacity_rows])),
    )


def time_text(value_s: float) -> str:
    """Write a waiting time: 45 seconds; from a minute and a half on 2.5 minutes."""
    if value_s < _SHOWN_BELOW_S:
        return fmt.seconds(round(value_s))
    return say("waiting.minutes", n=fmt.fixed(value_s / _MINUTE_S, 1))


def _queue(row: Row, hours: Sequence[Row]) -> QueueView:
    mean, most = value_of(row, "people_waiting"), value_of(row, "people_waiting_p90")
    lines = []
    if mean.value is None:
        lines.append(say("waiting.no_people", reason=_why(mean)))
    else:
        on_average = _sentence("people", mean, fmt.number)
        lines.append(
            on_average if most.value is None else f"{on_average} {say('waiting.most', n=fmt.count(most.value))}"
        )
    median = value_of(row, "wait_median_s")
    if median.value is None:
        lines.append(say("waiting.no_waits", reason=_why(median)))
    else:
        lines.append(_sentence("median", median, time_text))
        for key, column, write in (("p90", "wait_p90_s", time_text), ("left", "left_share", fmt.percent)):
            if (value := value_of(row, column)).value is not None:
                lines.append(_sentence(key, value, write))
        tracks, little = (value_of(row, name).value for name in ("stay_mean_s", "stay_mean_little_s"))
        if row["means_agree"] is False and tracks is not None and little is not None:
            lines.append(say("waiting.disagree", tracks=time_text(tracks), little=time_text(little)))
    if silent := listed(row, "silent_cameras"):
        lines.append(say("waiting.silent", cameras=silent))
    elif unknown := unknown_hours(row):
        lines.append(say("waiting.unrecorded", hours=unknown))
    return QueueView(name=str(row["name"]), lines=tuple(lines), hours=tuple(_hour(h) for h in hours))


def _hour(row: Row) -> HourRow:
    mean = value_of(row, "people_waiting")
    return HourRow(
        hour=fmt.hour_label(int(str(row["local_hour"]))),
        people=fmt.number(mean.value),
        likely=_likely(mean, fmt.number),
        median_s=fmt.count(value_of(row, "wait_median_s").value),
        left=fmt.percent(value_of(row, "left_share").value),
    )


def _capacity(row: Row) -> str:
    people, busy, full, over, surplus = (
        value_of(row, name) for name in ("people", "busy_share", "full_share", "over_share", "surplus_people")
    )
    place = {"name": row["name"], "capacity": fmt.count(float(str(row["capacity"])))}
    if people.value is None:
        return say("waiting.place_unknown", plural=None, **place, reason=_why(people))
    if not full.value:
        key, more = "waiting.place_never" if busy.value else "waiting.place_roomy", {}
    else:
        key = "waiting.place" if full.lo is not None and full.hi is not None else "waiting.place_plain"
        minutes = None if surplus.value is None else surplus.value * _MINUTE_S
        more = {"full": fmt.percent(full.value), "over": fmt.percent(over.value), "surplus": fmt.number(minutes)}
        more |= {"low": fmt.percent(full.lo), "high": fmt.percent(full.hi)}
    sentence = say(key, plural=None, **place, people=fmt.number(people.value), busy=fmt.percent(busy.value), **more)
    missed = unknown_hours(row)
    return f"{sentence} {say('waiting.unrecorded', hours=missed)}" if missed else sentence


def _queue_row(row: Row) -> PlaceNumbers:
    writers = {"people_waiting": fmt.number, "wait_median_s": fmt.count, "wait_p90_s": fmt.count}
    return _place(row, writers | {"left_share": fmt.percent_short})


def _capacity_row(row: Row) -> PlaceNumbers:
    writers = {"people": fmt.number, "busy_share": fmt.percent_short, "full_share": fmt.percent_short}
    return _place(row, writers, (fmt.count(float(str(row["capacity"]))), ""))


def _place(row: Row, writers: Mapping[str, Callable[[float], str]], *first: tuple[str, str]) -> PlaceNumbers:
    values = {name: value_of(row, name) for name in writers}
    cells = (_numbers(value, writers[name]) for name, value in values.items())
    missing = dict.fromkeys(_why(value) for value in values.values() if value.value is None)
    return PlaceNumbers(name=str(row["name"]), cells=(*first, *cells), missing=tuple(missing))


def _numbers(value: Value, write: Callable[[float], str]) -> tuple[str, str]:
    """Return a number and its likely range, nothing where that is not known or no wider than it is written."""
    if value.value is None:
        return fmt.MISSING, ""
    if value.lo is None or value.hi is None:
        return write(value.value), ""
    low, high = write(value.lo), write(value.hi)
    return write(value.value), "" if low == high else f"{low.removesuffix('%')}\u2013{high}"


def _notes(queues: Sequence[Row], use: Sequence[Row], rows: Sequence[PlaceNumbers]) -> list[str]:
    """Return what is not known of the numbers, or doubtful, as short sentences."""
    notes = []
    reasons = dict.fromkeys(reason for row in rows for reason in row.missing)
    notes += [say("waiting.dash", reason=reason) for reason in reasons]
    if doubtful := dict.fromkeys(str(r["name"]) for r in queues if r["means_agree"] is False):
        notes.append(say("waiting.care", places=terms.joined(doubtful)))
    gaps = [r for r in (*queues, *use) if r["silent_cameras"] or r["unrecorded_hours"]]
    if part := dict.fromkeys(str(r["name"]) for r in gaps):
        notes.append(say("waiting.gaps", places=terms.joined(part)))
    return notes


def listed(row: Row, column: str) -> str:
    """Return a list cell as text, joined by commas."""
    cell = row[column]
    return ", ".join(map(str, cell)) if isinstance(cell, tuple) else ""


def unknown_hours(row: Row) -> str:
    """Return the hours of the day that were never recorded, as the page writes them."""
    cell = row["unrecorded_hours"]
    return ", ".join(f"{h:02d}:00" for h in cell) if isinstance(cell, tuple) else ""


def _why(value: Value) -> str:
    """Return why a number is not known."""
    return reason_text(value.reason) or say("words.too_little_data").lower()


def _sentence(key: str, value: Value, write: Callable[[float], str]) -> str:
    assert value.value is not None
    if value.lo is None or value.hi is None:
        return say(f"waiting.{key}_plain", n=write(value.value))
    return say(f"waiting.{key}", n=write(value.value), low=write(value.lo), high=write(value.hi))


def _likely(value: Value, write: Callable[[float], str]) -> str:
    if value.lo is None or value.hi is None:
        return fmt.MISSING
    return say("format.and", first=write(value.lo), last=write(value.hi))
