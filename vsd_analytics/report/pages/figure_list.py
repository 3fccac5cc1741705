"""Further figures of the catalogue as rows of a table: durations, distances, sizes, gatherings, sensitivity."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from vsd_analytics.figures.week.results import Figure
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.words import format as fmt
from vsd_analytics.report.words import terms
from vsd_analytics.report.words.catalogue import say
from vsd_analytics.report.words.reasons import reason_text

SHARE: Final = "share"


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureRow:
    """One figure: texts; `reason` replaces the value where there is none."""

    name: str
    value: str
    likely: str
    unit: str
    reason: str = ""


def more_figures(report: WeekReport) -> tuple[FigureRow, ...]:
    """Return the catalogue's figures that the page has nowhere else, in catalogue order; absent ones are left out."""
    unit = report.rules.distance_unit
    makers: dict[str, Callable[[Figure], Iterator[FigureRow]]] = {
        "M5": lambda f: _single("M5", f, say("more.people")),
        "M6": lambda f: _single("M6", f, SHARE, distance=fmt.distance(report.rules.distance_m, unit)),
        "M10": _durations,
        "M11": lambda f: _closeness(f, unit),
        "M12": lambda f: _single("M12", f, say("more.pairs")),
        "M21": _sizes,
        "M22": lambda f: _single("M22", f, say("more.per_100_h")),
        "M26": lambda f: _sensitivity(f, unit),
    }
    rows: list[FigureRow] = []
    for key, maker in makers.items():
        figure = report.figures.get(key)
        if figure is None:
            continue
        if figure.state != "ok":
            reason = terms.sentence(reason_text(figure.reason) or say("words.too_little_data"))
            distance = fmt.distance(report.rules.distance_m, unit)
            rows.append(
                FigureRow(name=say(f"more.{key}_all", distance=distance), value="", likely="", unit="", reason=reason)
            )
        else:
            rows += maker(figure)
    return tuple(rows)


def _single(key: str, figure: Figure, unit: str, *, distance: str = "") -> Iterator[FigureRow]:
    if figure.value is not None:
        yield _row(say(f"more.{key}_all", distance=distance), figure.value, figure.lo, figure.hi, unit)


def _durations(figure: Figure) -> Iterator[FigureRow]:
    for row in figure.rows or ():
        if (value := row.get("value")) is not None:
            unit = SHARE if row.get("unit") == SHARE else say("more.seconds")
            yield _row(say("more.M10", what=row.get("what", "")), value, row.get("lo"), row.get("hi"), unit)


def _closeness(figure: Figure, unit: str) -> Iterator[FigureRow]:
    for row in figure.rows or ():
        low, high = (fmt.distance(row[k], unit) for k in ("from_m", "to_m"))
        yield from _shared(say("more.M11", low=low, high=high), row)


def _sizes(figure: Figure) -> Iterator[FigureRow]:
    for row in figure.rows or ():
        least, most = row["least"], row["most"]
        people = f"{least}+" if most is None else f"{least}" if most == least else f"{least}\u2013{most}"
        yield from _shared(say("more.M21", people=people), row)


def _sensitivity(figure: Figure, unit: str) -> Iterator[FigureRow]:
    for row in figure.rows or ():
        yield from _shared(say("more.M26", distance=fmt.distance(row["distance_m"], unit)), row)


def _shared(name: str, row: Mapping[str, Any]) -> Iterator[FigureRow]:
    if (share := row.get("share")) is not None:
        yield _row(name, share, None, None, SHARE)


def _row(name: str, value: float, lo: float | None, hi: float | None, unit: str) -> FigureRow:
    write = fmt.percent if unit == SHARE else fmt.number
    likely = fmt.MISSING if lo is None or hi is None else say("format.and", first=write(lo), last=write(hi))
    return FigureRow(name=name, value=write(value), likely=likely, unit="" if unit == SHARE else unit)
