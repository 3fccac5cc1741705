"""Track ids for a detector that has none: people followed on the floor, forward and backward in time by turns.

A foot point far away is uncertain along the view and certain across it, so its covariance is mapped through the
homography (Yi and others, UCMCTrack, AAAI 2024). Each sweep learns from the tracks of the last one: where people enter
and leave, and how they walk (`floor_sightings`). Then it looks for more likely links (`link_search`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vsd_analytics.engine.body import feet
from vsd_analytics.engine.calibration_error import floor_per_px
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.floor_sightings import FloorSightings
from vsd_analytics.engine.link_search import LinkSearch
from vsd_analytics.engine.links import reversed_links, track_numbers
from vsd_analytics.engine.people import Array, People
from vsd_analytics.engine.walks import WALK_M_S, Rows
from vsd_analytics.geometry.homography import to_floor

FOOT_SHARE: Final = 0.05
"""Error of a foot point in body heights of the picture, as in UCMCTrack."""
FOOT_PX: Final = 1.0
"""And at least so many pixels."""
NOISES: Final = (2.0, 1.6, 1.2, 0.8, 0.4, 0.0, 0.0)
"""After the first sweep, forward: backward and forward by turns, each with so much noise (as `LinkSearch` has it).

By a noise of 2 links are chosen as often as they are likely. The last two sweeps have none.
"""
SEED: Final = 20210
RARE_S: Final = 0.2
"""With more frequent frames one sweep backward follows: all else costs time, and ids get no better."""


def tracked(
    people: People, *, homography: ArrayLike, picture_px: tuple[int, int] | None, ts_ms: NDArray[np.int64]
) -> People:
    """Return the people with track ids: `START-N`, the file's first instant in hexadecimal milliseconds and a number.

    Ids of files that begin at different instants therefore differ. A person without a place on the floor has an id of
    its own.

    Args:
        people: As detected; their ids, if any, are left aside.
        homography: 3x3, pixels to floor metres.
        picture_px: Width and height of the picture.
        ts_ms: UTC milliseconds of each of `people.frames`.
    """
    uv = floor_points(people, homography=homography, picture_px=picture_px)
    xy = to_floor(homography, uv, picture_px=picture_px)
    per_px = floor_per_px(homography, uv, picture_px=picture_px)
    return tracked_at(people, xy, per_px, picture_px=picture_px, ts_ms=ts_ms)


def tracked_at(
    people: People, xy: Array, per_px: Array, *, picture_px: tuple[int, int] | None, ts_ms: NDArray[np.int64]
) -> People:
    """Return the people with track ids, as `tracked`, from places on the floor.

    Args:
        people: As detected.
        xy: Floor metres, shape (n, 2).
        per_px: Derivative of the places by pixels, metres per pixel, shape (n, 2, 2).
        picture_px: Width and height of the picture; None = nobody knows where it ends.
        ts_ms: UTC milliseconds of each of `people.frames`.
    """
    outline = people.outline
    sd_px = np.maximum(FOOT_PX, FOOT_SHARE * (outline[:, 3] - outline[:, 1]))
    covariance = per_px @ np.swapaxes(per_px, 1, 2) * (sd_px**2)[:, None, None]
    border_s = None if picture_px is None else _border_s(feet(people), per_px, picture_px)
    rows = np.searchsorted(people.frames, people.frame)
    return with_ids(people, follow(xy, covariance, rows, ts_ms / 1000, border_s=border_s), ts_ms=ts_ms)


def with_ids(people: People, numbers: NDArray[np.int64], *, ts_ms: NDArray[np.int64]) -> People:
    """Return the people with ids of track numbers: `START-N`, so that those of two files never meet."""
    start = int(ts_ms[0]) if len(ts_ms) else 0
    ids = np.empty(len(people), dtype=object)
    ids[:] = [f"{start:x}-{number}" for number in numbers.tolist()]
    return replace(people, track=ids)


def _border_s(uv: Array, per_px: Array, picture_px: tuple[int, int]) -> Array:
    """Return how many seconds of usual walking it is to each side of the picture, shape (n, 4)."""
    a, b, c, d = per_px[:, 0, 0], per_px[:, 0, 1], per_px[:, 1, 0], per_px[:, 1, 1]
    px_m = np.column_stack([np.hypot(d, b), np.hypot(c, a)]) / np.abs(a * d - b * c)[:, None]
    return np.concatenate([uv, np.array(picture_px) - uv], axis=1) / np.tile(WALK_M_S * px_m, 2)


def follow(
    xy: Array, covariance: Array, frame: NDArray[np.intp], time_s: Array, *, border_s: Array | None = None
) -> NDArray[np.int64]:
    """Return the track number of each sighting, shape (n,), from 1.

    Args:
        xy: Floor metres, NaN where unknown, shape (n, 2).
        covariance: Of `xy`, square metres, shape (n, 2, 2).
        frame: Row of the frame in `time_s`, in order, shape (n,).
        time_s: Seconds of each frame.
        border_s: Seconds of usual walking to each side of the picture, shape (n, 4); None = not known.
    """
    known = np.flatnonzero(np.isfinite(xy).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2)))
    border_s = np.full((len(xy), 4), np.inf) if border_s is None else border_s
    seen = FloorSightings.of(xy[known], covariance[known], frame[known], time_s, border_s[known])
    before = LinkSearch(seen).found()
    if len(time_s) > 1 and (time_s[-1] - time_s[0]) / (len(time_s) - 1) > RARE_S:
        before = _settled(seen, before)
    else:
        search = LinkSearch(seen.with_ends(before).backward(), reversed_links(before), seen.pasts(before).turned())
        before = reversed_links(search.found())
    number = np.zeros(len(xy), dtype=np.int64)
    number[known] = track_numbers(before)
    n_tracks = int(number.max(initial=0))
    number[number == 0] = n_tracks + 1 + np.arange(len(xy) - len(known))
    return number


def _settled(seen: FloorSightings, before: Rows) -> Rows:
    """Return the links after sweeps backward and forward by turns, each with what the last one found."""
    rng = np.random.default_rng(SEED)
    for sweep, noise in enumerate(NOISES):
        pasts, futures = seen.pasts(before), seen.futures(before)
        learnt = seen.with_ends(before).with_velocities(before, pasts, futures)
        if sweep % 2 == 1:
            before = LinkSearch(learnt, before, futures, exchanges=True, noise=noise, rng=rng).found()
        else:
            back, links = learnt.backward(), reversed_links(before)
            before = reversed_links(
                LinkSearch(back, links, pasts.turned(), exchanges=True, noise=noise, rng=rng).found()
            )
    return before
