"""The layout of the data sets that the paper's authors published: Images, HumanJoints, Annotations, Calibrations.

Each sequence has a folder of images and one of OpenPose files, in the same order, and a file of annotations: for each
frame the numbers of the persons that count and the matrix of their distances in metres. A frame without people has no
entry. The calibrations are not needed: the distances are in the annotations.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vsd_analytics.engine.joint_files import frame_numbers, read_joint_folder
from vsd_analytics.engine.people import People
from vsd_analytics.engine.ratio_search import Labelled
from vsd_analytics.errors import InputError, UsageError, Where
from vsd_analytics.geometry.picture_size import picture_size

FOLDERS = ("HumanJoints", "Annotations")


@dataclass(frozen=True, slots=True)
class LabelledSequence:
    """One sequence: its name as `dataset/sequence`, all detected people, and those with true distances."""

    name: str
    people: People
    labelled: Labelled


def read_sequences(folder: Path, *, size_px: tuple[int, int] | None = None) -> list[LabelledSequence]:
    """Read all sequences of a data set, or of all data sets in a folder.

    Args:
        folder: With `HumanJoints` and `Annotations`, or holding such folders.
        size_px: Size of the pictures; None = as the first image of each sequence.

    Raises:
        InputError: There is none (E202), or an annotation cannot be used (E205).
        UsageError: The size is not given and there are no images (E101).
    """
    found = [
        _sequence(data_set, joints, size_px)
        for data_set in _data_sets(folder)
        for joints in sorted((data_set / "HumanJoints").iterdir())
        if joints.is_dir()
    ]
    if not found:
        raise InputError(
            f"{folder.name} has no sequence",
            code="E202",
            where=Where(str(folder)),
            fix="give a folder with Images, HumanJoints and Annotations",
        )
    return found


def _data_sets(folder: Path) -> Iterator[Path]:
    for candidate in (folder, *sorted(p for p in folder.iterdir() if p.is_dir())):
        if all((candidate / name).is_dir() for name in FOLDERS):
            yield candidate


def _sequence(data_set: Path, joints: Path, size_px: tuple[int, int] | None) -> LabelledSequence:
    name = f"{data_set.name}/{joints.name}"
    pictures = data_set / "Images" / joints.name
    images = sorted(p for p in pictures.iterdir() if p.is_file()) if pictures.is_dir() else []
    seen = picture_size(images[0]) if images else None
    size = size_px or (None if seen is None else (round(seen[0]), round(seen[1])))
    if size is None:
        raise UsageError(f"the picture size of {name} is not known", fix="--size 640x480")
    people = read_joint_folder(joints, keeps_empty=True)  # PersonList counts all persons of a file
    frames = _annotation(data_set / "Annotations" / f"{joints.name}_joints.json")
    number_of = _frames_of(frame_numbers(joints), [image.stem for image in images], frames)
    rows: list[int] = []
    pairs: list[tuple[int, int, float]] = []
    for key in sorted(number_of, key=lambda k: number_of[k]):
        first = int(np.searchsorted(people.frame, number_of[key]))
        in_frame = int(np.searchsorted(people.frame, number_of[key], side="right")) - first
        listed = [(i, int(person)) for i, person in enumerate(frames[key]["PersonList"])]
        listed = [(i, person) for i, person in listed if 0 <= person < in_frame]
        matrix = frames[key]["DistanceMatrix"]
        start = len(rows)
        rows += [first + person for _, person in listed]
        pairs += [
            (start + i, start + j, float(matrix[listed[i][0]][listed[j][0]]))
            for i in range(len(listed))
            for j in range(i + 1, len(listed))
            if _is_distance(matrix[listed[i][0]][listed[j][0]])
        ]
    counted = people.rows(np.array(rows, dtype=np.intp))
    counted = People(counted.frame, counted.track, counted.box, counted.joints, np.unique(counted.frame))
    a, b, distance_m = (np.array([pair[i] for pair in pairs]) for i in range(3))
    return LabelledSequence(
        name, people, Labelled(counted, a.astype(np.intp), b.astype(np.intp), distance_m.astype(np.float64), size)
    )


def _frames_of(numbers: dict[str, int], images: list[str], frames: dict[str, Any]) -> dict[str, int]:
    """Return the frame number of each annotated frame that has a file of joints, by its key in the annotation.

    Annotations name a frame by the name of its image, by that of its joints, or by its place in the order, with six
    digits. Names count that match most.
    """
    in_order = list(numbers.values())
    known = [
        {f"{place:06}": number for place, number in enumerate(in_order)},
        dict(zip(images, in_order, strict=False)) if len(images) == len(in_order) else {},
        {Path(name).stem.removesuffix("_keypoints"): number for name, number in numbers.items()},
        {str(number): number for number in in_order},
    ]
    best = max(known, key=lambda names: len(names.keys() & frames.keys()))
    return {key: best[key] for key in frames if key in best}


def _is_distance(value: object) -> bool:
    """Return whether a distance is known: null, NaN and numbers below 0 are none."""
    return isinstance(value, int | float) and value >= 0


def _annotation(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if not all({"PersonList", "DistanceMatrix"} <= frame.keys() for frame in content.values()):
            raise ValueError("a frame without PersonList or DistanceMatrix")
    except (OSError, ValueError, AttributeError) as error:
        raise InputError(
            f"cannot read the annotation {path.name}",
            code="E205",
            where=Where(str(path)),
            why=str(error),
            fix='write {"000000": {"PersonList": [0, 1], "DistanceMatrix": [[0, 1.4], [1.4, 0]]}}',
        ) from None
    return content  # type: ignore[no-any-return]
