"""Queues and capacities as the page shows them: texts made from the rows of M39, M40 and M41."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vsd_analytics.figures.week.results import Figure
from vsd_analytics.report.words import format as fmt
from vsd_analytics.report.words.catalogue import say
from vsd_analytics.report.words.reasons import reason_text

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
class WaitingView:
    """The section: queues, and a sentence for each place with a capacity."""

    queues: tuple[QueueView, ...]
    capacities: tuple[str, ...]


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
    capacities = [
        _capacity(name, [row for row in of_use if row["place"] == name])
        for name in dict.fromkeys(str(row["place"]) for row in of_use)
    ]
    if use is not None and not of_use:
        capacities = [say("waiting.no_capacity", reason=reason_text(use.reason))]
    return WaitingView(queues=tuple(views), capacities=tuple(capacities))


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
