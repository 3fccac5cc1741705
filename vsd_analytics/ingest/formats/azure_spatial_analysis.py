"""Azure Spatial Analysis archives: the JSON messages of person count and person distance events.

The service was retired in March 2025; archives remain. A message has `events`, `sourceInfo` (camera, UTC time, picture
size) and the `detections` of its frame. Distances between people are computed from `centerGroundPoint`, feet on the
ground, seen from the camera; the mean and least distance of an event are not used. Ids of detections name a detection
and no person, so records have no track.

The first preview (Project Archon, `metadataType`) has the persons inside its events: all of them in count events, and
only those too close or too far in distance events. Its crossings of lines and zones are one person, of lines the head,
and are left out. Messages of Video Analyzer (`inferences`) name no camera and count 90,000ths of a second since 1970.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any, ClassVar

from vsd_analytics.config.file_columns import METRES
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.envelopes import unwrapped
from vsd_analytics.ingest.reading.frame_rows import FrameRows, SeenPerson, finite, instant_of, size_of
from vsd_analytics.ingest.reading.json_messages import JsonMessages, has_marks, inner, listed, text
from vsd_analytics.ingest.reading.raw import BadRowError
from vsd_analytics.ingest.reading.reasons import NOT_A_PERSON

CROSSINGS = "a crossing of a line or zone"
UNPLACED = "a person whose place the event does not give"
_MARKS = (("sourceInfo", "detections"), ("sourceInfo", "metadataType"), ("inferences", "inferenceId"))
_TICKS_HZ = 90_000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)

Size = tuple[int, int]


class AzureSpatialAnalysis(JsonMessages):
    """Adapter of Azure Spatial Analysis messages."""

    name: ClassVar = "azure-spatial-analysis"
    coordinates: ClassVar = (
        "feet from the camera (centerGroundPoint), as metres; --coordinates image: pixels of the box"
    )
    uses: ClassVar = JsonMessages.uses | {"coordinates", "size_px"}
    engine: ClassVar = "Azure Spatial Analysis"
    marks: ClassVar = ("sourceInfo", "detections")

    def detects(self, source: Source) -> bool:
        """Return whether the file begins as JSON and has the keys of one of the three versions."""
        return any(has_marks(source, marks) for marks in _MARKS)

    def take(self, message: Mapping[str, Any], frames: FrameRows, options: IngestOptions, number: int) -> None:
        """Add the frame of one message; messages of one frame have the same records, which are stored once."""
        _, message = unwrapped(message)
        if "inferences" in message:
            _take_inferences(message, frames, options, number)
            return
        source = inner(message, "sourceInfo")
        camera = text(source, "id") or options.camera
        at = instant_of(source.get("timestamp"))
        is_calibrated = text(inner(source, "cameraCalibrationInfo"), "status") in (
            "",
            "Complete",
            "Calibrated",
        )
        detections = listed(message, "detections")
        if "metadataType" in message or any(isinstance(d, dict) and "metadataType" in d for d in detections):
            frames.dropped[CROSSINGS] += len(detections)
            return
        if any(isinstance(e, dict) and "metadataType" in e for e in listed(message, "events")):
            detections, n_unplaced = _of_preview(message)
            frames.dropped[UNPLACED] += n_unplaced
        message_px = tuple(
            n for n in (source.get("width"), source.get("height")) if isinstance(n, int) and 0 < n < 100_000
        )
        size = (message_px[0], message_px[1]) if len(message_px) == 2 else None
        seen, n_others = [], 0
        for detection in detections:
            if not isinstance(detection, dict):
                raise BadRowError("bad-message", f"a detection is {str(detection)[:40]!r}")
            if not _is_person(detection):
                n_others += 1
                continue
            is_floor = is_calibrated and options.coordinates != "image"
            seen.append(frames.person(partial(_person, detection, is_floor, size, options, camera)))
        frames.add(camera, at, seen, line=number)
        frames.dropped[NOT_A_PERSON] += n_others


def _is_person(detection: Mapping[str, Any]) -> bool:
    """Return whether a detection is of a person; the preview's distance events list nobody else."""
    kinds = [text(kind, "name") for kind in listed(detection, "types") if isinstance(kind, dict)]
    return "person" in (kind.lower() for kind in [*kinds, text(detection, "type") or ("" if kinds else "person")])


def _of_preview(message: Mapping[str, Any]) -> tuple[list[Any], int]:
    """Return the persons of the first preview's events, each once, and how many are counted without a place."""
    detection: dict[str, Any] = {}
    n_unplaced = 0
    for event in (e for e in listed(message, "events") if isinstance(e, dict)):
        about = inner(event, "metadata")
        people = [*listed(event, "detections"), *listed(about, "distanceViolationPersonInfo")]
        n_stated = about.get("personCount", about.get("detectionCount"))
        n_unplaced = max(n_unplaced, (n_stated if isinstance(n_stated, int) else 0) - len(people))
        for person in people:
            name = person.get("id") if isinstance(person, dict) else None
            detection.setdefault(str(name or person), person)
    return list(detection.values()), n_unplaced


def _take_inferences(message: Mapping[str, Any], frames: FrameRows, options: IngestOptions, number: int) -> None:
    """Add the frame of a message of Video Analyzer."""
    ticks = message.get("timestamp")
    if isinstance(ticks, bool) or not isinstance(ticks, int) or not 0 < ticks < 2**53:
        raise BadRowError("not-a-time", f"{str(ticks)[:40]!r} is no number of ticks")
    seen = []
    for entity, more in _entities(message):
        if text(inner(entity, "tag"), "value").lower() != "person":
            frames.dropped[NOT_A_PERSON] += 1
            continue
        point = {"x": more.get("centerGroundPointX"), "y": more.get("centerGroundPointY")}
        detection = {"centerGroundPoint": point, "rectangle": inner(entity, "box")}
        is_floor = options.coordinates != "image"
        seen.append(frames.person(partial(_person, detection, is_floor, None, options, options.camera)))
    frames.add(options.camera, _EPOCH + timedelta(seconds=ticks / _TICKS_HZ), seen, line=number)


def _entities(message: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    for inference in listed(message, "inferences"):
        if not isinstance(inference, dict):
            raise BadRowError("bad-message", f"an inference is {str(inference)[:40]!r}")
        if text(inference, "type") == "entity":
            yield inner(inference, "entity"), inner(inference, "extensions")


def _person(
    detection: Mapping[str, Any], is_floor: bool, message_px: Size | None, options: IngestOptions, camera: str | None
) -> SeenPerson:
    floor = _ground(detection) if is_floor else None
    return SeenPerson(None, floor, _foot(detection, message_px, options, camera) if floor is None else None)


def _ground(detection: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the point on the ground in metres; None where the service had none, which it writes as 0, 0."""
    point = inner(detection, "centerGroundPoint") or inner(inner(detection, "metadata"), "centerGroundPoint")
    if point.get("x") is None or point.get("y") is None:
        return None
    x, y = finite(point["x"]), finite(point["y"])
    return None if x == y == 0 else (x * METRES["ft"], y * METRES["ft"])


def _foot(
    detection: Mapping[str, Any], message_px: Size | None, options: IngestOptions, camera: str | None
) -> tuple[float, float]:
    """Return the bottom centre of the region in pixels."""
    box = inner(detection, "rectangle") or inner(detection, "bbox")
    if box:
        left, top, width, height = (
            finite(box.get(side, box.get(side[0]))) for side in ("left", "top", "width", "height")
        )
        xs, ys = [left, left + width], [top, top + height]
    else:
        points = listed(inner(detection, "region"), "points")
        if not points or not all(isinstance(p, dict) for p in points):
            raise BadRowError("no-position", "the detection has neither a point on the ground nor a region")
        xs, ys = ([finite(p.get(axis)) for p in points] for axis in "xy")
    width_px, height_px = size_of(options, camera, message_px=message_px)
    return (min(xs) + max(xs)) / 2 * width_px, max(ys) * height_px
