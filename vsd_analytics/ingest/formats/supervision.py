"""Roboflow supervision's CSV and JSON sinks: a row or object per detection, boxes in pixels.

The sinks write `x_min y_min x_max y_max class_id confidence tracker_id`, then what the user added. They write no time
by themselves: a column `timestamp`, `ts` or `time` is the time, else `frame_index`, `frame_number`, `frame_id` or
`frame` is the frame number, with `--hz` and `--start`. Unless `--where` says otherwise, only persons are read:
`class_name = 'person'`, or class 0 where there are no names.
"""

from __future__ import annotations

import re
from dataclasses import replace

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.formats.tables import Tables, open_table
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.columns import ColumnPlan
from vsd_analytics.ingest.reading.table_file import TableFile
from vsd_analytics.ingest.reading.table_parts import TablePart

BOX = {"left": "x_min", "top": "y_min", "right": "x_max", "bottom": "y_max"}
TIMES = ("timestamp", "ts", "time")
FRAMES = ("frame_index", "frame_number", "frame_id", "frame")
_OWN = (*BOX.values(), "class_id", "confidence", "tracker_id")


def _without_time(source: Source) -> InputError:
    return InputError(
        f"{source.file_name} has neither times nor frame numbers",
        code="E203",
        where=Where(source.name, 1),
        why="the sinks write none by themselves, and without a time nothing can be counted by hour",
        fix='write it again with the number of the frame: sink.append(detections, {"frame_index": number}); another '
        "column of the file: --map frame=NAME or --map ts=NAME",
    )


class Supervision(Tables):
    """Adapter of supervision's `CSVSink` and `JSONSink`."""

    name = "supervision"
    coordinates = "image pixels, foot point = bottom centre of the box"

    def detects(self, source: Source) -> bool:
        """Return whether the first row has the columns that the sinks write."""
        if not source.path.is_file():
            return False
        head = source.head(8192).removeprefix(b"\xef\xbb\xbf").lstrip()
        if head.startswith(b"["):
            return all(re.search(rf'"{name}"\s*:'.encode(), head) for name in _OWN)
        return head.partition(b"\n")[0].strip().split(b",")[: len(_OWN)] == [name.encode() for name in _OWN]

    def _planned(
        self, source: Source, options: IngestOptions, part: TablePart | None = None
    ) -> tuple[TableFile, ColumnPlan]:
        names = open_table(source, options).header.names
        preset = {ours: theirs for ours, theirs in {**BOX, "track_id": "tracker_id"}.items() if theirs in names}
        taken = options.map.keys()
        if not {"ts", "frame"} & taken:
            preset |= next(({"ts": n} for n in TIMES if n in names), {})
            if "ts" not in preset:
                preset |= next(({"frame": n} for n in FRAMES if n in names), {})
            if not {"ts", "frame"} & preset.keys():
                raise _without_time(source)
        persons = "class_name = 'person'" if "class_name" in names else "class_id = 0" if "class_id" in names else None
        read = replace(options, map={**preset, **options.map}, where=options.where or persons)
        return super()._planned(source, read, part)
