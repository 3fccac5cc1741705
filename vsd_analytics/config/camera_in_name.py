"""Cameras in the names of files: `camera_from_name = "{camera}_*.csv"` of a `[[source]]`."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Final

MARK: Final = "{camera}"
EXAMPLE: Final = "{camera}_*.csv"
_TOKEN: Final = re.compile(r"\*|\?|\[!?[^\]/]+\]|.", re.DOTALL)
_ANY: Final = {"*": "[^/]*", "?": "[^/]"}
_NO_WORD_BEFORE, _NO_WORD_AFTER = r"(?<![^\W_])", r"(?![^\W_])"
_NUMBERS: Final = re.compile(r"\d+(?:[-_.:T ]\d+)*")


def fault_of(pattern: str) -> str | None:
    """Return why a text is no pattern of names with a camera in them, or None."""
    if pattern.count(MARK) != 1:
        return f"it has {MARK} where the name has the camera, once"
    if "**" in pattern or PurePosixPath(pattern).is_absolute():
        return "it is compared with the end of the path, part by part"
    return None


def cameras_in_name(name: str, pattern: str, known: Collection[str]) -> list[str]:
    """Return the names of cameras that a path has where a pattern says so; more than one where it can be read so.

    Args:
        name: A path. A pattern without a slash is compared with its last part.
        pattern: As `*`, `?` and `[...]` of shells, with `{camera}`. Beside a `*` the name of a camera ends where a word
            ends, so that `cam-12` is never read as `cam-1`.
        known: Names of cameras.
    """
    end = _end_of(name, pattern)
    cameras = [camera for camera in known if re.fullmatch(_expression(pattern, re.escape(camera)), end)]
    return [camera for camera in cameras if not any(camera != other and camera in other for other in cameras)]


def text_in_name(name: str, pattern: str) -> str | None:
    """Return what a path has where a pattern says that the camera is; None where it does not fit the pattern."""
    match = re.fullmatch(_expression(pattern, "([^/]+?)"), _end_of(name, pattern))
    return None if match is None else match[1]


@dataclass(frozen=True, slots=True)
class CameraName:
    """The name of a camera in the name of a file.

    Attributes:
        camera: The name.
        pattern: Where it is, for `camera_from_name`.
        files: Patterns of such files of all known cameras.
    """

    camera: str
    pattern: str
    files: tuple[str, ...]


def camera_named(file_name: str, known: Collection[str]) -> CameraName | None:
    """Return the one known camera that the last part of a path names; None where it names none, or several."""
    names = [camera for camera in known if camera and not set(camera) & set("/{}")]
    cameras = cameras_in_name(file_name, f"*{MARK}*", names)
    if len(cameras) != 1 or file_name.count(cameras[0]) != 1:
        return None
    front, back = (_glob(part) for part in file_name.split(cameras[0]))
    files = tuple(dict.fromkeys(f"{front}{_glob(camera)}{back}" for camera in names))
    return CameraName(cameras[0], f"{front}{MARK}{back}", files)


def _end_of(name: str, pattern: str) -> str:
    return "/".join(PurePosixPath(name).parts[-len(PurePosixPath(pattern).parts) :])


def _expression(pattern: str, camera: str) -> str:
    front, back = ([*_TOKEN.findall(part)] for part in pattern.split(MARK))
    before = _NO_WORD_BEFORE if front and _is_wild(front[-1]) else ""
    after = _NO_WORD_AFTER if back and _is_wild(back[0]) else ""
    return f"{_joined(front)}{before}{camera}{after}{_joined(back)}"


def _is_wild(token: str) -> bool:
    return token in _ANY or len(token) > 1


def _joined(tokens: list[str]) -> str:
    return "".join(_ANY.get(t) or (_class(t) if len(t) > 1 else re.escape(t)) for t in tokens)


def _class(token: str) -> str:
    body = token[1:-1].replace("\\", r"\\").replace("[", r"\[")
    return f"[{body.replace('!', '^', 1) if body.startswith('!') else body.replace('^', chr(92) + '^', 1)}]"


def _glob(literal: str) -> str:
    """Return a pattern of texts that differ from this one in their numbers."""
    return _NUMBERS.sub("*", re.sub(r"([\[*?])", r"[\1]", literal))
