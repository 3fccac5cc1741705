"""All sightings of a recording on the floor, with what its tracks teach: where they begin and end, and how people walk.

A link between two frames competes with the end of one track and the begin of another, which are likely at the border of
the picture and where tracks of the same recording begin and end. How people usually walk in a place is learnt from the
same tracks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from vsd_analytics.engine.links import NO_LINK, reversed_links, track_numbers
from vsd_analytics.engine.people import Array
from vsd_analytics.engine.walks import WALK_M_S, Rows, Velocities, Walks, joined_velocity

OUTSIDE_M2: Final = 0.05
"""Persons per square metre beyond the border of the picture, who may step into it."""
BEGIN_M2_S: Final = 0.002
"""Tracks that begin inside the picture, per square metre and second, before any are known."""
END_S: Final = 0.01
"""Share of tracks that end inside the picture, per second."""
LEAVE: Final = 0.7
"""Share of those who could step out of the picture that do."""
KNOWN_S: Final = 100.0
"""After so many seconds the begins that were found in a place count as much as what is assumed."""
KNOWN_PERSON_S: Final = 20.0
"""And after so many seconds of persons in a place the ends."""
KNOWN_PERSONS: Final = 10.0
"""After so many persons the velocities found in a place count as much as what is assumed."""
CELL_M: Final = 1.0
"""Begins and ends are counted in squares of three such cells."""


@dataclass(frozen=True, slots=True)
class FloorSightings:
    """All sightings in order of time.

    What begins and ends of tracks cost at each (-2 log of their likelihood), and which velocities are usual there.
    """

    xy: Array
    covariance: Array
    frame: Rows
    time_s: Array
    begin: Array
    end: Array
    usual: Velocities

    @classmethod
    def of(cls, xy: Array, covariance: Array, frame: Rows, time_s: Array, border_s: Array) -> FloorSightings:
        """Return sightings with begins and ends as assumed before any track is known; arguments as of `follow`."""
        step_s = np.diff(time_s, prepend=np.nan, append=np.nan)

        def crossing(step: Array) -> Array:
            """Return the chance that somebody of unknown direction crosses the border in a time."""
            with np.errstate(invalid="ignore"):
                return np.asarray(1 - np.prod(ndtr(border_s / step[:, None]), axis=1))

        since, until = step_s[frame], step_s[frame + 1]
        begin = np.nan_to_num(BEGIN_M2_S * since + OUTSIDE_M2 * crossing(since), nan=1.0)
        end = np.nan_to_num(np.minimum(END_S * until + LEAVE * crossing(until), 0.95), nan=1.0)
        usual = Velocities.anywhere(len(xy))
        return cls(xy, covariance, frame, time_s, -2 * np.log(begin), -2 * np.log(end), usual)

    def with_ends(self, before: Rows) -> FloorSightings:
        """Return the same with begins and ends as the tracks found have them; no sighting counts for itself."""
        n_frames = len(self.time_s)
        if n_frames < 2:
            return self
        step_s = (self.time_s[-1] - self.time_s[0]) / (n_frames - 1)
        begins = (before == NO_LINK) & (self.frame > 0)
        ends = self.frame < n_frames - 1
        ends[before[before != NO_LINK]] = False
        cells = np.floor(self.xy / CELL_M).astype(np.int64)
        near = _Counts(cells)
        weight = KNOWN_S / step_s
        begin = weight * np.exp(-self.begin / 2) + (near.of(begins) - begins) / (3 * CELL_M) ** 2
        weight_end = KNOWN_PERSON_S / step_s
        end = weight_end * np.exp(-self.end / 2) + near.of(ends) - ends
        share = np.minimum(end / (weight_end + near.of(np.ones(len(ends)))), 0.95)
        return replace(
            self,
            begin=np.where(self.frame > 0, -2 * np.log(begin / (weight + n_frames)), self.begin),
            end=np.where(self.frame < n_frames - 1, -2 * np.log(share), self.end),
        )

    def pasts(self, before: Rows) -> Walks:
        """Return what each sighting and all earlier ones of its track say of the walk at its instant."""
        walks, anywhere = Walks.unseen(len(before)), Velocities.anywhere(len(before))
        for rows in self.rows():
            new, old = rows[before[rows] == NO_LINK], rows[before[rows] != NO_LINK]
            walks.put(new, Walks.begun(self.xy[new], self.covariance[new], anywhere[new]))
            if len(old):
                walk = walks[before[old]].after(self.time_s[self.frame[old]] - self.time_s[self.frame[before[old]]])
                walks.put(old, walk.seen(self.xy[old], self.covariance[old], anywhere[old]))
        return walks

    def futures(self, before: Rows) -> Walks:
        """Return what each sighting and all later ones of its track say of the walk at its instant."""
        return self.backward().pasts(reversed_links(before)).turned()

    def with_velocities(self, before: Rows, pasts: Walks, futures: Walks) -> FloorSightings:
        """Return the same with velocities as usual in each place as those of the tracks found there.

        A person counts once in a cell, however long there, and never for itself.
        """
        b = np.flatnonzero(before != NO_LINK)
        if not len(b):
            return self
        a = before[b]
        step_s = self.time_s[self.frame[b]] - self.time_s[self.frame[a]]
        velocities = joined_velocity(pasts[a].after(step_s), futures[b])
        velocity, error = np.zeros((len(before), 2)), np.zeros((len(before), 2, 2))
        for rows in (a, b):  # the first of a track has the velocity of its second
            velocity[rows], error[rows] = velocities.mean, velocities.covariance
        is_known = np.zeros(len(before), dtype=bool)
        is_known[a] = is_known[b] = True
        cells = np.floor(self.xy / CELL_M).astype(np.int64)
        cells_of_track = np.column_stack([track_numbers(before), cells])
        _, cell_of_row, times = np.unique(cells_of_track, axis=0, return_inverse=True, return_counts=True)
        weight = is_known / times[cell_of_row.reshape(-1)]
        everybody, own = _Counts(cells), _Counts(cells_of_track)

        def others(value: Array) -> Array:
            return everybody.of(weight * value) - own.of(weight * value)

        n = KNOWN_PERSONS + others(np.ones(len(before)))
        mean = np.column_stack([others(velocity[:, i]) for i in (0, 1)]) / n[:, None]
        square = velocity[:, :, None] * velocity[:, None, :] + error
        xx, xy, yy = (others(square[:, i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
        usual = KNOWN_PERSONS * WALK_M_S**2
        second = np.stack([xx + usual, xy, xy, yy + usual], axis=1).reshape(-1, 2, 2) / n[:, None, None]
        return replace(self, usual=Velocities(mean, second - mean[:, :, None] * mean[:, None, :]))

    def backward(self) -> FloorSightings:
        """Return the sightings with time reversed."""
        frame = len(self.time_s) - 1 - self.frame[::-1]
        time_s = self.time_s[-1] - self.time_s[::-1] if len(self.time_s) else self.time_s
        usual = self.usual[np.arange(len(frame))[::-1]].backward()
        return FloorSightings(
            self.xy[::-1], self.covariance[::-1], frame, time_s, self.end[::-1], self.begin[::-1], usual
        )

    def rows(self) -> list[Rows]:
        """Return the sightings of each frame."""
        edges = np.searchsorted(self.frame, np.arange(1, len(self.time_s)))
        return np.split(np.arange(len(self.frame)), edges)


class _Counts:
    """How many sightings lie in the three by three cells around each."""

    def __init__(self, cells: NDArray[np.int64]) -> None:
        unique, self._of = np.unique(cells, axis=0, return_inverse=True)
        self._of = self._of.reshape(-1)
        index = {tuple(cell): row for row, cell in enumerate(unique.tolist())}
        near = [
            (row, index[other])
            for (*who, x, y), row in index.items()
            for other in ((*who, x + dx, y + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1))
            if other in index
        ]
        self._row, self._near = np.array(near, dtype=np.intp).reshape(-1, 2).T

    def of(self, counted: Array | NDArray[np.bool_]) -> Array:
        """Return the sum of a value over the sightings around each."""
        here = np.bincount(self._of, counted)
        return np.asarray(np.bincount(self._row, here[self._near]), dtype=np.float64)[self._of]
