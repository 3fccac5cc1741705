"""What of people measures a camera: upright bodies as segments of known height, and how far walkers get."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import ANKLES, HEAD, NECK, Array, People

EDGE_PX: Final = 5.0
"""A box this near to the picture's edge is cut off there."""
PARTS_OF_TRACK: Final = 12
MAX_ROWS: Final = 3000
LINK_LENGTHS, LINK_CHANGE = 0.5, 0.2
"""Half a body length is what somebody walks in .6 s; a body's length in the picture changes by less than a fifth."""
LARGEST: Final = np.iinfo(np.int64).max
MAX_GAP, STAY_LENGTHS = 6, 0.15
"""Somebody who was missed for some frames is linked if the feet have hardly moved."""


@dataclass(frozen=True, slots=True)
class Body:
    """Two marks of an upright person and where they are, population means in metres.

    Attributes:
        low_m: Height of the lower mark.
        high_m: Height of the upper mark.
        depth_m: How far the marks are from the person's vertical axis: the lower one towards the camera; the upper one
            away from it where the camera looks down on it, towards it otherwise. 0 for joints.
        depth_sd_m: How well that is known.
    """

    low_m: float
    high_m: float
    depth_m: float
    depth_sd_m: float


BOX: Final = Body(0.0, 1.76, 0.15, 0.05)
"""A box around a walking adult: 1.70 m of body, as the paper takes it, and 6 cm of shoes, hair and margin. The depth is
half of that of a body between two steps. Annotated boxes of known cameras have 1.78 to 1.80 m (docs/engine.md)."""
NECK_ALONE: Final = Body(0.077, 1.40, 0.0, 0.001)
JOINTS: Final = Body(0.077, 1.497, 0.0, 0.001)
"""Ankles, neck (between the shoulders), and the middle of neck and head: .039, .818 and .874 of 1.70 m (Drillis and
Contini 1966; eyes .936, nose and ears a little less), and 1 cm of sole. Two upper marks depend less on either."""


@dataclass(frozen=True, slots=True)
class Sightings:
    """Segments from a lower to an upper mark of upright people, in the picture.

    Attributes:
        body: What the marks are.
        low: Lower marks in pixels, shape (n, 2).
        high: Upper marks in pixels, shape (n, 2).
        has_lean: Whether the columns of both marks were seen apart: for joints, not for boxes.
        who: Number of the person, shape (n,); without track ids of a part of its walk (`tracklets`).
        frame: Shape (n,).
        has_tracks: Whether `who` comes from the detector's track ids.
    """

    body: Body
    low: Array
    high: Array
    has_lean: bool
    who: NDArray[np.intp]
    frame: NDArray[np.int64]
    has_tracks: bool

    @property
    def length_px(self) -> Array:
        """Return the length of each segment, shape (n,)."""
        return np.asarray(np.linalg.norm(self.high - self.low, axis=1))

    def rows(self, chosen: NDArray[np.intp]) -> Sightings:
        """Return some of the rows."""
        return replace(
            self, low=self.low[chosen], high=self.high[chosen], who=self.who[chosen], frame=self.frame[chosen]
        )


def sightings(people: People, *, size_px: tuple[int, int]) -> Sightings:
    """Return the whole upright people of a picture: joints where most persons have ankles and neck, else boxes.

    Boxes that the picture's edge cuts off are left out.
    """
    body, ankles, upper = _joint_marks(people)
    has_both = np.isfinite(ankles).all(axis=1) & np.isfinite(upper).all(axis=1)
    box = people.box
    with np.errstate(invalid="ignore"):
        is_whole = (box[:, :2] > EDGE_PX).all(axis=1) & (box[:, 2:] < np.array(size_px) - EDGE_PX).all(axis=1)
    uses_joints = has_both.sum() > is_whole.sum() / 2
    if uses_joints:
        low, high, chosen = ankles, upper, has_both
    else:
        middle = (box[:, 0] + box[:, 2]) / 2
        body, chosen = BOX, is_whole
        low, high = np.column_stack([middle, box[:, 3]]), np.column_stack([middle, box[:, 1]])
    rows = np.flatnonzero(chosen & (np.linalg.norm(high - low, axis=1) > 0))
    tracks = people.track[rows]
    has_tracks = bool(len(rows)) and all(track is not None for track in tracks)
    if has_tracks:
        who = np.unique(tracks.astype(str), return_inverse=True)[1]
    else:
        who = tracklets(low[rows], np.linalg.norm(high[rows] - low[rows], axis=1), people.frame[rows])
    return Sightings(
        body, low[rows], high[rows], bool(uses_joints), who.astype(np.intp), people.frame[rows], has_tracks
    )


def _joint_marks(people: People) -> tuple[Body, Array, Array]:
    """Return what the marks are, the middle of the ankles, and the upper mark: with the head where most have one."""
    ankles = people.joints[:, ANKLES].mean(axis=1)
    neck = people.joints[:, NECK]
    head = people.joints[:, HEAD]
    n = np.isfinite(head).all(axis=2).sum(axis=1)
    middle = np.nansum(head, axis=1) / np.where(n > 0, n, np.nan)[:, None]
    has_both = np.isfinite(ankles).all(axis=1) & np.isfinite(neck).all(axis=1)
    if (has_both & (n > 0)).sum() < has_both.sum() / 2:
        return NECK_ALONE, ankles, neck
    return JOINTS, ankles, (neck + middle) / 2


def tracklets(uv: Array, length_px: Array, frame: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return a number for each row that rows of the same person in neighbouring frames share, shape (n,).

    Two rows are linked when each is the nearest to the other in the two frames, within `LINK_LENGTHS` body lengths and
    of about the same length. Where somebody passes close by the link breaks, and a new number begins. Then those who
    stay within `STAY_LENGTHS` and were missed in up to `MAX_GAP` - 1 frames are linked: whoever stands or sits there
    would else count as many persons.

    Args:
        uv: Feet in pixels, shape (n, 2).
        length_px: Length of each body, shape (n,).
        frame: In order, shape (n,).
    """
    who = np.arange(len(uv))
    starts = np.flatnonzero(np.r_[True, frame[1:] != frame[:-1]]) if len(frame) else np.empty(0, dtype=np.intp)
    spans = [np.arange(*span) for span in zip(starts, [*starts[1:], len(frame)], strict=False)]  # none without rows
    is_last, is_first = np.ones(len(uv), dtype=bool), np.ones(len(uv), dtype=bool)
    for gap in range(1, MAX_GAP + 1):
        within = LINK_LENGTHS if gap == 1 else STAY_LENGTHS
        for before, after in zip(spans, spans[gap:], strict=False):
            a, b = before[is_last[before]], after[is_first[after]]
            if not (len(a) and len(b)):
                continue
            apart = np.linalg.norm(uv[a][:, None] - uv[b][None], axis=2)
            size = np.sqrt(length_px[a][:, None] * length_px[b][None])
            alike = np.abs(np.log(length_px[a][:, None] / length_px[b][None])) < LINK_CHANGE
            apart = np.where(alike & (apart < within * size), apart / size, np.inf)
            to, back = apart.argmin(axis=1), apart.argmin(axis=0)
            rows = np.arange(len(to))
            linked = (back[to] == rows) & np.isfinite(apart[rows, to])
            is_last[a[linked]], is_first[b[to[linked]]] = False, False
            who[b[to[linked]]] = a[linked]
    for row in np.flatnonzero(~is_first).tolist():  # in order of frames, so the one before has its number already
        who[row] = who[who[row]]
    return np.unique(who, return_inverse=True)[1].astype(np.intp)


def n_persons(seen: Sightings) -> int:
    """Return how many different persons there are, where a broken track counts once.

    Two track ids are one person where the second begins as the first ends, at the place that `tracklets` links.
    """
    walk = tracklets(seen.low, seen.length_px, seen.frame)
    order = np.lexsort((seen.frame, walk))
    who, frame = seen.who[order], seen.frame[order]
    first, last = (np.full(int(seen.who.max(initial=-1)) + 1, limit) for limit in (LARGEST, -1))
    np.minimum.at(first, who, frame)
    np.maximum.at(last, who, frame)
    joins = (walk[order][1:] == walk[order][:-1]) & (who[1:] != who[:-1])
    joins &= (frame[:-1] == last[who[:-1]]) & (frame[1:] == first[who[1:]])
    return len(first) - len({*who[1:][joins].tolist()})


def n_at_once(seen: Sightings) -> int:
    """Return how many people are in the frame with most of them: so many are certainly different."""
    return int(np.unique(seen.frame, return_counts=True)[1].max(initial=0))


def thinned(seen: Sightings) -> Sightings:
    """Return at most `PARTS_OF_TRACK` rows of each person and `MAX_ROWS` in all.

    A row is the median of a part of the walk, so that the error of single boxes goes away: a box that ends too low is
    too high as well, which would look like a nearer person and pull the horizon.
    """
    order = np.lexsort((seen.frame, seen.who))
    size = np.bincount(seen.who)
    rank = np.arange(len(order)) - np.repeat(np.cumsum(size) - size, size)
    n_parts = np.minimum(size, PARTS_OF_TRACK)[seen.who[order]]
    part = seen.who[order] * PARTS_OF_TRACK + rank * n_parts // size[seen.who[order]]
    _, begin, length = np.unique(part, return_index=True, return_counts=True)
    middle = begin + length // 2
    marks = np.column_stack([seen.low, seen.high])[order]
    for column in marks.T:
        column[:] = column[np.lexsort((column, part))]  # in order within each part
    some = middle[:: max(1, -(-len(middle) // MAX_ROWS))]
    chosen = seen.rows(order[some])
    return replace(chosen, low=marks[some, :2], high=marks[some, 2:])


@dataclass(frozen=True, slots=True)
class Steps:
    """Stretches of equal time along tracks: rows of sightings where each begins and ends, and its person."""

    begin: NDArray[np.intp]
    end: NDArray[np.intp]
    who: NDArray[np.intp]


def steps(seen: Sightings, *, n_frames: int) -> Steps:
    """Return the stretches of exactly `n_frames` frames along tracks; those of one person do not overlap."""
    order = np.lexsort((seen.frame, seen.who))
    span = int(np.ptp(seen.frame)) + n_frames + 1 if len(order) else 1
    key = seen.who[order].astype(np.int64) * span + seen.frame[order] - (seen.frame.min() if len(order) else 0)
    at = np.searchsorted(key, key + n_frames)
    there = np.flatnonzero((at < len(key)) & (key[np.minimum(at, len(key) - 1)] == key + n_frames))
    begin: list[int] = []
    free_from = -1
    for row in there.tolist():  # greedy: the next stretch begins where the last one ended
        if key[row] >= free_from:
            begin.append(row)
            free_from = key[row] + n_frames
    first = np.array(begin, dtype=np.intp)
    return Steps(order[first], order[at[first]], seen.who[order[first]])
