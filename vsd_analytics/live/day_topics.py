"""The figures of the day as retained MQTT messages, for the tools around: `vsd today --publish`.

One topic per floor holds one JSON object. What is unknown is null and has a reason. Whoever listens all day would
collect all hours, so topics have the day that is over, in round numbers (`figures.share.days`); with `--exact`, the
hours of today for the operator's own tools.
"""

from __future__ import annotations

from datetime import timedelta
from typing import Any, Final

from vsd_analytics.answer import Reason
from vsd_analytics.figures.today import DayLevel, Today, TodayHour
from vsd_analytics.site.model import Broker, Floor, Site

VERSION: Final = 1


def day_topic(broker: Broker, floor: Floor) -> str:
    """Return the topic of a floor's figures."""
    return f"{broker.figures_topic}/{floor.floor_id}"


def day_figures(today: Today, site: Site, floor: Floor) -> dict[str, Any]:
    """Return the figures of a floor's day so far and of its last hour that is over, or of yesterday, as JSON values.

    Args:
        today: The numbers; of closed days, the day is yesterday, in round numbers, and there is no last hour.
        site: The site.
        floor: The floor.
    """
    is_closed = today.is_of_closed_days
    over = [h for h in today.hours if not is_closed and h.is_over and h.day == today.at.date()]
    day = today.at.date() - timedelta(days=1) if is_closed else today.at.date()
    return {
        "v": VERSION,
        "site": site.site_id,
        "floor": floor.floor_id,
        "at": today.at.isoformat(timespec="seconds"),
        "day": day.isoformat(),
        **_day(today.yesterday if is_closed else today.so_far),
        "last_hour": _last_hour(over[-1]) if over else None,
        "silent_cameras": len(today.silent),
    }


def _day(level: DayLevel | None) -> dict[str, Any]:
    if level is None:
        return {**_no_day(None), "state": "closed"}
    known = _no_day(level)
    n = level.violations
    if n is None:
        return {**known, "state": "masked"} if level.masked_below else known
    known["violations"] = round(n)
    if level.usual is not None:
        known |= {
            "usual_lo": round(level.usual.lo, 1),
            "usual_hi": round(level.usual.hi, 1),
            "position": level.position,
        }
    return known


def _no_day(level: DayLevel | None) -> dict[str, Any]:
    return {
        "until_hour": None if level is None else level.until_hour,
        "open_hours": None if level is None else level.open_hours,
        "recorded_hours": None if level is None else level.recorded_hours,
        "violations": None,
        "usual_lo": None,
        "usual_hi": None,
        "position": None,
        "state": None if level is None else level.state,
        "reason": None if level is None else _code(level.reason),
    }


def _code(reason: Reason | None) -> str | None:
    return None if reason is None else reason.code


def _last_hour(hour: TodayHour) -> dict[str, Any]:
    """Return the figures of an hour."""
    n, rate, people = hour.violations, hour.encounter_rate, hour.seen
    return {
        "hour": hour.hour,
        "violations": None if n is None else round(n),
        "violations_per_person_h": None if rate is None else round(rate, 2),
        "usual_lo": None if hour.lo is None else round(hour.lo, 1),
        "usual_hi": None if hour.hi is None else round(hour.hi, 1),
        "people_in_view": None if people is None else round(people, 1),
        "state": "no_data" if n is None and people is None else "ok",
    }
