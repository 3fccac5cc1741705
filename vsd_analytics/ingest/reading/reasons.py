"""How to fix records in quarantine, by reason."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

from vsd_analytics.site.cameras_by_name import camera_meant
from vsd_analytics.site.model import Camera, ReadingRule

NO_TIME: Final = "no-time"
TOO_MANY: Final = "too-many"
"""A frame with more persons or pairs than `persons_max` or `pairs_max`."""

UNKNOWN_FIELD: Final = "unknown field"
"""What a frame message has beside the fields of its format; it is left out and counted."""

NO_PLACE: Final = "person without a place"
"""Somebody whom an engine saw and could not place on the floor, as it says itself; left out and counted."""

NOT_A_PERSON: Final = "not a person"
"""An object of another class, left out and counted."""

NO_CLASS: Final = "object without a class"
"""An object that the engine did not classify, left out and counted."""

PART_OF_A_PERSON: Final = "part of a person"
"""An object that belongs to a person who is an object too; it is left out and counted."""

FIXES: Final[Mapping[str, str]] = {
    "bad-frame": "--first-frame 0 if frames are counted from 0; else correct the column of frames",
    "bad-box": "map the sides as they are: left,top,right,bottom or left,top,width,height; leave out empty boxes",
    "bad-xml": "look at the document: it was cut off, or it is not XML; export it again",
    "bad-json": "look at the line: it was cut off, or is not JSON (a missing number is null, not NaN); export it again",
    "bad-message": "compare it with the format: vsd schema frame",
    "bad-quotes": 'quote cells as "a""b", without line breaks inside, or leave such columns out of the export',
    "forgotten-day": "nothing: the day's key was destroyed by vsd purge --forget-keys, which cannot be undone",
    "line-too-long": "if such lines are right, raise line_max_bytes under [ingest] in vsd.toml",
    "long-track-id": "use the engine's short ids",
    "negative-distance": "export distances in metres; leave the cell empty where there is none",
    "negative-number": "counts, and the numbers of the persons in a frame, begin at 0; leave out what is not known",
    "no-camera": "--camera ID, a column camera_id, or camera_from_name of a [[source]] in vsd.toml",
    "no-distance": "export distance_m, or both positions",
    "no-position": "export x_m y_m, or u_px v_px",
    "no-size": "--size WIDTHxHEIGHT, or picture of the camera in vsd.toml",
    NO_TIME: "export an ISO time with offset, or unix seconds",
    "not-a-number": "correct the export: a point before decimals (or semicolons between cells), nothing between "
    "thousands; an empty cell is missing, a text or NaN is not",
    "not-a-time": "export ISO times such as 2026-11-09T08:00:00+01:00, or unix seconds; other texts: --time-format "
    '"%d %b %Y %H:%M:%S"; the date in another column: --map ts=DATE+TIME',
    "out-of-range": "check units (metres, pixels) and columns; the limit is coordinate_max_m under [ingest]",
    "retained": "let the engine publish frames without the retain flag",
    "same-person": "export pairs of two different persons",
    "sealed-hour": "nothing: the hour was purged and its figures stay as they are (purge.jsonl says when)",
    "time-out-of-range": "check the unit of the times and the engine's clock; files may reach a day beyond now (--now)",
    "camera-not-there": "correct from and to of its [[camera]] in vsd.toml, or the engine's clock",
    "cell-too-long": "if such cells are right, raise cell_max_bytes under [ingest] in vsd.toml",
    "too-many": "check the times: many frames may share one; else raise persons_max or pairs_max, and ingest it again",
    "unknown-camera": 'add engine_ids = ["its name"] to its [[camera]] in vsd.toml, or describe it in a new one',
    "unknown-quality": "vsd schema frame",
    "wrong-number-of-fields": "check the delimiter and decimal commas of these lines",
}
"""What to do, by reason; the details of adapters' own reasons say it themselves."""

_MAPPING_CHARS: Final = 300


def fix_of(
    reason: str,
    *,
    format: str | None = None,
    mapping: Mapping[str, Any] | None = None,
    sources: Sequence[ReadingRule] = (),
    cameras: Sequence[Camera] = (),
    row: Mapping[str, Any] | str | None = None,
) -> str | None:
    """Return what to do about a record in quarantine, or None when its detail says it.

    Args:
        reason: Slug.
        format: Adapter that read it; None = unknown.
        mapping: `persons` and `map` that it was read by, for the format "json".
        sources: The `[[source]]` of vsd.toml, of which the one with this mapping is named.
        cameras: The cameras of vsd.toml, of which the one that the raw record means is named.
        row: The raw record, also as JSON, whose camera is named.
    """
    if reason == "unknown-camera" and row is not None:
        name = (json.loads(row) if isinstance(row, str) else row).get("camera")
        if isinstance(name, str) and name.isprintable():
            known = f"engine_ids = [{json.dumps(name[:80], ensure_ascii=False)}]"
            meant = camera_meant(name, cameras)
            its = "its [[camera]]" if meant is None else f'[[camera]] id = "{meant.camera_id}"'
            return f"add {known} to {its} in vsd.toml, or describe it in a new one"
    if reason != "bad-message" or format in (None, "frames"):
        return FIXES.get(reason)
    if format != "json":
        return f"compare it with what engines of the format {format} send (vsd schema frame has our own format)"
    persons, renames = (mapping or {}).get("persons"), dict((mapping or {}).get("map") or {})
    source = next((s for s in sources if s.persons == persons and dict(s.map) == renames), None)
    shown = "" if persons is None else f"persons = {json.dumps(persons)}, "
    shown += f"map = {{ {', '.join(f'{ours} = {json.dumps(theirs)}' for ours, theirs in renames.items())} }}"
    by = "the mapping" if source is None else f"[[source]] {source.rule_id!r}"
    compared = f"compare it with {by}: {shown if len(shown) <= _MAPPING_CHARS else shown[:_MAPPING_CHARS] + '...'}"
    nobody = "; --no-list-is-nobody if a message without its list is a frame without persons"
    return compared if persons is None else compared + nobody
