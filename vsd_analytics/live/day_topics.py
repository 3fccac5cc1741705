"""The figures of the day as retained MQTT messages, for the tools around: `vsd today --publish`.

One topic per floor holds one JSON object. What is unknown is null and has a reason. Whoever listens all day collects
all hours, and could compute from exact ones what the weekly page hides. So counts from 1 to just under `mask_below` are
hidden, and all others are rounded to steps of twice that.
"""

from __future__ import annotations

from typing import Any, Final

from vsd_analytics.answer import Reason
from vsd_analytics.figures.suppression import is_small
from vsd_analytics.figures.today import DayLevel, Today, TodayHour, coarse
from vsd_analytics.site.model import Broker, Floor, Site

VERSION: Final = 1
MINUTES: Final = 60


def day_topic(broker: Broker, floor: Floor) -> str:
    """Return the topic of a floor's figures."""
    return f"{broker.figures_topic}/{floor.floor_id}"


def day_figures(today: Today, site: Site, floor: Floor) -> dict[str, Any]:
    """Return the figures of a floor's day so far, and of its last hour that is over, as JSON values.

    Args:
        today: The numbers.
        site: The site; counts from 1 to just under its `mask_below` are not given.
        floor: The floor.
    """
    below = site.settings.mask_below
    over = [h for h in today.hours if h.is_over and h.day == today.at.date()]
    return {
        "v": VERSION,
        "site": site.site_id,
        "floor": floor.floor_id,
        "at": today.at.isoformat(timespec="seconds"),
        **_day(today, below=below),
        "last_hour": _last_hour(over[-1], below=below) if over else None,
        "silent_cameras": len(today.silent),
    }


def _day(today: Today, *, below: int) -> dict[str, Any]:
    level = today.so_far
    if level is None:
        return {**_no_day(None), "state": "closed"}
    known = _no_day(level)
    n = level.violations
    if n is None:
        return known
    if is_small(n, below=below):
        return {**known, "state": "masked"}
    known["violations"] = _rounded(n, below=below)
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


def _rounded(n: float, *, below: int) -> float:
    return round(n) if below <= 1 else coarse(n, below=below)


def _last_hour(hour: TodayHour, *, below: int) -> dict[str, Any]:
    """Return the figures of an hour; nothing where somebody was in view for less than `below` person-minutes in all."""
    n, people = hour.violations, hour.seen
    is_few = (people is not None and 0 < people * MINUTES < below) or (n is not None and is_small(n, below=below))
    shown, scaled = (None if v is None or is_few else _rounded(v, below=below) for v in (n, hour.estimate))
    return {
        "hour": hour.hour,
        "violations": shown,
        "violations_per_person_h": round(scaled / people, 2) if scaled is not None and people else None,
        "usual_lo": None if hour.lo is None else round(hour.lo, 1),
        "usual_hi": None if hour.hi is None else round(hour.hi, 1),
        "people_in_view": None if people is None or is_few else round(people, 1),
        "state": "masked" if is_few else "no_data" if n is None and people is None else "ok",
    }
