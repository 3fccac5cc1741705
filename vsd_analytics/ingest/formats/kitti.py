"""KITTI tracking labels: a line `frame id type truncated occluded alpha left top right bottom ...` for each object.

The lines have 17 columns, or 18 with a score, and no clock: `--fps` (KITTI has 10) and `--start` say when frames were
taken. Unless `--where` says otherwise, pedestrians alone are read.
"""

from __future__ import annotations

import re
from dataclasses import replace

from vsd_analytics.ingest.formats.tables import Tables
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.columns import ColumnPlan
from vsd_analytics.ingest.reading.table_file import TableFile
from vsd_analytics.ingest.reading.table_head import TableHead
from vsd_analytics.ingest.reading.table_parts import TablePart

_NUMBER = rb"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_FIRST_LINE = re.compile(rb"\d+ -?\d+ [A-Z][A-Za-z_]+ -?\d+(?:\.\d+)? -?\d+(?: " + _NUMBER + rb"){12,13}\s*(?:\r?\n|$)")
_COLUMNS = ("frame", "track_id", "type", "truncated", "occluded", "alpha", "left", "top", "right", "bottom")


class Kitti(Tables):
    """Adapter of KITTI tracking labels."""

    name = "kitti"
    coordinates = "image pixels, foot point = bottom centre of the box"
    uses = frozenset({"where", "period_s", "fps", "start", "first_frame"})

    def detects(self, source: Source) -> bool:
        """Return whether the first line has the columns of KITTI."""
        return source.path.is_file() and _FIRST_LINE.match(source.head(4096)) is not None

    def head(self, source: Source, options: IngestOptions) -> TableHead:
        """Return what the columns, which always mean the same, hold in the first rows; see `Tables.head`."""
        return replace(super().head(source, options), n_columns=len(_COLUMNS))

    def _planned(
        self, source: Source, options: IngestOptions, part: TablePart | None = None
    ) -> tuple[TableFile, ColumnPlan]:
        return super()._planned(source, _as_table(options), part)


def _as_table(options: IngestOptions) -> IngestOptions:
    return replace(options, columns=_COLUMNS, where=options.where or "type = 'Pedestrian'")
