"""Steps of a track that nobody walks: the engine lost the person, or gave the id to somebody else."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd

from vsd_analytics.ingest.sample import STEP_MAX_S, Sample

FAR_M: Final = 2.0
"""Errors of a position in one frame are shorter."""
FAR_SHARE: Final = 0.2
"""Share of the extent of all pixels that nobody crosses in one step."""


def steps(sample: Sample, across: str, up: str, *, fast_m_s: float) -> pd.DataFrame:
    """Return the records of tracks by camera, track and time, and which of them are jumps.

    Args:
        sample: The records.
        across: "x" (floor metres) or "u" (pixels).
        up: "y" or "v".
        fast_m_s: A step on the floor is a jump from this speed on.

    Returns:
        Columns `camera_no track_no ts_ms`, both axes, `is_step` (the record before it is of the same track, and at most
        `STEP_MAX_S` older) and `is_jump` (the step is far, and on the floor also faster than `fast_m_s`).
    """
    rows = sample.placed(across, up).reset_index(drop=True)
    before = rows.shift()
    step_s = (rows["ts_ms"] - before["ts_ms"]) / 1000
    way = np.hypot(rows[across] - before[across], rows[up] - before[up])
    is_same = (rows["camera_no"] == before["camera_no"]) & (rows["track_no"] == before["track_no"])
    is_step = is_same & (step_s > 0) & (step_s <= STEP_MAX_S)
    if across == "x":
        is_far = (way > FAR_M) & (way > fast_m_s * step_s)
    else:
        extent = sample.extent(across, up)
        size = 0.0 if extent is None else max(extent[1] - extent[0], extent[3] - extent[2])
        is_far = (way > FAR_SHARE * size) & (size > 0)
    return rows.assign(is_step=is_step, is_jump=is_step & is_far)
