"""The truth of a made-up world: what is planted, and violations counted from true positions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date, datetime, timedelta
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from vsd_analytics.simulate.cameras import CAMERAS
from vsd_analytics.simulate.people import SimulatedDay, people_inside
from vsd_analytics.simulate.positions import IntArray
from vsd_analytics.simulate.shop import FloatArray, Rect
from vsd_analytics.warehouse.rules import RULES

DISTANCE_M = 2.0
PARTING_M = RULES["parting_mm"] / 1000
MIN_S = 3.0


@dataclass(frozen=True, slots=True)
class PlantedHotspot:
    """The spot with most violations per square metre in the last week.

    Attributes:
        area_id: Its area.
        x_m: Floor x of the mean place of its violations.
        y_m: Floor y of it.
        rate_ratio: Violations per m² in the area over violations per m² of the other free floor, last week.
    """

    area_id: str
    x_m: float
    y_m: float
    rate_ratio: float


@dataclass(frozen=True, slots=True)
class PlantedGap:
    """A time during which no message of some cameras arrives.

    Attributes:
        cameras: Cameras it concerns.
        start: First lost instant.
        end: First instant that is recorded again.
    """

    cameras: tuple[str, ...]
    start: datetime
    end: datetime


@dataclass(frozen=True, slots=True)
class PlantedRedesign:
    """A logged change of the shop: the move of the display, or one that does nothing.

    Attributes:
        at: When it was moved, while the shop was closed.
        area_id: Area it was moved out of.
        text: Text of the change log.
        effect: Violations per open hour in the area, its week over the week before (0.4 = 60 % fewer); None when there
            is no week before.
    """

    at: datetime
    area_id: str
    text: str
    effect: float | None


@dataclass(frozen=True, slots=True)
class HourTruth:
    """People in the shop in one open hour.

    Attributes:
        start: Local start of the hour.
        mean_people: Mean number inside.
        entered: People who came in.
    """

    start: datetime
    mean_people: float
    entered: int


@dataclass(frozen=True, slots=True)
class AreaTruth:
    """Violations in one area and week, from true positions on floor in view at the week's frame interval.

    Attributes:
        week: ISO week.
        area_id: Area, or "floor" for the whole floor.
        violations: Episodes of at least 3 s under 2 m, placed at the mean middle of the pair (`in_view`).
        open_h: Open hours of the week.
    """

    week: str
    area_id: str
    violations: int
    open_h: float


@dataclass(frozen=True, slots=True)
class DemoTruth:
    """The truth of a made-up world.

    Attributes:
        seed: Its seed.
        weeks: Its ISO weeks, in order.
        frame_interval_s: Seconds from frame to frame, per week.
        hotspot: The busiest spot of the last week.
        outage: A camera that is down for most of a day.
        low_data: An hour that no camera recorded for half or more.
        missing: An hour that no camera recorded.
        redesign: The move of the display.
        areas: Violations by week and area.
        hours: People by open hour.
        n_messages: Messages written.
        n_person_records: Persons in all of them.
        idle: A logged change that does nothing, so that its `effect` is chance; None without a history.
        lost: Times before the last week during which nothing of some cameras arrives.
        closed: Local dates on which the shop was closed all day.
    """

    seed: int
    weeks: tuple[str, ...]
    frame_interval_s: tuple[float, ...]
    hotspot: PlantedHotspot
    outage: PlantedGap
    low_data: PlantedGap
    missing: PlantedGap
    redesign: PlantedRedesign
    areas: tuple[AreaTruth, ...]
    hours: tuple[HourTruth, ...]
    n_messages: int
    n_person_records: int
    idle: PlantedRedesign | None = None
    lost: tuple[PlantedGap, ...] = ()
    closed: tuple[date, ...] = ()

    def write(self, path: Path) -> None:
        """Write the truth as JSON with ISO times."""
        path.write_bytes(msgspec.json.format(msgspec.json.encode(self), indent=1) + b"\n")

    @staticmethod
    def read(path: Path) -> DemoTruth:
        """Read what `write` wrote."""
        return msgspec.json.decode(path.read_bytes(), type=DemoTruth)


@dataclass(frozen=True, slots=True)
class Violations:
    """Violations of one day, one per element, in the order of pairs.

    Attributes:
        person_a: One person.
        person_b: The other, with the higher number.
        frame: First frame.
        duration_s: Time closer than the distance; half a frame interval where its ends are not seen.
        x_m: Floor x of the middle of the pair, mean over its records.
        y_m: Floor y of it.
    """

    person_a: IntArray
    person_b: IntArray
    frame: IntArray
    duration_s: FloatArray
    x_m: FloatArray
    y_m: FloatArray

    def inside(self, rect: Rect) -> NDArray[np.bool_]:
        """Return which violations are inside a rectangle of the floor."""
        x0, y0, x1, y1 = rect
        return (self.x_m >= x0) & (self.x_m < x1) & (self.y_m >= y0) & (self.y_m < y1)


def in_view(day: SimulatedDay) -> SimulatedDay:
    """Return the part of a day that cameras can see: rows on floor in view; out of view, a person becomes a new one.

    Whoever crosses floor that no camera sees comes back as somebody else, and so does whoever no single camera sees in
    two frames in a row. This is one camera that sees all floor in view and never errs.
    """
    seen = np.stack([camera.sees(day.x_m, day.y_m) for camera in CAMERAS])
    rows = np.flatnonzero(seen.any(axis=0))
    seen, person, frame = seen[:, rows], day.person[rows], day.frame[rows]
    begins = np.ones(len(rows), dtype=np.bool_)
    begins[1:] = (np.diff(person) != 0) | (np.diff(frame) != 1) | ~(seen[:, 1:] & seen[:, :-1]).any(axis=0)
    return replace(
        day,
        person=np.cumsum(begins) - 1,
        party=day.party[rows],
        frame=frame,
        x_m=day.x_m[rows],
        y_m=day.y_m[rows],
        entered_ms=day.entered_ms[person[begins]],
    )


def close_pairs(day: SimulatedDay, *, distance_m: float = DISTANCE_M) -> tuple[IntArray, IntArray]:
    """Return rows of `day` that are in one frame and strictly closer than `distance_m`, each pair once.

    Rows are ordered by frame and x and compared with their next neighbours until none is within reach in x.
    """
    order = np.lexsort((day.x_m, day.frame))
    frame, x, y = day.frame[order], day.x_m[order], day.y_m[order]
    firsts, seconds = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    candidates = np.arange(len(order))
    lag = 0
    while len(candidates):
        lag += 1
        candidates = candidates[candidates + lag < len(order)]
        other = candidates + lag
        candidates = candidates[(frame[other] == frame[candidates]) & (x[other] - x[candidates] < distance_m)]
        other = candidates + lag
        near = np.hypot(x[other] - x[candidates], y[other] - y[candidates]) < distance_m
        firsts.append(order[candidates[near]])
        seconds.append(order[other[near]])
    return np.concatenate(firsts), np.concatenate(seconds)


def violations(day: SimulatedDay, *, distance_m: float = DISTANCE_M, min_s: float = MIN_S) -> Violations:
    """Return a day's violations: episodes of pairs that are close for `min_s` or more.

    A pair that was close parts where it is `PARTING_M` farther apart, for longer than max(3 s, 2.5 intervals). The same
    rule as the fact `episode_segments` and the mart `episodes`, on true positions instead of what cameras see: from one
    frame to the next people walk straight to the middle of a cubic, then on.
    """
    first, second = close_pairs(day, distance_m=distance_m + PARTING_M)
    swap = day.person[first] > day.person[second]
    first, second = np.where(swap, second, first), np.where(swap, first, second)
    order = np.lexsort((day.frame[first], day.person[second], day.person[first]))
    first, second = first[order], second[order]
    interval_s = day.interval_ms / 1000
    gap_frames = max(3.0, 2.5 * interval_s) / interval_s
    meets = _begins(day, first, second, gap_frames)
    stretch = np.cumsum(meets) - 1
    is_close = np.hypot(day.x_m[first] - day.x_m[second], day.y_m[first] - day.y_m[second]) < distance_m
    first, second, stretch = first[is_close], second[is_close], stretch[is_close]
    a, b, frame = day.person[first], day.person[second], day.frame[first]
    run = np.flatnonzero(_begins(day, first, second, gap_frames) | (np.diff(stretch, prepend=-1) != 0))
    end = np.append(run[1:], len(frame))[: len(run)] - 1
    close_s = (frame[end] - frame[run]) * interval_s if len(frame) else np.zeros(0)
    for at, step in ((run, -1), (end, 1)):
        close_s = close_s + interval_s * _share_close(day, first[at], second[at], step=step, distance_m=distance_m)
    start = np.flatnonzero(np.diff(stretch, prepend=-1) != 0)
    episode = np.searchsorted(start, run, side="right") - 1
    duration = np.bincount(episode, close_s, minlength=len(start)).astype(np.float64)
    x, y = ((values[first] + values[second]) / 2 for values in (day.x_m, day.y_m))
    if len(frame):
        n_records = np.diff(start, append=len(frame))
        x, y = (np.add.reduceat(values, start) / n_records for values in (x, y))
    is_long = duration >= min_s
    start, duration, x, y = start[is_long], duration[is_long], x[is_long], y[is_long]
    return Violations(
        person_a=a[start],
        person_b=b[start],
        frame=frame[start],
        duration_s=duration,
        x_m=x,
        y_m=y,
    )


def _begins(day: SimulatedDay, first: IntArray, second: IntArray, gap_frames: float) -> NDArray[np.bool_]:
    """Return which of the rows, in order of pairs and frames, begin a run with no longer gap."""
    begins = np.ones(len(first), dtype=np.bool_)
    a, b, frame = day.person[first], day.person[second], day.frame[first]
    begins[1:] = (np.diff(a) != 0) | (np.diff(b) != 0) | (np.diff(frame) > gap_frames)
    return begins


def _share_close(day: SimulatedDay, first: IntArray, second: IntArray, *, step: int, distance_m: float) -> FloatArray:
    """Return for which share of the way to the next frame (`step` 1) or the one before (-1) a close pair stays close.

    Args:
        day: True positions.
        first: Rows of one person of pairs closer than `distance_m`.
        second: Rows of the other.
        step: Which frame.
        distance_m: When a pair parts.

    Returns:
        The share at which one person, seen from the other, crosses the distance on the way from r to r' in that frame,
        straight to its middle and on: (r + r') / 2 + (v - v') / 8, where v is half the way from the frame behind r to
        r' and v' half that from r to the frame beyond r', or r' - r where one of the two is not there. 1/2 where one of
        the two is not there at r', or they are close there as well.
    """
    here, _ = _seen(day, first, second, step=0)
    there, is_there = _seen(day, first, second, step=step)
    beyond, knows_beyond = _seen(day, first, second, step=2 * step)
    behind, knows_behind = _seen(day, first, second, step=-step)
    v_here = np.where(knows_behind, (there - behind) / 2, there - here)
    v_there = np.where(knows_beyond, (beyond - here) / 2, there - here)
    # the middle of the cubic (Catmull-Rom) through the four frames: people turn between two frames, so straight
    # interpolation would place the crossing too late or too early; the mart `episodes` does the same
    middle = (here + there) / 2 + (v_here - v_there) / 8
    is_late = np.hypot(*middle) < distance_m
    is_there &= np.hypot(*there) >= distance_m
    start = np.where(is_late, middle, here)[:, is_there]
    move = np.where(is_late, there - middle, middle - here)[:, is_there]
    square, mixed, rest = (move**2).sum(axis=0), (start * move).sum(axis=0), (start**2).sum(axis=0) - distance_m**2
    share = np.full(len(first), 0.5)
    share[is_there] = (is_late[is_there] + (np.sqrt(mixed**2 - square * rest) - mixed) / square) / 2
    return share


def _seen(day: SimulatedDay, first: IntArray, second: IntArray, *, step: int) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the position of the first of a pair relative to the second, `step` frames on, and if both are there."""
    there = []
    is_there = np.ones(len(first), dtype=np.bool_)
    for rows in (first, second):
        later = np.clip(rows + step, 0, max(0, len(day.person) - 1))
        is_there &= (day.person[later] == day.person[rows]) & (day.frame[later] == day.frame[rows] + step)
        there.append(np.stack([day.x_m[later], day.y_m[later]]))
    return there[0] - there[1], is_there


def hours_of(day: SimulatedDay) -> tuple[HourTruth, ...]:
    """Return the people of each open hour of a day."""
    inside, at_ms = people_inside(day), day.frame_ms
    hours, start = [], day.opens
    while start < day.closes:
        low = round(start.timestamp() * 1000)
        high = min(low + 3_600_000, round(day.closes.timestamp() * 1000))
        frames = (at_ms >= low) & (at_ms < high)
        mean = round(float(inside[frames].mean()), 3) if frames.any() else 0.0
        hours.append(HourTruth(start, mean, int(((day.entered_ms >= low) & (day.entered_ms < high)).sum())))
        start += timedelta(hours=1)
    return tuple(hours)
