"""The best ratios for a scene whose truth is known, for each part of the body: the paper's grid search."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.body import Part, is_valid
from vsd_analytics.engine.paper_method import spaces_of
from vsd_analytics.engine.people import Array, People
from vsd_analytics.engine.ratios import Ratios
from vsd_analytics.engine.scores import Hits, f1_of, f1_of_frames

GRID: Final = tuple(Ratios(h / 10, v / 10) for h, v in product(range(10), repeat=2))
"""0 to 0.9 in steps of 0.1, inset: the paper's grid without 1, which makes no trapezoid."""
Criterion = Literal["pairs", "persons"]
"""Pooled F1 of pairs, or mean F1 of persons over frames, which the paper reports."""


@dataclass(frozen=True, slots=True)
class Labelled:
    """People with the true distances among them.

    Attributes:
        people: In order of frames.
        a: Row of the first person of each pair whose distance is known, shape (m,).
        b: Row of the second, in the same frame.
        distance_m: True distance, shape (m,).
        size_px: Width and height of the picture.
    """

    people: People
    a: NDArray[np.intp]
    b: NDArray[np.intp]
    distance_m: Array
    size_px: tuple[int, int]

    def hits(self, found_m: Array, *, distance_m: float) -> tuple[Hits, Hits]:
        """Return hits of pairs and of persons per frame, for the distances that a method gives the pairs.

        Args:
            found_m: Distance of each pair; NaN = not measured, so not close. Shape (m,).
            distance_m: Closer than this violates.
        """
        is_true, is_found = self.distance_m < distance_m, found_m < distance_m
        frame_of = np.searchsorted(self.people.frames, self.people.frame)
        n = len(self.people.frames)
        pairs = _hits(frame_of[self.a], is_true, is_found, n)
        in_true, in_found = (self._persons(close) for close in (is_true, is_found))
        return pairs, _hits(frame_of, in_true, in_found, n)

    def _persons(self, close: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return who is in a pair that is close."""
        in_any = np.zeros(len(self.people), dtype=bool)
        in_any[self.a[close]] = in_any[self.b[close]] = True
        return in_any


def _hits(frame: NDArray[np.intp], is_true: NDArray[np.bool_], is_found: NDArray[np.bool_], n: int) -> Hits:
    hit, false, missed = (
        np.bincount(frame[rows], minlength=n) for rows in (is_true & is_found, ~is_true & is_found, is_true & ~is_found)
    )
    return Hits(hit, false, missed)


def paper_distances(labelled: Labelled, *, ratios: Ratios, part: Part, distance_m: float = 2.0) -> Array:
    """Return the paper's approximate distance of each pair; NaN where a person does not count or has no such part."""
    people = labelled.people
    spaces = spaces_of(people, ratios=ratios, size_px=labelled.size_px, part=part, distance_m=distance_m)
    radius = np.where(is_valid(people), spaces.radius, np.nan)
    apart = np.linalg.norm(spaces.centre[labelled.a] - spaces.centre[labelled.b], axis=1)
    return np.asarray(apart / (radius[labelled.a] + radius[labelled.b]) * distance_m)


@dataclass(frozen=True, slots=True)
class Searched:
    """The best ratios for a part of the body, with what decided, and the hits they give in each scene.

    Attributes:
        part: Part of the body.
        ratios: One pair of ratios for all scenes.
        f1: The criterion's value.
        pairs: Hits of pairs, all frames of all scenes.
        persons: Hits of persons.
    """

    part: Part
    ratios: Ratios
    f1: float
    pairs: Hits
    persons: Hits


def search(
    scenes: Iterable[Labelled],
    *,
    part: Part,
    distance_m: float = 2.0,
    by: Criterion = "pairs",
    grid: Iterable[Ratios] = GRID,
) -> Searched:
    """Return the ratios of the grid with the greatest F1 against the truth, over all frames of the scenes together.

    Args:
        scenes: Of one camera.
        part: What measures.
        distance_m: Closer than this violates.
        by: What is greatest.
        grid: Ratios to try.
    """
    given = list(scenes)
    best: Searched | None = None
    for ratios in grid:
        hits = [
            s.hits(paper_distances(s, ratios=ratios, part=part, distance_m=distance_m), distance_m=distance_m)
            for s in given
        ]
        pairs, persons = joined(p for p, _ in hits), joined(p for _, p in hits)
        f1 = f1_of(pairs) if by == "pairs" else f1_of_frames(persons)
        if best is None or f1 > best.f1 or np.isnan(best.f1):
            best = Searched(part, ratios, f1, pairs, persons)
    assert best is not None
    return best


def joined(parts: Iterable[Hits]) -> Hits:
    """Return the hits of several scenes one after the other."""
    given = list(parts)
    return Hits(*(np.concatenate([getattr(p, name) for p in given]) for name in ("hit", "false", "missed")))
