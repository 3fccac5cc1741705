"""A recording as places and times without ids, and how much of one recording is in another one.

The same people seen again are at the same places at the same times, however a file names, rounds, thins, orders or
shifts its records. So records are compared with the nearest ones of another recording at about their time, and with
those some minutes before and after, which tell how many would be near by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

FINE_M: Final = 0.012
"""Places that were rounded to a centimetre are this near."""
COARSE_M: Final = 0.15
"""Places between two frames are this near where people walk on."""
FINEST_MAX_M: Final = 0.25
_STEPS_MM: Final = (304.8, 1000.0, 500.0, 250.0, 100.0, 50.0, 30.48, 25.4, 20.0, 10.0, 5.0, 3.048)
"""Steps in which places are often rounded, the coarsest first: metres, feet and inches."""
_CLOSE_S, _AROUND_S = 0.15, 0.7
"""Longest time between two records of one moment; times without parts of seconds need the longer one."""
CONTROLS_S: Final = (-241.0, -113.0, -47.0, -19.0, 19.0, 47.0, 113.0, 241.0)
"""Other lags, in seconds: what is near then is near by chance. No usual period fits all."""
SHARE_MIN: Final = 0.03
"""A smaller share of records that are near shows nothing."""
UNSHIFTED_MS: Final = 2_000
"""Lags up to this are clocks that differ, not a recording that is shifted."""
BESIDE_MAX_M: Final = 2.0
BESIDE_TRACKS: Final = 5
"""Fewer people who walk at one distance from others may be couples."""
_GAP_S: Final = 3.0
"""A track whose records are further apart is not drawn in between."""
_DRAWN_S: Final = 0.25


@dataclass(frozen=True, eq=False)
class Recording:
    """Records of people, sorted by time.

    Attributes:
        ts_ms: UTC milliseconds.
        places: Shape (n, 2): metres on the floor. Pixels of a camera without calibration are hundredths of a unit, far
            away from all floors (`stored_recordings`), so that they are near pixels only.
        camera: Number of each record's camera in `cameras`.
        track: Number of its track; -1 = no id.
        owner: Number of the import that brought it, in `owners`.
        cameras: Ids of cameras.
        owners: Ids of imports; "" = none, such as a broker.
    """

    ts_ms: Ints
    places: Floats
    camera: Ints
    track: Ints
    owner: Ints
    cameras: Sequence[str] = ()
    owners: Sequence[str] = ("",)

    def __len__(self) -> int:
        """Return the number of records."""
        return len(self.ts_ms)

    def at(self, rows: Any) -> Recording:
        """Return some of the records, in order of time where `rows` keep it."""
        return Recording(
            self.ts_ms[rows],
            self.places[rows],
            self.camera[rows],
            self.track[rows],
            self.owner[rows],
            self.cameras,
            self.owners,
        )

    def of_camera(self, camera_id: str) -> Recording:
        """Return the records of one camera."""
        if camera_id not in self.cameras:
            return self.at(np.zeros(0, dtype=np.int64))
        return self.at(self.camera == self.cameras.index(camera_id))

    def some(self, n: int) -> Recording:
        """Return at most `n` of the records, drawn evenly: the same ones each time."""
        if len(self) <= n:
            return self
        # one of each of n equal stretches, at a changing place in it: a stride could meet one person in all frames
        edges = np.linspace(0, len(self), n + 1).astype(np.int64)
        within = np.random.default_rng(0).random(n)
        return self.at(edges[:-1] + (within * np.diff(edges)).astype(np.int64))

    def shifted(self, way_m: Floats) -> Recording:
        """Return the recording at places that far away, (x, y)."""
        return replace(self, places=self.places + way_m)

    def rounding_m(self) -> float:
        """Return the step in which nearly all places are rounded, in metres; 0 = none that is coarse."""
        values_mm = np.rint(self.places[: 10 * 1000].ravel() * 1000)
        if len(values_mm) < 20:
            return 0.0
        for step in _STEPS_MM:
            off = np.abs(values_mm - step * np.rint(values_mm / step))
            if np.mean(off <= 0.51) > 0.99:
                return step / 1000
        return 0.0

    def of_cameras(self, numbers: frozenset[int]) -> Recording:
        """Return the records of some cameras, by their numbers; the same recording each time."""
        chosen = numbers & self._numbers
        if chosen not in self._of_cameras:
            self._of_cameras[chosen] = self.at(np.isin(self.camera, sorted(chosen)))
        return self._of_cameras[chosen]

    def near(self, *, side_m: float) -> Near:
        """Return what finds its records near a place, with those between the records of a track; made once."""
        if side_m not in self._near:
            self._near[side_m] = Near(self._drawn, side_m=side_m)
        return self._near[side_m]

    @cached_property
    def _numbers(self) -> frozenset[int]:
        return frozenset(np.unique(self.camera).tolist())

    @cached_property
    def _of_cameras(self) -> dict[frozenset[int], Recording]:
        return {}

    @cached_property
    def _near(self) -> dict[float, Near]:
        return {}

    @cached_property
    def _drawn(self) -> Recording:
        """Return the records with places between those of a track, in steps of `_DRAWN_S`, in straight lines."""
        order = np.lexsort((self.ts_ms, self.track, self.camera))
        order = order[self.track[order] >= 0]
        if len(order) < 2:
            return self
        before, after = order[:-1], order[1:]
        gap_s = (self.ts_ms[after] - self.ts_ms[before]) / 1000
        is_way = (self.track[before] == self.track[after]) & (self.camera[before] == self.camera[after])
        is_way &= (gap_s > 1.5 * _DRAWN_S) & (gap_s <= _GAP_S)
        before, after, gap_s = before[is_way], after[is_way], gap_s[is_way]
        n_between = np.maximum(np.rint(gap_s / _DRAWN_S).astype(np.int64) - 1, 1)
        row = np.repeat(np.arange(len(before)), n_between)
        step_no = np.arange(len(row)) - np.repeat(np.cumsum(n_between) - n_between, n_between) + 1
        share = step_no / (n_between[row] + 1)
        start, end = before[row], after[row]
        ts_ms = self.ts_ms[start] + np.rint(share * (self.ts_ms[end] - self.ts_ms[start])).astype(np.int64)
        places = self.places[start] + share[:, None] * (self.places[end] - self.places[start])
        both_ms = np.concatenate([self.ts_ms, ts_ms])
        by_time = np.argsort(both_ms, kind="stable")
        return Recording(
            both_ms[by_time],
            np.concatenate([self.places, places])[by_time],
            np.concatenate([self.camera, self.camera[start]])[by_time],
            np.concatenate([self.track, self.track[start]])[by_time],
            np.concatenate([self.owner, self.owner[start]])[by_time],
            self.cameras,
            self.owners,
        )


class Near:
    """Finds the records of a recording near a place and time.

    Args:
        recording: The recording.
        side_m: Side of the squares by which records are looked up; no distance above it can be asked for.
    """

    def __init__(self, recording: Recording, *, side_m: float) -> None:
        self.recording = recording
        self.side_m = side_m
        squares = np.floor(recording.places / side_m).astype(np.int64)
        key = key_of(squares)
        self._order = np.lexsort((recording.ts_ms, key))
        self._keys, self._starts = np.unique(key[self._order], return_index=True)
        self._ends = np.append(self._starts[1:], len(key))
        self._squares = squares
        self._ts_ms = recording.ts_ms[self._order]
        first = int(recording.ts_ms.min()) if len(key) else 0
        self._first_ms, self._range_ms = first, (int(recording.ts_ms.max()) - first + 2) if len(key) else 2
        no = np.repeat(np.arange(len(self._keys)), self._ends - self._starts)
        self._rank = no * self._range_ms + (self._ts_ms - first)

    def pairs(self, places: Floats, from_ms: Ints, to_ms: Ints, *, within_m: float) -> tuple[Ints, Ints, Floats]:
        """Return which of some places are near records, with these and the distances.

        Args:
            places: Shape (n, 2), metres.
            from_ms: Earliest instant of the records, of each place.
            to_ms: Latest instant.
            within_m: Longest distance, at most the side of the squares.
        """
        squares = np.floor(places / self.side_m).astype(np.int64)
        rows: list[Ints] = []
        positions: list[Ints] = []
        low = np.clip(from_ms - self._first_ms, 0, self._range_ms - 1)
        high = np.clip(to_ms - self._first_ms + 1, 0, self._range_ms - 1)
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                key = key_of(squares + np.array([dx, dy]))
                no = np.searchsorted(self._keys, key)
                is_there = no < len(self._keys)
                is_there[is_there] = self._keys[no[is_there]] == key[is_there]
                asked = np.flatnonzero(is_there & (high > low))
                begin = np.searchsorted(self._rank, no[asked] * self._range_ms + low[asked])
                end = np.searchsorted(self._rank, no[asked] * self._range_ms + high[asked])
                n = end - begin
                rows.append(np.repeat(asked, n))
                positions.append(np.arange(int(n.sum())) - np.repeat(np.cumsum(n) - n, n) + np.repeat(begin, n))
        row, record = np.concatenate(rows), self._order[np.concatenate(positions)]
        away_m = np.hypot(*(places[row] - self.recording.places[record]).T)
        is_near = away_m <= within_m
        return row[is_near], record[is_near], away_m[is_near]


def key_of(squares: Ints) -> Ints:
    """Return one number for each square, from the two of its place, shape (n, 2)."""
    return np.asarray(squares[:, 0] * 2_147_483_647 + squares[:, 1])


@dataclass(frozen=True, eq=False)
class Match:
    """How much of a recording is in another one.

    Attributes:
        lag_ms: What is added to the times of the other one to get those of the first.
        within_m: Longest distance.
        is_near: Which records are near one of the other recording.
        record: The nearest record of `other`; -1 = none.
        chance: Share of records that would be near by chance.
        other: The other recording, with places between records.
    """

    lag_ms: int
    within_m: float
    is_near: Bools
    record: Ints
    chance: float
    other: Recording

    @property
    def share(self) -> float:
        """Return the share of records that are near."""
        return float(np.mean(self.is_near)) if len(self.is_near) else 0.0

    @property
    def excess(self) -> float:
        """Return the share of records that are near and would not be by chance: (share - chance) / (1 - chance)."""
        return (self.share - self.chance) / (1 - self.chance) if self.chance < 1 else 0.0


def match(here: Recording, there: Near, *, lag_ms: int, within_m: float, around_s: float) -> Match:
    """Return how many records have one of another recording near, at about their time.

    Args:
        here: The records.
        there: The other recording.
        lag_ms: See `Match`.
        within_m: Longest distance.
        around_s: Longest time between the two.
    """
    around_ms = round(1000 * around_s)
    row, record, away_m = _pairs(here, there, lag_ms, within_m, around_ms)
    nearest = np.full(len(here), -1, dtype=np.int64)
    order = np.argsort(-away_m, kind="stable")
    nearest[row[order]] = record[order]
    stored_ms = there.recording.ts_ms
    chances = []
    for control_s in CONTROLS_S if (nearest >= 0).mean() > SHARE_MIN else ():
        control_ms = lag_ms + round(1000 * control_s)
        at_ms = here.ts_ms - control_ms
        is_compared = (at_ms >= stored_ms[0]) & (at_ms <= stored_ms[-1])
        if is_compared.mean() < 0.3:
            continue
        row, _, _ = _pairs(here, there, control_ms, within_m, around_ms)
        chances.append(len(np.unique(row[is_compared[row]])) / is_compared.sum())
    # no control fits a recording of seconds: people who sit look like themselves at any lag, so a shift proves nothing
    unknown = 1.0 if abs(lag_ms) > UNSHIFTED_MS else 0.0
    return Match(lag_ms, within_m, nearest >= 0, nearest, max(chances, default=unknown), there.recording)


def _pairs(here: Recording, there: Near, lag_ms: int, within_m: float, around_ms: int) -> tuple[Ints, Ints, Floats]:
    at_ms = here.ts_ms - lag_ms
    return there.pairs(here.places, at_ms - around_ms, at_ms + around_ms, within_m=within_m)


def best_match(
    here: Recording, stored: Recording, *, lags_ms: Sequence[int], distances_m: Sequence[float]
) -> Match | None:
    """Return the match with the largest excess, of several lags, distances and times between; None without records."""
    if not len(here) or not len(stored):
        return None
    there = stored.near(side_m=max(distances_m))
    best: Match | None = None
    for lag_ms in lags_ms:
        for within_m in distances_m:
            for around_s in (_CLOSE_S, _AROUND_S):
                candidate = match(here, there, lag_ms=lag_ms, within_m=within_m, around_s=around_s)
                if best is None or candidate.excess > best.excess + 0.02:
                    best = candidate
                if best.excess > 0.97:
                    return best
    return best


def match_beside(here: Recording, stored: Recording) -> tuple[Match, float] | None:
    """Return the match of a recording that is shifted on the floor, and how far in metres; None where there is none.

    The shift is the most frequent way from a stored record to one of the same time, up to `BESIDE_MAX_M`.
    """
    if not len(here) or not len(stored):
        return None
    there = stored.near(side_m=BESIDE_MAX_M)
    row, record, _ = _pairs(here, there, 0, BESIDE_MAX_M, round(1000 * _CLOSE_S))
    ways = here.places[row] - there.recording.places[record]
    if not len(ways):
        return None
    _, square, n = np.unique(
        key_of(np.floor(ways / COARSE_M).astype(np.int64)), return_inverse=True, return_counts=True
    )
    way = np.median(ways[square.ravel() == np.argmax(n)], axis=0)
    way = np.median(ways[np.hypot(*(ways - way).T) <= COARSE_M], axis=0)
    matched = best_match(here.shifted(-way), stored, lags_ms=[0], distances_m=[COARSE_M, FINEST_MAX_M])
    if matched is None or not matched.is_near.any():
        return None
    # in a crowd there is somebody at any distance, whatever the direction
    for x, y in ((-way[1], way[0]), -way, (way[1], -way[0])):
        turned = best_match(here.shifted(-np.array([x, y])), stored, lags_ms=[0], distances_m=[matched.within_m])
        if turned is not None and turned.share > matched.chance:
            matched = replace(matched, chance=turned.share)
    tracks = here.track[matched.is_near], matched.other.track[matched.record[matched.is_near]]
    if max(len(np.unique(t)) for t in tracks) < BESIDE_TRACKS:
        return None
    return matched, float(np.hypot(*way))


def fine_m(*recordings: Recording) -> float:
    """Return the distance within which two spellings of one place are, by how coarsely each is rounded."""
    rounded_m = 0.71 * sum(recording.rounding_m() for recording in recordings) + 0.002
    return min(max(FINE_M, rounded_m), FINEST_MAX_M)


def lags_of(
    here: Near, marks_ms: Ints, marks: Floats, *, within_m: float, longest_s: float | None = None, n_most: int = 2
) -> list[tuple[int, int]]:
    """Return the lags at which most of some marks are in a recording, as milliseconds and number of marks.

    Args:
        here: The recording.
        marks_ms: Instants of records of another one.
        marks: Their places.
        within_m: Longest distance.
        longest_s: Longest lag looked for, in seconds; None = any.
        n_most: Lags to return.
    """
    if not len(marks_ms) or not len(here.recording):
        return []
    ever_ms = round(1000 * longest_s) if longest_s is not None else 1 << 45
    mark, record, _ = here.pairs(marks, marks_ms - ever_ms, marks_ms + ever_ms, within_m=within_m)
    lag_ms = here.recording.ts_ms[record] - marks_ms[mark]
    candidates: list[tuple[int, int]] = []
    for offset_ms in (0, 500):  # a lag at the edge of one second is in the middle of the other
        second = (lag_ms + offset_ms) // 1000
        each = np.unique(np.column_stack([second, mark]), axis=0)[:, 0]
        seconds, n = np.unique(each, return_counts=True)
        for at in np.argsort(-n, kind="stable")[: 3 * n_most].tolist():
            inside = lag_ms[second == seconds[at]]
            candidates.append((int(np.median(inside)), int(n[at])))
    chosen: list[tuple[int, int]] = []
    for lag, n_marks in sorted(candidates, key=lambda f: -f[1]):
        if all(abs(lag - other) > 1500 for other, _ in chosen):
            chosen.append((lag, n_marks))
    return chosen[:n_most]
