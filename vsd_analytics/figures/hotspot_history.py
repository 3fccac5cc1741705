"""The same hotspot in one week and the next: who is new, who persists, who is gone, who is watched after a change.

The windows are walked from the oldest to the newest. A hotspot takes over the id of a known one when they share cells,
or their middles are at most 2 m apart; most shared cells first, then the nearest, each id once. Ids that were gone are
known as well. Any other gets a new id: the floor's, and the square metre of its middle, such as `ground-x6-y5` (`-2`
when taken). A hotspot that splits in two is not new: both parts have the date of the old one, and one has its id. Where
two merge into one, none is reported as gone. Where the log names a change and too few days have passed since, a hotspot
is watched: it is neither gone nor present, and has the same id until the test can decide. So an id follows from stored
data alone, and stays while windows reach back to it, or it does not move.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.stats.hotspots import Hotspots, Spot

SAME_PLACE_M: Final = 2.0
"""Hotspots of two windows whose middles are at most this far apart are one."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What a window showed.

    Attributes:
        last: Its last day.
        result: The test's cells and hotspots; the cells of all windows are the same ones.
        is_watched: Cells that a logged change left with too few days to be tested; None = none.
    """

    last: date
    result: Hotspots
    is_watched: NDArray[np.bool_] | None = None


@dataclass(frozen=True, slots=True)
class PastSpot:
    """A hotspot of an earlier window: its id, that window's place among the windows, and its label there."""

    spot_id: str
    window: int
    label: int


@dataclass(frozen=True, slots=True)
class Identity:
    """Who a hotspot of the newest window is; attributes as of `FloorSpot`."""

    spot_id: str
    state: Literal["new", "persisting"] | None
    since: date
    is_since_first: bool


@dataclass(frozen=True, slots=True)
class History:
    """The newest window, as an index.

    Attributes:
        now: Identity by label of its hotspots.
        resolved: Hotspots of the window before, or watched in it, that are gone: none of their cells is hot now.
        watching: Hotspots in or near which something was changed, with too few days since to decide.
    """

    now: Mapping[int, Identity]
    resolved: tuple[PastSpot, ...]
    watching: tuple[PastSpot, ...] = ()


@dataclass(slots=True, eq=False)
class _Known:
    spot_id: str
    inside: NDArray[np.bool_]
    middle: tuple[float, float]
    past: PastSpot
    since: int
    seen: int

    @property
    def is_hot_then(self) -> bool:
        """Return whether it was hot, not watched, in the window in which it was last seen."""
        return self.past.window == self.seen


def follow(windows: Sequence[Found], *, floor_id: str, cell_m: float, first_cell: tuple[int, int]) -> History:
    """Return who the hotspots of the newest window are (rules: this module).

    Args:
        windows: Oldest first; those in which nothing could be tested are left out.
        floor_id: For new ids.
        cell_m: Side of a cell.
        first_cell: cx and cy of the first column and row.
    """
    known: dict[str, _Known] = {}
    for k, window in enumerate(windows):
        earlier = list(known.values())
        label = window.result.cells.label
        n_labels = int(label.max(initial=0)) + 1
        n_shared = {one.spot_id: np.bincount(label[one.inside], minlength=n_labels) for one in earlier}
        names = _named(window.result, earlier, n_shared, cell_m=cell_m)
        for spot in window.result.spots:
            spot_id = names.get(spot.label) or _new_id(spot, known, floor_id=floor_id, cell_m=cell_m, first=first_cell)
            inside = label == spot.label
            stood = [
                one.since
                for one in earlier
                if one.seen == k - 1 and (one.spot_id == spot_id or n_shared[one.spot_id][spot.label])
            ]
            middle = (spot.row, spot.column)
            past = PastSpot(spot_id, k, spot.label)
            known[spot_id] = _Known(spot_id, inside, middle, past, since=min(stood, default=k), seen=k)
        for one in earlier:
            is_here = known[one.spot_id].seen == k or n_shared[one.spot_id][1:].any()
            if one.seen == k - 1 and not is_here and _is_watched(one, window):
                known[one.spot_id].seen = k
    if not windows:
        return History({}, ())
    newest = len(windows) - 1
    now = {
        one.past.label: Identity(
            one.spot_id,
            None if newest == 0 else "new" if one.since == newest else "persisting",
            windows[one.since].last,
            one.since == 0,
        )
        for one in known.values()
        if one.seen == newest and one.is_hot_then
    }
    is_hot = windows[-1].result.cells.is_hot
    gone = [one for one in known.values() if one.seen == newest - 1 and not (one.inside & is_hot).any()]
    watched = [one for one in known.values() if one.seen == newest and not one.is_hot_then]
    resolved, watching = (
        tuple(sorted((one.past for one in spots), key=lambda p: p.spot_id)) for spots in (gone, watched)
    )
    return History(now, resolved, watching)


def _is_watched(one: _Known, window: Found) -> bool:
    return window.is_watched is not None and bool((one.inside & window.is_watched).any())


def _named(
    result: Hotspots, known: Sequence[_Known], n_shared: Mapping[str, NDArray[np.int64]], *, cell_m: float
) -> dict[int, str]:
    """Return the ids that hotspots take over, by label, given how many cells each known one shares with each label."""
    pairs = []
    for spot in result.spots:
        for one in known:
            n = int(n_shared[one.spot_id][spot.label])
            away_m = cell_m * float(np.hypot(spot.row - one.middle[0], spot.column - one.middle[1]))
            if n or away_m <= SAME_PLACE_M:
                pairs.append((-n, away_m, one.spot_id, spot.label))
    names: dict[int, str] = {}
    for _, _, spot_id, label in sorted(pairs):
        if label not in names and spot_id not in names.values():
            names[label] = spot_id
    return names


def _new_id(spot: Spot, taken: Mapping[str, _Known], *, floor_id: str, cell_m: float, first: tuple[int, int]) -> str:
    x, y = (math.floor((i + at + 0.5) * cell_m) for i, at in zip(first, (spot.column, spot.row), strict=True))
    name = f"{floor_id}-x{x}-y{y}"
    return next(i for i in (name, *(f"{name}-{k}" for k in range(2, len(taken) + 3))) if i not in taken)
