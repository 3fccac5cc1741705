"""Azure Spatial Analysis archives: the JSON messages of person count and person distance events.

The service was retired in March 2025; archives remain. A message has `events`, `sourceInfo` (camera, UTC time, picture
size) and the `detections` of its frame. Distances between people are computed from `centerGroundPoint`, feet on the
ground, seen from the camera; the mean and least distance of an event are not used. Ids of detections name a detection
and no person, so records have no track.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from vsd_analytics.config.file_columns import METRES
from vsd_analytics.ingest.adapter import IngestOptions
from vsd_analytics.ingest.frame_rows import FrameRows, SeenPerson, finite, instant_of
from vsd_analytics.ingest.json_messages import JsonMessages, inner, listed, text
from vsd_analytics.ingest.picture_sizes import size_of
from vsd_analytics.ingest.raw import BadRowError

OTHERS = "not a person"


class AzureSpatialAnalysis(JsonMessages):
    """Adapter of Azure Spatial Analysis messages."""

    name: ClassVar = "azure-spatial-analysis"
    coordinates: ClassVar = (
        "feet from the camera (centerGroundPoint), as metres; --coordinates image: pixels of the box"
    )
    engine: ClassVar = "Azure Spatial Analysis"
    marks: ClassVar = ("sourceInfo", "detections")

    def take(self, message: Mapping[str, Any], frames: FrameRows, options: IngestOptions, number: int) -> None:
        """Add the frame of one message; messages of one frame have the same records, which are stored once."""
        source = inner(message, "sourceInfo")
        at = instant_of(source.get("timestamp"))
        camera = text(source, "id") or options.camera
        is_calibrated = text(inner(source, "cameraCalibrationInfo"), "status") in (
            "",
            "Complete",
            "Calibrated",
        )
        seen, n_others = [], 0
        for found in listed(message, "detections"):
            if not isinstance(found, dict):
                raise BadRowError("bad-message", f"a detection is {str(found)[:40]!r}")
            if text(found, "type").lower() != "person":
                n_others += 1
                continue
            floor = _ground(found) if is_calibrated and options.coordinates != "image" else None
            seen.append(SeenPerson(None, floor, _foot(found, source, options, camera) if floor is None else None))
        frames.add(camera, at, seen, line=number)
        frames.dropped[OTHERS] += n_others


def _ground(found: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the point on the ground in metres; None where the service had none, which it writes as 0, 0."""
    point = inner(found, "centerGroundPoint") or inner(inner(found, "metadata"), "centerGroundPoint")
    if point.get("x") is None or point.get("y") is None:
        return None
    x, y = finite(point["x"]), finite(point["y"])
    return None if x == y == 0 else (x * METRES["ft"], y * METRES["ft"])


def _foot(
    found: Mapping[str, Any], source: Mapping[str, Any], options: IngestOptions, camera: str | None
) -> tuple[float, float]:
    """Return the bottom centre of the region in pixels."""
    points = listed(inner(found, "region"), "points")
    if not points or not all(isinstance(p, dict) for p in points):
        raise BadRowError("no-position", "the detection has neither a point on the ground nor a region")
    xs, ys = ([finite(p.get(axis)) for p in points] for axis in "xy")
    own = source.get("width"), source.get("height")
    known = tuple(n for n in own if isinstance(n, int) and 0 < n < 100_000)
    width, height = size_of(options, camera, own=(known[0], known[1]) if len(known) == 2 else None)
    return (min(xs) + max(xs)) / 2 * width, max(ys) * height
