"""Distances between people from the heights of their boxes, as smart-social-distancing estimates them, and their check.

    d_cm = 170/2 (1/h_a + 1/h_b) |p_a - p_b|

The formula takes every person to be 1.7 m tall. h is the height of a box and p a point of it, in pixels at the
resolution the engine worked at. `center-points` takes the centres. `four-corner` takes the least d over the four pairs
of like corners (upper left with upper left, and so on). Only the aspect ratio of the resolution matters, not its size:
a factor in all pixels cancels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

PERSON_CM = 170.0
METHODS = ("center-points", "four-corner")
ASPECTS_PX = ((640, 480), (1280, 720), (1280, 800), (300, 300), (720, 1280))
"""One resolution for each usual aspect ratio: 4:3, 16:9, 16:10, 1:1, 9:16."""
THRESHOLDS_M = (1.0, 1.5, 1.8, 2.0)
SAMPLE_FRAMES = 300
SAMPLE_PAIRS = 200_000


@dataclass(frozen=True, slots=True)
class EngineSetting:
    """The engine's settings that decide which pairs it counted.

    Attributes:
        method: One of `METHODS`.
        resolution_px: Width and height of the picture; boxes are given as shares of them.
        threshold_m: Pairs strictly closer than this count.
    """

    method: str
    resolution_px: tuple[int, int]
    threshold_m: float

    def __str__(self) -> str:
        width, height = self.resolution_px
        return f"--method {self.method} --resolution {width}x{height} --threshold {self.threshold_m:g}"


@dataclass(frozen=True, slots=True)
class LoggedFrame:
    """The content of one row of a log.

    Attributes:
        boxes: Shape (n, 4): left, top, right, bottom as shares of width and height; bottom below top.
        n_violations: Pairs the engine counted.
        violators: Indexes of the persons in these pairs, each once; None when the log does not list them.
    """

    boxes: NDArray[np.float64]
    n_violations: int
    violators: frozenset[int] | None


@dataclass(frozen=True, slots=True)
class Pairs:
    """All unordered pairs of several frames, flat.

    Attributes:
        frame: Index of the frame each pair is in.
        a: Index of the first person within the frame.
        b: Index of the second, greater than `a`.
        boxes_a: Boxes of the first, shape (pairs, 4).
        boxes_b: Boxes of the second, shape (pairs, 4).
    """

    frame: NDArray[np.intp]
    a: NDArray[np.intp]
    b: NDArray[np.intp]
    boxes_a: NDArray[np.float64]
    boxes_b: NDArray[np.float64]

    @classmethod
    def of(cls, frames: Sequence[LoggedFrame]) -> Pairs:
        """Return the n(n-1)/2 pairs of every frame."""
        sizes = [len(f.boxes) for f in frames]
        by_size = {n: np.triu_indices(n, 1) for n in set(sizes)}
        frame = np.repeat(np.arange(len(frames)), [n * (n - 1) // 2 for n in sizes])
        a, b = (np.concatenate([np.empty(0, np.intp), *(by_size[n][side] for n in sizes)]) for side in (0, 1))
        boxes = np.concatenate([np.empty((0, 4)), *(f.boxes for f in frames)])
        first = np.concatenate([[0], np.cumsum(sizes)]).astype(np.intp)[frame]
        return cls(frame, a, b, boxes[first + a], boxes[first + b])

    def distances_m(self, setting: EngineSetting) -> NDArray[np.float64]:
        """Return the estimated distance of every pair in metres (formula at the top of this module)."""
        scale = np.array(setting.resolution_px * 2, dtype=np.float64)
        a, b = self.boxes_a * scale, self.boxes_b * scale
        # a person 1.7 m tall and h px high gives 170/h cm per pixel; the mean of both persons' scales is used
        cm_per_px = PERSON_CM / 2 * (1 / (a[:, 3] - a[:, 1]) + 1 / (b[:, 3] - b[:, 1]))
        if setting.method == "center-points":
            centre = a[:, :2] + a[:, 2:] - b[:, :2] - b[:, 2:]
            px = np.hypot(centre[:, 0], centre[:, 1]) / 2
        else:
            # like corners differ by left or right in x and by top or bottom in y, each on its own: the least distance
            # over the four corners has the least difference in x and the least in y
            apart = np.abs(a - b)
            px = np.hypot(np.minimum(apart[:, 0], apart[:, 2]), np.minimum(apart[:, 1], apart[:, 3]))
        return np.asarray(cm_per_px * px / 100)


def agreeing(frames: Sequence[LoggedFrame], pairs: Pairs, *, is_close: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return for each frame whether its close pairs agree with the log: equal in number, and of the same persons.

    Args:
        frames: The frames.
        pairs: `Pairs.of(frames)`.
        is_close: For each pair, whether it is closer than the threshold.

    Returns:
        Shape (n_frames,).
    """
    span = 1 + max((len(f.boxes) for f in frames), default=0)
    counts = np.bincount(pairs.frame[is_close], minlength=len(frames))
    agrees = np.asarray(counts == np.array([f.n_violations for f in frames], dtype=np.int64))
    # a person of a frame as one number, frame * span + index, so that all frames are compared in one pass
    close = np.concatenate([(pairs.frame * span + side)[is_close] for side in (pairs.a, pairs.b)])
    logged = [i * span + v for i, f in enumerate(frames) for v in f.violators or ()]
    differing = np.setxor1d(close, np.array(logged, dtype=np.intp)) // span
    is_logged = np.array([f.violators is not None for f in frames], dtype=np.bool_)
    agrees[differing[is_logged[differing]]] = False
    return agrees


@dataclass(slots=True)
class LogAgreement:
    """Counts in how many frames the pairs rebuilt from boxes agree with the log.

    Attributes:
        setting: The setting the pairs were rebuilt with.
        n_frames: Frames compared.
        n_agreeing: Frames in which number and persons of the close pairs are those of the log.
    """

    setting: EngineSetting
    n_frames: int = 0
    n_agreeing: int = 0
    _sample: list[LoggedFrame] = field(default_factory=list)
    _sample_pairs: int = 0

    def add(self, frames: Sequence[LoggedFrame], pairs: Pairs, *, distances_m: NDArray[np.float64]) -> None:
        """Compare some frames, and store the first `SAMPLE_FRAMES` of them for `best`."""
        self.n_frames += len(frames)
        is_close = distances_m < self.setting.threshold_m
        self.n_agreeing += int(agreeing(frames, pairs, is_close=is_close).sum())
        for frame in frames[: SAMPLE_FRAMES - len(self._sample)]:
            self._sample_pairs += len(frame.boxes) ** 2 // 2
            if self._sample_pairs <= SAMPLE_PAIRS:
                self._sample.append(frame)

    def best(self) -> tuple[EngineSetting, int, int]:
        """Return the usual setting that agrees best in the first frames, the number that agree, and their number."""
        pairs = Pairs.of(self._sample)
        tried = []
        thresholds = dict.fromkeys((self.setting.threshold_m, *THRESHOLDS_M))
        resolutions = dict.fromkeys((self.setting.resolution_px, *ASPECTS_PX))
        for method in METHODS:
            for resolution_px in resolutions:
                metres = pairs.distances_m(EngineSetting(method, resolution_px, 0.0))
                for threshold_m in thresholds:
                    n_agreeing = agreeing(self._sample, pairs, is_close=metres < threshold_m).sum()
                    tried.append((int(n_agreeing), EngineSetting(method, resolution_px, threshold_m)))
        n_agreeing, setting = max(tried, key=lambda entry: (entry[0], entry[1] == self.setting))
        return setting, n_agreeing, len(self._sample)

    def note(self) -> str | None:
        """Return the note for the user: "info:" when all frames agree, else warning W209; None without frames."""
        if not self.n_frames:
            return None
        words = f"pairs rebuilt from boxes agree with the log in {self.n_agreeing:,} of {self.n_frames:,} rows"
        if self.n_agreeing == self.n_frames:
            return f"info: {words}"
        best, n_best, n_sample = self.best()
        text = f"W209: {words} ({self.setting})"
        if best == self.setting:
            return (
                f"{text}; no usual setting agrees better: take DistMethod, Resolution and DistThreshold from the "
                "engine's configuration and give them as --method, --resolution and --threshold"
            )
        return f"{text}; set {best}, which agrees in {n_best:,} of the first {n_sample:,} rows"
