"""Storing a frame in memory: it is read as the Parquet file that it would be, so every check of a file holds."""

from __future__ import annotations

import re
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
        UsageError: E101, it is no frame, or `clock` is no time zone.
    """
    from vsd_analytics.config.values import is_zone, nearest_zone
    from vsd_analytics.ingest.intake.pipeline import ingest
    from vsd_analytics.ingest.reading.adapter import IngestOptions

    try:
        rows = pa.table(frame)
    except (TypeError, ValueError, pa.ArrowException) as error:
        why = " ".join(str(error).split())[:300]
        fix = "give a pandas or polars frame, or an Arrow table"
        raise UsageError(f"a {type(frame).__name__} is no frame of records", why=why, fix=fix) from None
    if clock is not None and not is_zone(clock):
        raise UsageError(f"there is no time zone {clock!r}", fix=f'clock="{nearest_zone(clock) or "Europe/Rome"}"')
    options = IngestOptions(camera=camera, zone=clock)
    with tempfile.TemporaryDirectory(prefix="vsd-frame-") as folder:
        path = Path(folder) / f"{Path(name).name}.parquet"
        pq.write_table(rows.replace_schema_metadata(None), path)
        result = ingest(site, [path], options, now=now or datetime.now(UTC), shown={path: name})
    for source in result.sources:
        if source.error is not None:
            source.error.in_python = _in_python(source.error.fix)
            raise source.error
    return result


def _in_python(fix: str | None) -> str | None:
    """Return the fix of a frame: the options of `vsd ingest` as arguments and columns."""
    if fix is None or "--" not in fix:
        return fix
    ways = [f'camera="{camera}"' for camera in re.findall(r"--camera (\S+)", fix)]
    ways += [f'clock="{zone}"' for zone in re.findall(r"--zone (\S+)", fix)]
    renames = [pair.split("=", 1) for pair in re.findall(r"--map (\S+=\S+)", fix)]
    ways += [f'frame.rename(columns={{"{theirs}": "{ours}"}})' for ours, theirs in renames]
    return ", or ".join(ways) or f"write the frame to a file; then in a terminal: vsd ingest FILE, with {fix}"
