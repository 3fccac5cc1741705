"""Queues and capacities as the page shows them: texts made from the rows of M39, M40 and M41.

A page shows a row of numbers for each place and what makes them doubtful; the same in words, and by hour, is folded.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vsd_analytics.figures.week.results import Figure
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

Rows = Sequence[Mapping[str, Any]]
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
    """A queue or a place with a capacity as a row of a table: each number, and its likely range or nothing."""

    name: str
    cells: tuple[tuple[str, str], ...]


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


def waiting(figures: Mapping[str, Figure]) -> WaitingView | None:
    """Return what is known of queues and capacities; None where no place asks for it.

    Args:
        figures: Of the report, by catalogue id.
    """
    people, waits, use = (figures.get(metric) for metric in ("M39", "M40", "M41"))
    if people is None and use is None:
        return None
    of_people, of_waits, of_use = ((figure.rows or ()) if figure else () for figure in (people, waits, use))
    places = dict.fromkeys((str(row["area"]), str(row["place"])) for row in (*of_people, *of_waits))
    views = [_queue(name, _of(of_people, area), _of(of_waits, area)) for area, name in places]
    if people is not None and not of_people:
        lines = (say("waiting.no_people", reason=reason_text(people.reason)),)
        views = [QueueView(name=say("waiting.queues"), lines=lines, hours=()), *views]
    use_of = {str(at["place"]): [row for row in of_use if row["place"] == at["place"]] for at in of_use}
    capacities = [_capacity(name, rows) for name, rows in use_of.items()]
    if use is not None and not of_use:
        capacities = [say("waiting.no_capacity", reason=reason_text(use.reason))]
    queue_rows = [_queue_row(name, _of(of_people, area), _of(of_waits, area)) for area, name in places]
    capacity_rows = [_capacity_row(name, rows) for name, rows in use_of.items()]
    return WaitingView(
        queues=tuple(views),
        capacities=tuple(capacities),
        queue_rows=tuple(queue_rows),
        capacity_rows=tuple(capacity_rows),
        notes=tuple(_notes(people, of_people, of_waits, use, of_use, [*queue_rows, *capacity_rows])),
    )


def time_text(value_s: float) -> str:
    """Write a waiting time: 45 seconds; from a minute and a half on 2.5 minutes."""
    if value_s < _SHOWN_BELOW_S:
        return fmt.seconds(round(value_s))
    return say("waiting.minutes", n=fmt.fixed(value_s / _MINUTE_S, 1))


def _of(rows: Rows, area: str) -> Rows:
    return [row for row in rows if row["area"] == area]


def _row(rows: Rows, key: str, hour: int | None = None) -> Mapping[str, Any]:
    """Return the row of a value, empty where there is none."""
    return next((r for r in rows if r["key"] == key and r.get("hour") == hour), {})


def _queue(name: str, people: Rows, waits: Rows) -> QueueView:
    mean, most = _row(people, "mean"), _row(people, "p90_people")
    lines = []
    if mean.get("value") is None:
        lines.append(say("waiting.no_people", reason=_too_little()))
    else:
        on_average = _sentence("people", mean, fmt.number)
        is_known = most.get("value") is not None
        lines.append(f"{on_average} {say('waiting.most', n=fmt.count(most['value']))}" if is_known else on_average)
    median = _row(waits, "median")
    if median.get("value") is None:
        lines.append(say("waiting.no_waits", reason=_too_little()))
    else:
        lines.append(_sentence("median", median, time_text))
        p90, left = _row(waits, "p90"), _row(waits, "left")
        if p90.get("value") is not None:
            lines.append(_sentence("p90", p90, time_text))
        if left.get("value") is not None:
            lines.append(_sentence("left", left, fmt.percent))
        tracks, little = _row(waits, "mean_tracks"), _row(waits, "mean_little")
        if tracks.get("agrees") is False:
            lines.append(say("waiting.disagree", tracks=time_text(tracks["value"]), little=time_text(little["value"])))
    if silent := mean.get("silent_cameras"):
        lines.append(say("waiting.silent", cameras=str(silent)))
    elif unknown := mean.get("unrecorded_hours"):
        lines.append(say("waiting.unrecorded", hours=str(unknown)))
    hours = [row["hour"] for row in people if row.get("hour") is not None]
    return QueueView(name=name, lines=tuple(lines), hours=tuple(_hour(h, people, waits) for h in hours))


def _hour(hour: int, people: Rows, waits: Rows) -> HourRow:
    mean, median, left = _row(people, "mean", hour), _row(waits, "median", hour), _row(waits, "left", hour)
    return HourRow(
        hour=fmt.hour_label(hour),
        people=fmt.number(mean.get("value")),
        likely=_likely(mean, fmt.number),
        median_s=fmt.count(median.get("value")),
        left=fmt.percent(left.get("value")),
    )


def _capacity(name: str, rows: Rows) -> str:
    mean = _row(rows, "people")
    place = {"name": name, "capacity": fmt.count(mean["capacity"])}
    if mean["value"] is None:
        return say("waiting.place_unknown", plural=None, **place, reason=_too_little())
    busy, full, over = (_row(rows, key) for key in ("busy", "full", "over"))
    if not full["value"]:
        key, more = "waiting.place_never" if busy["value"] else "waiting.place_roomy", {}
    else:
        key = "waiting.place" if full.get("lo") is not None and full.get("hi") is not None else "waiting.place_plain"
        surplus_min = fmt.number(_row(rows, "surplus")["value"] * _MINUTE_S)
        more = {"full": fmt.percent(full["value"]), "over": fmt.percent(over["value"]), "surplus": surplus_min}
        more |= {"low": fmt.percent(full.get("lo")), "high": fmt.percent(full.get("hi"))}
    missed = mean.get("unrecorded_hours")
    people, well = fmt.number(mean["value"]), fmt.percent(busy["value"])
    said = say(key, plural=None, **place, people=people, busy=well, **more)
    return f"{said} {say('waiting.unrecorded', hours=str(missed))}" if missed else said


def _queue_row(name: str, people: Rows, waits: Rows) -> PlaceNumbers:
    cells = [_numbers(_row(people, "mean"), fmt.number)]
    cells += [_numbers(_row(waits, key), fmt.count) for key in ("median", "p90")]
    return PlaceNumbers(name=name, cells=(*cells, _numbers(_row(waits, "left"), fmt.percent_short)))


def _capacity_row(name: str, rows: Rows) -> PlaceNumbers:
    mean, busy, full = (_row(rows, key) for key in ("people", "busy", "full"))
    capacity = (fmt.count(mean["capacity"]), "")
    cells = (capacity, _numbers(mean, fmt.number), _numbers(busy, fmt.percent_short), _numbers(full, fmt.percent_short))
    return PlaceNumbers(name=name, cells=cells)


def _numbers(row: Mapping[str, Any], write: Callable[[float], str]) -> tuple[str, str]:
    """Return a number and its likely range, nothing where that is not known or no wider than it is written."""
    lo, hi = row.get("lo"), row.get("hi")
    if row.get("value") is None:
        return fmt.MISSING, ""
    if lo is None or hi is None:
        return write(row["value"]), ""
    low, high = write(lo), write(hi)
    return write(row["value"]), "" if low == high else f"{low.removesuffix('%')}\u2013{high}"


def _notes(
    people: Figure | None,
    of_people: Rows,
    of_waits: Rows,
    use: Figure | None,
    of_use: Rows,
    rows: Sequence[PlaceNumbers],
) -> list[str]:
    """Return what is not known of the numbers, or doubtful, as short sentences."""
    notes = []
    if people is not None and not of_people:
        notes.append(say("waiting.no_people", reason=reason_text(people.reason)))
    if use is not None and not of_use:
        notes.append(say("waiting.no_capacity", reason=reason_text(use.reason)))
    if any(value == fmt.MISSING for row in rows for value, _ in row.cells):
        notes.append(say("waiting.dash"))
    if doubtful := dict.fromkeys(str(r["place"]) for r in of_waits if r.get("agrees") is False):
        notes.append(say("waiting.care", places=terms.joined(doubtful)))
    gaps = [r for r in (*of_people, *of_use) if r.get("hour") is None and r["key"] in ("mean", "people")]
    if part := dict.fromkeys(str(r["place"]) for r in gaps if r.get("silent_cameras") or r.get("unrecorded_hours")):
        notes.append(say("waiting.gaps", places=terms.joined(part)))
    return notes


def _too_little() -> str:
    """Return why a row has no value: its own reason is English, as all texts of the JSON file are."""
    return say("words.too_little_data").lower()


def _sentence(key: str, row: Mapping[str, Any], write: Callable[[float], str]) -> str:
    value, lo, hi = row["value"], row.get("lo"), row.get("hi")
    if lo is None or hi is None:
        return say(f"waiting.{key}_plain", n=write(value))
    return say(f"waiting.{key}", n=write(value), low=write(lo), high=write(hi))


def _likely(row: Mapping[str, Any], write: Callable[[float], str]) -> str:
    lo, hi = row.get("lo"), row.get("hi")
    return fmt.MISSING if lo is None or hi is None else say("format.and", first=write(lo), last=write(hi))
