"""The paper's two tables on a data set of its layout: ratios by grid search, and each part of the body; beside ours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.engine.body import PART_M
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.people_calibration import calibrate_from_people
from vsd_analytics.engine.published_layout import LabelledSequence
from vsd_analytics.engine.ratio_search import Labelled, joined, paper_distances, search
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
        f1_torso_ratios: Mean F1 of persons over frames with the ratios that are best for the torso: the paper compares
            the parts of the body with ratios that people chose while the torso measured. NaN for `people`.
        pairs: Pooled.
    """

    sequence: str
    method: str
    setting: str
    persons: Scores
    f1_published: float
    f1_torso_ratios: float
    pairs: Scores


@dataclass(frozen=True, slots=True)
class _Found:
    """Hits of one method: of pairs, of persons, and of persons by the torso's ratios (None for `people`)."""

    setting: str
    pairs: Hits
    persons: Hits
    by_torso: Hits | None


def reproduce(sequences: list[LabelledSequence], *, distance_m: float) -> list[MethodScores]:
    """Return the scores of each part of the body with its best ratios, and of the calibration from people.

    Ratios are chosen for each sequence, as it is one camera, by the mean F1 of persons over frames. The calibration
    from people uses no truth.
    """
    rows: list[MethodScores] = []
    gathered: dict[tuple[str, str], list[_Found]] = {}
    for sequence in sequences:
        by_method = {**_by_parts(sequence.labelled, distance_m), "people": _by_people(sequence, distance_m)}
        for method, hits in by_method.items():
            rows.append(_row(sequence.name, method, hits))
            gathered.setdefault((sequence.name.split("/")[0], method), []).append(hits)
    return rows + [_row(f"{data_set}/all", method, _together(hits)) for (data_set, method), hits in gathered.items()]


def _by_parts(labelled: Labelled, distance_m: float) -> dict[str, _Found]:
    """Return what each part of the body finds with its best ratios."""
    best = {part: search([labelled], part=part, distance_m=distance_m, by="persons") for part in PARTS}
    hits_by_part: dict[str, _Found] = {}
    for part, its in best.items():
        apart = paper_distances(labelled, ratios=best["torso"].ratios, part=part, distance_m=distance_m)
        by_torso = labelled.hits(apart, distance_m=distance_m)[1]
        hits_by_part[part] = _Found(str(its.ratios), its.pairs, its.persons, by_torso)
    return hits_by_part


def _by_people(sequence: LabelledSequence, distance_m: float) -> _Found:
    """Return what the calibration from people finds; nothing where it is refused."""
    labelled = sequence.labelled
    apart = np.full(len(labelled.a), np.nan)
    try:
        calibration = calibrate_from_people(sequence.people, size_px=labelled.size_px)
    except CalibrationError as error:
        return _Found(f"refused: {error.why}", *labelled.hits(apart, distance_m=distance_m), None)
    uv = floor_points(labelled.people, homography=calibration.homography, picture_px=labelled.size_px)
    xy = to_floor(calibration.homography, uv, picture_px=labelled.size_px)
    apart = np.linalg.norm(xy[labelled.a] - xy[labelled.b], axis=1)
    return _Found(f"error {calibration.error:.0%}", *labelled.hits(apart, distance_m=distance_m), None)


def _together(all_hits: list[_Found]) -> _Found:
    by_torso = [one.by_torso for one in all_hits if one.by_torso is not None]
    return _Found(
        "",
        joined(one.pairs for one in all_hits),
        joined(one.persons for one in all_hits),
        joined(by_torso) if by_torso else None,
    )


def _row(sequence: str, method: str, hits: _Found) -> MethodScores:
    return MethodScores(
        sequence=sequence,
        method=method,
        setting=hits.setting,
        persons=frame_mean(hits.persons),
        f1_published=f1_of_frames(hits.persons, counts_empty=True),
        f1_torso_ratios=np.nan if hits.by_torso is None else f1_of_frames(hits.by_torso),
        pairs=pooled(hits.pairs),
    )
