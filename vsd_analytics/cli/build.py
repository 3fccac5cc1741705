"""`vsd build`: compute the stale facts."""

from __future__ import annotations

import click

from vsd_analytics.cli.ingest_output import warn_of_full_disk
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, facts_progress
from vsd_analytics.cli.project import Project, pass_project


@click.command()
@json_option
@pass_project
def build(project: Project, /, as_json: bool) -> int:
    """Compute the stale facts and print why they were stale. Figures and reports do this by themselves.

    Then publish the current facts as links below published/current, for programs that read Parquet by a glob.

    \b
    Example:
      vsd build
    """
    from vsd_analytics.store import Store
    from vsd_analytics.warehouse.build import build as build_facts

    site = project.site
    folded = Store(site.root / "store", site_id=site.site_id, ballast_mb=site.settings.ballast_mb).fold()
    warn_of_full_disk(folded)
    with facts_progress(quiet=project.quiet) as (on_plan, on_hours):
        result = build_facts(site, on_plan=on_plan, on_hours=on_hours, is_published=True)
    if as_json:
        emit_json({"n_fresh": result.n_fresh, "n_built": result.n_built, "reasons": dict(result.reasons)})
        return int(folded.is_ballast_spent)
    for reason, n in sorted(result.reasons.items()):
        click.echo(f"{n:>8,} hours  {reason}")
    click.echo(f"{result.n_built:,} hours computed, {result.n_fresh:,} were fresh")
    return int(folded.is_ballast_spent)
