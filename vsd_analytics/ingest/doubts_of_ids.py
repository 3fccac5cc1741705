"""Doubts about track ids: none, ids that do not last, ids of several people (W225)."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from typing import Final

import numpy as np
import pandas as pd

from vsd_analytics.ingest.doubt_case import ROWS_MIN, Case, Doubt
from vsd_analytics.ingest.telling_names import ids_like

TWO_PLACES_M: Final = 1.0
"""Nobody is in two places this far apart at once; two boxes of one person are nearer."""
TWO_PLACES_SHARE: Final = 0.002
SECOND_SHARE: Final = 0.05
COUNTED_SHARE: Final = 0.99
COMINGS_MIN: Final = 10
"""So often somebody must come or go before numbers without a gap show that they number a frame."""
SPELLED_SHARE: Final = 0.1
UNKNOWN_SHARE: Final = 0.2
"""Of rows without an id: violations of such people cannot be counted."""


def _ids(case: Case) -> Iterator[Doubt]:
    """W225: no ids, or ids that do not last."""
    sample = case.sample
    if sample.is_pairs or not sample.n:
        return
    why = "a violation needs the same two people for 3 seconds; records, person-hours and maps are not concerned"
    like = [] if case.head is None else ids_like(case.head.ignored)
    named = f"--map {shlex.quote('track_id=' + (like[0] if like else '...'))}"
    if case.head is not None and not sample.has_ids:
        what = "there are no track ids: violations cannot be counted"
        unread = ", ".join(name[:40] for name in case.head.ignored[:5])
        of_these = f", if one of the columns that are not read holds them: {unread}" if unread else ""
        fix = named if like else f"export the tracker's ids, and map them: --map track_id=...{of_these}"
        yield Doubt("W225", what, why, fix, is_note=not like)
        return
    if sample.has_ids:
        n_without = int((sample.rows["track_no"] < 0).sum())
        if n_without > UNKNOWN_SHARE * sample.n:
            what = f"{n_without:,} of {sample.n:,} rows have no track id"
            yield Doubt("W225", what, why, "export the tracker's ids for everybody in view", is_note=True)
        n_records = sample.rows.loc[sample.rows["track_no"] >= 0, "track_no"].value_counts()
        n_frames = sample.rows["ts_ms"].nunique()
        if len(n_records) >= 2 * ROWS_MIN and n_frames >= 3 and float((n_records == 1).mean()) > 0.9:
            what = f"{len(n_records):,} track ids, and nearly each has one record: they do not last"
            yield Doubt("W225", what, why, f"map the id of the track, not of the detection or row: {named}")


def _of_several(case: Case) -> Iterator[Doubt]:
    """W225: ids in two places at once, such as one id for everybody whom no tracker follows."""
    sample = case.sample
    if sample.is_pairs or not sample.has_ids or case.options.period_s is not None:
        return
    across, up, far = ("x", "y", TWO_PLACES_M) if sample.has_floor else ("u", "v", _far_px(case))
    key = ["camera_no", "ts_ms", "track_no"]
    rows = sample.rows.loc[sample.rows["track_no"] >= 0, [*key, "track", across, up]].dropna()
    rows = rows[rows.duplicated(key, keep=False)]
    if rows.empty or sample.n_second > SECOND_SHARE * sample.n:  # so many have times that are too coarse: W224
        return
    spread = rows.groupby(key)[[across, up]].agg(np.ptp)
    n_far = int((np.hypot(spread[across], spread[up]) > far).sum())
    if n_far < max(ROWS_MIN, TWO_PLACES_SHARE * sample.n):
        return
    names = rows["track"].value_counts().index[:3]
    yield Doubt(
        "W225",
        f"an id is in two places at once {n_far:,} times: {', '.join(str(name)[:20] for name in names)}",
        "it is no id of one person: all but one of them are left out, and its way leads from one to the other",
        "export ids that are unique among people in view, and none for people whom the tracker does not follow",
    )


def _far_px(case: Case) -> float:
    extent = case.sample.extent("u", "v")
    return np.inf if extent is None else 0.1 * max(extent[1] - extent[0], extent[3] - extent[2])


def _numbers_of_a_frame(case: Case) -> Iterator[Doubt]:
    """W225: ids that number the people of each frame from 0 or 1 on."""
    sample = case.sample
    if sample.is_pairs or not sample.has_ids or sample.n < 5 * ROWS_MIN:
        return
    rows = sample.rows.loc[sample.rows["track_no"] >= 0, ["camera_no", "ts_ms", "track"]]
    number = rows["track"].where(rows["track"].str.fullmatch(r"\d{1,4}"))
    if number.isna().any():
        return
    frames = number.astype(int).groupby([rows["camera_no"], rows["ts_ms"]]).agg(["min", "max", "nunique", "size"])
    is_counted = (frames["min"] <= 1) & (frames["max"] - frames["min"] + 1 == frames["nunique"])
    is_counted &= (frames["size"] == frames["nunique"]) & (frames["min"] == frames["min"].iloc[0])
    n_changes = int((frames["size"].diff().fillna(0) != 0).sum())
    if n_changes >= COMINGS_MIN and is_counted.mean() >= COUNTED_SHARE and frames["size"].max() > 2:
        yield Doubt(
            "W225",
            f"in nearly each frame the ids are {frames['min'].iloc[0]}, {frames['min'].iloc[0] + 1}, ... without a gap",
            "they number the people of a frame: who has number 2 is somebody else as soon as number 1 leaves",
            "map the id of the track: --map track_id=...; if there is none, violations cannot be counted",
        )


def _spelled_twice(case: Case) -> Iterator[Doubt]:
    """W225: one id written in two ways, such as 7 and 007."""
    sample = case.sample
    if sample.is_pairs or not sample.has_ids:
        return
    names = pd.Series(sample.rows["track"].dropna().unique(), dtype=str)
    plain = names.str.strip().str.casefold().str.replace(r"^0+(?=.)", "", regex=True)
    n_twice = len(names) - plain.nunique()
    if n_twice >= max(2, SPELLED_SHARE * plain.nunique()):
        shown = names[plain.duplicated(keep=False)].to_list()
        first = [name for name, same in zip(names, plain, strict=True) if same == plain[names == shown[0]].iloc[0]]
        yield Doubt(
            "W225",
            f"{n_twice:,} ids are written in two ways, such as {' and '.join(name[:20] for name in first[:2])}",
            "each way of writing would count as a person of its own, and nobody would stay for long",
            "export ids in one way; leave it if small and capital letters, or zeros in front, mean different people",
        )


ID_LOOKS: Final[tuple[Callable[[Case], Iterator[Doubt]], ...]] = (
    _ids,
    _of_several,
    _numbers_of_a_frame,
    _spelled_twice,
)
