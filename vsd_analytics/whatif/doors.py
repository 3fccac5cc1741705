"""A way through a line that gets narrower: seconds too close per person, by the ratio of the widths.

Measured on seven published runs (HERMES, pedestrian corridors with exits and entrances of several widths): where people
walk one way and queue before and after, seconds closer than a distance per person grow as old over new width. The rule
misses where people walk both ways, where the way gets wider, and where nobody queues; these are refused.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.site.layout import DoorEdit
from vsd_analytics.site.model import Point
from vsd_analytics.whatif.arrays import Bools, Ints
from vsd_analytics.whatif.closeness import n_close
from vsd_analytics.whatif.floor_records import FloorRecords

ONE_WAY_SHARE: Final = 0.95
"""Share of passages in one direction from which a way is one-way."""
CROWDED_SHARE: Final = 0.9
"""Share of the time at a door that people are closer than `QUEUE_M` to somebody, from which there is a queue: 0.91
to 0.99 in the seven runs."""
QUEUE_M: Final = 1.0
REACH_M: Final = 12.0
"""Way before an exit, or behind an entrance, that counts: the length of the corridors measured."""
MIN_PEOPLE: Final = 100
"""The runs measured have 121 to 351 people."""
EXPONENTS: Final = {"exit": 1.0, "entrance": 0.65}
"""Power of the width ratio, at 1 m; of entrances it is 1.15 at 0.75 m."""
ENTRANCE_NEAR: Final = (0.75, 1.15)
FACTORS: Final = {"exit": 1.21, "entrance": 1.22}
"""The prediction times or over this holds 90 % of widths that were left out; of entrances 1.35 at 0.75 m."""
ENTRANCE_NEAR_FACTOR: Final = 1.35


@dataclass(frozen=True, slots=True)
class DoorTraffic:
    """Who passes a line, and how crowded it is on the side that counts.

    Attributes:
        n_people: Tracks that pass it.
        one_way_share: Share of passages in the direction that most take.
        crowded_share: Share of the time of these people there in which somebody is closer than 1 m.
        close_s_per_person: Seconds closer than the distance asked for, there, for each of them.
    """

    n_people: int
    one_way_share: float
    crowded_share: float
    close_s_per_person: float


@dataclass(frozen=True, slots=True)
class PredictedSeconds:
    """Seconds too close per person with another width, or why there is no prediction.

    Attributes:
        traffic: What was recorded.
        value, lo, hi: Seconds per person; None where refused.
        refusal: Why there is none; None where there is one.
    """

    traffic: DoorTraffic
    value: float | None
    lo: float | None
    hi: float | None
    refusal: Reason | None


def predicted_seconds(records: FloorRecords, door: DoorEdit, *, within_m: float) -> PredictedSeconds:
    """Return the seconds closer than `within_m` per person at a door of another width (times (old / new width)^b).

    Args:
        records: People within `REACH_M` of the door.
        door: Its line, kind and widths.
        within_m: The distance.
    """
    traffic = door_traffic(records, door, within_m=within_m)
    refusal = _refusal(traffic, door)
    if refusal is not None:
        return PredictedSeconds(traffic, None, None, None, refusal)
    power, factor = rule(door.kind, within_m)
    ratio = door.width_m / door.new_width_m
    value = traffic.close_s_per_person * (ratio if door.kind == "exit" else 1 / ratio) ** power
    return PredictedSeconds(traffic, value, value / factor, value * factor, None)


def rule(kind: str, within_m: float) -> tuple[float, float]:
    """Return the power of the width ratio, and the factor of its 90 % range, at a distance."""
    if kind == "entrance" and within_m <= ENTRANCE_NEAR[0]:
        return ENTRANCE_NEAR[1], ENTRANCE_NEAR_FACTOR
    return EXPONENTS[kind], FACTORS[kind]


def door_traffic(records: FloorRecords, door: DoorEdit, *, within_m: float) -> DoorTraffic:
    """Return who passes a door, and how close people are before it (an exit) or behind it (an entrance)."""
    side, rows = passages(records, door.line)
    if not rows.size:
        return DoorTraffic(0, 0.0, 0.0, 0.0)
    sign = 1 if 2 * int((side > 0).sum()) >= side.size else -1
    people = np.unique(records.track[rows])
    counts = _on_side(records, door, people, sign if door.kind == "exit" else -sign)
    crowd, close = (
        n_close(records.frames, records.x_m, records.y_m, within_m=d) > 0 for d in (QUEUE_M, within_m)
    )  # fmt: skip
    weight = records.weight_s * records.is_owned * counts
    total = max(float(weight.sum()), 1e-9)
    return DoorTraffic(
        people.size, float((side == sign).mean()), float(weight[crowd].sum()) / total,
        float(weight[close].sum()) / people.size,
    )  # fmt: skip


def passages(records: FloorRecords, line: tuple[Point, Point]) -> tuple[Ints, Ints]:
    """Return the direction of each step across a line (1: from its left to its right), and the step's first record."""
    (ax, ay), (bx, by) = line
    beside = (bx - ax) * (records.y_m - ay) - (by - ay) * (records.x_m - ax)
    length2 = (bx - ax) ** 2 + (by - ay) ** 2
    crosses = records.joins_next & ((beside[1:] > 0) != (beside[:-1] > 0))
    rows = np.flatnonzero(crosses)
    share = beside[rows] / (beside[rows] - beside[rows + 1])
    x, y = (v[rows] + share * (v[rows + 1] - v[rows]) for v in (records.x_m, records.y_m))
    at = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length2
    rows = rows[(at >= 0) & (at <= 1)]
    return np.where(beside[rows] > 0, 1, -1), rows


def _on_side(records: FloorRecords, door: DoorEdit, people: Ints, sign: int) -> Bools:
    """Return the records of some people on one side of a door (1: its left), within `REACH_M` of it."""
    (ax, ay), (bx, by) = door.line
    beside = (bx - ax) * (records.y_m - ay) - (by - ay) * (records.x_m - ax)
    apart = np.hypot(records.x_m - (ax + bx) / 2, records.y_m - (ay + by) / 2)
    return np.asarray(np.isin(records.track, people) & (beside * sign > 0) & (apart <= REACH_M))


def _refusal(traffic: DoorTraffic, door: DoorEdit) -> Reason | None:
    if traffic.n_people < MIN_PEOPLE:
        return Reason("whatif.few_people", n=traffic.n_people, least=MIN_PEOPLE)
    if door.new_width_m > door.width_m:
        return Reason("whatif.wider")
    if traffic.one_way_share < ONE_WAY_SHARE:
        return Reason("whatif.both_ways", share=1 - traffic.one_way_share)
    if traffic.crowded_share < CROWDED_SHARE:
        return Reason("whatif.no_queue", queue_m=QUEUE_M, share=traffic.crowded_share, least=CROWDED_SHARE)
    return None
