"""NVIDIA frame messages (nvschema 4.0), as Metropolis, VSS and DeepStream's message converter publish them.

A message is one frame of one sensor: `{"version": "4.0", "id", "timestamp", "sensorId", "objects": [...]}`. Objects are
JSON objects, or in DeepStream's minimal payload texts `id|left|top|right|bottom|type|...`. Pairs are computed from the
positions, as for every engine. The clusters that the service itself reports (`socialDistancing`) are not distances:
they are left out and counted.

DeepStream's full payload (`mdsversion`, the converter's default) is one message for each object instead: `sensor.id`,
`object.id`, `object.bbox`, and the class as a key of the object (`person`, `vehicle`). Where each message has the time
at which it was written, `--period` makes one frame of those of a frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.column_hints import PERSON
from vsd_analytics.ingest.reading.envelopes import unwrapped
from vsd_analytics.ingest.reading.frame_rows import FrameRows, SeenPerson, finite, id_of, instant_of
from vsd_analytics.ingest.reading.json_messages import JsonMessages, has_marks, inner, listed, text
from vsd_analytics.ingest.reading.raw import BadRowError
from vsd_analytics.ingest.reading.reasons import NOT_A_PERSON

CLUSTERS = "cluster of the engine"
_CLASS_KEYS = ("person", "vehicle", "bike", "roadsign", "face", "product", "pose")
"""Keys that say what an object of the full payload is."""


class Nvidia(JsonMessages):
    """Adapter of NVIDIA frame messages."""

    name: ClassVar = "nvidia"
    coordinates: ClassVar = "floor metres (footLocation3D, coordinate), else pixels (footLocation2D, box)"
    uses: ClassVar = JsonMessages.uses | {"coordinates"}
    engine: ClassVar = "nvidia nvschema"
    marks: ClassVar = ("sensorId", "objects")
    full_marks: ClassVar = ("mdsversion", "sensor", "object")

    def detects(self, source: Source) -> bool:
        """Return whether the file begins with frame messages, or with those of single objects."""
        return super().detects(source) or has_marks(source, self.full_marks)

    def take(self, message: Mapping[str, Any], frames: FrameRows, options: IngestOptions, number: int) -> None:
        """Add one frame: its persons, with the best position that the message has of them."""
        _, message = unwrapped(message)
        is_full = "object" in message and "objects" not in message
        camera = (text(inner(message, "sensor"), "id") if is_full else text(message, "sensorId")) or options.camera
        at = instant_of(message.get("timestamp", message.get("@timestamp")))
        seen, n_others = [], 0
        for entry in [message["object"]] if is_full else listed(message, "objects"):
            kind, person = _minimal(entry, options) if isinstance(entry, str) else _whole(entry, options)
            if kind.lower() in PERSON or options.is_staff(kind):
                seen.append(frames.person(person))
            else:
                n_others += 1
        frames.add(camera, at, seen, line=number)
        frames.dropped[NOT_A_PERSON] += n_others
        clusters = listed(inner(message, "socialDistancing"), "clusters")
        frames.dropped[CLUSTERS] += len(clusters)


def _whole(entry: Any, options: IngestOptions) -> tuple[str, Any]:
    """Return the class of an object, and a function that returns it as a person."""
    if not isinstance(entry, dict):
        raise BadRowError("bad-message", f"an object is {str(entry)[:40]!r}")

    kind = text(entry, "type") or next((key for key in _CLASS_KEYS if isinstance(entry.get(key), dict)), "")

    def person() -> SeenPerson:
        info = inner(entry, "info")
        floor, picture = None, None
        if options.coordinates != "image":
            floor = _of_text(info.get("footLocation3D")) or _of_floor(inner(entry, "coordinate"))
        if floor is None:
            picture = _of_text(info.get("footLocation2D")) or _foot(inner(entry, "bbox"))
        return SeenPerson(id_of(entry.get("id")), floor, picture, options.is_staff(kind))

    return "person" if kind == "pose" else kind, person


def _minimal(line: str, options: IngestOptions) -> tuple[str, Any]:
    """Return the class of an object of the minimal payload, and a function that returns it as a person."""
    cells = line.split("|")
    if len(cells) < 6:
        raise BadRowError("bad-message", f"an object is {line[:40]!r}, not id|left|top|right|bottom|type")

    def person() -> SeenPerson:
        left, _, right, bottom = (finite(cell) for cell in cells[1:5])
        return SeenPerson(id_of(cells[0].strip()), None, ((left + right) / 2, bottom), options.is_staff(kind))

    kind = cells[5].strip()
    return kind, person


def _of_text(value: Any) -> tuple[float, float] | None:
    """Return the first two numbers of a text such as "9.85,-12.53"; None where there is none."""
    if value is None or value == "":
        return None
    x, comma, rest = str(value).partition(",")
    if not comma:
        raise BadRowError("not-a-number", f"a foot point is {str(value)[:40]!r}")
    return finite(x), finite(rest.partition(",")[0])


def _of_floor(coordinate: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return x and y of a coordinate; the origin itself is what the service writes when it has none."""
    if coordinate.get("x") is None or coordinate.get("y") is None:
        return None
    x, y = finite(coordinate["x"]), finite(coordinate["y"])
    return None if x == y == 0 else (x, y)


def _foot(box: Mapping[str, Any]) -> tuple[float, float] | None:
    if not box:
        return None
    names = ("leftX", "rightX", "bottomY") if "leftX" in box else ("topleftx", "bottomrightx", "bottomrighty")
    left, right, bottom = (finite(box.get(name)) for name in names)
    return (left + right) / 2, bottom
