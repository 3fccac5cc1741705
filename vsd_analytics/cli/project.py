"""The project folder, site and clock that a command works with."""

from __future__ import annotations

import os
import shlex
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.output import plain, render_error
from vsd_analytics.errors import UsageError, VsdError
from vsd_analytics.owners import other_owner
from vsd_analytics.site.instants import instant

if TYPE_CHECKING:
    from vsd_analytics.site.model import Site


FILES = frozenset((".html", ".json", ".csv", ".pdf", ".png", ".eml", ".txt"))
"""Ends of names that nobody gives a folder."""


def folder_of_files(out: Path) -> Path:
    """Return the folder of `--out DIR`, into which files go that a command names itself.

    Raises:
        UsageError: E101, there is no such folder and its name is that of a file, as in `--out week.pdf`.
    """
    if out.suffix.lower() in FILES and not out.is_dir():
        raise UsageError(
            f"--out is a folder, and {out.name} is the name of a file",
            why="a command may write several files, and calls each by what is in it, such as 2026-W46.html",
            fix=f"--out {shlex.quote(str(out.parent))}",
        )
    return out


@dataclass
class Project:
    """The project folder and clock a command works with (click's context object).

    Attributes:
        folder: As given by `-C`.
        now_text: As given by `--now`.
        quiet: Print nothing but results and errors.
        verbose: Show tracebacks.
        is_exact: `--exact`: what the command makes is for the operator and hides nothing.
    """

    folder: str
    now_text: str | None = None
    quiet: bool = False
    verbose: bool = False
    is_exact: bool = False

    def inside(self, folder: Path) -> Project:
        """Return the project of another folder, with the same clock and the same words."""
        return Project(str(folder), now_text=self.now_text, quiet=self.quiet, verbose=self.verbose)

    @cached_property
    def now(self) -> datetime:
        """Return the clock: `--now`, else the machine's, in UTC."""
        if self.now_text is None:
            return datetime.now(tz=UTC)
        return instant(self.now_text, zone="UTC", what="--now")

    def clock(self) -> datetime:
        """Return the instant of `--now`, else the machine's at each call, in UTC."""
        return self.now if self.now_text is not None else datetime.now(tz=UTC)

    @cached_property
    def root(self) -> Path:
        """Return the project folder: `-C`, or the nearest one upward that holds vsd.toml."""
        from vsd_analytics.config.project import find_project

        folder = find_project(Path(self.folder))
        if warning := _root_in_the_house_of(folder):
            click.echo(render_error(warning, word="warning"), err=True)
        return folder

    @cached_property
    def site(self) -> Site:
        """Return the site that vsd.toml describes; with `--exact`, it hides nothing."""
        from vsd_analytics.config.project import load_site

        site = load_site(self.root, environ=os.environ)
        return site.with_settings(mask_below=0) if self.is_exact else site

    def pages(self, out: str | None = None, *, is_operators: bool = False) -> Path:
        """Return where pages and files go: `reports/`, which may be shared, or `operator/`, which may not.

        Args:
            out: Folder asked for; None = that of the project.
            is_operators: They show small counts whatever the command was given; with `--exact` all do.

        Raises:
            UsageError: E101, pages for the operator were to go to `reports/`, from where readers get them, or into a
                folder with the name of a file.
        """
        reports, are_operators = self.root / "reports", is_operators or self.is_exact
        if out is None:
            return self.root / "operator" if are_operators else reports
        if are_operators and Path(out).resolve().is_relative_to(reports.resolve()):
            raise UsageError(
                "pages for the operator do not go to reports/",
                why="nothing is hidden in them, and what is in reports/ may be shared",
                fix="leave --out away, or name another folder, such as operator/",
            )
        return folder_of_files(Path(out))

    def say(self, text: str) -> None:
        """Print a message for the user on standard error, unless `--quiet`."""
        if not self.quiet:
            click.echo(plain(text), err=True)

    def speak(self) -> None:
        """Write the pages of the running command in the site's language, unless `--language` chose one."""
        from vsd_analytics.wording.languages import chosen, speaking

        click.get_current_context().with_resource(speaking(chosen() or self.site.language))


pass_project = click.make_pass_decorator(Project)


def _root_in_the_house_of(folder: Path) -> VsdError | None:
    """Return a warning where root runs a command on the project of another user; None = all is well."""
    owner = other_owner(folder)
    if owner is None or os.geteuid() != 0:
        return None
    return VsdError(
        f"this runs as root, and the project belongs to {owner}",
        code="W111",
        why=f"{owner} and its services cannot read files that root makes here",
        fix=f"runuser -u {owner} -- vsd ...; for what root has made: chown -R {owner}: {shlex.quote(str(folder))}",
    )


def warn_of_broken_log_lines(project: Project) -> None:
    """Warn of lines of the change log that end too early."""
    from vsd_analytics.config.change_log import torn_lines

    for warning in torn_lines(project.site):
        click.echo(render_error(warning, word="warning"), err=True)
