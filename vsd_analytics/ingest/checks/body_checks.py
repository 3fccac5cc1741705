"""Checks of places that several people would share: a body has its own half square metre (W220)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from vsd_analytics.ingest.checks.check_case import ROWS_MIN, Case, SourceCheck, SourceWarning, has_positions
from vsd_analytics.ingest.checks.sample import is_known, is_new

BODY_M: Final = 0.2
"""The middles of two bodies are hardly ever nearer to each other: a chest is deeper."""
SAME_SHARE: Final = 0.02
CROWDED_SHARE: Final = 0.5
COARSE_M: Final = 0.5
"""Positions in steps of this size, or of a multiple, are off by a good part of a legal distance."""
_SHIFTS_MAX: Final = 20
_HALF_MM: Final = 0.0005


def _rounded(case: Case) -> Iterator[SourceWarning]:
    places = case.sample.floor_m[is_known(case.sample.floor_m)]
    if len(places) < 5 * ROWS_MIN:
        return
    is_coarse = (np.abs(places / COARSE_M - np.rint(places / COARSE_M)) < 1e-6).all()
    if is_coarse and len(np.unique(places, axis=0)) >= ROWS_MIN:
        is_whole = (places == np.rint(places)).all()
        yield SourceWarning(
            f"all positions are {'whole' if is_whole else 'half'} metres",
            "distances between rounded places are off by as much, and people in one place have none",
            "export positions with decimals, or state the unit (--unit) if the numbers are no metres",
        )


def _bodies(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    row = np.flatnonzero(is_known(sample.floor_m))
    if len(row) < 5 * ROWS_MIN or np.ptp(sample.floor_m[row], axis=0).max() <= 1:
        return  # all within a square metre: another unit
    # what a fold stores once is one person here as well
    is_repeated = np.zeros(sample.n, dtype=bool)
    is_repeated[sample.ways.row[sample.ways.is_again]] = True
    if (sample.track.no[row] < 0).any():
        order = row[np.lexsort((*sample.floor_m[row].T, sample.frame_no[row]))]
        is_same = ~is_new(sample.frame_no[order], *sample.floor_m[order].T)
        is_repeated[order[is_same & (sample.track.no[order] < 0)]] = True
    row = row[~is_repeated[row]]
    near_m = _nearest_m(sample.frame_no[row], *sample.floor_m[row].T)
    n_same, share_in = int((near_m < _HALF_MM).sum()), float((near_m < BODY_M).mean())
    why = "two people cannot stand in one place: the same person may be written several times, or lost ones repeated"
    fix = "one row for each person and time, and none for lost people; export the times of frames with their decimals"
    if share_in > CROWDED_SHARE:
        what = f"{share_in:.0%} of the people would be within {BODY_M * 100:.0f} cm of another one of the same time"
        yield SourceWarning(what, why, fix, is_sure=True)
    elif n_same >= SAME_SHARE * len(row):
        what = f"{n_same:,} of {len(row):,} records are at exactly the same place and time as another person"
        yield SourceWarning(what, why, fix)


def _nearest_m(frame: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the distance to the nearest other record of the frame where it is below `BODY_M`, else infinity."""
    order = np.lexsort((x, frame))
    frame, x, y = frame[order], x[order], y[order]
    nearest = np.full(len(x), np.inf)
    for shift in range(1, min(_SHIFTS_MAX, len(x) - 1) + 1):
        is_near = (frame[shift:] == frame[:-shift]) & (x[shift:] - x[:-shift] < BODY_M)
        if not is_near.any():
            break
        apart = np.where(is_near, np.hypot(x[shift:] - x[:-shift], y[shift:] - y[:-shift]), np.inf)
        nearest[shift:] = np.minimum(nearest[shift:], apart)
        nearest[:-shift] = np.minimum(nearest[:-shift], apart)
    return nearest


BODY_CHECKS: Final = (
    SourceCheck("W220", has_positions, _rounded, "positions that were rounded to half metres or metres"),
    SourceCheck(
        "W220",
        has_positions,
        _bodies,
        "people inside each other: one person several times in a frame, or a unit that is too large",
    ),
)
