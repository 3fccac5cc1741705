"""`vsd check`: validate engine files and change nothing."""

from __future__ import annotations

from typing import Any

import click

from vsd_analytics.cli.file_options import file_options
from vsd_analytics.cli.ingest import read_files
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.project import Project, pass_project


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@file_options
@json_option
@pass_project
def check(project: Project, /, files: tuple[str, ...], as_json: bool, **given: Any) -> int:
    """Validate files and change nothing: format, columns, times, cameras, numbers.

    \b
    Example:
      vsd check export/*.csv
    """
    return read_files(project, files, given, is_dry_run=True, as_json=as_json)
