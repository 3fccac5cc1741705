"""Track ids while people are seen: each picture is linked to those of the last seconds, and no id changes afterwards.

`tracker` looks forward and backward over a whole recording and gives better ids. This one knows no future: its links
are those of the first sweep there.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import count
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.floor_sightings import FloorSightings
from vsd_analytics.engine.link_search import LinkSearch
from vsd_analytics.engine.links import NO_LINK
from vsd_analytics.engine.people import Array, People
from vsd_analytics.engine.tracker import FOOT_PX, FOOT_SHARE

MEMORY_S: Final = 6.0
"""Somebody not seen for longer gets another id."""


@dataclass(frozen=True, slots=True)
class _Sightings:
    """People of one picture with places."""

    xy: Array
    covariance: Array
    ids: list[str]
    time_s: float


@dataclass
class LiveTracker:
    """Follows the people of one camera."""

    _past: list[_Sightings] = field(default_factory=list)
    _start_ms: int | None = None
    _numbers: count[int] = field(default_factory=lambda: count(1))

    def with_ids(self, people: People, xy: Array, per_px: Array, *, ms: int) -> People:
        """Return the people of one picture with track ids, `START-N` as `tracker.tracked` has them.

        Args:
            people: Of the picture.
            xy: Floor metres, NaN where unknown, shape (n, 2).
            per_px: Derivative of the places by pixels, metres per pixel, shape (n, 2, 2).
            ms: UTC milliseconds.
        """
        self._start_ms = ms if self._start_ms is None else self._start_ms
        outline = people.outline
        sd_px = np.maximum(FOOT_PX, FOOT_SHARE * (outline[:, 3] - outline[:, 1]))
        covariance = per_px @ np.swapaxes(per_px, 1, 2) * (sd_px**2)[:, None, None]
        known = np.flatnonzero(np.isfinite(xy).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)))
        time_s = (ms - self._start_ms) / 1000
        if self._past and time_s <= self._past[-1].time_s:  # the clock was set back
            self._past.clear()
        self._past = [past for past in self._past if time_s - past.time_s <= MEMORY_S]
        ids: list[str] = [""] * len(people)
        seen = self._linked(_Sightings(xy[known], covariance[known], [], time_s))
        for row, name in zip(known.tolist(), seen.ids, strict=True):
            ids[row] = name
        self._past.append(seen)
        track: NDArray[np.object_] = np.empty(len(people), dtype=object)
        track[:] = [name or self._new_id() for name in ids]
        return replace(people, track=track)

    def _linked(self, now: _Sightings) -> _Sightings:
        """Return the sightings of now with the ids of those before them, or new ones."""
        every = [*self._past, now]
        before_ids = [name for past in self._past for name in past.ids]
        n_now = len(now.xy)
        if not before_ids or not n_now:
            return replace(now, ids=[self._new_id() for _ in range(n_now)])
        xy = np.concatenate([one.xy for one in every])
        frame = np.repeat(np.arange(len(every)), [len(one.xy) for one in every])
        sightings = FloorSightings.of(
            xy,
            np.concatenate([one.covariance for one in every]),
            frame,
            np.array([one.time_s for one in every]),
            np.full((len(xy), 4), np.inf),
        )
        before = LinkSearch(sightings).found()[-n_now:]
        return replace(now, ids=[self._new_id() if row == NO_LINK else before_ids[row] for row in before.tolist()])

    def _new_id(self) -> str:
        return f"{self._start_ms:x}-{next(self._numbers)}"
