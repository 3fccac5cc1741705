"""Cards of a day by hand: usual, far above, silent cameras, first weeks, closed, hostile names."""

from __future__ import annotations

from datetime import date, datetime
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

from vsd_analytics.answer import Reason
from vsd_analytics.figures.today import DayLevel, SilentCamera, Today, TodayHour
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.stats.unusual import Unusual, UnusualSlots
from vsd_analytics.stats.usual import UsualRange

AT = datetime(2026, 11, 14, 14, 20, tzinfo=ZoneInfo("Europe/Rome"))
FRIDAY, SATURDAY, SUNDAY = (date(2026, 11, d) for d in (13, 14, 15))
DAYS = Reason("today.days", least=4, has=2)


def site(*, name: str = "Quayside Market", cameras: tuple[str, ...] = ("Entrance", "Aisles")) -> Site:
    return Site(
        "shop",
        name,
        "Europe/Rome",
        Path("/nowhere"),
        floors=(Floor("ground", "Ground floor"),),
        cameras=tuple(Camera(f"cam-{k + 1}", camera, "ground") for k, camera in enumerate(cameras)),
    )


def level(day: date, violations: float | None, **changed: Any) -> DayLevel:
    usual = UsualRange(100.0, 200.0, 10)
    made: dict[str, Any] = {
        "day": day,
        "is_over": day < SATURDAY,
        "until_hour": 21 if day < SATURDAY else 14,
        "open_hours": 13 if day < SATURDAY else 6,
        "recorded_hours": 13 if day < SATURDAY else 6,
        "violations": violations,
        "estimate": violations,
        "usual": usual,
        "n_days": 10,
        "state": "ok",
        "reason": None,
    }
    return DayLevel(**{**made, **changed})


def hour(day: date, hour: int, violations: float | None = None, **changed: Any) -> TodayHour:
    is_over = day < SATURDAY or (day == SATURDAY and hour < 14)
    made = {
        "estimate": violations if is_over else None,
        "usual": 20.0,
        "lo": 10.0,
        "hi": 32.0,
        "seen": 6.0,
        "people": 6.0 + hour / 10,
        "people_lo": 4.0,
        "people_hi": 9.0,
    }
    return TodayHour(
        day=day, hour=hour, is_over=is_over, violations=violations if is_over else None, **{**made, **changed}
    )


def unusual(*rows: Unusual) -> UnusualSlots:
    return UnusualSlots(rows, len(rows), 19, 12, "ok", None)


def card(**changed: Any) -> Today:
    made: dict[str, Any] = {
        "at": AT,
        "floor_id": "ground",
        "yesterday": level(FRIDAY, 150.0),
        "so_far": level(SATURDAY, 120.0),
        "hours": tuple(hour(d, h, 20.0 + h) for d in (FRIDAY, SATURDAY, SUNDAY) for h in range(8, 21)),
        "unusual": unusual(),
        "silent": (),
        "n_cameras": 2,
        "forecast_state": "ok",
        "forecast_reason": None,
    }
    return Today(**{**made, **changed})


def odd_hour(violations: int = 283, usual: float = 72.0) -> Unusual:
    return Unusual(SATURDAY, 5, 10, violations, 1.0, usual, 40.0, 110.0, violations / usual, 0.001, 12)


def first_weeks() -> Today:
    few = {"usual": None, "n_days": 2, "state": "not_enough_data", "reason": DAYS}
    none = {"usual": None, "lo": None, "hi": None, "people": None, "people_lo": None, "people_hi": None}
    weeks = Reason("forecast.weeks", least=4, has=2)
    return card(
        yesterday=level(FRIDAY, 150.0, **few),
        so_far=level(SATURDAY, 120.0, **few),
        hours=tuple(hour(d, h, 20.0, **none) for d in (FRIDAY, SATURDAY, SUNDAY) for h in range(8, 21)),
        unusual=UnusualSlots((), 0, 0, 2, "not_enough_data", Reason("unusual.weeks", least=4, has=2)),
        forecast_state="not_enough_data",
        forecast_reason=weeks,
    )


def silent(*camera_ids: str) -> tuple[SilentCamera, ...]:
    return tuple(SilentCamera(camera_id, FRIDAY, 16, 10) for camera_id in camera_ids)


def stopped() -> Today:
    hours = tuple(hour(d, h, None if d == SATURDAY else 20.0) for d in (FRIDAY, SATURDAY, SUNDAY) for h in range(8, 21))
    nothing = {"violations": None, "usual": None, "recorded_hours": 0, "reason": Reason("recorded.nothing")}
    return card(
        so_far=level(SATURDAY, **{**nothing, "state": "not_enough_data"}), hours=hours, silent=silent("cam-1", "cam-2")
    )


ALL = {
    "usual": card,
    "above": lambda: card(so_far=level(SATURDAY, 260.0)),
    "unusual": lambda: card(unusual=unusual(odd_hour())),
    "one_silent": lambda: card(silent=silent("cam-2")),
    "stopped": stopped,
    "first_weeks": first_weeks,
    "closed": lambda: card(yesterday=None, so_far=None, hours=()),
}
