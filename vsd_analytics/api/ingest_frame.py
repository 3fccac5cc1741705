"""Storing a frame in memory: it is read as the Parquet file that it would be, so every check of a file holds."""

from __future__ import annotations

import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.errors import UsageError
from vsd_analytics.site.model import Site

if TYPE_CHECKING:
    from vsd_analytics.ingest.intake.pipeline import IngestResult


def ingest_frame(
    site: Site, frame: Any, *, camera: str | None, clock: str | None, name: str, now: datetime | None
) -> IngestResult:
    """Return what was stored of a frame; arguments as of `OpenProject.ingest`.

    Raises:
        VsdError: The frame could not be read to its end, or would almost surely be read wrongly.
        UsageError: E101, it is no frame.
    """
    from vsd_analytics.ingest.intake.pipeline import ingest
    from vsd_analytics.ingest.reading.adapter import IngestOptions

    try:
        rows = pa.table(frame)
    except (TypeError, ValueError, pa.ArrowException) as error:
        why = " ".join(str(error).split())[:300]
        fix = "give a pandas or polars frame, or an Arrow table"
        raise UsageError(f"a {type(frame).__name__} is no frame of records", why=why, fix=fix) from None
    options = IngestOptions(camera=camera, zone=clock)
    with tempfile.TemporaryDirectory(prefix="vsd-frame-") as folder:
        path = Path(folder) / f"{Path(name).name}.parquet"
        pq.write_table(rows.replace_schema_metadata(None), path)
        result = ingest(site, [path], options, now=now or datetime.now(UTC), shown={path: name})
    for source in result.sources:
        if source.error is not None:
            raise source.error
    return result
