"""Joints of people as JSON: OpenPose folders, and the lists that AlphaPose, mmpose, openpifpaf and COCO tools write.

The layouts are recognised by their keys. Skeletons are recognised by their number of joints.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsd_analytics.engine.people import Array, People, PeopleRows, joints_of, unusable
from vsd_analytics.errors import InputError, Where

LARGEST_FRAME = 2**62
"""Longer runs of digits are names and no frame numbers."""
NORMALISED_BELOW = 1.5
"""Coordinates that all lie below this are shares of the picture and no pixels."""


def read_joint_folder(folder: Path, *, keeps_empty: bool = False) -> People:
    """Read a folder with one JSON file per frame, as OpenPose's `--write_json` makes; a file without people is a frame.

    Args:
        folder: See `frame_numbers` for its names.
        keeps_empty: Persons without joints have rows, so that rows of a frame are numbered as in its file.

    Raises:
        InputError: No file of the folder can be used (E202), two files have one frame number, as those of two videos
            do (E202), or joints are no pixels (E202).
    """
    rows = PeopleRows(keeps_empty=keeps_empty)
    numbers = frame_numbers(folder)
    for path in _json_files(folder):
        if path.name not in numbers:
            rows.bad["file without a frame number in its name"] += 1
            continue
        try:
            content = json.loads(path.read_text(encoding="utf-8-sig"))
        except (OSError, ValueError, RecursionError):
            rows.bad["file that is no JSON"] += 1
            continue
        number = numbers[path.name]
        rows.frames.add(number)
        _add(rows, ((number, person) for _, person in _persons(content)))
    return _checked(rows, folder)


def frame_numbers(folder: Path) -> dict[str, int]:
    """Return the frame number of each JSON file of a folder by its name, in order of names.

    It is the last run of digits in the name, such as 12 in `door_000000000012_keypoints.json`. Files without digits
    are no frames, unless none has any: then they are numbered in their order.

    Raises:
        InputError: Two files have one number (E202).
    """
    paths = _json_files(folder)
    numbers = [_last_number(path.stem.removesuffix("_keypoints")) for path in paths]
    if all(number is None for number in numbers):
        return {path.name: index for index, path in enumerate(paths)}
    names: dict[int, str] = {}
    for path, number in zip(paths, numbers, strict=True):
        if number is None:
            continue
        if number in names:
            raise unusable(
                folder,
                f"two files of {folder.name} are frame {number}",
                why=f"the last number in a name is the frame's: {names[number]} and {path.name}",
                fix="give each video a folder of its own",
            )
        names[number] = path.name
    return {name: number for number, name in names.items()}


def _json_files(folder: Path) -> list[Path]:
    """Return the JSON files of a folder in order of names, without the hidden ones that macOS puts beside others."""
    return sorted(folder.glob("[!.]*.json"))


def read_joint_file(path: Path) -> People:
    """Read a JSON file, or JSON lines, with the people of all frames.

    Raises:
        InputError: It is no JSON (E205), has no joints (E202), or its joints are no pixels (E202).
    """
    rows = PeopleRows()
    try:
        text = path.read_text(encoding="utf-8-sig")
        try:
            content = json.loads(text)
        except ValueError:
            content = [json.loads(line) for line in text.splitlines() if line.strip()]
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(
            f"cannot read {path.name} as JSON",
            code="E205",
            where=Where(str(path)),
            why=str(error),
            fix="write the detector's results again",
        ) from None
    rows.frames.update(number for number, person in _persons(content) if person is None and number is not None)
    _add(rows, ((number, person) for number, person in _persons(content) if person is not None))
    return _checked(rows, path)


def _checked(rows: PeopleRows, path: Path) -> People:
    """Return the people, or say why there are none."""
    if not rows.frame:
        listed = "; ".join(f"{n:,}: {why}" for why, n in rows.bad.items()) or "it lists nobody"
        below = sorted(f.name for f in path.iterdir() if f.is_dir() and any(f.glob("*.json"))) if path.is_dir() else []
        if below:
            raise unusable(
                path,
                f"{path.name} has no JSON files, but folders with JSON files",
                why=f"one folder is one camera: {', '.join(below[:5])}",
                fix=f"give one of them: {path / below[0]}",
            )
        raise unusable(
            path,
            f"{path.name} has no person with joints",
            why=listed,
            fix="give an OpenPose --write_json folder, a COCO, AlphaPose, mmpose or openpifpaf JSON file, or a CSV of "
            "boxes",
        )
    people = rows.people()
    known = people.joints[np.isfinite(people.joints)]
    if len(known) and np.abs(known).max() < NORMALISED_BELOW:
        raise unusable(
            path,
            f"the joints of {path.name} are no pixels",
            why="all coordinates are shares of the picture",
            fix="run the detector with pixels, such as OpenPose's --keypoint_scale 0",
        )
    return people


def _persons(content: Any) -> Iterator[tuple[int | None, Any]]:
    """Yield frame number and person of any known layout; (number, None) is a frame without people."""
    if isinstance(content, Mapping):
        for key in ("instance_info", "people", "predictions", "instances", "annotations"):
            if isinstance(content.get(key), Sequence):
                number = _number(content)
                yield from ((number, None),) if number is not None else ()
                yield from ((number if n is None else n, p) for n, p in _persons(content[key]))
                return
        keyed = {_last_number(Path(str(key)).stem): persons for key, persons in content.items()}
        if keyed and None not in keyed and all(map(_are_persons, keyed.values())):
            for number, persons in keyed.items():  # by picture, as AlphaPose and PoseFlow write them
                yield number, None
                yield from ((number if n is None else n, p) for n, p in _persons(persons))
            return
        yield _number(content), content
    elif isinstance(content, Sequence) and not isinstance(content, str):
        for item in content:
            yield from _persons(item)


def _are_persons(value: object) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str) and all(isinstance(p, Mapping) for p in value)


def _number(item: Mapping[str, Any]) -> int | None:
    """Return the frame number an object carries: a number, or the last digits of a file name."""
    for key in ("frame_id", "frame", "image_id", "image"):
        value = _whole(item.get(key))
        if isinstance(value, int) and abs(value) < LARGEST_FRAME:
            return value
        if isinstance(value, str) and (number := _last_number(Path(value).stem)) is not None:
            return number
    return None


def _last_number(name: str) -> int | None:
    """Return the last run of digits in a name, None where there is none or it is too long for a frame number."""
    digits = re.findall(r"[0-9]+", name)
    number = int(digits[-1]) if digits and len(digits[-1]) < 100 else None
    return number if number is not None and number < LARGEST_FRAME else None


def _whole(value: object) -> object:
    """Return whole numbers written with a decimal point, as tools of arrays write them, as int; no bool."""
    if isinstance(value, bool):
        return None
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _add(rows: PeopleRows, persons: Iterator[tuple[int | None, Any]]) -> None:
    for number, person in persons:
        if number is None:
            rows.bad["person without a frame"] += 1
            continue
        try:
            points, confidence = _points(person)
            box = _box(person)
            joints = joints_of(points, confidence)
        except (TypeError, ValueError, KeyError, IndexError, StopIteration):
            rows.skip(number, "person whose joints are no numbers")
            continue
        if joints is None and len(points):
            rows.skip(number, f"skeleton of {len(points)} joints, which is not known")
            continue
        rows.add(number, track=_track(person), box=box, joints=joints)
        if joints is not None:
            rows.n_joints.add(len(points))


def _points(person: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return pixels (k, 2) and confidences (k,) of one person."""
    if "keypoint_scores" in person:
        return (
            np.asarray(person["keypoints"], dtype=np.float64).reshape(-1, 2),
            np.asarray(person["keypoint_scores"], dtype=np.float64).reshape(-1),
        )
    if isinstance(columns := person.get("keypoints"), Mapping):  # ultralytics
        points = np.column_stack([columns["x"], columns["y"]]).astype(np.float64)
        return points, np.asarray(columns.get("visible", np.ones(len(points))), dtype=np.float64)
    flat = next(person[key] for key in ("pose_keypoints_2d", "pose_keypoints", "keypoints") if key in person)
    triples = np.asarray(flat, dtype=np.float64).reshape(-1, 3)
    return triples[:, :2], triples[:, 2]


def _box(person: Mapping[str, Any]) -> tuple[float, float, float, float] | None:
    """Return left, top, right, bottom; mmpose nests them, the others give left, top, width, height."""
    given = person.get("bbox", person.get("box"))
    if given is None:
        return None
    if isinstance(given, Mapping):  # ultralytics
        return float(given["x1"]), float(given["y1"]), float(given["x2"]), float(given["y2"])
    values = np.asarray(given, dtype=np.float64).reshape(-1)[:4]
    left, top, right, bottom = (float(v) for v in values)
    return (left, top, right, bottom) if "bbox_score" in person else (left, top, left + right, top + bottom)


def _track(person: Mapping[str, Any]) -> object:
    """Return the track id, None where the tool did not track; OpenPose writes [-1] then."""
    for key in ("track_id", "idx", "id_", "person_id"):
        value = person.get(key)
        value = _whole(value[0] if isinstance(value, list) and len(value) == 1 else value)
        if isinstance(value, int | str) and value not in {-1, ""}:
            return value
    return None
