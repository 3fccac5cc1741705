"""Checks of ids that pass from one person to another, and people who pass from one id to the next (W225)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import pandas as pd

from vsd_analytics.ingest.checks.check_case import ROWS_MIN, Case, SourceCheck, SourceWarning, has_tracks
from vsd_analytics.ingest.checks.sample import Bools, Floats, Ints, Sample, Ways, is_last, is_new, steps

NEAR_M, NEAR_SHARE = 1.5, 0.05
"""Nobody walks further in a second; of pixels, a share of the extent of all of them."""
JUMP_M_S: Final = 4.0
"""Nobody in view runs this fast."""
TAKEN_MIN, TAKEN_SHARE = 3, 0.002
"""Steps by which an id takes over another person. Share of all steps: at most .0009 in fifteen real recordings."""
TOGETHER_SHARE: Final = 0.5
"""Of the people in view in one frame; two trackers' mistakes at once do not concern so many."""
TOGETHER_MIN: Final = 3
"""Two people go where two others come in two of fifteen real recordings; three do so once, where ids begin again."""
ENDS_SHARE: Final = 0.5
"""Of the ends of tracks: at most .09 in fifteen real recordings."""


def _taken_over(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if case.options.period_s is not None:
        return
    is_step, is_jump = steps(sample, sample.ways, fast_m_s=JUMP_M_S)
    if not is_jump.any():
        return
    is_taken = _is_taken_over(sample.ways, is_jump, _reach(sample))
    n_steps, n_taken = int(is_step.sum()), int(is_taken.sum())
    if n_taken == 0 or n_taken > n_steps / 10:  # more often: a wrong unit, or no ids at all
        return
    frame_no = sample.frame_no[sample.ways.row]
    n_in_view, n_of_frame = np.bincount(frame_no), np.bincount(frame_no, weights=is_taken)
    n_at_once = int(((n_of_frame >= 2) & (n_of_frame > TOGETHER_SHARE * n_in_view)).sum())
    if n_at_once or n_taken >= max(TAKEN_MIN, TAKEN_SHARE * n_steps):
        most = f", in {n_at_once:,} frame{'' if n_at_once == 1 else 's'} most people in view at once"
        yield SourceWarning(
            f"{n_taken:,} times an id jumps to where another person was a moment before{most if n_at_once else ''}",
            "the ids begin again there, number the people of a frame, or the tracker takes one person for another: "
            "ways and violations of people would be joined",
            "map the id of the track (--map); export ids that do not begin again, or a file for each part, "
            "with the part in front of its ids",
            is_note=not n_at_once,  # a tracker that is often wrong does so, too, and its file cannot be corrected
        )


def _is_taken_over(ways: Ways, is_jump: Bools, near: float) -> Bools:
    """Return which jumps lead to the last place of another id that is no longer there."""
    (x, y), jump = ways.places.T, np.flatnonzero(is_jump)
    columns = {"camera_no": ways.camera_no, "ts_ms": ways.ts_ms, "track_no": ways.track_no, "x": x, "y": y}
    others = pd.DataFrame(columns)
    jumps = others.iloc[jump].assign(row=jump, before_ms=ways.ts_ms[jump - 1])
    was = jumps.merge(others, left_on=["camera_no", "before_ms"], right_on=["camera_no", "ts_ms"], suffixes=("", "_2"))
    was = was[(was["track_no"] != was["track_no_2"]) & (_apart(was) <= near)]
    here = was[["row", "camera_no", "ts_ms", "track_no_2", "x", "y"]].merge(
        others.rename(columns={"track_no": "track_no_2"}),
        on=["camera_no", "ts_ms", "track_no_2"],
        suffixes=("", "_2"),
        how="left",
    )
    is_taken = np.zeros(len(ways), dtype=bool)
    is_taken[here.loc[~(_apart(here) <= near), "row"]] = True
    return is_taken


def _apart(rows: pd.DataFrame) -> Floats:
    return np.asarray(np.hypot(rows["x"] - rows["x_2"], rows["y"] - rows["y_2"]))


def _handed_on(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    ways = sample.ways
    # hardly any id comes twice: that has a check of its own
    if not ways.usual_ms > 0 or len(ways) < 2 * np.count_nonzero(ways.is_begun):
        return
    begun, ended = np.flatnonzero(ways.is_begun), np.flatnonzero(is_last(ways.is_begun))
    cameras = np.flatnonzero(is_new(ways.camera_no))
    latest_ms = np.maximum.reduceat(ways.ts_ms, cameras)
    ends = ended[ways.ts_ms[ended] < latest_ms[np.searchsorted(cameras, ended, side="right") - 1]]
    followed = ends[_is_followed(ways, ends, begun, _reach(sample), within_ms=2 * int(ways.usual_ms))]
    n_on = len(followed)
    frame_no = sample.frame_no[ways.row]
    n_in_view, n_of_frame = np.bincount(frame_no), np.bincount(frame_no[followed], minlength=frame_no.max() + 1)
    n_at_once = int(((n_of_frame >= TOGETHER_MIN) & (n_of_frame > TOGETHER_SHARE * n_in_view)).sum())
    is_usual = n_on >= max(ROWS_MIN, ENDS_SHARE * len(ends))
    if is_usual or n_at_once:
        most = f", {'once' if n_at_once == 1 else f'{n_at_once:,} times'} most of those in view together"
        yield SourceWarning(
            f"{n_on:,} of {len(ends):,} ids end where another one begins in the next frame{most if n_at_once else ''}",
            "they do not last, or begin again: a violation needs the same two people for 3 seconds, and visits are cut",
            "map the id of the track (--map), not of the detection, row, stretch or file",
            is_note=not is_usual,
        )


def _is_followed(ways: Ways, ends: Ints, begun: Ints, near: float, *, within_ms: int) -> Bools:
    """Return for each end of a life whether another one begins near it, and soon behind it."""
    is_followed = np.zeros(len(ends), dtype=bool)
    for camera in np.unique(ways.camera_no[ends]):
        of_end, first = np.flatnonzero(ways.camera_no[ends] == camera), begun[ways.camera_no[begun] == camera]
        first = first[np.argsort(ways.ts_ms[first])]
        ended_ms, begun_ms = ways.ts_ms[ends[of_end]], ways.ts_ms[first]
        from_, to = (np.searchsorted(begun_ms, ended_ms + late) for late in (1, within_ms + 1))
        while len(of_end):  # the next first record of each end that has one left
            has_one = from_ < to
            of_end, from_, to = of_end[has_one], from_[has_one], to[has_one]
            is_followed[of_end] |= np.hypot(*(ways.places[first[from_]] - ways.places[ends[of_end]]).T) <= near
            from_ = from_ + 1
    return is_followed


def _reach(sample: Sample) -> float:
    """Return how far apart two places of one person in successive frames may be, in the unit of `sample.places`."""
    return NEAR_M if sample.has_floor else NEAR_SHARE * sample.picture_side_px


ID_SWITCH_CHECKS: Final = (
    SourceCheck(
        "W225",
        has_tracks,
        _taken_over,
        "ids that jump to where another person was a moment before: they begin again, or number a frame",
    ),
    SourceCheck(
        "W225",
        has_tracks,
        _handed_on,
        "ids that end where another one begins in the next frame: most of them, or of all people in view at once",
    ),
)
