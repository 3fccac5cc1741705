"""Monoloco's output: a folder with one `*.monoloco.json` per picture (`--output_types json` of its `predict`).

A file holds parallel lists, one entry per person. Names of keys changed between versions of Monoloco; both are read.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import Array, People, PeopleRows, joints_of, unusable

SUFFIX: Final = ".monoloco.json"
_XYZ, _ALEATORIC, _TOTAL, _SOCIAL = ("xyz_pred", "xyz"), "stds_ale", "stds_epi", "social_distance"


@dataclass(frozen=True, slots=True)
class MonolocoPeople:
    """People with Monoloco's own place for each.

    Attributes:
        people: Boxes and joints.
        xyz: Middle of the body in camera axes: metres right, down and ahead, shape (n, 3); NaN where it gave none.
        sd_m: Standard deviation of the distance from the camera, shape (n,); NaN where it gave none.
        is_social: 1 for people whom Monoloco's own rule judges to interact too close, 0 for others, NaN where it did
            not judge, shape (n,). It looks at how people face each other and is no distance.
    """

    people: People
    xyz: Array
    sd_m: Array
    is_social: Array

    def between(self, first_ms: int, end_ms: int) -> MonolocoPeople:
        """Return the frames of [first_ms, end_ms) and their persons; `people` needs times."""
        part = self.people.between(first_ms, end_ms)
        return replace(self.rows(np.isin(self.people.frame, part.frames)), people=part)

    def rows(self, chosen: NDArray[np.bool_]) -> MonolocoPeople:
        """Return some of the persons, over the same frames."""
        people, xyz = self.people.rows(chosen), self.xyz[chosen]
        return MonolocoPeople(people, xyz, self.sd_m[chosen], self.is_social[chosen])


def is_monoloco(path: Path) -> bool:
    """Return whether a path is a folder of Monoloco's files."""
    return path.is_dir() and any(path.glob(f"*{SUFFIX}"))


def read_monoloco(folder: Path) -> MonolocoPeople:
    """Read a folder of Monoloco's files; `{}` is a frame without people.

    The frame number is the last run of digits in the picture's name, such as 12 in `door_000012.png.monoloco.json`;
    names without digits are numbered in their order. The spread is Monoloco's whole one where it ran with dropout
    (`stds_epi`), else that of the Laplace distribution whose scale is `stds_ale`.

    Raises:
        InputError: It has no such file, or nobody in them can be used (E202).
    """
    rows, numbers = PeopleRows(), []
    for number, path in _numbered(folder):
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            persons = _persons(content)
        except (OSError, ValueError, RecursionError):
            rows.bad["file that is not Monoloco's JSON"] += 1
            continue
        rows.frames.add(number)
        for person in persons:
            n_before = len(rows.frame)
            try:
                joints, box, own = _joints(person), _box(person), _own(person)
            except (TypeError, ValueError, IndexError):
                rows.bad["person whose values are no numbers"] += 1
                continue
            rows.add(number, box=box, joints=joints)
            if len(rows.frame) > n_before:
                numbers.append(own)
    if not rows.frame:
        listed = "; ".join(f"{n:,}: {why}" for why, n in rows.bad.items()) or "its files list nobody"
        raise unusable(
            folder,
            f"{folder.name} has no person of Monoloco",
            why=listed,
            fix=f"give the folder that Monoloco's predict wrote its *{SUFFIX} files to (--output_types json)",
        )
    own_numbers = np.array(numbers, dtype=np.float64).reshape(-1, 5)  # files come in order of frames, so rows do
    return MonolocoPeople(rows.people(), own_numbers[:, :3], own_numbers[:, 3], own_numbers[:, 4])


def _numbered(folder: Path) -> list[tuple[int, Path]]:
    files = []
    for index, path in enumerate(sorted(folder.glob(f"*{SUFFIX}")) if folder.is_dir() else ()):
        picture = Path(path.name.removesuffix(SUFFIX))
        digits = re.findall(r"\d+", picture.stem if picture.suffix.lower() in _PICTURES else picture.name)
        files.append((int(digits[-1]) if digits else index, path))
    return sorted(files)


_PICTURES: Final = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".webp"})


def _persons(content: Any) -> list[dict[str, Any]]:
    """Return the entries of all lists person by person; ValueError where lists differ in length."""
    if not isinstance(content, Mapping):
        raise ValueError("no object")
    first = next((content[key] for key in (*_XYZ, "boxes") if isinstance(content.get(key), Sequence)), ())
    names = (*_XYZ, "boxes", "uv_kps", _ALEATORIC, _TOTAL, _SOCIAL)
    lists = {name: content[name] for name in names if isinstance(content.get(name), Sequence)}
    if any(len(values) != len(first) for values in lists.values()):
        raise ValueError("lists of different lengths")
    return [{name: values[i] for name, values in lists.items()} for i in range(len(first))]


def _joints(person: Mapping[str, Any]) -> Array | None:
    if "uv_kps" not in person:
        return None
    u, v, confidence = np.asarray(person["uv_kps"], dtype=np.float64)
    return joints_of(np.column_stack([u, v]), confidence)


def _box(person: Mapping[str, Any]) -> tuple[float, ...] | None:
    return tuple(float(side) for side in person["boxes"][:4]) if "boxes" in person else None


def _own(person: Mapping[str, Any]) -> tuple[float, ...]:
    """Return x, y, z, the spread along the view, and the social flag; NaN for what is not given."""
    given = next((person[key] for key in _XYZ if key in person), (np.nan,) * 3)
    x, y, z = (float(value) for value in given)
    scale, whole = (float(person.get(key, np.nan)) for key in (_ALEATORIC, _TOTAL))
    sd = whole if whole > 0 else scale * float(np.sqrt(2))  # without dropout Monoloco writes 0 for the whole
    social = person.get(_SOCIAL)
    return x, y, z, sd if sd > 0 else np.nan, np.nan if social is None else float(bool(social))
