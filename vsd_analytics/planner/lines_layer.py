"""Counting lines as a layer of the planner's map: the lines, and who crossed them in the days and hours chosen (M57).

The counts are those of `vsd lines`, hidden by the same mask: of the week, of its days and of its hours of the day. Only
the operator's page has hours of single days.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any, Final

from vsd_analytics.answer import Answers, Row, Value, value_of
from vsd_analytics.figures.lines import line_answers, line_day_hours, lines_of
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.answers import audience_answers
from vsd_analytics.report.draw.floor_frame import Frame
from vsd_analytics.site.lines import Line
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say, template
from vsd_analytics.wording.reasons import reason_text

SAID: Final = ("lines_either", "lines_of")
"""Sentences of `planner.lines` that the script says."""
_WAYS: Final = {"n_to_left": "left", "n_to_right": "right"}


@dataclass(frozen=True, slots=True, kw_only=True)
class LineRow:
    """A line in the table below the map, of the whole week: for each side a number, and its name or a reason."""

    name: str
    sides: tuple[tuple[str, str], ...]
    recorded: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LinesLayer:
    """The layer.

    Attributes:
        rows: A row for each line.
        paths: Those that are drawn, by their number, in units of the drawing; none without a map.
        meta: What the script knows of each line.
        words: Sentences that the script says.
    """

    rows: tuple[LineRow, ...]
    paths: tuple[tuple[int, str], ...]
    meta: dict[str, Any]
    words: dict[str, str]


def crossings(period: Period) -> Answers:
    """Return who crossed the counting lines of a floor, as far as the page may tell; empty without a line."""
    if not lines_of(period):
        return Answers()
    site = period.data.site
    shared = audience_answers(line_answers(period), site)
    return shared if period.data.mask.is_on else Answers((*shared, line_day_hours(period)))


def lines_layer(answers: Answers, lines: Sequence[Line], frame: Frame | None) -> LinesLayer | None:
    """Return the layer; None where no line is there.

    Args:
        answers: As `crossings` returns them.
        lines: The lines of the site.
        frame: The drawing; None without a map.
    """
    whole = answers.get("lines")
    if whole is None:
        return None
    drawn = {line.line_id: line for line in lines}
    reasons: list[tuple[str, bool]] = []
    points = [drawn[str(row["line_id"])].points or () for row in whole.rows]
    ends = [[(round(x), round(y)) for x, y in map(frame.at, pair)] if frame else [] for pair in points]
    meta = [_meta(answers, row, pair, reasons) for row, pair in zip(whole.rows, ends, strict=True)]
    return LinesLayer(
        rows=tuple(_row(row) for row in whole.rows),
        paths=tuple((k, "M" + "L".join(f"{x} {y}" for x, y in pair)) for k, pair in enumerate(ends) if pair),
        meta={"lines": meta, "reasons": [{"why": why, "hides": int(hides)} for why, hides in reasons]},
        words={key: template(f"planner.lines.{key}") for key in SAID},
    )


def _row(row: Row) -> LineRow:
    sides = tuple(_side(value_of(row, way), str(row[side])) for way, side in _WAYS.items())
    return LineRow(name=str(row["name"]), sides=sides, recorded=fmt.percent(_share(row)))


def _side(value: Value, side: str) -> tuple[str, str]:
    name = say("planner.lines.lines_of", side=side)
    return fmt.count(value.value), name if value.value is not None else f"{name}: {reason_text(value.reason)}"


def _share(row: Row) -> float | None:
    share = row["recorded_open_share"]
    return share if isinstance(share, float) else None


def _meta(answers: Answers, whole: Row, ends: list[tuple[int, int]], reasons: list[tuple[str, bool]]) -> dict[str, Any]:
    """Return a line for the script: cells of the week, of each weekday and hour of the day, and of both together."""
    tables = {name: list(answers[name].where(line_id=str(whole["line_id"]))) for name in ("line_days", "line_hours")}
    day_hours = answers.get("line_day_hours")
    slots = [] if day_hours is None else list(day_hours.where(line_id=str(whole["line_id"])))
    days = {_weekday(row): _cells(row, reasons) for row in tables["line_days"]}
    hours = {row["local_hour"]: _cells(row, reasons) for row in tables["line_hours"]}
    both = {(_weekday(row), row["local_hour"]): _cells(row, reasons) for row in slots}
    return {
        **{key: whole[key] for key in ("name", "left", "right")},
        "ends": ends,
        "week": _cells(whole, reasons),
        "days": [days.get(d) for d in range(7)],
        "hours": [hours.get(h) for h in range(24)],
        **({"slots": [[both.get((d, h)) for h in range(24)] for d in range(7)]} if slots else {}),
    }


def _weekday(row: Row) -> int:
    day = row["local_date"]
    return (day if isinstance(day, date) else date.fromisoformat(str(day))).weekday()


def _cells(row: Row, reasons: list[tuple[str, bool]]) -> list[int]:
    """Return crossings to either side, open quarter-hours not recorded in full, and all: -1, -2, ... are reasons."""
    cells = []
    for value in (value_of(row, way) for way in _WAYS):
        if value.value is not None:
            cells.append(round(value.value))
            continue
        is_hidden = value.reason is not None and value.reason.code.startswith("hidden.")
        reason = reason_text(value.reason) or say("words.too_little_data"), is_hidden
        if reason not in reasons:
            reasons.append(reason)
        cells.append(-1 - reasons.index(reason))
    return [*cells, *(round(4 * float(str(row[name]))) for name in ("unrecorded_open_h", "open_h"))]
