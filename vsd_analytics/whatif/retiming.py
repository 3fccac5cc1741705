"""People who come at another time: their recorded paths, shifted, among the people who are there then.

Shifted walkers have not seen those whom they now meet, so strangers come too close. A step aside from the nearest
stranger corrects it; its strength is calibrated at the site, where the right answer is known: shifted by half a minute,
people must come as close to strangers as they did.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.whatif.arrays import Bools, Floats, Ints
from vsd_analytics.whatif.closeness import is_close_to_any, near_strangers, nearest_strangers, stepped_aside
from vsd_analytics.whatif.floor_records import FloorRecords

SHIFTS_S: Final = (-40.0, -20.0, 20.0, 40.0)
STRENGTHS: Final = tuple(k / 20 for k in range(13))
"""Shares of the lacking distance that were tried: 0 to 0.6."""
BEYOND_M: Final = 0.5
"""People begin to step aside this far beyond the distance that counts."""
BLOCK_S: Final = 600.0
MOST_RECORDS: Final = 40_000
"""Records that are shifted, about; of more, some blocks of time are left out."""
MIN_CLOSE_S: Final = 15.0
"""Areas with less time too close than this say nothing."""


@dataclass(frozen=True, slots=True)
class StepAside:
    """How strongly people step aside at a site.

    Attributes:
        strength: Share of the lacking distance.
        ratio: Time too close to strangers of shifted people over that recorded, with this strength; None where too
            little time says nothing.
        ratio_without: The same of people who do not step aside.
        close_s: Person-seconds too close to strangers that it rests on.
    """

    strength: float
    ratio: float | None
    ratio_without: float | None
    close_s: float


@dataclass(frozen=True, slots=True)
class ShiftedPeople:
    """Records of people at another time: arrays of shape (n_shifted,).

    Attributes:
        rows: The records that were shifted.
        frame: The frame of the same camera at the new time.
        x_m, y_m: Where they are.
    """

    rows: Ints
    frame: Ints
    x_m: Floats
    y_m: Floats


def shifted(records: FloorRecords, chosen: Bools, shift_s: Floats | float) -> ShiftedPeople:
    """Return records at another time, in the camera's frame that is nearest to it; those without one are left out.

    Args:
        records: The records.
        chosen: Which are shifted, shape (n_records,).
        shift_s: By how many seconds, one number or of shape (n_records,).
    """
    rows = np.flatnonzero(chosen)
    moved = np.full(rows.size, -1)
    later = records.t_s[rows] + (shift_s[rows] if isinstance(shift_s, np.ndarray) else shift_s)
    for camera, (t_s, frames) in enumerate(records.frames_of_cameras):
        here = np.flatnonzero(records.camera[rows] == camera)
        if not here.size or not t_s.size:
            continue
        wanted = later[here]
        right = (
            np.clip(np.searchsorted(t_s, wanted), 1, max(t_s.size - 1, 1)) if t_s.size > 1 else np.zeros(here.size, int)
        )
        left = np.maximum(right - 1, 0)
        nearest = np.where(np.abs(t_s[left] - wanted) <= np.abs(t_s[right] - wanted), left, right)
        is_there = np.abs(t_s[nearest] - wanted) <= records.interval_s / 2 + 1e-6
        moved[here[is_there]] = frames[nearest[is_there]]
    keep = moved >= 0
    return ShiftedPeople(rows[keep], moved[keep], records.x_m[rows[keep]], records.y_m[rows[keep]])


def halves(records: FloorRecords) -> Bools:
    """Return which records lie in every second ten minutes: half of the time, to calibrate on; the rest checks it."""
    return np.asarray(records.t_s // BLOCK_S % 2 == 0)


def step_aside(records: FloorRecords, chosen: Bools, *, within_m: float) -> StepAside:
    """Return the strength with which shifted people come as close to strangers as they did when they were there.

    Everybody chosen is shifted by each of `SHIFTS_S` and meets everybody else as recorded.

    Args:
        records: The site's records.
        chosen: Those to calibrate on (`halves`), shape (n_records,).
        within_m: The distance that counts.
    """
    every = -(-int(chosen.sum()) // MOST_RECORDS) or 1
    rows = np.flatnonzero(chosen)
    rows = rows[records.t_s[rows] // BLOCK_S // 2 % every == 0]
    records, chosen = _beside(records, rows)
    layers = [Meetings(records, shifted(records, chosen, shift_s), within_m=within_m) for shift_s in SHIFTS_S]
    recorded = sum(layer.recorded_s for layer in layers)
    if recorded < MIN_CLOSE_S * len(SHIFTS_S):
        return StepAside(0.0, None, None, recorded / len(SHIFTS_S))
    ratios = [sum(layer.close_s(strength) for layer in layers) / recorded for strength in STRENGTHS]
    best = int(np.argmin(np.abs(np.log(np.maximum(ratios, 1e-9)))))
    return StepAside(STRENGTHS[best], ratios[best], ratios[0], recorded / len(SHIFTS_S))


def _beside(records: FloorRecords, rows: Ints) -> tuple[FloorRecords, Bools]:
    """Return the records of the time of some and of that to which these are shifted, and which of them are the some."""
    if not rows.size:
        return records.part(rows), np.zeros(0, np.bool_)
    reach_s = max(SHIFTS_S) - min(SHIFTS_S)
    span = ((records.t_s - records.t_s.min()) / reach_s).astype(np.int64)
    is_here = np.zeros(int(span.max()) + 3, np.bool_)
    for beside in (0, 1, 2):
        is_here[span[rows] + beside] = True
    near = np.flatnonzero(is_here[span + 1])
    chosen = np.zeros(near.size, np.bool_)
    chosen[np.searchsorted(near, rows)] = True
    return records.part(near), chosen


class Meetings:
    """Shifted people and the strangers whom they meet.

    Args:
        records: Everybody as recorded.
        layer: The shifted people.
        within_m: The distance that counts.
    """

    def __init__(self, records: FloorRecords, layer: ShiftedPeople, *, within_m: float) -> None:
        self._within_m = within_m
        self._others = records.x_m, records.y_m
        self._places = layer.x_m, layer.y_m
        rows = layer.rows
        is_with = records.track[rows], records.company[rows], records.track, records.company
        self._weight_s = (records.weight_s * records.is_owned)[rows]
        frames, everyone = records.frames, np.arange(rows.size)
        reach_m = within_m + STRENGTHS[-1] * (within_m + BEYOND_M)
        self._pairs = near_strangers(
            frames, everyone, layer.frame, self._places, self._others, is_with, within_m=reach_m
        )  # fmt: skip
        self._nearest = nearest_strangers(self._pairs, self._places, self._others)
        met = near_strangers(
            frames, everyone, records.frame[rows], self._places, self._others, is_with, within_m=within_m
        )  # fmt: skip
        self.recorded_s = float(self._weight_s[np.unique(met[0])].sum())
        """Person-seconds too close to strangers when they were there."""

    def places(self, strength: float) -> tuple[Floats, Floats]:
        """Return x and y of the shifted people after they step aside."""
        reach_m = self._within_m + BEYOND_M
        return stepped_aside(self._nearest, self._places, self._others, strength=strength, reach_m=reach_m)

    def is_close(self, strength: float) -> Bools:
        """Return which of them are too close to strangers after they step aside."""
        return is_close_to_any(self._pairs, self.places(strength), self._others, within_m=self._within_m)

    def close_s(self, strength: float) -> float:
        """Return the person-seconds that they are too close to strangers after they step aside."""
        return float(self._weight_s[self.is_close(strength)].sum())
