"""Doubts about frames: who is seen together, and who beside himself (W224)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from vsd_analytics.ingest.doubt_case import ROWS_MIN, Case, Doubt

Ints = npt.NDArray[np.int64]

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
LIFE_STEPS: Final = 10
"""A track that is not seen for so many of its usual steps has ended."""
TOGETHER: Final = 1.5
"""People in view at once, on average while anybody is, from which some of them must share a frame."""
FRAMES_A_STEP: Final = 1.15
"""Frames from one record of a person to the next, beyond which each shows a part of the people: 1.0 in seven real
recordings, 1.24 to 1.38 in the three hours of ATC, whose times scatter."""


def several_frames(case: Case) -> Iterator[Doubt]:
    """W224: several frames with one time and without ids, so that each person stands beside himself."""
    sample = case.sample
    if sample.is_pairs or sample.has_ids or not sample.has_floor or case.options.period_s is not None:
        return
    frames = islice(sample.rows.groupby(["camera_no", "ts_ms"], sort=False)[["x", "y"]], _GROUPS_MAX)
    groups = [places.to_numpy() for _, places in frames if len(places) >= 2 * PEOPLE_MIN]
    n_repeated = sum(map(_is_repeated, groups))
    if n_repeated >= max(ROWS_MIN, REPEATED_SHARE * len(groups)):
        yield Doubt(
            "W224",
            f"{n_repeated:,} of {len(groups):,} times have several frames: the same people again, a step further",
            "people without ids would stand beside themselves, and each would be too close to himself",
            "export times with parts of seconds, or one frame of each second",
            is_sure=True,
        )


def _is_repeated(places: np.ndarray) -> bool:
    """Return whether places, in the order of the file, are those of the same people in two to five frames."""
    for k in range(2, FRAMES_MAX + 1):
        if len(places) % k == 0 and len(places) >= k * PEOPLE_MIN:
            across, up = np.diff(places.reshape(k, -1, 2), axis=0).T
            if np.hypot(across, up).max() <= STEP_MAX_M_S / k:
                return True
    return False


def _parts_of_frames(case: Case) -> Iterator[Doubt]:
    """W224: times that scatter, so that each frame shows a part of the people, or one of them alone."""
    sample = case.sample
    if sample.is_pairs or not sample.has_ids or sample.n < 5 * ROWS_MIN or case.options.period_s is not None:
        return
    rows = sample.rows.loc[sample.rows["track_no"] >= 0, ["camera_no", "track_no", "ts_ms"]]
    seen = _followed(rows, sample.tracked)
    if seen is None:
        return
    yield from _scattered(rows, seen)
    yield from _strays(rows, seen)


def _scattered(rows: pd.DataFrame, seen: _Followed) -> Iterator[Doubt]:
    """W224: people of one frame with times of their own, so that nobody is ever seen together with anybody."""
    n_in_company = int(seen.is_in_company.sum())
    if n_in_company < 5 * ROWS_MIN:
        return
    is_alone = ~rows.duplicated(["camera_no", "ts_ms"], keep=False).to_numpy()
    n_alone = int((is_alone & seen.is_in_company).sum())
    if n_alone < APART_SHARE * n_in_company:
        return
    period_s = float(f"{seen.usual_ms / 1000:.1g}")
    yield Doubt(
        "W224",
        f"{n_alone:,} of {n_in_company:,} records have a time of their own, while several people are in view",
        "people are close to each other only in one frame: nobody would ever be too close to anybody",
        f"--period {period_s:g} makes one frame of each {period_s:g} s; or export the time of the frame",
        is_sure=n_alone >= ALONE_SHARE * n_in_company,
    )


def _strays(rows: pd.DataFrame, seen: _Followed) -> Iterator[Doubt]:
    """W224: frames that show a part of the people each, where the times of one sampling period scatter."""
    n_frames = len(rows[["camera_no", "ts_ms"]].drop_duplicates())
    a_step = (n_frames - seen.n_stretches) * seen.usual_ms / max(seen.busy_ms, 1.0)
    if a_step < FRAMES_A_STEP or seen.lives_ms < TOGETHER * seen.busy_ms:
        return
    period_s = float(f"{seen.usual_ms / 1000:.1g}")
    yield Doubt(
        "W224",
        f"{a_step:.1f} frames come while a person is seen once: each shows a part of the people",
        "person-time is counted by frame and would be too low, and people who were close may share no frame",
        f"--period {period_s:g} makes one frame of each {period_s:g} s; or export the time of the frame",
    )


@dataclass(frozen=True, slots=True)
class _Followed:
    """How people with ids are seen.

    Attributes:
        usual_ms: From one record of a person to the next.
        lives_ms: In view, summed over people.
        busy_ms: With anybody in view.
        n_stretches: Stretches of time with anybody in view.
        is_in_company: For each record, whether somebody else was in view.
    """

    usual_ms: float
    lives_ms: float
    busy_ms: float
    n_stretches: int
    is_in_company: npt.NDArray[np.bool_]


def _followed(records: pd.DataFrame, rows: pd.DataFrame) -> _Followed | None:
    """Return how people are seen; None for nobody seen twice.

    Args:
        records: camera_no, track_no and ts_ms of each record with an id.
        rows: The same records by camera, track and time.
    """
    steps_ms = rows.groupby(["camera_no", "track_no"], sort=False)["ts_ms"].diff()
    if not (usual_ms := float(steps_ms.median())) >= FRAME_MIN_MS:
        return None
    # an id that comes again after a long time is somebody else's, or the same person's next visit
    life = (steps_ms.isna() | (steps_ms > LIFE_STEPS * usual_ms)).cumsum()
    lives = rows.groupby(["camera_no", life], sort=False)["ts_ms"].agg(["min", "max"]).reset_index(level=1, drop=True)
    stretches, is_in_company = list[npt.NDArray[np.int64]](), np.zeros(len(records), dtype=bool)
    of_life, begun, ended = lives.index.to_numpy(), lives["min"].to_numpy(), lives["max"].to_numpy()
    of_record, ts_ms = records["camera_no"].to_numpy(), records["ts_ms"].to_numpy()
    for camera in np.unique(of_life):
        of_camera, is_here = of_life == camera, of_record == camera
        stretches.append(_stretches_ms(begun[of_camera], ended[of_camera]))
        is_in_company[is_here] = _n_in_view(ts_ms[is_here], begun[of_camera], ended[of_camera]) > 1
    stretches_ms = np.concatenate(stretches)
    return _Followed(
        usual_ms,
        float((lives["max"] - lives["min"]).sum()),
        float(stretches_ms.sum()),
        len(stretches_ms),
        is_in_company,
    )


def _n_in_view(ts_ms: Ints, begun: Ints, ended: Ints) -> Ints:
    """Return how many of the lives of one camera each instant is within."""
    return np.searchsorted(np.sort(begun), ts_ms, side="right") - np.searchsorted(np.sort(ended), ts_ms, side="left")


def _stretches_ms(begun: Ints, ended: Ints) -> Ints:
    """Return how long each stretch with somebody in view lasts, from the first and last instants of tracks."""
    order = np.argsort(begun)
    starts, latest = begun[order], np.maximum.accumulate(ended[order])
    is_new = np.r_[True, starts[1:] > latest[:-1]]
    firsts, lasts = starts[is_new], latest[np.r_[is_new[1:], True]]
    return np.asarray(lasts - firsts, dtype=np.int64)


FRAME_LOOKS: Final[tuple[Callable[[Case], Iterator[Doubt]], ...]] = (several_frames, _parts_of_frames)
