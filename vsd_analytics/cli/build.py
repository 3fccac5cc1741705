"""`vsd build`: compute the stale facts."""

from __future__ import annotations

import contextlib

import click

from vsd_analytics.cli.ingest_output import warn_of_full_disk
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, facts_progress
from vsd_analytics.cli.project import Project, pass_project


@click.command()
@click.option(
    "--on", "address", metavar="ADDRESS", help="Compute on the workers of tcp://HOST:PORT or spark://HOST:PORT."
)
@json_option
@pass_project
def build(project: Project, /, address: str | None, as_json: bool) -> int:
    """Compute the stale facts and print why they were stale. Figures and reports do this by themselves.

    Then publish the current facts as links below published/current, for programs that read Parquet by a glob.

    --on hands out one UTC day after the other to the workers of a Dask scheduler or a Spark master, which read the
    project folder at the same path. Only this command writes; a worker that dies costs time.

    \b
    Example:
      vsd build
      vsd build --on tcp://192.168.1.20:8786
    """
    from vsd_analytics.store import Store
    from vsd_analytics.warehouse.build import build as build_facts

    site = project.site
    folded = Store(site.root / "store", site_id=site.site_id, ballast_mb=site.settings.ballast_mb).fold()
    warn_of_full_disk(folded)
    with contextlib.ExitStack() as stack:
        spread = None
        if address is not None:
            from vsd_analytics.cluster.workers import workers

            spread = stack.enter_context(workers(address))
        on_plan, on_hours = stack.enter_context(facts_progress(quiet=project.quiet))
        result = build_facts(site, on_plan=on_plan, on_hours=on_hours, is_published=True, spread=spread)
    if as_json:
        emit_json({"n_fresh": result.n_fresh, "n_built": result.n_built, "reasons": dict(result.reasons)})
        return int(folded.is_ballast_spent)
    for reason, n in sorted(result.reasons.items()):
        click.echo(f"{n:>8,} hours  {reason}")
    click.echo(f"{result.n_built:,} hours computed, {result.n_fresh:,} were fresh")
    return int(folded.is_ballast_spent)
