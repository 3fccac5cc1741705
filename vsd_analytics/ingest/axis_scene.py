"""AXIS Scene Metadata, frame by frame: the messages of `axis.scene.frame_v1` as MQTT publishes them.

A message has a UTC time and the objects of one frame: track id, class, box as shares of the picture. The frame is the
message itself, or is below `frame` or `data.frame`, as in the beta. Messages do not name the camera: `--camera` does.
`operations` end or rename tracks. A track that was renamed goes on under its new id; ids are not joined afterwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from vsd_analytics.ingest.adapter import IngestOptions
from vsd_analytics.ingest.frame_rows import FrameRows, SeenPerson, finite, id_of, instant_of
from vsd_analytics.ingest.json_messages import JsonMessages, inner, listed
from vsd_analytics.ingest.picture_sizes import size_of
from vsd_analytics.ingest.raw import BadRowError

OTHERS = "not a person"
UNKNOWN = "object without a class"
_EDGE = 1.5
"""Boxes reach a little beyond the picture; further out they are no shares of it."""


class AxisScene(JsonMessages):
    """Adapter of AXIS Scene Metadata."""

    name: ClassVar = "axis-scene"
    coordinates: ClassVar = "shares of the picture (0 to 1), foot point = bottom centre of the box"
    engine: ClassVar = "AXIS Scene Metadata"
    marks: ClassVar = ("observations", "timestamp")

    def take(self, message: Mapping[str, Any], frames: FrameRows, options: IngestOptions, number: int) -> None:
        """Add one frame: the humans of its observations."""
        frame = inner(message, "data") or message
        frame = inner(frame, "frame") or frame
        at = instant_of(frame.get("timestamp"))
        seen, others = [], {OTHERS: 0, UNKNOWN: 0}
        for found in listed(frame, "observations"):
            if not isinstance(found, dict):
                raise BadRowError("bad-message", f"an observation is {str(found)[:40]!r}")
            kind = _kind(found)
            if kind == "human":
                box = inner(found, "bounding_box")
                left, right, bottom = (_share(box.get(side)) for side in ("left", "right", "bottom"))
                width, height = size_of(options, None)
                seen.append(
                    SeenPerson(id_of(found.get("track_id")), None, ((left + right) / 2 * width, bottom * height))
                )
            else:
                others[OTHERS if kind else UNKNOWN] += 1
        frames.add(None, at, seen, line=number)
        frames.dropped.update(others)


def _kind(found: Mapping[str, Any]) -> str:
    """Return the class of an object in lower case; "" = not given. Of several the most certain counts."""
    given = found.get("class", found.get("classes"))
    each = given if isinstance(given, list) else [given]
    known = [c for c in each if isinstance(c, dict) and isinstance(c.get("type"), str)]
    best = max(known, key=lambda c: finite(c.get("score", 0)), default={"type": ""})
    return str(best["type"]).lower()


def _share(value: object) -> float:
    share = finite(value)
    if not -_EDGE <= share <= _EDGE:
        raise BadRowError("out-of-range", f"a box is at {share:g}; its sides are shares of the picture, 0 to 1")
    return share
