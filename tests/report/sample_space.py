"""A made-up week whose five areas ask for visits, a queue or a capacity: what its page may hold and print."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.answer import Reason
from vsd_analytics.figures.week.results import Figure
from vsd_analytics.report.model import week as page_model
from vsd_analytics.wording.reasons import read_reason

AREAS = {"checkout": "Checkout queue", "entrance": "Main entrance", "aisle-2": "End of aisle 2",
         "pharmacy": "Pharmacy counter", "tills": "Tills"}  # fmt: skip
CAPACITY = {"checkout": 12, "entrance": 10, "aisle-2": 6, "pharmacy": 5}
CELLS_M = ((3.5, 2.5), (4.5, 2.5), (5.5, 3.5), (6.5, 3.5), (7.5, 4.5))
LITTLE = Reason("hidden.few", least=5)


def five_areas() -> page_model.WeekReport:
    """A normal week, two of whose five areas are queues and four have a capacity."""
    report = weeks.normal()
    spots = sections.busiest(report)
    return replace(
        report,
        trend=sections.trend(report),
        spots=replace(spots, cards=spots.cards[:1]),
        causes=sections.CAUSES,
        figures={**report.figures, "M37": _flow(), "M39": _people(), "M40": _waits(), "M41": _use(), "M42": _arrows()},
    )


def visits() -> dict[str, Figure]:
    """Return visits and stays of the five areas, which the planner shows."""
    violation_rate, stays = [], []
    for area, name in AREAS.items():
        where = {"area": area, "place": name}
        violation_rate.append({**where, **_limits(12.5), "recorded_share": 0.98})
        stays += [{**where, "what": what, **_limits(v)} for what, v in (("median", 95.0), ("p90", 310.0))]
        stays.append({**where, "what": "share of long visits", "longer_than_s": 300.0, **_limits(0.2)})
    return {
        "M35": Figure(unit=read_reason("visits per open hour"), rows=tuple(violation_rate)),
        "M36": Figure(unit=read_reason("seconds"), rows=tuple(stays)),
    }


def _limits(value: float | None) -> dict[str, Any]:
    if value is None:
        return {"value": None, "lo": None, "hi": None, "reason": LITTLE}
    return {"value": value, "lo": 0.8 * value, "hi": 1.25 * value, "reason": None}


def _people() -> Figure:
    gaps = {"recorded_share": 0.98, "silent_cameras": "", "unrecorded_hours": ""}
    rows = []
    for area, mean in (("checkout", 1.2), ("pharmacy", 0.2)):
        where = {"area": area, "place": AREAS[area], "hour": None}
        rows += [
            {**where, "key": "mean", "what": "mean", **_limits(mean), **gaps},
            {**where, "key": "p90_people", "what": "90 % of the time", **_limits(4.0)},
            *({**where, "key": "mean", "what": "mean", "hour": h, **_limits(mean)} for h in range(8, 21)),
        ]
    return Figure(unit=read_reason("people waiting"), rows=tuple(rows))


def _waits() -> Figure:
    rows = []
    for area, is_known in (("checkout", True), ("pharmacy", False)):
        where = {"area": area, "place": AREAS[area], "hour": None}
        values = {"median": 68.0, "p90": 202.0, "left": 0.12, "mean_tracks": 65.0, "mean_little": 55.0}
        for key, value in values.items():
            agrees = not is_known if key == "mean_tracks" else None
            rows.append({**where, "key": key, "what": key, **_limits(value if is_known else None), "agrees": agrees})
    return Figure(unit=read_reason("seconds"), rows=tuple(rows))


def _use() -> Figure:
    rows: list[dict[str, Any]] = []
    for area, capacity in CAPACITY.items():
        where = {"area": area, "place": AREAS[area], "capacity": capacity}
        values = {"people": 1.2, "busy": 0.11, "full": 0.02, "over": 0.003, "surplus": 0.02}
        rows += [{**where, "key": key, "what": key, "unit": "share", **_limits(v)} for key, v in values.items()]
    return Figure(unit=read_reason("share of time"), rows=tuple(rows))


def _flow() -> Figure:
    rows = []
    for area, name in AREAS.items():
        where = {"area": area, "place": name, "not_followed_share": 0.3, "fits_arrivals": True}
        if area in ("entrance", "tills"):
            rows.append({**where, "to": None, "to_areas": None, **_limits(None), "in_view_only": False})
            continue
        rows += [
            {**where, "to": AREAS[to], "to_areas": to, **_limits(share), "per_open_h": 40 * share,
             "in_view_only": area == "checkout"}
            for to, share in (("tills", 0.6), ("aisle-2", 0.4)) if to != area
        ]  # fmt: skip
    return Figure(unit=read_reason("share"), rows=tuple(rows))


def _arrows() -> Figure:
    cells = [{"x_m": x, "y_m": y, "cell_m": 1.0, "ways": "one" if k else "both", "value": 30.0 * k, "agreement": 0.8,
              "n_people": 12 + k} for k, (x, y) in enumerate(CELLS_M)]  # fmt: skip
    return Figure(unit=read_reason("degrees"), rows=tuple(cells))
