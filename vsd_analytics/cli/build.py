"""`vsd build`: compute the stale facts."""

from __future__ import annotations

import contextlib

import click

from vsd_analytics.cli.ingest_output import warn_of_erased, warn_of_full_disk
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, facts_progress
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError


@click.command()
@click.option(
    "--on", "address", metavar="ADDRESS", help="Compute on the workers of tcp://HOST:PORT or spark://HOST:PORT."
)
@click.option("--publish", "url", metavar="URL", help="Then bring s3://BUCKET/FOLDER to the current facts.")
@click.option("--records", "has_records", is_flag=True, help="With --publish: the records too, for vsd fetch.")
@json_option
@pass_project
def build(project: Project, /, address: str | None, url: str | None, has_records: bool, as_json: bool) -> int:
    """Compute the stale facts and print why they were stale. Figures and reports do this by themselves.

    Then publish the current facts as links below published/current, for programs that read Parquet by a glob.

    --on hands out one UTC day after the other to the workers of a Dask scheduler or a Spark master, which read the
    project folder at the same path. Only this command writes; a worker that dies costs time.

    --publish writes the files that are missing there, then current.json, which names those of this build, then removes
    all others. Credentials and endpoint come from the environment (AWS_ENDPOINT_URL, AWS_ACCESS_KEY_ID, ...). After a
    purge, run it again: a bucket does not know of it. With --records the bucket also holds the records and sealed
    facts, which vsd fetch brings to projects that only read.

    \b
    Example:
      vsd build
      vsd build --on tcp://192.168.1.20:8786
      vsd build --publish s3://figures/shop
    """
    from vsd_analytics.store.store import Store
    from vsd_analytics.warehouse.build import build as build_facts

    site, s3 = project.site, None
    if has_records and url is None:
        raise UsageError("--records needs --publish URL", fix="vsd build --publish s3://figures/shop --records")
    if url is not None:
        from vsd_analytics.cluster import bucket
        from vsd_analytics.cluster.record_mirror import RECORDS, publish_records
        from vsd_analytics.warehouse.build import current_files

        bucket.place(url)
        s3 = bucket.client()
    folded = Store(site.root / "store", site_id=site.site_id, ballast_mb=site.settings.ballast_mb).fold()
    warn_of_full_disk(folded)
    warn_of_erased(folded.n_erased)
    with contextlib.ExitStack() as stack:
        distributed = None
        if address is not None:
            from vsd_analytics.cluster.workers import workers

            distributed = stack.enter_context(workers(address))
        on_plan, on_hours = stack.enter_context(facts_progress(quiet=project.quiet))
        result = build_facts(site, on_plan=on_plan, on_hours=on_hours, is_published=True, distributed=distributed)
    n_written = 0
    if url is not None and s3 is not None:
        n_written = bucket.publish(current_files(site, result), url, s3, spared=RECORDS if has_records else None)
        if has_records:
            n_written += publish_records(site, url, s3)
    if as_json:
        emit_json(
            {
                "n_fresh": result.n_fresh,
                "n_built": result.n_built,
                "reasons": dict(result.reasons),
                "n_written": n_written,
            }
        )
        return int(folded.is_ballast_spent)
    for reason, n in sorted(result.reasons.items()):
        click.echo(f"{n:>8,} hours  {reason}")
    if url is not None:
        click.echo(f"{n_written:,} files written to {url}")
    click.echo(f"{result.n_built:,} hours computed, {result.n_fresh:,} were fresh")
    return int(folded.is_ballast_spent)
