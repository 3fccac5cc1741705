"""How good found pairs and persons are against the truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import Array
from vsd_analytics.engine.safe_space import pairs_of_frames
from vsd_analytics.engine.scores import Hits, Scores, frame_mean, pooled
from vsd_analytics.engine.truth import FoundPairs, Positions
from vsd_analytics.errors import InputError

ERROR_WITHIN_M = 6.0
"""Distance errors are measured over true pairs up to here: three times the legal distance says all that matters."""
ERROR_FROM_M = 0.3
"""Below, the annotation itself is as uncertain as the distance."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Scores of one file of messages.

    Attributes:
        distance_m: Pairs closer than this violate.
        n_frames: Frames in both files.
        n_unlabelled: Frames with a message and no truth; they say nothing.
        n_unprocessed: Frames with truth and no message; not scored.
        n_true_pairs: Violations in the truth.
        n_found_pairs: Violations found.
        pairs: Scores of pairs, pooled and as mean of frames.
        persons: The same for persons: in any violation or not.
        detection: The same for all persons: found or not.
        distance_error: Median |found / true - 1| over pairs up to `ERROR_WITHIN_M`; NaN without a common pair.
        distance_bias: Median of found / true - 1.
        n_distances: Pairs these are over.
        n_unnamed: Found persons without id, who are not compared.
    """

    distance_m: float
    n_frames: int
    n_unlabelled: int
    n_unprocessed: int
    n_true_pairs: int
    n_found_pairs: int
    pairs: tuple[Scores, Scores]
    persons: tuple[Scores, Scores]
    detection: tuple[Scores, Scores]
    distance_error: float
    distance_bias: float
    n_distances: int
    n_unnamed: int


def evaluate(detections: FoundPairs, truth: Positions, *, distance_m: float) -> Evaluation:
    """Compare persons and pairs by track id, in the frames that both files have.

    A true pair that is not found counts as missed, also when one of its persons was not detected. A found pair counts
    as false when it is not true, also when the truth does not know one of its persons.

    Raises:
        InputError: The files have no frame, or no track id, in common (E412).
    """
    frames = np.intersect1d(detections.positions.instants, truth.instants)
    if not len(frames):
        raise _nothing("frame", f"messages {_span(detections.positions.instants)}, truth {_span(truth.instants)}")
    index = _Persons(frames, truth, detections)
    if not index.n_common:
        unnamed = f"; {detections.n_unnamed:,} persons have no id" if detections.n_unnamed else ""
        example = f"the truth has such as {truth.track[0]!r}" if len(truth.track) else "the truth has nobody"
        raise _nothing("track id", f"{example}{unnamed}", more="; or compare by place: --by place")
    true = index.true_pairs(truth)
    detected = index.found_pairs(detections, beyond_m=distance_m)
    n = index.size
    is_true, is_found = true.distance_m < distance_m, detected.distance_m < distance_m
    there, got = np.unique(true.code[is_true]), np.unique(detected.code[is_found])
    hit = np.intersect1d(there, got, assume_unique=True)
    pair_hits = _hits(*(index.frame_of[part // n] for part in (hit, got, there)), n_frames=len(frames))
    in_true, in_found = (np.unique(np.concatenate([part // n, part % n])) for part in (there, got))
    both = np.intersect1d(in_true, in_found, assume_unique=True)
    person_hits = _hits(*(index.frame_of[part] for part in (both, in_found, in_true)), n_frames=len(frames))
    seen, known = index.seen, np.arange(index.n_true)
    common = np.intersect1d(seen, known, assume_unique=True)
    all_hits = _hits(*(index.frame_of[part] for part in (common, seen, known)), n_frames=len(frames))
    _, i, j = np.intersect1d(true.code, detected.code, return_indices=True)
    measured = (true.distance_m[i] >= ERROR_FROM_M) & (true.distance_m[i] < ERROR_WITHIN_M)
    off = detected.distance_m[j][measured] / true.distance_m[i][measured] - 1
    off = off[np.isfinite(off)]
    return Evaluation(
        distance_m=distance_m,
        n_frames=len(frames),
        n_unlabelled=len(detections.positions.instants) - len(frames),
        n_unprocessed=len(truth.instants) - len(frames),
        n_true_pairs=len(there),
        n_found_pairs=len(got),
        pairs=(pooled(pair_hits), frame_mean(pair_hits)),
        persons=(pooled(person_hits), frame_mean(person_hits)),
        detection=(pooled(all_hits), frame_mean(all_hits)),
        distance_error=float(np.median(np.abs(off))) if len(off) else np.nan,
        distance_bias=float(np.median(off)) if len(off) else np.nan,
        n_distances=len(off),
        n_unnamed=detections.n_unnamed,
    )


@dataclass(frozen=True, slots=True)
class _Measured:
    """Pairs as one number each, lesser person times all persons plus greater person, and their distances."""

    code: NDArray[np.int64]
    distance_m: Array


class _Persons:
    """Gives every (frame, track id) of truth and messages one number."""

    def __init__(self, frames: NDArray[np.int64], truth: Positions, detections: FoundPairs) -> None:
        self._frames = frames
        self._number: dict[tuple[int, object], int] = {}
        self._add(truth.instant, truth.track)
        self.n_true = len(self._number)
        sides = [
            (detections.positions.instant, detections.positions.track),
            (detections.instant, detections.a),
            (detections.instant, detections.b),
        ]
        for instant, track in sides:
            self._add(instant, track)
        seen = {self._number[key] for instant, track in sides for key in self._keys(instant, track)}
        self.seen = np.array(sorted(seen), dtype=np.int64)
        self.n_common = int((self.seen < self.n_true).sum())
        self.size = len(self._number)
        self.frame_of = np.searchsorted(frames, np.array([at for at, _ in self._number], dtype=np.int64))

    def _add(self, instant: NDArray[np.int64], track: NDArray[np.object_]) -> None:
        for key in self._keys(instant, track):
            self._number.setdefault(key, len(self._number))

    def _keys(self, instant: NDArray[np.int64], track: NDArray[np.object_]) -> Iterator[tuple[int, object]]:
        """Yield frame and track id of the rows in common frames."""
        used = np.isin(instant, self._frames)
        return zip(instant[used].tolist(), track[used], strict=True)

    def _of(self, instant: NDArray[np.int64], track: NDArray[np.object_]) -> NDArray[np.int64]:
        rows = [self._number[key] for key in zip(instant.tolist(), track, strict=True)]
        return np.array(rows, dtype=np.int64)

    def true_pairs(self, positions: Positions) -> _Measured:
        """Return all pairs of positions within a frame."""
        used = np.isin(positions.instant, self._frames)
        instant, track, xy = positions.instant[used], positions.track[used], positions.xy[used]
        a, b = pairs_of_frames(instant)
        who = self._of(instant, track)
        return self._coded(who[a], who[b], np.linalg.norm(xy[a] - xy[b], axis=1))

    def found_pairs(self, detections: FoundPairs, *, beyond_m: float) -> _Measured:
        """Return the pairs that were sent, and those derived from metres: in frames without sent pairs, and farther."""
        used = np.isin(detections.instant, self._frames)
        a, b = (self._of(detections.instant[used], side[used]) for side in (detections.a, detections.b))
        sent = self._coded(a, b, detections.distance_m[used])
        derived = self.true_pairs(detections.positions)
        is_sent_frame = np.isin(self._frames[self.frame_of[derived.code // self.size]], detections.has_pairs)
        # a sender of pairs leaves out the far ones: they are needed for the distance error and are never violations
        reach = sent.distance_m.max(initial=beyond_m)
        free = ~np.isin(derived.code, sent.code) & (~is_sent_frame | (derived.distance_m > reach))
        free &= np.isfinite(derived.distance_m)
        return _Measured(
            np.concatenate([sent.code, derived.code[free]]), np.concatenate([sent.distance_m, derived.distance_m[free]])
        )

    def _coded(self, a: NDArray[np.int64], b: NDArray[np.int64], distance_m: Array) -> _Measured:
        code = np.minimum(a, b) * self.size + np.maximum(a, b)
        code, first = np.unique(code, return_index=True)
        return _Measured(code, distance_m[first])


def _hits(hit: NDArray[np.int64], detected: NDArray[np.int64], there: NDArray[np.int64], *, n_frames: int) -> Hits:
    n_hit, n_found, n_there = (np.bincount(part, minlength=n_frames) for part in (hit, detected, there))
    return Hits(n_hit, n_found - n_hit, n_there - n_hit)


def _span(instants: NDArray[np.int64]) -> str:
    return f"{instants[0]} to {instants[-1]}" if len(instants) else "none"


def _nothing(what: str, why: str, *, more: str = "") -> InputError:
    return InputError(
        f"messages and truth have no {what} in common",
        code="E412",
        why=why,
        fix="compare the same recording: frame is the frame number of the file given to vsd engine run" + more,
    )
