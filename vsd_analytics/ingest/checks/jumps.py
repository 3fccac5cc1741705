"""Steps of a track that nobody walks: the engine lost the person, or gave the id to somebody else."""

from __future__ import annotations

from typing import Final

import numpy as np

from vsd_analytics.ingest.checks.sample import STEP_MAX_S, Bools, Sample, Ways

FAR_M: Final = 2.0
"""Errors of a position in one frame are shorter."""
FAR_SHARE: Final = 0.2
"""Share of the extent of all pixels that nobody crosses in one step."""


def steps(sample: Sample, ways: Ways, *, fast_m_s: float) -> tuple[Bools, Bools]:
    """Return which records come by a step, and by which of these nobody walks.

    Args:
        sample: The records.
        ways: Those of them with an id and a place.
        fast_m_s: A step on the floor is a jump from this speed on.

    Returns:
        For each record of `ways` whether it is a step (the record before it is of the same track, and at most
        `STEP_MAX_S` older), and whether it is a jump (the step is far, and on the floor also faster than `fast_m_s`).
    """
    step_s = ways.steps_ms / 1000
    way = np.hypot(*np.diff(ways.places, axis=0, prepend=0).T)
    is_step = (step_s > 0) & (step_s <= STEP_MAX_S)
    if ways.is_metric:
        is_far = (way > FAR_M) & (way > fast_m_s * step_s)
    else:
        is_far = (way > FAR_SHARE * sample.picture_side_px) & (sample.picture_side_px > 0)
    return is_step, is_step & is_far
