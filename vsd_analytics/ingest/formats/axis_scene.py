"""AXIS Scene Metadata, frame by frame: the messages of `com.axis.scene.frame.v1` as MQTT publishes them.

A message has a UTC time and the objects of one frame (`detections`; `observations` in the beta): track id, class, box
as shares of the picture. The frame is the message itself, or is below `frame` or `data.frame`. An empty frame has a
time only. Cameras classify an object in some frames, so its class is remembered. Messages do not name the camera:
`--camera` does, and frames of another channel than the first are refused. Tracks that are renamed are not joined.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial
from typing import Any, ClassVar

from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.envelopes import unwrapped
from vsd_analytics.ingest.reading.frame_rows import FrameRows, SeenPerson, finite, id_of, instant_of, size_of
from vsd_analytics.ingest.reading.json_messages import JsonMessages, has_marks, inner, listed
from vsd_analytics.ingest.reading.raw import BadRowError
from vsd_analytics.ingest.reading.reasons import NO_CLASS, NOT_A_PERSON

_EMPTY = frozenset({"channel_id", "timestamp", "detections", "track_events"})
_EDGE = 1.5
"""Boxes reach a little beyond the picture; further out they are no shares of it."""


class AxisScene(JsonMessages):
    """Adapter of AXIS Scene Metadata."""

    name: ClassVar = "axis-scene"
    coordinates: ClassVar = "shares of the picture (0 to 1), foot point = bottom centre of the box"
    uses: ClassVar = JsonMessages.uses | {"size_px"}
    engine: ClassVar = "AXIS Scene Metadata"
    marks: ClassVar = ("observations", "timestamp")
    stable_marks: ClassVar = ("object_track_id", "timestamp")

    def detects(self, source: Source) -> bool:
        """Return whether the file begins with frames of the beta, of version 1, or with empty ones of version 1."""
        return super().detects(source) or has_marks(source, self.stable_marks) or _is_empty_frame(source)

    def take(self, message: Mapping[str, Any], frames: FrameRows, options: IngestOptions, number: int) -> None:
        """Add one frame: the humans of its observations."""
        topic, message = unwrapped(message)
        frame = inner(message, "data") or message
        frame = inner(frame, "frame") or frame
        at = instant_of(frame.get("timestamp"))
        channel = frame.get("channel_id", message.get("channel_id"))
        if channel is None and not {"observations", "detections"} & set(frame):  # frames without people have one
            raise BadRowError("bad-message", "it has neither observations nor detections nor a channel")
        view = [f"topic {topic}"] * (topic is not None) + [f"channel {channel}"] * (channel is not None)
        frames.check_view(" and ".join(view) or None)
        seen, others = [], {NOT_A_PERSON: 0, NO_CLASS: 0}
        for observation in [*listed(frame, "observations"), *listed(frame, "detections")]:
            if not isinstance(observation, dict):
                raise BadRowError("bad-message", f"an observation is {str(observation)[:40]!r}")
            track = id_of(observation.get("object_track_id", observation.get("track_id")))
            kind = frames.kind_of(track, _kind(observation))
            is_staff = options.is_staff(kind)
            if kind == "human" or is_staff:
                seen.append(frames.person(partial(_person, track, observation, options, is_staff)))
            else:
                others[NOT_A_PERSON if kind else NO_CLASS] += 1
        frames.add(None, at, seen, line=number)
        frames.dropped.update(others)


def _person(
    track: str | None, observation: Mapping[str, Any], options: IngestOptions, is_staff: bool | None
) -> SeenPerson:
    box = inner(observation, "bounding_box")
    left, right, bottom = (_share(box.get(side)) for side in ("left", "right", "bottom"))
    width, height = size_of(options, None)
    return SeenPerson(track, None, ((left + right) / 2 * width, bottom * height), is_staff)


def _is_empty_frame(source: Source) -> bool:
    """Return whether the first line is a frame of version 1 without objects."""
    first = source.head(4096).lstrip().partition(b"\n")[0] if source.path.is_file() else b""
    if not first.startswith(b"{"):
        return False
    try:
        message = json.loads(first)
    except (ValueError, RecursionError):
        return False
    return {"channel_id", "timestamp"} <= set(message) <= _EMPTY


def _kind(observation: Mapping[str, Any]) -> str:
    """Return the class of an object in lower case; "" = not given. Of several the most certain counts."""
    given = observation.get("class", observation.get("classes"))
    each = given if isinstance(given, list) else [given]
    known = [c for c in each if isinstance(c, dict) and isinstance(c.get("type"), str)]
    best = max(known, key=lambda c: finite(c.get("score", 0)), default={"type": ""})
    return str(best["type"]).lower()


def _share(value: object) -> float:
    share = finite(value)
    if not -_EDGE <= share <= _EDGE:
        raise BadRowError("out-of-range", f"a box is at {share:g}; its sides are shares of the picture, 0 to 1")
    return share
