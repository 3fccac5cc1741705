"""Doubts about ids that pass from one person to another, and people who pass from one id to the next (W225)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from vsd_analytics.ingest.doubt_case import ROWS_MIN, Case, Doubt
from vsd_analytics.ingest.doubts_of_frames import LIFE_STEPS
from vsd_analytics.ingest.jumps import steps
from vsd_analytics.ingest.sample import Sample

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


def _taken_over(case: Case) -> Iterator[Doubt]:
    """W225: ids that jump to where another person was a moment before: they begin again, or number a frame."""
    sample = case.sample
    if sample.is_pairs or not sample.has_ids or case.options.period_s is not None:
        return
    axes, near = _reach(sample)
    rows = steps(sample, *axes, fast_m_s=JUMP_M_S)
    if not rows["is_jump"].any():
        return
    is_taken = _is_taken_over(rows, axes, near)
    n_steps, n_taken = int(rows["is_step"].sum()), int(is_taken.sum())
    if n_taken == 0 or n_taken > n_steps / 10:  # more often: a wrong unit, or no ids at all
        return
    frames = is_taken.groupby([rows["camera_no"], rows["ts_ms"]]).agg(["size", "sum"])
    n_at_once = int(((frames["sum"] >= 2) & (frames["sum"] > TOGETHER_SHARE * frames["size"])).sum())
    if n_at_once or n_taken >= max(TAKEN_MIN, TAKEN_SHARE * n_steps):
        most = f", in {n_at_once:,} frame{'' if n_at_once == 1 else 's'} most people in view at once"
        yield Doubt(
            "W225",
            f"{n_taken:,} times an id jumps to where another person was a moment before{most if n_at_once else ''}",
            "the ids begin again there, number the people of a frame, or the tracker takes one person for another: "
            "ways and violations of people would be joined",
            "map the id of the track: --map track_id=...; export ids that do not begin again, or a file for each part, "
            "with the part in front of its ids",
            is_note=not n_at_once,  # a tracker that is often wrong does so, too, and its file cannot be corrected
        )


def _is_taken_over(rows: pd.DataFrame, axes: tuple[str, str], near: float) -> pd.Series:
    """Return which jumps of `steps` lead to the last place of another id that is no longer there."""
    is_taken = pd.Series(data=False, index=rows.index)
    jumps = rows[rows["is_jump"]].assign(row=rows.index[rows["is_jump"]])
    jumps["before_ms"] = rows["ts_ms"].shift()[rows["is_jump"]]
    others = rows[["camera_no", "ts_ms", "track_no", *axes]]
    was = jumps.merge(others, left_on=["camera_no", "before_ms"], right_on=["camera_no", "ts_ms"], suffixes=("", "_2"))
    was = was[(was["track_no"] != was["track_no_2"]) & (_apart(was, axes) <= near)]
    here = was[["row", "camera_no", "ts_ms", "track_no_2", *axes]].merge(
        others.rename(columns={"track_no": "track_no_2"}),
        on=["camera_no", "ts_ms", "track_no_2"],
        suffixes=("", "_2"),
        how="left",
    )
    is_taken[here.loc[~(_apart(here, axes) <= near), "row"].unique()] = True
    return is_taken


def _apart(rows: pd.DataFrame, axes: tuple[str, str]) -> npt.NDArray[np.float64]:
    across, up = (rows[axis] - rows[f"{axis}_2"] for axis in axes)
    return np.asarray(np.hypot(across, up))


def _handed_on(case: Case) -> Iterator[Doubt]:
    """W225: ids that end where another one begins in the next frame: most of them, or of all people in view at once."""
    sample = case.sample
    if sample.is_pairs or not sample.has_ids:
        return
    axes, near = _reach(sample)
    key = ["camera_no", "track_no"]
    rows = sample.placed(*axes)
    steps_ms = rows.groupby(key)["ts_ms"].diff()
    usual_ms = steps_ms.median()
    rows["life"] = (steps_ms.isna() | (steps_ms > LIFE_STEPS * usual_ms)).cumsum()
    first, last = (rows.drop_duplicates("life", keep=keep).sort_values("ts_ms") for keep in ("first", "last"))
    if not usual_ms > 0 or len(rows) < 2 * len(first):  # hardly any id comes twice, which has a doubt of its own
        return
    ends = last[last["ts_ms"] < last["camera_no"].map(rows.groupby("camera_no")["ts_ms"].max())]
    ends = ends.assign(is_on=_is_followed(ends, first, axes, near, within_ms=2 * int(usual_ms)))
    n_on = int(ends["is_on"].sum())
    frames = ends[ends["is_on"]].groupby(["camera_no", "ts_ms"]).size()
    in_view = rows.groupby(["camera_no", "ts_ms"]).size().reindex(frames.index)
    n_at_once = int(((frames >= TOGETHER_MIN) & (frames > TOGETHER_SHARE * in_view)).sum())
    is_usual = n_on >= max(ROWS_MIN, ENDS_SHARE * len(ends))
    if is_usual or n_at_once:
        most = f", {'once' if n_at_once == 1 else f'{n_at_once:,} times'} most of those in view together"
        yield Doubt(
            "W225",
            f"{n_on:,} of {len(ends):,} ids end where another one begins in the next frame{most if n_at_once else ''}",
            "they do not last, or begin again: a violation needs the same two people for 3 seconds, and visits are cut",
            "map the id of the track, not of the detection, row, stretch or file: --map track_id=...",
            is_note=not is_usual,
        )


def _is_followed(
    ends: pd.DataFrame, first: pd.DataFrame, axes: tuple[str, str], near: float, *, within_ms: int
) -> npt.NDArray[np.bool_]:
    """Return for each end of a track whether one of the first records, in order of time, is near and soon behind it."""
    found = np.zeros(len(ends), dtype=bool)
    ended_ms, begun_ms = ends["ts_ms"].to_numpy(), first["ts_ms"].to_numpy()
    here, there = ends[[*axes]].to_numpy(), first[[*axes]].to_numpy()
    for camera in np.unique(ends["camera_no"]):
        of_end, of_first = (np.flatnonzero(rows["camera_no"].to_numpy() == camera) for rows in (ends, first))
        from_, to = (np.searchsorted(begun_ms[of_first], ended_ms[of_end] + late) for late in (1, within_ms + 1))
        while len(of_end):  # the next first record of each end that has one left
            has_one = from_ < to
            of_end, from_, to = of_end[has_one], from_[has_one], to[has_one]
            found[of_end] |= np.hypot(*(there[of_first[from_]] - here[of_end]).T) <= near
            from_ = from_ + 1
    return found


def _reach(sample: Sample) -> tuple[tuple[str, str], float]:
    """Return the axes of a sample, and how far apart two places of one person in successive frames may be."""
    if sample.has_floor:
        return ("x", "y"), NEAR_M
    extent = sample.extent("u", "v")
    size = 0.0 if extent is None else max(extent[1] - extent[0], extent[3] - extent[2])
    return ("u", "v"), NEAR_SHARE * size


HANDOVER_LOOKS: Final[tuple[Callable[[Case], Iterator[Doubt]], ...]] = (_taken_over, _handed_on)
