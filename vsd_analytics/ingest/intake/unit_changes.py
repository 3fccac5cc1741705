"""Positions that grow by the factor of another unit: feet after metres, in one file or in the next one (W220).

One camera sees one floor. Where its people are spread as widely as before times 3.28, and walk as fast as before times
3.28, the unit has changed, and not the people.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.config.file_columns import METRES
from vsd_analytics.ingest.intake.recording import Floats, Recording

RECORDS_MIN, STEPS_MIN = 50, 20
NEAR: Final = 0.3
"""Logarithms of a ratio and of a unit are this near: feet as metres are 3.28, between 2.4 and 4.4 times as large."""
FIT_LEAST: Final = 0.85
"""Share of the spread of places that the scale must explain."""
N_PIECES: Final = 24


@dataclass(frozen=True, slots=True)
class UnitChange:
    """A change of unit.

    Attributes:
        factor: How many times as large positions are as before.
        unit: Unit of the larger ones, where the smaller ones are in metres.
        speeds_m_s: Median speed before and behind it.
        from_ms: Instant of the first record behind it.
    """

    factor: float
    unit: str
    speeds_m_s: tuple[float, float]
    from_ms: int


def change_between(before: Recording, after: Recording) -> UnitChange | None:
    """Return the change of unit from some records of a camera to others; None = there is none."""
    if min(len(before), len(after)) < RECORDS_MIN:
        return None
    old, new = _speeds_m_s(before), _speeds_m_s(after)
    if min(len(old), len(new)) < STEPS_MIN:
        return None
    quick = [float(np.quantile(v, 0.75)) for v in (old, new)]
    if min(quick) <= 0.01:
        return None
    scale, fit = _scale(before.places, after.places)
    if scale <= 0 or fit < FIT_LEAST:
        return None
    for unit, metres in METRES.items():
        for factor in (1 / metres, metres) if metres < 1 else ():
            is_like = [abs(math.log(ratio / factor)) < NEAR for ratio in (scale, quick[1] / quick[0])]
            if abs(math.log(factor)) > 2 * NEAR and all(is_like):
                speeds = (float(np.median(old)), float(np.median(new)))
                return UnitChange(factor, unit, speeds, int(after.ts_ms[0]))
    return None


def change_within(recording: Recording) -> UnitChange | None:
    """Return the change of unit inside of the records of a camera, in order of time; None = there is none."""
    if len(recording) < 2 * RECORDS_MIN:
        return None
    sizes = np.hypot(*recording.places.T)
    edges = np.unique(np.linspace(0, len(recording), N_PIECES + 1).astype(np.int64))[1:-1]
    logs = np.log(np.maximum(sizes, 1e-3))
    # where the sizes differ most on both sides, weighed by how many records are there
    before = np.cumsum(logs)[edges - 1] / edges
    after = (logs.sum() - np.cumsum(logs)[edges - 1]) / (len(logs) - edges)
    weight = np.sqrt(edges * (len(logs) - edges))
    for edge in edges[np.argsort(-np.abs(after - before) * weight)][:3].tolist():
        change = change_between(recording.at(slice(0, edge)), recording.at(slice(edge, None)))
        if change is not None:
            return UnitChange(change.factor, change.unit, change.speeds_m_s, _turn_ms(recording, edge, change.factor))
    return None


def _turn_ms(recording: Recording, edge: int, factor: float) -> int:
    """Return the first instant from which sizes are those behind the change, near the edge of a piece."""
    reach = len(recording) // N_PIECES + 1
    low, high = max(0, edge - reach), min(len(recording), edge + reach)
    logs = np.log(np.maximum(np.hypot(*recording.places[low:high].T), 1e-3))
    side = 1 if factor > 1 else -1
    middle = np.median(logs[: max(1, len(logs) // 4)]) + math.log(factor) / 2
    is_behind = side * (logs - middle) > 0
    n_wrong = np.concatenate([[0], np.cumsum(is_behind)]) + np.concatenate([np.cumsum(~is_behind[::-1])[::-1], [0]])
    at = low + int(np.argmin(n_wrong))
    return int(recording.ts_ms[min(at, len(recording) - 1)])


def _scale(before: Floats, after: Floats) -> tuple[float, float]:
    """Return by which factor the deciles of places fit those before, and the share of their spread it explains."""
    shares = np.linspace(0.05, 0.95, 10)
    old, new = (np.quantile(places, shares, axis=0).ravel(order="F") for places in (before, after))
    if not (old @ old):
        return 0.0, 0.0
    scale = float(old @ new / (old @ old))
    spread = float(((new.reshape(2, -1) - new.reshape(2, -1).mean(axis=1, keepdims=True)) ** 2).sum())
    rest = float(((new - scale * old) ** 2).sum())
    return scale, 1 - rest / spread if spread else 0.0


def _speeds_m_s(recording: Recording) -> Floats:
    """Return speeds of steps of half a second to three seconds of one track."""
    order = np.lexsort((recording.ts_ms, recording.track, recording.camera))
    order = order[recording.track[order] >= 0]
    if len(order) < 2:
        return np.zeros(0)
    # one record of each half second: errors of places in frames in quick succession are no speed
    half = recording.ts_ms[order] // 500
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = (half[1:] != half[:-1]) | (recording.track[order][1:] != recording.track[order][:-1])
    order = order[is_first]
    step_s = np.diff(recording.ts_ms[order]) / 1000
    way_m = np.hypot(*np.diff(recording.places[order], axis=0).T)
    is_step = (np.diff(recording.track[order]) == 0) & (step_s >= 0.4) & (step_s <= 3)
    return np.asarray(way_m[is_step] / step_s[is_step])
