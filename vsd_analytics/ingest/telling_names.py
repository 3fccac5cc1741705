"""Columns whose names tell what they hold, though nobody mapped them: cameras, ids, classes, confidences, times."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final, Literal

Role = Literal["camera", "id", "class", "confidence", "date", "time"]


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_NAMES: Final[dict[Role, frozenset[str]]] = {
    "camera": _words(
        "camera cameraid cameraname camerano cameranumber cam camid camname camno sensor sensorid sensorname stream "
        "streamid streamname view viewid viewname source sourceid sourcename device deviceid devicename channel "
        "channelid videoid video feed feedid"
    ),
    "id": _words(
        "id person personid personnumber persons pid track tracks trackid tid trackerid trackingid trackingnumber "
        "tracknumber trackno objectid objid oid object obj who name uid uuid subject subjectid pedestrian pedestrianid "
        "pedid agent agentid identity globalid"
    ),
    "class": _words(
        "class classname classid classlabel cls clsname clsid label labelname category categoryid categoryname "
        "objecttype objtype objectclass objclass detectionclass predictedclass kind type"
    ),
    "confidence": _words(
        "confidence conf score prob probability detectionconfidence detectionscore detconf trackconfidence "
        "confidencescore"
    ),
    "date": _words("date day datum localdate"),
    "time": _words("time timeofday clock uhrzeit localtime hour heure hora"),
}

_PLACES: Final = (
    (
        "left top right bottom",
        "x1 y1 x2 y2",
        "x0 y0 x1 y1",
        "xmin ymin xmax ymax",
        "minx miny maxx maxy",
        "xtl ytl xbr ybr",
        "left top right bottom",
    ),
    (
        "center_x center_y width height",
        "xcenter ycenter width height",
        "centerx centery width height",
        "xcentre ycentre width height",
        "xc yc w h",
        "cx cy w h",
        "xcenter ycenter w h",
        "centerx centery w h",
    ),
    ("left top width height", "x y w h", "x y width height", "left top width height", "left top w h"),
    (
        "x_m y_m",
        "xm ym",
        "xmm ymm",
        "xcm ycm",
        "xft yft",
        "xin yin",
        "worldx worldy",
        "floorx floory",
        "groundx groundy",
    ),
    ("u_px v_px", "upx vpx", "xpx ypx", "xpixel ypixel", "footx footy", "u v"),
    ("x_m y_m", "x y", "posx posy", "positionx positiony", "xpos ypos", "xposition yposition", "px py"),
)
"""Names of columns that hold a place together, and ours: boxes first."""

_INSTANTS: Final = ("ts", "timestamp", "time", "datetime", "utc", "epoch", "date", "when", "at", "t")
"""Names of instants, the surest first."""

_FAINT_IDS: Final = ("name", "object", "obj")
"""Names of ids that often hold a class instead."""

PERSON: Final = _words("person persons people pedestrian pedestrians human humans man woman adult child")
"""Words for what is counted, as classes of detectors name it."""

VAGUE: Final = frozenset({"kind", "type"})
"""Names of columns that hold anything: they name classes only where a class of objects is in them."""

OBJECTS: Final = _words(
    "bicycle bike car motorcycle motorbike bus train truck van vehicle dog cat bird cart trolley chair face head "
    "backpack handbag suitcase"
)
"""Classes of detectors that are no person."""


def is_named_like(name: str, role: Role) -> bool:
    """Return whether a column's name says that it holds this, whatever its case, blanks, signs, or front (`p.id`)."""
    return letters(name) in _NAMES[role] or letters(name.rpartition(".")[2]) in _NAMES[role]


def named_like(names: Iterable[str], role: Role) -> list[str]:
    """Return the names that say that their columns hold this, in their order."""
    return [name for name in names if is_named_like(name, role)]


def ids_like(names: Iterable[str]) -> list[str]:
    """Return the names that say that their columns hold the id of a track, the surest first: `trackId` before `id`."""
    given = list(names)
    classes = named_like(given, "class")
    return sorted((n for n in named_like(given, "id") if n not in classes), key=_faintness)


def _faintness(name: str) -> int:
    last = letters(name.rpartition(".")[2])
    if last in _FAINT_IDS:
        return 3
    return 0 if last.startswith("tr") or last == "tid" else 2 if last in ("id", "uid", "uuid") else 1


def time_like(names: Iterable[str]) -> str | None:
    """Return the name that says most surely that its column holds an instant, or None."""
    by_letters = {letters(name.rpartition(".")[2]): name for name in reversed(list(names))}
    return next((by_letters[name] for name in _INSTANTS if name in by_letters), None)


def place_like(names: Iterable[str]) -> dict[str, str]:
    """Return which columns hold a place, as the value of `--map`: ours = theirs; {} when no names say so.

    A box in the picture comes first: `x` and `y` alone may be metres or pixels.
    """
    known = {re.sub(r"[^a-z0-9]", "", name.lower()): name for name in reversed(list(names))}
    for ours, *theirs in _PLACES:
        for wanted in (text.split() for text in theirs):
            for front in ("", "bbox", "box", "bb", "bboxes", "rect"):
                if all(front + name in known for name in wanted):
                    return {o: known[front + name] for o, name in zip(ours.split(), wanted, strict=True)}
    return {}


def letters(text: str) -> str:
    """Return the letters of a text in lower case."""
    return re.sub(r"[^a-z]", "", text.lower())
