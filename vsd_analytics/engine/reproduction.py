"""The paper's two tables on a data set of its layout: ratios by grid search, and each part of the body; beside ours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.engine.body import PART_M
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.people_calibration import calibrate_from_people
from vsd_analytics.engine.published_layout import LabelledSequence
from vsd_analytics.engine.ratio_search import joined, search
from vsd_analytics.engine.scores import Hits, Scores, f1_of_frames, frame_mean, pooled
from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry.homography import to_floor

PARTS: Final = tuple(PART_M)


@dataclass(frozen=True, slots=True)
class MethodScores:
    """One method on one sequence, or on all sequences of a data set together (`sequence` ends with /all).

    Attributes:
        sequence: `dataset/sequence`.
        method: Part of the body, or `people` for the calibration from people.
        setting: Ratios, or what became of the calibration.
        persons: Mean over frames; a frame without violations and alarms has none.
        f1_published: F1 as mean over frames where such a frame counts 0, as the published evaluation has it.
        pairs: Pooled.
    """

    sequence: str
    method: str
    setting: str
    persons: Scores
    f1_published: float
    pairs: Scores


def reproduce(sequences: list[LabelledSequence], *, distance_m: float) -> list[MethodScores]:
    """Return the scores of each part of the body with its best ratios, and of the calibration from people.

    Ratios are chosen for each sequence, as it is one camera, by the mean F1 of persons over frames. The calibration
    from people uses no truth.
    """
    rows: list[MethodScores] = []
    gathered: dict[tuple[str, str], list[tuple[Hits, Hits]]] = {}
    for sequence in sequences:
        for method in (*PARTS, "people"):
            setting, pairs, persons = _scored(sequence, method, distance_m)
            rows.append(_row(sequence.name, method, setting, pairs, persons))
            gathered.setdefault((sequence.name.split("/")[0], method), []).append((pairs, persons))
    for (data_set, method), parts in gathered.items():
        pairs, persons = joined(p for p, _ in parts), joined(p for _, p in parts)
        rows.append(_row(f"{data_set}/all", method, "", pairs, persons))
    return rows


def _scored(sequence: LabelledSequence, method: str, distance_m: float) -> tuple[str, Hits, Hits]:
    labelled = sequence.labelled
    for part in PARTS:
        if part == method:
            best = search([labelled], part=part, distance_m=distance_m, by="persons")
            return str(best.ratios), best.pairs, best.persons
    try:
        found = calibrate_from_people(sequence.people, size_px=labelled.size_px)
    except CalibrationError as error:
        return f"refused: {error.why}", *labelled.hits(np.full(len(labelled.a), np.nan), distance_m=distance_m)
    xy = to_floor(
        found.homography,
        floor_points(labelled.people, homography=found.homography, picture_px=labelled.size_px),
        picture_px=labelled.size_px,
    )
    apart = np.linalg.norm(xy[labelled.a] - xy[labelled.b], axis=1)
    return f"error {found.error:.0%}", *labelled.hits(apart, distance_m=distance_m)


def _row(sequence: str, method: str, setting: str, pairs: Hits, persons: Hits) -> MethodScores:
    return MethodScores(
        sequence, method, setting, frame_mean(persons), f1_of_frames(persons, counts_empty=True), pooled(pairs)
    )
