"""`vsd export`: write stored records, or the figures for other tools, to a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.options import exact_option, json_option
from vsd_analytics.cli.output import count, emit_json
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import RECORD_NAMES, camera_id_of, parse_span, resolve
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from vsd_analytics.retention.export import Exported


@click.command()
@click.option("--range", "span", metavar="RANGE", help="Local days or times (default: everything stored).")
@click.option("--camera", metavar="ID", help="This camera only.")
@click.option(
    "--table",
    type=click.Choice(["all", "frames", "observations", "pairs"]),
    help="Which records (default: all for .jsonl, else observations).",
)
@click.option("--out", metavar="FILE", help="FILE.parquet, FILE.csv, or FILE.jsonl (frame messages).")
@click.option(
    "--duckdb", "duckdb_out", metavar="FILE", help="Write the figures of whole weeks, without records, for other tools."
)
@exact_option
@json_option
@pass_project
def export(
    project: Project,
    span: str | None,
    camera: str | None,
    table: str | None,
    out: str | None,
    duckdb_out: str | None,
    as_json: bool,
) -> None:
    """Write stored records to a file: for somebody who asks what is stored about them, or to move elsewhere.

    JSON Lines are VSD frame messages, which vsd ingest reads. Records in quarantine that are, or may be, of the camera
    and time go to a file beside it, NAME.quarantine.jsonl, as they came. All this is personal data: handle it
    with care.

    --duckdb writes no records: it writes the numbers of the weekly reports, small counts hidden, as tables for Grafana,
    Metabase, Excel and others. A range means the weeks that it touches.

    \b
    Example:
      vsd export --camera cam-1 --range 2026-11-09T10:00..2026-11-09T12:00 --out asked-for.csv
      vsd export --range 2026-11-09..2026-11-15 --out week.jsonl
      vsd export --duckdb week.duckdb --range 2026-11-09..2026-11-15
    """
    if duckdb_out is not None:
        if out is not None or camera is not None or table is not None:
            raise UsageError("--duckdb takes no --out, --camera or --table", fix=f"vsd export --duckdb {duckdb_out}")
        _export_duckdb(project, span, duckdb_out, as_json=as_json)
        return
    if out is None:
        raise UsageError("which file?", fix="--out FILE.csv for records, or --duckdb FILE.duckdb for figures")
    from vsd_analytics.retention import export as exporting
    from vsd_analytics.store.erasures import RecordScope

    path = Path(out)
    project.pages(str(path.parent), is_operators=True)  # records are personal data
    chosen = table or ("all" if path.suffix == ".jsonl" else "observations")
    first_ms, after_ms = (0, 2**53) if span is None else parse_span(span, project=project)
    which = RecordScope(camera_id_of(project, camera), first_ms, after_ms)
    done = exporting.export(project.site, which, out=path, table=None if chosen == "all" else chosen)  # type: ignore[arg-type]
    if as_json:
        printed: dict[str, Any] = {"file": out, "records": dict(done.records)}
        printed |= {"without_frame": done.n_unframed, "left_out": done.n_left_out}
        beside = None if done.quarantine is None else str(done.quarantine)
        printed |= {"quarantined": done.n_quarantined, "doubtful": done.n_doubtful, "quarantine_file": beside}
        emit_json(printed)
        return
    _print_result(project, done, out)


def _export_duckdb(project: Project, days: str | None, out: str, *, as_json: bool) -> None:
    from vsd_analytics.report.pages.duckdb_file import export_duckdb

    if project.is_exact:
        project.pages(str(Path(out).parent))
    first, last = resolve(project, week=None, days=days)
    done = export_duckdb(
        project.site,
        first,
        last,
        out=Path(out),
        now=project.now if project.now_text is not None else None,
        clock=project.now,
        on_week=lambda monday: project.say(f"week {monday:%G-W%V}"),
    )
    if as_json:
        emit_json({"file": out, "rows": dict(done.rows)})
        return
    click.echo(f"{sum(done.rows.values()):,} rows in {len(done.rows)} tables written to {out}")
    if project.is_exact:
        project.say("nothing is hidden in it: it is for the operator, do not share it")


def _print_result(project: Project, done: Exported, out: str) -> None:
    written = ", ".join(count(n, RECORD_NAMES[t]) for t, n in done.records.items() if n)
    click.echo(f"{written or 'no records'} written to {out}")
    if done.quarantine is not None:
        doubt = f", {done.n_doubtful:,} of them as their camera or time cannot be read" if done.n_doubtful else ""
        click.echo(f"{count(done.n_quarantined, 'quarantined record')} written to {done.quarantine}{doubt}")
    if done.n_unframed:
        project.say(f"{count(done.n_unframed, 'instant')} had no frame record: read again, they will have one")
    if done.n_left_out:
        project.say(f"{count(done.n_left_out, 'pair')} without track ids left out: use --table pairs and .csv for them")
    if project.site.settings.pseudonyms:
        project.say("track ids in it are pseudonyms of one camera and day")
