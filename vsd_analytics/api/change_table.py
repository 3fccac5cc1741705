"""The change log as a table."""

from __future__ import annotations

from datetime import date

import pyarrow as pa

from vsd_analytics.api.table import Table
from vsd_analytics.config.change_log import read_log
from vsd_analytics.site.model import Site


def change_table(site: Site, first: date | None = None, last: date | None = None) -> Table:
    """Return the entries of the change log: `number` in the whole log, from 1, `at`, `text`, `area_id`.

    Args:
        site: The project.
        first: First local day; None = the whole log.
        last: Last local day, inclusive.
    """
    rows = [
        {"number": number, "at": entry.at, "text": entry.text, "area_id": entry.area_id}
        for number, entry in enumerate(read_log(site), start=1)
        if first is None or last is None or first <= entry.at.astimezone(site.zone).date() <= last
    ]
    at = pa.timestamp("us", tz=site.timezone)
    schema = pa.schema([("number", pa.int64()), ("at", at), ("text", pa.string()), ("area_id", pa.string())])
    return Table(pa.Table.from_pylist(rows, schema=schema), title="Change log")
