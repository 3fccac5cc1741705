"""What `vsd queue --forecast` prints of the next week: people waiting by hour, and hours that may exceed a limit."""

from __future__ import annotations

from dataclasses import asdict
from datetime import date, timedelta
from typing import TYPE_CHECKING, Any, Final

from vsd_analytics.cli.output import rounded, table
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.figures.forecast import HourForecast
    from vsd_analytics.figures.queue_forecast import BusyHour, QueueForecast
    from vsd_analytics.stats.forecast import ForecastScore

_ADVICE: Final = {
    "likely": "very likely above the limit: plan another point of service",
    "expected": "expected above the limit: consider another point of service",
}


def whole_week(last: date) -> date:
    """Return the Monday of the last week that is over on a day, that day included."""
    return last - timedelta(days=(last.weekday() + 1) % 7 + 6)


def forecast_dict(of: QueueForecast) -> dict[str, Any]:
    """Return a forecast as the JSON output has it."""
    busy = None if of.busy is None else [{"chance": b.chance, **asdict(b.hour)} for b in of.busy]
    found: dict[str, Any] = rounded(
        {
            "area_id": of.area.area_id,
            "week": of.week,
            "monday": of.monday,
            "after": of.last_week,
            "queue_limit": of.area.queue_limit,
            "people_waiting": asdict(of.people),
            "above_limit": busy,
        }
    )
    return found


def forecast_lines(outlook: tuple[QueueForecast, ...]) -> list[str]:
    """Return the lines of forecasts, an empty one first; none without any."""
    return [line for of in outlook for line in ["", *_lines(of)]]


def _lines(of: QueueForecast) -> list[str]:
    title = f"{of.area.name}: people waiting in {of.week}, mean of the hour"
    people = of.people
    if people.state != "ok":
        return [f"{title}: no forecast, {reason_text(people.reason)}"]
    days = [of.monday + timedelta(days=i) for i in range(7)]
    cells = {(r.hour, r.day): _cell(r) for r in people.rows}
    rows = [("hour", *(f"{d:%a} {d.day}" for d in days))]
    rows += [
        (f"{hour:02d}:00", *(cells.get((hour, d), "") for d in days)) for hour in sorted({r.hour for r in people.rows})
    ]
    weeks = max(r.n_weeks for r in people.rows)
    made = f"{people.range_share:.0%} range in brackets; from the last {weeks} recorded weeks of each hour"
    return [f"{title} ({made})", *table(rows), *_score(people.score, of.last_week), *_advice(of)]


def _cell(row: HourForecast) -> str:
    if row.value is None or row.lo is None or row.hi is None:
        return "–"
    return f"{row.value:.1f} ({row.lo:.1f}–{row.hi:.1f})"


def _score(score: ForecastScore | None, week: str) -> list[str]:
    if score is None or score.hit_rate is None or score.wape is None:
        return []
    return [
        f"the forecast of {week}, made the same way: off by {score.wape:.0%}, {score.hit_rate:.0%} of {score.n_hours} "
        f"hours in their range (to be {score.share:.0%})"
    ]


def _advice(of: QueueForecast) -> list[str]:
    limit = of.area.queue_limit
    if limit is None or of.busy is None:
        return ["for advice on staff, add queue_limit = 5 (people waiting that are too many) to the area in vsd.toml"]
    sure = [b for b in of.busy if b.chance in _ADVICE]
    n_possible = len(of.busy) - len(sure)
    lines = [f"above {limit:g} people waiting, the limit of vsd.toml:", *(_busy(b) for b in sure)]
    if not sure:
        lines = [f"no hour is expected above {limit:g} people waiting, the limit of vsd.toml"]
    if n_possible:
        lines.append(f"in {n_possible} more hours the range reaches above it")
    return [*lines, "the range is of people waiting as so far: what another point of service would do is not known"]


def _busy(of: BusyHour) -> str:
    h = of.hour
    return f"  {h.day:%a} {h.hour:02d}:00: {h.lo:.0f} to {h.hi:.0f} waiting, {_ADVICE[of.chance]}"
