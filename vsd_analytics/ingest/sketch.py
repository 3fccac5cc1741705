"""A sketch of a source: by a few hashes, an export of a recording that is stored already is known again.

Four frames in succession show people's places to the centimetre; no other day repeats them. The 16 smallest of the
hashes of all such windows are noted with each import. Two sources that share most of those that both could hold are the
same recording, whatever their bytes, times and ids are.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from vsd_analytics.ingest.sample import Sample

SIZE: Final = 16
FRAMES: Final = 4
"""Frames of one window."""
SAME_MIN, SAME_SHARE = 5, 0.5
"""Windows that two sources share; a share of those that both could hold."""
_CHARS: Final = (12, 1, 1)
"""Hexadecimal digits of the places, the time and the ids of a window. One digit does not say who it was, but of several
windows it shows whether most have another time or others' ids."""
_ODD: Final = np.uint64(0x9E3779B97F4A7C15)

Hashes = NDArray[np.uint64]


def sketch_of(sample: Sample) -> str:
    """Return the sketch of the first records of a source: hexadecimal digits, 14 for each window; "" = too few.

    A window is left out whose places come again: a camera that hangs, people who sit, coarse places.
    """
    rows = sample.rows
    if rows.empty:
        return ""
    axes = ["distance_m"] if sample.is_pairs else ["x", "y"] if sample.has_floor else ["u", "v"]
    places = np.nan_to_num(rows[axes].to_numpy(dtype=float) * (1 if axes[0] == "u" else 100))
    with np.errstate(invalid="ignore"):
        whole = np.rint(places).astype(np.int64)
    of_row, ids = pd.factorize(rows["track"].fillna(""))
    frames = pd.DataFrame(
        {
            "camera": rows["camera_no"],
            "ts_ms": rows["ts_ms"],
            "places": _mixed(whole),
            "ids": pd.util.hash_array(np.asarray(ids.astype(str), dtype=object))[of_row],
        }
    )
    frames = frames.groupby(["camera", "ts_ms"], as_index=False).sum()  # whatever the order of the rows
    by_camera = frames.groupby("camera")
    windows = pd.DataFrame({name: _mixed(_successive(by_camera[name])) for name in ("places", "ids")})
    windows["ts_ms"] = _mixed(frames[["ts_ms"]].to_numpy(dtype=np.int64))
    windows = windows[by_camera.cumcount(ascending=False) >= FRAMES - 1].drop_duplicates("places", keep=False)
    least = windows.assign(places=windows["places"].to_numpy() >> np.uint64(16)).sort_values("places")[:SIZE]
    return "".join(
        f"{place:012x}{time & 0xF:x}{ids & 0xF:x}"
        for place, time, ids in least[["places", "ts_ms", "ids"]].astype(object).itertuples(index=False)
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


def _successive(frames: pd.api.typing.SeriesGroupBy[Any, Any]) -> NDArray[np.int64]:
    """Return for each frame its value and those of the frames behind it."""
    columns = [frames.shift(-i, fill_value=0) for i in range(FRAMES)]
    return np.column_stack([column.to_numpy().astype(np.int64) for column in columns])


def _mixed(values: NDArray[np.int64]) -> Hashes:
    """Return a hash of each row."""
    mixed = np.zeros(len(values), dtype=np.uint64)
    for column in values.T:
        mixed = (mixed ^ column.astype(np.uint64)) * _ODD
        mixed ^= mixed >> np.uint64(29)
    return mixed
