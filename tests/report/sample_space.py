"""A made-up week whose five areas ask for visits, a queue or a capacity: what its page may hold and print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.answer import VALUES, Answer, Answers, Cell, Column, HoldsFor, Reason, Value
from vsd_analytics.figures import capacities, flow_answers, queues
from vsd_analytics.figures import visits as visits_of_areas
from vsd_analytics.report.model import week as page_model

AREAS = {"checkout": "Checkout queue", "entrance": "Main entrance", "aisle-2": "End of aisle 2",
         "pharmacy": "Pharmacy counter", "tills": "Tills"}  # fmt: skip
CAPACITY = {"checkout": 12, "entrance": 10, "aisle-2": 6, "pharmacy": 5}
CELLS_M = ((3.5, 2.5), (4.5, 2.5), (5.5, 3.5), (6.5, 3.5), (7.5, 4.5))
LITTLE = Reason("hidden.few_counted", least=5)
_WAITS = {"wait_median_s": 68.0, "wait_p90_s": 202.0, "left_share": 0.12, "stay_mean_s": 65.0,
          "stay_mean_little_s": 55.0}  # fmt: skip


def five_areas() -> page_model.WeekReport:
    """A normal week, two of whose five areas are queues and four have a capacity."""
    report = weeks.normal()
    spots = sections.busiest(report)
    return replace(
        report,
        trend=sections.trend(report),
        spots=replace(spots, cards=spots.cards[:1]),
        causes=sections.CAUSES,
        answers=Answers(a for a in space() if a.name != "visits"),
    )


def space() -> Answers:
    """Return all answers on the five areas; visits are those that the planner shows."""
    return Answers([_visits(), _queues(), _queue_hours(), _capacity(), _flow(), _flow_areas(), _directions()])


def _answer(name: str, columns: Sequence[Column], rows: Sequence[Mapping[str, float | Cell]]) -> Answer:
    """Return an answer as it leaves: numbers become values with limits, what is not given is missing."""
    week = weeks.normal().week
    shared = tuple(c for c in columns if c.audience == "anybody")
    return Answer(
        name,
        shared,
        tuple({c.name: _cell(row.get(c.name), c) for c in shared} for row in rows),
        HoldsFor("shop", "ground", week.monday, week.sunday),
    )


def _cell(cell: float | Cell, column: Column) -> Cell:
    if column.name == "floor_id":
        return "ground"
    if column.kind not in VALUES or isinstance(cell, Value):
        return cell
    if not isinstance(cell, int | float):
        return Value.missing(LITTLE)
    return Value(cell) if column.kind == "count" else Value(cell, 0.8 * cell, 1.25 * cell)


def _of(area: str) -> dict[str, Cell]:
    return {"area_id": area, "name": AREAS[area]}


def _visits() -> Answer:
    numbers = {"visits_per_open_h": 12.5, "dwell_median_s": 95.0, "dwell_p90_s": 310.0, "long_share": 0.2,
               "long_visit_s": 300.0, "recorded_share": Value(0.98)}  # fmt: skip
    return _answer("visits", visits_of_areas.COLUMNS, [{**_of(area), **numbers} for area in AREAS])


def _queues() -> Answer:
    rows: list[dict[str, float | Cell]] = [
        {**_of("checkout"), "people_waiting": 1.2, "people_waiting_p90": 4.0, **_WAITS, "means_agree": False},
        {**_of("pharmacy"), "people_waiting": 0.2, "people_waiting_p90": 4.0, "means_agree": None},
    ]
    return _answer("queues", queues.QUEUE_COLUMNS, rows)


def _queue_hours() -> Answer:
    rows = [
        {**_of(area), "local_hour": hour, "people_waiting": mean}
        for area, mean in (("checkout", 1.2), ("pharmacy", 0.2))
        for hour in range(8, 21)
    ]
    return _answer("queue_hours", queues.HOUR_COLUMNS, rows)


def _capacity() -> Answer:
    use = {"people": 1.2, "busy_share": 0.11, "full_share": 0.02, "over_share": 0.003, "surplus_people": 0.02}
    rows = [{**_of(area), "capacity": capacity, **use} for area, capacity in CAPACITY.items()]
    return _answer("capacity", capacities.COLUMNS, rows)


def _flow() -> Answer:
    rows: list[dict[str, float | Cell]] = []
    for area in AREAS:
        where = {**_of(area), "fits_arrivals": True, "in_view_only": area == "checkout"}
        if area in ("entrance", "tills"):
            rows.append({**where, "to_area_ids": "", "to_name": None})
            continue
        rows += [
            {**where, "to_area_ids": to, "to_name": AREAS[to], "next_area_share": share, "per_open_h": 40 * share}
            for to, share in (("tills", 0.6), ("aisle-2", 0.4))
            if to != area
        ]
    return _answer("flow", flow_answers.FLOW_COLUMNS, rows)


def _flow_areas() -> Answer:
    rows = [{**_of(area), "not_followed_share": 0.3, "fits_arrivals": True} for area in AREAS]
    return _answer("flow_areas", flow_answers.AREA_COLUMNS, rows)


def _directions() -> Answer:
    cells = [
        {"x_m": x, "y_m": y, "cell_m": 1.0, "ways": "one" if k else "both", "direction_deg": 30.0 * k,
         "agreement": 0.8, "n_people": Value(12 + k)}
        for k, (x, y) in enumerate(CELLS_M)
    ]  # fmt: skip
    return _answer("walking_directions", flow_answers.DIRECTION_COLUMNS, cells)
