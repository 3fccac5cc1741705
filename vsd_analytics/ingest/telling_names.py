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
        "tracknumber trackno objectid objid object obj who name uid uuid subject subjectid pedestrian pedestrianid "
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
    """Return whether a column's name says that it holds this: case, blanks and signs do not matter."""
    return letters(name) in _NAMES[role]


def named_like(names: Iterable[str], role: Role) -> list[str]:
    """Return the names that say that their columns hold this, in their order."""
    return [name for name in names if is_named_like(name, role)]


def letters(text: str) -> str:
    """Return the letters of a text in lower case."""
    return re.sub(r"[^a-z]", "", text.lower())
