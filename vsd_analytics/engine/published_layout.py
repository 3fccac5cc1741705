"""The layout of the data sets that the paper's authors published: Images, HumanJoints, Annotations, Calibrations.

Each sequence has a folder of images and one of OpenPose files, in the same order, and a file of annotations: for each
frame the numbers of the persons that count and the matrix of their distances in metres. A frame without people has no
entry. The calibrations are not needed: the distances are in the annotations.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.body import is_valid
from vsd_analytics.engine.doubles import without_doubles
from vsd_analytics.engine.joint_files import frame_numbers, read_joint_folder
from vsd_analytics.engine.people import Array, People, unusable
from vsd_analytics.engine.ratio_search import Labelled
from vsd_analytics.errors import InputError, UsageError, Where
from vsd_analytics.geometry.picture_size import picture_size

FOLDERS: Final = ("HumanJoints", "Annotations")
DEEPEST: Final = 3
"""Data sets are searched in so many levels of folders: an archive unpacks into folders of its own."""


@dataclass(frozen=True, slots=True)
class LabelledSequence:
    """One sequence of a data set.

    Attributes:
        name: `dataset/sequence`.
        people: All detected people, with one skeleton for each person.
        labelled: Those with true distances: the annotation says who counts.
        n_unknown: Annotated persons who are not in the files of joints, also those of frames without a file.
    """

    name: str
    people: People
    labelled: Labelled
    n_unknown: int


@dataclass(frozen=True, slots=True)
class _AnnotatedFrame:
    """Numbers of the persons of a frame that count, shape (n,), and their distances in metres, shape (n, n)."""

    persons: NDArray[np.intp]
    distance_m: Array


def read_sequences(folder: Path, *, size_px: tuple[int, int] | None = None) -> list[LabelledSequence]:
    """Read all sequences of a data set, or of all data sets in a folder and the folders in it.

    Args:
        folder: With `HumanJoints` and `Annotations`, or holding such folders.
        size_px: Size of the pictures; None = as the first image of each sequence.

    Raises:
        InputError: There is none (E202), an annotation cannot be used (E205), or none of its frames has joints (E202).
        UsageError: The size is not given and there are no images (E101).
    """
    sequences = [
        _sequence(data_set, joints, size_px)
        for data_set in _data_sets(folder, DEEPEST)
        for joints in sorted((data_set / "HumanJoints").iterdir())
        if joints.is_dir()
    ]
    if not sequences:
        raise unusable(
            folder, f"{folder.name} has no sequence", fix="give a folder with Images, HumanJoints and Annotations"
        )
    return sequences


def _data_sets(folder: Path, depth: int) -> Iterator[Path]:
    if all((folder / name).is_dir() for name in FOLDERS):
        yield folder
    elif depth:
        for inner in sorted(p for p in folder.iterdir() if p.is_dir()):
            yield from _data_sets(inner, depth - 1)


def _sequence(data_set: Path, joints: Path, size_px: tuple[int, int] | None) -> LabelledSequence:
    name = f"{data_set.resolve().name}/{joints.name}"
    pictures = data_set / "Images" / joints.name
    images = sorted(p for p in pictures.glob("[!.]*") if p.is_file())
    seen = next((size for image in images if (size := picture_size(image)) is not None), None)
    size = size_px or (None if seen is None else (round(seen[0]), round(seen[1])))
    if size is None:
        raise UsageError(f"the picture size of {name} is not known", fix="--size 640x480")
    people = read_joint_folder(joints, keeps_empty=True)  # PersonList counts all persons of a file
    path = data_set / "Annotations" / f"{joints.name}_joints.json"
    frames = _annotation(path)
    number_of = _frames_of(people, frame_numbers(joints), [image.stem for image in images], frames)
    if not number_of:
        raise unusable(
            path,
            f"no frame of {path.name} has a file of joints",
            why=f"it has frames such as {next(iter(frames), 'none')!r}",
            fix="name frames by their place in the order with six digits, or like their images",
        )
    rows, pairs = [np.empty(0, dtype=np.intp)], [np.empty((0, 3))]
    n_rows = 0
    for key in sorted(number_of, key=lambda k: number_of[k]):
        there, who = _persons(people, number_of[key], frames[key])
        a, b = np.triu_indices(len(there), 1)
        pairs.append(np.column_stack([n_rows + a, n_rows + b, frames[key].distance_m[there[a], there[b]]]))
        rows.append(who)
        n_rows += len(who)
    counted = people.rows(np.concatenate(rows))
    counted = People(counted.frame, counted.track, counted.box, counted.joints, np.unique(counted.frame))
    a, b, distance_m = np.concatenate(pairs).T
    is_known = distance_m >= 0
    labelled = Labelled(counted, a[is_known].astype(np.intp), b[is_known].astype(np.intp), distance_m[is_known], size)
    n_listed = sum(len(frame.persons) for frame in frames.values())
    return LabelledSequence(name, without_doubles(people), labelled, n_listed - n_rows)


def _persons(people: People, number: int, given: _AnnotatedFrame) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return which of the persons listed in a frame are in its file of joints, and their rows."""
    first, end = np.searchsorted(people.frame, [number, number + 1])
    there = np.flatnonzero((given.persons >= 0) & (given.persons < end - first))
    return there, first + given.persons[there]


def _frames_of(
    people: People, numbers: Mapping[str, int], images: list[str], frames: Mapping[str, _AnnotatedFrame]
) -> dict[str, int]:
    """Return the frame number of each annotated frame that has a file of joints, by its key in the annotation.

    Annotations name a frame by its place in the order, with six digits, by the name of its image, or by that of its
    joints. Names of images may look like places and begin with 1. So the naming counts by which most of the persons
    who are listed have the joints that a valid person has, as the annotations list only those.
    """
    in_order = list(numbers.values())
    known = [
        {f"{place:06}": number for place, number in enumerate(in_order)},
        dict(zip(images, in_order, strict=False)) if len(images) == len(in_order) else {},
        {Path(name).stem.removesuffix("_keypoints"): number for name, number in numbers.items()},
        {str(number): number for number in in_order},
    ]
    is_person = is_valid(people)

    def n_persons(names: dict[str, int]) -> int:
        return sum(int(is_person[_persons(people, names[k], frames[k])[1]].sum()) for k in names.keys() & frames.keys())

    best = max(known, key=lambda names: (n_persons(names), len(names.keys() & frames.keys())))
    return {key: best[key] for key in frames if key in best}


def _annotation(path: Path) -> dict[str, _AnnotatedFrame]:
    """Return the annotated frames by their keys; unknown distances (null, NaN, below 0) are NaN or below 0."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return {key: _annotated(key, frame) for key, frame in content.items() if frame}
    except (OSError, ValueError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"cannot read the annotation {path.name}",
            code="E205",
            where=Where(str(path)),
            why=str(error),
            fix='write {"000000": {"PersonList": [0, 1], "DistanceMatrix": [[0, 1.4], [1.4, 0]]}}',
        ) from None


def _annotated(key: str, frame: Mapping[str, Any]) -> _AnnotatedFrame:
    """Return one frame; ValueError with the frame where it cannot be used."""
    if not {"PersonList", "DistanceMatrix"} <= frame.keys():
        raise ValueError(f"frame {key} has no PersonList or no DistanceMatrix")
    persons = np.array([int(person) for person in frame["PersonList"]], dtype=np.intp)
    n = len(persons)
    if n < 2:  # nobody to be near to
        return _AnnotatedFrame(persons, np.full((n, n), np.nan))
    distance_m = np.array(frame["DistanceMatrix"], dtype=np.float64)  # null becomes NaN
    if distance_m.ndim != 2 or min(distance_m.shape) < n or len(np.unique(persons)) < n:
        raise ValueError(f"frame {key} has persons {persons.tolist()} and distances of shape {distance_m.shape}")
    return _AnnotatedFrame(persons, distance_m)
