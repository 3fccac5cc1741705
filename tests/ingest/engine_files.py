"""Files as engines write them, made from one walk of people; seeded. Each writer follows the engine's own format."""

from __future__ import annotations

import csv
import io
import json
import random
from datetime import UTC, datetime, timedelta
from typing import Any

START = datetime(2025, 11, 10, 9, 0, tzinfo=UTC)
START_MS = round(START.timestamp() * 1000)
SIZE = (1280, 960)

Person = tuple[str, float, float]
"""Track, and x and y: metres on the floor, or shares of the picture."""


def frames(n: int = 20, *, seed: int = 1, width: float = 10.0, height: float = 8.0) -> list[list[Person]]:
    """Return the people of each frame, one a second; every fifth frame is empty."""
    draw = random.Random(seed)
    starts = {str(k): (draw.uniform(0.1, 0.6), draw.uniform(0.2, 0.9), draw.uniform(-0.01, 0.01)) for k in range(1, 4)}
    return [
        []
        if k % 5 == 4
        else [
            (track, round((x + k * 0.01) * width, 3), round((y + k * speed) * height, 3))
            for track, (x, y, speed) in starts.items()
        ]
        for k in range(n)
    ]


def at(k: int) -> datetime:
    return START + timedelta(seconds=k)


def iso(k: int) -> str:
    return f"{at(k):%Y-%m-%dT%H:%M:%S.000Z}"


def lines(messages: list[dict[str, Any]]) -> bytes:
    return b"".join(json.dumps(m).encode() + b"\n" for m in messages)


def nvidia(people: list[list[Person]]) -> list[dict[str, Any]]:
    """Return VSS frame messages with foot points on the floor, a vehicle, and clusters of the service's own."""
    car = {
        "id": "900",
        "type": "Vehicle",
        "confidence": 0.9,
        "bbox": {"leftX": 1, "topY": 1, "rightX": 9, "bottomY": 9},
    }
    return [
        {
            "version": "4.0",
            "id": str(k),
            "timestamp": iso(k),
            "sensorId": "cam-1",
            "objects": [
                *(
                    {
                        "id": track,
                        "type": "Person",
                        "confidence": 0.9,
                        "bbox": {"leftX": 100.0, "topY": 50.0, "rightX": 140.0, "bottomY": 200.0},
                        "coordinate": None,
                        "info": {"footLocation2D": "120.0,200.0", "footLocation3D": f"{x},{y}", "visibility": "0.97"},
                    }
                    for track, x, y in found
                ),
                car,
            ],
            "socialDistancing": {"threshold": 2.0, "clusters": [{"objectIds": ["1", "2"]}]},
        }
        for k, found in enumerate(people)
    ]


def deepstream(people: list[list[Person]]) -> list[dict[str, Any]]:
    """Return frame messages of DeepStream's minimal payload; positions are shares of a picture of `SIZE`."""
    (width, height) = SIZE
    return [
        {
            "version": "4.0",
            "id": str(k),
            "@timestamp": iso(k),
            "sensorId": "cam-1",
            "objects": [
                f"{track}|{x * width - 20}|{y * height - 100}|{x * width + 20}|{y * height}|Person|#||||||0.8"
                for track, x, y in found
            ],
        }
        for k, found in enumerate(people)
    ]


def axis(people: list[list[Person]], *, below: str = "") -> list[dict[str, Any]]:
    """Return AXIS frames; positions are shares of the picture. `below` is "" (v1), "frame" or "data" (the beta)."""
    found = []
    for k, each in enumerate(people):
        observations: list[dict[str, Any]] = [
            {
                "track_id": track,
                "timestamp": iso(k),
                "bounding_box": {"left": x - 0.02, "top": y - 0.2, "right": x + 0.02, "bottom": y},
                "class": {"type": "Human", "score": 0.8, "upper_clothing_colors": [{"name": "White", "score": 0.7}]},
            }
            for track, x, y in each
        ]
        box = {"left": 0.1, "top": 0.1, "right": 0.2, "bottom": 0.2}
        observations.append({"track_id": "77", "bounding_box": box, "class": {"type": "Bus", "score": 0.7}})
        observations.append({"track_id": "78", "bounding_box": box})
        frame = {
            "timestamp": iso(k),
            "observations": observations,
            "operations": [{"type": "DeleteOperation", "id": "3"}],
        }
        found.append({"": frame, "frame": {"frame": frame}, "data": {"data": {"frame": frame}}}[below])
    return found


def axis_v1(people: list[list[Person]]) -> list[dict[str, Any]]:
    """Return frames of `com.axis.scene.frame.v1`: empty frames have no list, persons a class now and then."""
    found = []
    for k, each in enumerate(people):
        objects: list[dict[str, Any]] = []
        for n, (track, x, y) in enumerate(each):
            box = {"left": x - 0.02, "top": y - 0.2, "right": x + 0.02, "bottom": y}
            person: dict[str, Any] = {"bounding_box": box, "object_track_id": f"8e653185-{track}"}
            head = {**person, "object_track_id": f"head-{track}", "class": {"type": "Head", "score": 0.9}}
            if k % 4 == 0:
                person["class"] = {"type": "Human", "score": 0.7, "upper_clothing_colors": []}
            objects += [person, head] if n == 0 else [person]
        frame: dict[str, Any] = {"channel_id": 1, "timestamp": iso(k).replace("Z", "249Z")}
        found.append({**frame, **({"detections": objects} if objects else {})})
    return found


def azure(people: list[list[Person]], *, is_calibrated: bool = True) -> list[dict[str, Any]]:
    """Return person distance events; positions are metres, or shares of the picture where not calibrated."""
    found = []
    for k, each in enumerate(people):
        detections = [
            {
                "id": f"{k}-{track}",
                "type": "person",
                "region": {
                    "type": "RECTANGLE",
                    "points": [{"x": x / 20 - 0.01, "y": y / 20 - 0.1}, {"x": x / 20 + 0.01, "y": y / 20}],
                },
                "confidence": 0.9,
                "centerGroundPoint": {"x": x / 0.3048, "y": y / 0.3048} if is_calibrated else {"x": 0.0, "y": 0.0},
            }
            for track, x, y in each
        ]
        properties = {"personCount": len(each), "averageDistance": 4.2, "minimumDistanceThreshold": 6.0}
        found.append(
            {
                "events": [
                    {
                        "id": f"e{k}",
                        "type": "personDistanceEvent",
                        "detectionIds": [d["id"] for d in detections],
                        "properties": {**properties, "eventName": "TooClose", "distanceViolationPersonCount": 2},
                        "zone": "lobby",
                        "trigger": "interval",
                    }
                ],
                "sourceInfo": {
                    "id": "cam-1",
                    "timestamp": iso(k),
                    "width": SIZE[0],
                    "height": SIZE[1],
                    "frameId": str(k),
                    "cameraCalibrationInfo": {"status": "Complete" if is_calibrated else "Calibrating"},
                },
                "detections": detections,
                "schemaVersion": "1.0",
            }
        )
    return found


def azure_preview(people: list[list[Person]]) -> list[dict[str, Any]]:
    """Return count events of the first preview, one person in two events; positions are shares of the picture."""
    found = []
    for k, each in enumerate(people):
        detections = [
            {
                "types": [{"name": "person", "confidence": 0.7}],
                "id": f"{k}-{track}",
                "rectangle": {"width": 0.02, "height": 0.1, "left": x - 0.01, "top": y - 0.1},
            }
            for track, x, y in each
        ]
        cart = {"types": [{"name": "cart"}], "id": f"{k}-cart", "rectangle": {}}
        events = [
            {
                "id": f"e{k}-{label}",
                "detections": some,
                "metadataType": "personCountEvent",
                "metadata": {"label": label, "trigger": "event", "detectionCount": len(some) + (label == "door")},
            }
            for label, some in (("queue", [*detections, cart]), ("door", detections[:1]))
        ]
        found.append({"schemaVersion": "0.1", "sourceInfo": {"id": "cam-1", "timestamp": iso(k)}, "events": events})
    crossing = {"id": "x", "types": [{"name": "person"}], "metadataType": "personLineEvent", "rectangle": {}}
    return [*found, {"sourceInfo": {"id": "cam-1", "timestamp": iso(0)}, "detections": [crossing]}]


def azure_preview_distances(people: list[list[Person]]) -> list[dict[str, Any]]:
    """Return distance events of the first preview, which list persons with a point on the ground in feet."""
    return [
        {
            "events": [
                {
                    "metadataType": "personDistanceEvent",
                    "metadata": {
                        "personCount": len(each) + 1,
                        "eventName": "TooClose",
                        "distanceViolationPersonInfo": [
                            {
                                "bbox": {"width": 0.01, "height": 0.02, "left": 0.1, "top": 0.1},
                                "centerGroundPoint": {"x": x / 0.3048, "y": y / 0.3048},
                            }
                            for _, x, y in each
                        ],
                    },
                }
            ],
            "sourceInfo": {"id": "cam-1", "timestamp": iso(k), "cameraCalibrationInfo": {"status": "Complete"}},
        }
        for k, each in enumerate(people)
    ]


def video_analyzer(people: list[list[Person]]) -> list[dict[str, Any]]:
    """Return messages of Azure Video Analyzer; positions are shares of the picture, times 90,000ths of a second."""
    return [
        {
            "timestamp": round(datetime.fromisoformat(iso(k)).timestamp() * 90_000),
            "inferences": [
                *(
                    {
                        "type": "entity",
                        "inferenceId": f"{k}-{track}",
                        "entity": {
                            "tag": {"value": "person", "confidence": 0.9},
                            "box": {"l": x - 0.01, "t": y - 0.1, "w": 0.02, "h": 0.1},
                        },
                        "extensions": {"centerGroundPointX": "0.0", "centerGroundPointY": "0.0"},
                    }
                    for track, x, y in each
                ),
                {"type": "event", "inferenceId": f"e{k}", "event": {"name": "personCountEvent"}},
            ],
        }
        for k, each in enumerate(people)
    ]


def onvif(people: list[list[Person]], *, per_document: int = 1, in_pixels: bool = False) -> bytes:
    """Return metadata documents; positions are shares of the picture. Each person has a head as a part."""
    documents = []
    for first in range(0, len(people), per_document):
        body = []
        for k in range(first, min(first + per_document, len(people))):
            move = f'<tt:Translate x="-1" y="1"/><tt:Scale x="{2 / SIZE[0]:.9f}" y="{-2 / SIZE[1]:.9f}"/>'
            objects = [_object(track, x, y, k, in_pixels=in_pixels) for track, x, y in people[k]]
            kind = '<tt:Class><tt:Type Likelihood="0.9">Vehicle</tt:Type></tt:Class>'
            car = f'<tt:Object ObjectId="900"><tt:Appearance>{kind}</tt:Appearance></tt:Object>'
            transformation = f"<tt:Transformation>{move}</tt:Transformation>" if in_pixels else ""
            body.append(f'<tt:Frame UtcTime="{iso(k)}">{transformation}{"".join(objects)}{car}</tt:Frame>')
        documents.append(
            '<?xml version="1.0" encoding="UTF-8"?>\n<tt:MetadataStream xmlns:tt="http://www.onvif.org/ver10/schema">'
            f"<tt:VideoAnalytics>{''.join(body)}</tt:VideoAnalytics></tt:MetadataStream>\n"
        )
    return "".join(documents).encode()


def _object(track: str, x: float, y: float, k: int, *, in_pixels: bool) -> str:
    def box(left: float, top: float, right: float, bottom: float) -> str:
        if in_pixels:
            sides = [left * SIZE[0], top * SIZE[1], right * SIZE[0], bottom * SIZE[1]]
        else:
            sides = [2 * left - 1, 1 - 2 * top, 2 * right - 1, 1 - 2 * bottom]
        names = ("left", "top", "right", "bottom")
        return "<tt:BoundingBox " + " ".join(f'{n}="{s:.9f}"' for n, s in zip(names, sides, strict=True)) + "/>"

    # the class comes in the first frame of an object, and in every fourth
    kind = '<tt:Class><tt:Type Likelihood="0.85">Human</tt:Type></tt:Class>' if k % 4 == 0 else ""
    shape = f"<tt:Shape>{box(x - 0.02, y - 0.2, x + 0.02, y)}<tt:CenterOfGravity x='0' y='0'/></tt:Shape>"
    head = f"<tt:Shape>{box(x - 0.01, y - 0.2, x + 0.01, y - 0.15)}</tt:Shape>"
    return (
        f'<tt:Object ObjectId="{track}"><tt:Appearance>{shape}{kind}</tt:Appearance></tt:Object>'
        f'<tt:Object ObjectId="{track}0" Parent="{track}"><tt:Appearance>{head}'
        '<tt:Class><tt:Type Likelihood="0.7">Head</tt:Type></tt:Class></tt:Appearance></tt:Object>'
    )


def contacts(people: list[list[Person]], *, first_s: int = 1_762_765_200) -> bytes:
    """Return a contact list: every 20 seconds the pairs of people who are there, with their classes."""
    rows = []
    for k, each in enumerate(people):
        ids = [1000 + int(track) for track, *_ in each]
        rows += [f"{first_s + 20 * k}\t{a}\t{b}\t5A\t5B" for i, a in enumerate(ids) for b in ids[i + 1 :]]
    return ("\n".join(rows) + "\n").encode()


def trajectories(people: list[list[Person]], *, unit: str = "m", fps: str = "1.00") -> bytes:
    """Return a PeTrack file: sorted by person, then frame."""
    scale = {"m": 1.0, "cm": 100.0}[unit]
    rows = [(int(t), k, x * scale, y * scale) for k, each in enumerate(people) for t, x, y in each]
    body = "\n".join(f"{t} {k} {x:.4f} {y:.4f} 1.7500" for t, k, x, y in sorted(rows))
    return (
        f"# description: made for a test\n# framerate: {fps} fps\n# id frame x/{unit} y/{unit} z/m\n{body}\n".encode()
    )


def supervision_rows(people: list[list[Person]]) -> list[dict[str, Any]]:
    """Return the rows of supervision's sinks; positions are shares of the picture. The last person is a car's."""
    (width, height) = SIZE
    found = []
    for k, each in enumerate(people):
        for track, x, y in [*each, ("9", 0.5, 0.5)]:
            is_car = track == "9"
            found.append(
                {
                    "x_min": x * width - 20,
                    "y_min": y * height - 100,
                    "x_max": x * width + 20,
                    "y_max": y * height,
                    "class_id": 2 if is_car else 0,
                    "confidence": 0.8,
                    "tracker_id": int(track),
                    "class_name": "car" if is_car else "person",
                    "frame_index": k,
                }
            )
    return found


def supervision_csv(people: list[list[Person]]) -> bytes:
    """Return the file of `CSVSink`."""
    rows = supervision_rows(people)
    out = io.StringIO()
    writer = csv.DictWriter(out, fieldnames=list(rows[0]), lineterminator="\r\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue().encode()


def supervision_json(people: list[list[Person]]) -> bytes:
    """Return the file of `JSONSink`, whose values are partly texts."""
    rows = [{**row, "confidence": "0.8", "class_id": str(row["class_id"])} for row in supervision_rows(people)]
    return json.dumps(rows, indent=4).encode()


def otvision(people: list[list[Person]], *, version: str = "1.2", is_share: bool = False) -> dict[str, Any]:
    """Return OTVision's tracks; positions are shares of a picture of `SIZE`. Each frame has a car."""
    across, down = (1, 1) if is_share else SIZE
    width, height = 0.03 * across, 0.2 * down
    is_centred = version == "1.0"

    def detection(kind: str, track: str, x: float, y: float, k: int) -> dict[str, Any]:
        corner = (x * across - width / 2, y * down - height)
        place = (corner[0] + width / 2, corner[1] + height / 2) if is_centred else corner
        occurrence = at(k).timestamp() if version == "1.2" else f"{at(k):%Y-%m-%d %H:%M:%S.%f}"
        return {
            "class": kind,
            "confidence": 0.8,
            **dict(zip("xywh", (*place, width, height), strict=True)),
            "interpolated-detection": False,
            "first": k == 0,
            "finished": False,
            "track-id": int(track),
            "frame": k + 1,
            "occurrence": occurrence,
            "input_file_path": "hall_2025-11-10_09-00-00.mp4",
        }

    detections = [
        d
        for k, each in enumerate(people)
        for d in (
            *(detection("person", track, x, y, k) for track, x, y in each),
            *([detection("car", "900", 0.5, 0.5, k)] if k % 5 != 4 else []),
        )
    ]
    video = {
        "filename": "hall_2025-11-10_09-00-00",
        "filetype": ".mp4",
        "width": SIZE[0],
        "height": SIZE[1],
        "recorded_fps": 1.0,
        "actual_fps": 1.0,
        "number_of_frames": len(people),
        "recorded_start_date": START.timestamp() if version == "1.2" else f"{START:%Y-%m-%d %H:%M:%S.%f}",
    }
    detector = {"otvision_version": "v1.0", "model": {"name": "YOLOv8"}, "normalized_bbox": is_share}
    metadata = {"otdet_version": version, "video": video, "detection": detector, "ottrk_version": "1.1"}
    return {"metadata": metadata, "data": {"detections": detections}}
