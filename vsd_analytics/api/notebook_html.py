"""Tables and days as a notebook shows them: numbers written as in the report, its bars and strips."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import date, datetime
from typing import Any, Final

from markupsafe import Markup, escape

from vsd_analytics.figures.operator_counts import n_violations_in, recorded_hours
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_recording import CameraDay
from vsd_analytics.report.draw.svg import MUTED, RULE, change_bar, change_limit, el, hatch_pattern, strip
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording import format as fmt

COLUMNS_SHOWN: Final = 12
DAYS_SHOWN: Final = 14
NOWRAP_LETTERS: Final = 24
_CELL = f"padding:2px 10px 2px 0;border-bottom:1px solid {RULE};vertical-align:middle"


def table_html(rows: Sequence[Mapping[str, Any]], *, columns: Sequence[str], title: str, note: str, n_rows: int) -> str:
    """Return the first rows of a table.

    Numbers are written as in the report. A change with its interval (`x_change`, `x_change_lo`, `x_change_hi`) is also
    drawn as the report's bar around zero.

    Args:
        rows: The rows to show.
        columns: Names of all columns; the first twelve are shown.
        title: What the table is.
        note: What a reader must know.
        n_rows: How many rows the whole table has.
    """
    parts = [Markup("<p><b>{}</b>, {} rows</p>").format(title, fmt.count(n_rows))]
    if note:
        parts.append(Markup("<p>{}</p>").format(note))
    if rows:
        shown = [c for c in columns if not _is_in_bar(c, columns)][:COLUMNS_SHOWN]
        left_out = len([c for c in columns if not _is_in_bar(c, columns)]) - len(shown)
        limits = {c: change_limit([_estimate(row, c) for row in rows]) for c in shown if f"{c}_lo" in columns}
        head = Markup("").join(_cell("th", c, is_number=_is_number(rows[0][c])) for c in shown)
        body = [Markup("").join(_value(row, c, limits.get(c)) for c in shown) for row in rows]
        lines = Markup("").join(el("tr", line) for line in body)
        parts.append(el("table", el("thead", el("tr", head)) + el("tbody", lines), style="border-collapse:collapse"))
        more = [f"{n_rows - len(rows):,} more rows" if n_rows > len(rows) else "", f"{left_out} more columns"]
        words = ", ".join(w for w in (more[0], more[1] if left_out else "") if w)
        parts.append(Markup("<p>{}</p>").format(words) if words else Markup(""))
    return str(Markup("").join(parts))


def recorded_html(warehouse: Warehouse, *, title: str) -> str:
    """Return strips of recorded hours by camera and day, of the first 14 days.

    Args:
        warehouse: The days.
        title: Site and days, in words.
    """
    hours: dict[tuple[str, date], dict[int, tuple[float, float]]] = defaultdict(dict)
    for row in recorded_hours(warehouse):
        hours[row["camera_id"], row["local_date"]][row["local_hour"]] = (row["open_s"], row["recorded_s"])
    days = sorted({day for _, day in hours})
    cameras = {
        c.name: [_day(day, hours[c.camera_id, day]) for day in days[:DAYS_SHOWN]] for c in warehouse.site.cameras
    }
    open_hours = [h for of_day in hours.values() for h, (open_s, _) in of_day.items() if open_s > 0] or [0, 23]
    scheduled_h, recorded_h = (
        sum(pair[k] for of_day in hours.values() for pair in of_day.values()) / 3600 for k in (0, 1)
    )
    share = fmt.percent(recorded_h / scheduled_h if scheduled_h else None)
    summary = f"{fmt.count(n_violations_in(warehouse))} violations; {share} of the open camera-hours recorded"
    if len(days) > DAYS_SHOWN:
        summary += f"; the first {DAYS_SHOWN} of {len(days):,} days are drawn"
    return _days_html(
        title=title, summary=summary, cameras=cameras, first_hour=min(open_hours), last_hour=max(open_hours)
    )


def _day(day: date, hours: dict[int, tuple[float, float]]) -> CameraDay:
    """Return a camera's day; its hours add up to the open and recorded seconds of `hours`."""
    shares = [None if not hours.get(h, (0.0, 0.0))[0] else min(1.0, hours[h][1] / hours[h][0]) for h in range(24)]
    open_s, recorded_s = (sum(pair[k] for pair in hours.values()) for k in (0, 1))
    return CameraDay(
        day=day,
        scheduled_h=open_s / 3600,
        recorded_h=recorded_s / 3600,
        share=recorded_s / open_s if open_s else None,
        hourly_share=tuple(shares),
    )


def _days_html(
    *, title: str, summary: str, cameras: Mapping[str, Sequence[CameraDay]], first_hour: int, last_hour: int
) -> str:
    """Return what was recorded on some days: a strip of hours for each camera and day, as in the report.

    Args:
        title: Site and days.
        summary: One line about them.
        cameras: By name of the camera, its days.
        first_hour: First local hour of the strips.
        last_hour: Last local hour, inclusive.
    """
    defs = el("svg", el("defs", hatch_pattern()), width=0, height=0, style="position:absolute", aria_hidden="true")
    days = next(iter(cameras.values()), ())
    head = _cell("th", "recorded") + Markup("").join(_cell("th", fmt.day_short(day.day)) for day in days)
    lines = [
        _cell("td", name)
        + Markup("").join(
            el(
                "td",
                el("div", strip(day, first_hour=first_hour, last_hour=last_hour), style="width:84px"),
                title=fmt.percent(day.share),
                style=_CELL,
            )
            for day in own
        )
        for name, own in cameras.items()
    ]
    body = Markup("").join(el("tr", line) for line in (head, *lines))
    hours = f"{fmt.hour_label(first_hour)} to {fmt.hour_label(last_hour)}; hatched: open, not recorded"
    return str(
        defs
        + Markup("<p><b>{}</b><br>{}</p>").format(title, summary)
        + el("table", body, style="border-collapse:collapse")
        + Markup('<p style="color:{}">{}</p>').format(MUTED, hours)
    )


def _is_in_bar(column: str, columns: Sequence[str]) -> bool:
    """Return whether a column is an end of an interval that a bar shows."""
    stem, _, end = column.rpartition("_")
    return end in ("lo", "hi") and stem.endswith("_change") and stem in columns


def _estimate(row: Mapping[str, Any], column: str) -> Estimate:
    verdict = row.get(f"{column.removesuffix('_change')}_verdict")
    lo, hi = row.get(f"{column}_lo"), row.get(f"{column}_hi")
    return Estimate(value=None, change=row.get(column), change_lo=lo, change_hi=hi, verdict=verdict)


def _value(row: Mapping[str, Any], column: str, limit: float | None) -> Markup:
    value = row[column]
    if column.endswith("_change") and limit is not None:
        bar = el("div", change_bar(_estimate(row, column), limit=limit), style="width:134px")
        return el("td", Markup("{}{}").format(fmt.signed(value), bar), style=_CELL)
    return _cell("td", _text(value), is_number=_is_number(value))


def _text(value: Any) -> str:
    match value:
        case None:
            return fmt.MISSING
        case bool():
            return "yes" if value else "no"
        case int():
            return fmt.count(value)
        case float():
            return fmt.number(value)
        case datetime():
            return value.isoformat(sep=" ", timespec="minutes")
        case date():
            return value.isoformat()
        case _:
            return str(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _cell(tag: str, text: str, *, is_number: bool = False) -> Markup:
    side = "right" if is_number else "left"
    wraps = ";white-space:nowrap" if len(text) <= NOWRAP_LETTERS else ""
    return el(tag, escape(text) or Markup("&nbsp;"), style=f"{_CELL};text-align:{side}{wraps}")
