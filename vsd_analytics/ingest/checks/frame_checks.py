"""Checks of frames: who is seen together, and who beside himself (W224)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from vsd_analytics.ingest.checks.check_case import (
    ROWS_MIN,
    Case,
    SourceCheck,
    SourceWarning,
    has_positions,
    has_tracks,
    is_on_floor,
)
from vsd_analytics.ingest.checks.sample import Bools, Floats, Ints, Sample, Ways, is_last, is_new

PEOPLE_MIN: Final = 2
FRAMES_MAX: Final = 5
STEP_MAX_M_S: Final = 2.4
REPEATED_SHARE: Final = 0.3
"""Share of times with the same people again. With one frame a time it is 0 on ATC, ETH, Hotel and Zara; with several a
second .51 to .54 on ETH and Hotel, .07 on Zara, where somebody comes or goes between most frames."""
_GROUPS_MAX: Final = 500
FRAME_MIN_MS: Final = 20
"""No engine sends frames faster."""
APART_SHARE, ALONE_SHARE = 0.5, 0.9
"""Share of records with a time of their own, while several people are in view: at most .02 in fifteen real recordings,
.24 where an engine misses a person in three frames of ten; beyond `ALONE_SHARE` no frame has several people."""
TOGETHER: Final = 1.5
"""People in view at once, on average while anybody is, from which some of them must share a frame."""
FRAMES_A_STEP: Final = 1.15
"""Frames from one record of a person to the next, beyond which each shows a part of the people: 1.0 in seven real
recordings, 1.24 to 1.38 in the three hours of ATC, whose times scatter."""

HELD_FRAMES, HELD_S = 30, 60.0
"""In sixteen real recordings nobody of two or more people moved for 6 frames (Hotel, 2 s) or 12 (Edinburgh, 1.2 s)."""
FINE_SHARE: Final = 0.5
"""Share of coordinates finer than a hundredth of a metre or pixel: coarser ones rest by themselves."""
_DIGITS: Final = 1000


def _several_frames(case: Case) -> Iterator[SourceWarning]:
    """Yield a warning of several frames with one time and without ids, so that each person stands beside himself."""
    sample = case.sample
    if sample.has_ids or case.options.period_s is not None:
        return
    _, first, size = np.unique(sample.frame_no, return_index=True, return_counts=True)
    frames = np.split(sample.floor_m[sample.by_frame], np.cumsum(size)[:-1])
    in_file = np.argsort(first)[:_GROUPS_MAX].tolist()
    groups = [frames[no] for no in in_file if len(frames[no]) >= 2 * PEOPLE_MIN]
    n_repeated = sum(map(_is_repeated, groups))
    if n_repeated >= max(ROWS_MIN, REPEATED_SHARE * len(groups)):
        yield SourceWarning(
            f"{n_repeated:,} of {len(groups):,} times have several frames: the same people again, a step further",
            "people without ids would stand beside themselves, and each would be too close to himself",
            "export times with parts of seconds, or one frame of each second",
            is_sure=True,
        )


def _is_repeated(places: Floats) -> bool:
    """Return whether places, in the order of the file, are those of the same people in two to five frames."""
    for k in range(2, FRAMES_MAX + 1):
        if len(places) % k == 0 and len(places) >= k * PEOPLE_MIN:
            across, up = np.diff(places.reshape(k, -1, 2), axis=0).T
            if np.hypot(across, up).max() <= STEP_MAX_M_S / k:
                return True
    return False


def _parts_of_frames(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if sample.n < 5 * ROWS_MIN or case.options.period_s is not None:
        return
    if not sample.tracked.usual_ms >= FRAME_MIN_MS:  # NaN: nobody is seen twice
        return
    yield from _scattered(sample)
    yield from _strays(sample)


def _scattered(sample: Sample) -> Iterator[SourceWarning]:
    """W224: people of one frame with times of their own, so that nobody is ever seen together with anybody."""
    ways = sample.tracked
    is_in_company = np.zeros(len(ways), dtype=bool)
    for is_here, begun, ended in _lives_of_cameras(ways):
        is_in_company[is_here] = _n_in_view(ways.ts_ms[is_here], begun, ended) > 1
    n_in_company = int(is_in_company.sum())
    if n_in_company < 5 * ROWS_MIN:
        return
    frame_no = sample.frame_no[ways.row]
    n_alone = int((is_in_company & (np.bincount(frame_no)[frame_no] == 1)).sum())
    if n_alone < APART_SHARE * n_in_company:
        return
    yield SourceWarning(
        f"{n_alone:,} of {n_in_company:,} records have a time of their own, while several people are in view",
        "people are close to each other only in one frame: nobody would ever be too close to anybody",
        _fix(ways),
        is_sure=n_alone >= ALONE_SHARE * n_in_company,
    )


def _strays(sample: Sample) -> Iterator[SourceWarning]:
    """W224: frames that show a part of the people each, where the times of one sampling period scatter."""
    ways, lives_ms, stretches = sample.tracked, 0, list[Ints]()
    for _, begun, ended in _lives_of_cameras(ways):
        lives_ms += (ended - begun).sum()
        stretches.append(_stretches_ms(begun, ended))
    stretches_ms = np.concatenate(stretches)  # with anybody in view
    n_frames, busy_ms = np.count_nonzero(np.bincount(sample.frame_no[ways.row])), stretches_ms.sum()
    a_step = (n_frames - len(stretches_ms)) * ways.usual_ms / max(busy_ms, 1.0)
    if a_step < FRAMES_A_STEP or lives_ms < TOGETHER * busy_ms:
        return
    yield SourceWarning(
        f"{a_step:.1f} frames come while a person is seen once: each shows a part of the people",
        "person-time is counted by frame and would be too low, and people who were close may share no frame",
        _fix(ways),
    )


def _fix(ways: Ways) -> str:
    period_s = float(f"{ways.usual_ms / 1000:.1g}")
    return f"--period {period_s:g} makes one frame of each {period_s:g} s; or export the time of the frame"


def _lives_of_cameras(ways: Ways) -> Iterator[tuple[Bools, Ints, Ints]]:
    """Yield for each camera which records are its, and the first and last instants of the lives of its people."""
    begun, ended = np.flatnonzero(ways.is_begun), np.flatnonzero(is_last(ways.is_begun))
    for camera in np.unique(ways.camera_no):
        of_camera = ways.camera_no[begun] == camera
        yield ways.camera_no == camera, ways.ts_ms[begun[of_camera]], ways.ts_ms[ended[of_camera]]


def _n_in_view(ts_ms: Ints, begun: Ints, ended: Ints) -> Ints:
    """Return how many of the lives of one camera each instant is within."""
    return np.searchsorted(np.sort(begun), ts_ms, side="right") - np.searchsorted(np.sort(ended), ts_ms, side="left")


def _stretches_ms(begun: Ints, ended: Ints) -> Ints:
    """Return how long each stretch with somebody in view lasts, from the first and last instants of tracks."""
    order = np.argsort(begun)
    starts, latest = begun[order], np.maximum.accumulate(ended[order])
    is_apart = np.r_[True, starts[1:] > latest[:-1]]
    firsts, lasts = starts[is_apart], latest[is_last(is_apart)]
    return np.asarray(lasts - firsts, dtype=np.int64)


def _held_frames(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    fine = np.rint(np.nan_to_num(sample.places) * _DIGITS)
    if sample.n < HELD_FRAMES or (fine % 10 != 0).mean() < FINE_SHARE:
        return
    order = sample.by_frame
    starts = np.flatnonzero(is_new(sample.camera.no[order], sample.ts_ms[order]))
    sums = np.add.reduceat(np.column_stack([np.ones(sample.n), fine, fine[:, 0] * fine[:, 1]])[order], starts)
    camera, ts_ms = sample.camera.no[order][starts], sample.ts_ms[order][starts]
    first = np.flatnonzero(is_new(camera, *sums.T) | (sums[:, 0] < PEOPLE_MIN))
    last = np.append(first[1:], len(starts)) - 1
    held_s = (ts_ms[last] - ts_ms[first]) / 1000
    held = (last - first + 1 >= HELD_FRAMES) & (held_s >= HELD_S)
    if held.any():
        at = first[held][np.argmax(held_s[held])]
        yield SourceWarning(
            f"for {held_s[held].max():,.0f} s nobody in view moves by a digit, from line "
            f"{int(sample.line[order][starts[at]]):,} on",
            "a picture or engine that hangs looks like this, and its people would count as long as it lasts",
            "leave these records out of the export, if so: the time then counts as not recorded",
        )


SEVERAL_FRAMES: Final = SourceCheck(
    "W224",
    is_on_floor,
    _several_frames,
    "several frames with one time and without ids, so that each person stands beside himself",
)
FRAME_CHECKS: Final = (
    SEVERAL_FRAMES,
    SourceCheck(
        "W224",
        has_tracks,
        _parts_of_frames,
        "times that scatter, so that each frame shows a part of the people, or one of them alone",
    ),
    SourceCheck(
        "W224",
        has_positions,
        _held_frames,
        "a picture that hangs: times go on, and everybody in view stays at one place to the last digit",
    ),
)
