"""A sketch of a source: by a few hashes, an export of a recording that is stored already is known again.

Four frames in succession show people's places to the centimetre; no other day repeats them. The 16 smallest of the
hashes of all such windows are noted with each import. Two sources that share most of those that both could hold are the
same recording, whatever their bytes, times and ids are.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from vsd_analytics.ingest.checks.sample import Sample, is_new

SIZE: Final = 16
FRAMES: Final = 4
"""Frames of one window."""
SAME_MIN, SAME_SHARE = 5, 0.5
"""Windows that two sources share; a share of those that both could hold."""
_CHARS: Final = (12, 1, 1)
"""Hexadecimal digits of the places, the time and the ids of a window. One digit does not say who it was, but of several
windows it shows whether most have another time or others' ids."""
_ODD: Final = np.uint64(0x9E3779B97F4A7C15)
_DIGIT: Final = np.uint64(0xF)

Hashes = NDArray[np.uint64]


def sketch_of(sample: Sample) -> str:
    """Return the sketch of the first records of a source: hexadecimal digits, 14 for each window; "" = too few.

    A window is left out whose places come again: a camera that hangs, people who sit, coarse places.
    """
    values = sample.distance_m[:, None] if sample.is_pairs else sample.places
    places = np.nan_to_num(values * (100 if sample.is_pairs or sample.has_floor else 1))
    with np.errstate(invalid="ignore"):
        whole = np.rint(places).astype(np.int64)
    ids = pd.util.hash_array(np.array([*sample.track.names, ""], dtype=object))[sample.track.no]
    order = sample.by_frame
    camera, ts_ms = sample.camera.no[order], sample.ts_ms[order]
    starts = np.flatnonzero(is_new(camera, ts_ms))
    camera, ts_ms = camera[starts], ts_ms[starts]
    if len(starts) < FRAMES:
        return ""
    # a sum is the same whatever the order of the rows
    sums = np.add.reduceat(np.column_stack([_mixed(whole), ids])[order], starts)
    windows = np.lib.stride_tricks.sliding_window_view(sums, FRAMES, axis=0)
    of_places, of_times, of_ids = _mixed(windows[:, 0]), _mixed(ts_ms[:, None]), _mixed(windows[:, 1])
    of_one_camera = np.flatnonzero(camera[: len(windows)] == camera[FRAMES - 1 :])
    _, at, n_same = np.unique(of_places[of_one_camera], return_index=True, return_counts=True)
    return "".join(
        f"{of_places[i] >> np.uint64(16):012x}{of_times[i] & _DIGIT:x}{of_ids[i] & _DIGIT:x}"
        for i in of_one_camera[at[n_same == 1][:SIZE]]
    )


def is_same_recording(one: str, other: str) -> bool:
    """Return whether two sketches are of one recording, of which most windows have other times or other ids."""
    here, there = _windows(one), _windows(other)
    if not here or not there:
        return False
    limit = min(max(here), max(there))  # beyond it, one of the two has no room for what the other holds
    both = here.keys() & there.keys()
    n_possible = min(sum(place <= limit for place in windows) for windows in (here, there))
    n_differing = sum(here[place] != there[place] for place in both)
    return len(both) >= max(SAME_MIN, SAME_SHARE * n_possible) and n_differing > len(both) / 2


def _windows(sketch: str) -> dict[str, str]:
    size, n_place = sum(_CHARS), _CHARS[0]
    parts = [sketch[i : i + size] for i in range(0, len(sketch) - size + 1, size)]
    return {part[:n_place]: part[n_place:] for part in parts}


def _mixed(values: NDArray[np.int64] | Hashes) -> Hashes:
    """Return a hash of each row."""
    mixed = np.zeros(len(values), dtype=np.uint64)
    for column in values.T:
        mixed = (mixed ^ column.astype(np.uint64)) * _ODD
        mixed ^= mixed >> np.uint64(29)
    return mixed
