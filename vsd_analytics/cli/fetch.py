"""`vsd fetch`: the records that a site published in a bucket, for a project that only reads."""

from __future__ import annotations

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import count, emit_json
from vsd_analytics.cli.project import Project, pass_project


@click.command()
@click.argument("url", metavar="s3://BUCKET/FOLDER")
@json_option
@pass_project
def fetch(project: Project, url: str, as_json: bool) -> None:
    """Bring a project that only reads to the records that vsd build --publish URL --records put into a bucket.

    The project is a folder with a copy of the site's vsd.toml and no records of its own. Only what is missing is
    fetched; what was purged at the site and published since goes here, too. Then every command works as at the site,
    with the same numbers. Credentials and endpoint come from the environment (AWS_ENDPOINT_URL, ...).

    \b
    Example:
      vsd fetch s3://figures/shop
    """
    from vsd_analytics.cluster import bucket
    from vsd_analytics.cluster.record_mirror import fetch_records

    bucket.place(url)
    n_fetched, n_removed = fetch_records(project.site, url, bucket.client("vsd fetch"))
    if as_json:
        emit_json({"fetched": n_fetched, "removed": n_removed})
    else:
        click.echo(f"{count(n_fetched, 'file')} fetched, {n_removed:,} removed")
