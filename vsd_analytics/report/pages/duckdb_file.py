"""The weekly reports as one DuckDB file for other tools: every number of their JSON files, in tables with comments.

`sql/exports/` has a file for each table; its header becomes the comments in the DuckDB file and `docs/tools.md`.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import pyarrow as pa

from vsd_analytics.errors import ReportError
from vsd_analytics.figures import operator_counts
from vsd_analytics.figures.context_values import context_rows
from vsd_analytics.figures.share.counts import mask_of
from vsd_analytics.figures.share.periods import check_days, is_over
from vsd_analytics.report.pages.json_and_csv import figures_json, to_json
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.site.model import Site
from vsd_analytics.site.places import named_floors
from vsd_analytics.store import durable, spill
from vsd_analytics.warehouse.sqlfiles import Relation, relations
from vsd_analytics.warehouse.warehouse import Warehouse, open_warehouse

if TYPE_CHECKING:
    import duckdb

STORAGE_VERSION: Final = "v1.0.0"
"""The oldest DuckDB that opens the file: 1.0 and every later one."""
OPERATOR_TABLES: Final = frozenset({"camera_hours", "area_hours"})
"""Tables of a file that hides nothing: who knows them knows what the others hide."""
_USUAL = {
    "camera_id": "camera of vsd.toml",
    "floor_id": "floor of vsd.toml",
    "local_date": "date in the site's zone",
}


@dataclass(frozen=True, slots=True)
class DuckdbExport:
    """What was written.

    Attributes:
        path: The file.
        rows: Number of rows by table.
    """

    path: Path
    rows: Mapping[str, int]


def export_duckdb(
    site: Site,
    first: date,
    last: date,
    *,
    out: Path,
    now: datetime | None = None,
    clock: datetime | None = None,
    on_week: Callable[[date], None] | None = None,
) -> DuckdbExport:
    """Write the weekly reports of all floors into one DuckDB file, whole or not at all.

    The numbers are those of `vsd report --format json`: small counts are hidden, and weeks that are not over or may not
    be shared again are left out. Where the site hides nothing, the file is the operator's and has hours by camera and
    by area too (`OPERATOR_TABLES`). Series of `vsd context add` are in it as they were added. A file that is there
    already is replaced in one step; who has it open reads the old one until it is opened again. The same input gives
    the same rows.

    Args:
        site: The project.
        first: Any day of the first week.
        last: Any day of the last week.
        out: The file.
        now: Instant that the reports print; None = the last record's.
        clock: The present, as for `week_report`.
        on_week: Called with the Monday of each week before its reports are made.

    Raises:
        UsageError: E105, no week is over.
        ReportError: E503, no week may be shared again.
        StoreError: E301, nothing is stored.
        DiskError: E304 to E306, the file cannot be written.
    """
    monday, sunday = first - timedelta(days=first.weekday()), last + timedelta(days=6 - last.weekday())
    mondays = [monday + timedelta(weeks=k) for k in range(((sunday - monday).days + 1) // 7)]
    over = [m for m in mondays if not mask_of(site).is_on or is_over(site, m + timedelta(days=6), clock=clock)]
    if not over:
        check_days(site, mondays[0], mondays[0] + timedelta(days=6), clock=clock)
    reports: list[dict[str, str]] = []
    refused: ReportError | None = None
    for start in over:
        if on_week is not None:
            on_week(start)
        for floor_id in named_floors(site, None):
            try:
                report = week_report(site, start, floor_id=floor_id, now=now, clock=clock)
            except ReportError as error:  # shared before, and changed by too little since
                refused = error
                continue
            told = {**json.loads(to_json(report)), "figures": figures_json(report)}
            reports.append({"floor_id": floor_id, "report": json.dumps(told)})
    if refused is not None and not reports:
        raise refused
    with open_warehouse(site, monday, sunday) as warehouse:
        inputs = {
            "reports": pa.Table.from_pylist(reports),
            "site_calendar": warehouse.table(
                "select * from calendar where local_date between $first and $last",
                {"first": monday, "last": sunday},
            ),
        }
        inputs |= {
            "site_context": context_rows(site, monday, sunday, per="hour"),
            "site_context_days": context_rows(site, monday, sunday, per="day"),
        }
        if not mask_of(site).is_on:
            inputs |= {"exact_camera_hours": _exact(warehouse, "camera"), "exact_area_hours": _exact(warehouse, "area")}
    folder = spill.new_folder()  # of an export that was killed, the next one removes it
    folder.mkdir()
    try:
        rows = _fill(folder / "export.duckdb", inputs)
        if out.parent.is_dir():
            durable.sweep_temporaries(out.parent, file_name=out.name)
        durable.publish(out, (folder / "export.duckdb").read_bytes(), is_private=True)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return DuckdbExport(out, rows)


def exported_tables() -> Sequence[Relation]:
    """Return the tables of the file, in the order of their names."""
    return [relation for _, relation in sorted(relations("exports").items())]


def column_text(relation: Relation, column: str) -> str:
    """Return what a column of an exported table is."""
    return relation.columns[column] or _USUAL[column]


def _exact(warehouse: Warehouse, by: Literal["camera", "area"]) -> pa.Table:
    """Return the hourly table by camera or area."""
    frame = operator_counts.hours(warehouse, by=by)
    return pa.Table.from_pandas(frame.rename(columns={"start": "started"}), preserve_index=False)


def _fill(path: Path, inputs: Mapping[str, pa.Table]) -> dict[str, int]:
    """Make the file; return the number of rows by table."""
    import duckdb

    rows: dict[str, int] = {}
    with duckdb.connect() as con:
        con.execute(f"attach {_quoted(str(path))} as export (storage_version '{STORAGE_VERSION}')")
        con.execute("use export")
        for name, table in inputs.items():
            con.register(name, table)
        for relation in exported_tables():
            if relation.name in OPERATOR_TABLES and f"exact_{relation.name}" not in inputs:
                continue
            con.execute(f"create table {relation.name} as {relation.sql}")
            _comment(con, relation)
            [(rows[relation.name],)] = con.execute(f"select count(*) from {relation.name}").fetchall()
        con.execute("checkpoint")
    return rows


def _comment(con: duckdb.DuckDBPyConnection, relation: Relation) -> None:
    about = f"{relation.description} Assumes: {relation.assumes}."
    con.execute(f"comment on table {relation.name} is {_quoted(about)}")
    for column in relation.columns:
        con.execute(f"comment on column {relation.name}.{column} is {_quoted(column_text(relation, column))}")


def _quoted(text: str) -> str:
    """Return a text as a literal: COMMENT ON and ATTACH take no parameter."""
    return "'" + text.replace("'", "''") + "'"
