"""The `vsd` command: one file per command, each a thin shell over a public function."""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
from typing import Final

import click

from vsd_analytics.cli.exit_codes import run
from vsd_analytics.cli.options import CONTEXT_SETTINGS
from vsd_analytics.cli.output import render_error
from vsd_analytics.cli.project import Project
from vsd_analytics.site.instants import instant
from vsd_analytics.version import VERSION

JOBS: Final = {
    "week": ("Every week", ("ingest", "coverage", "report", "planner", "log", "compare", "doctor")),
    "start": ("Start a site", ("demo", "init", "check", "calibrate", "mark", "opening", "schema")),
    "cameras": ("Read cameras and engines", ("engine", "evaluate", "listen", "node", "imports", "quarantine")),
    "space": (
        "How a space is used",
        (
            "today",
            "hours",
            "heatmap",
            "hotspots",
            "groups",
            "visits",
            "flow",
            "queue",
            "capacity",
            "lines",
            "counts",
            "context",
            "forecast",
        ),
    ),
    "change": ("Change the room", ("plan", "whatif", "target", "selfcheck", "inbox", "alarms")),
    "share": ("Publish and query", ("site", "serve", "mcp", "export", "sql")),
    "store": ("Keep the store", ("build", "fetch", "purge", "verify", "failed")),
    "manual": ("Get help", ("help", "explain")),
}
"""What the program is used for: the title of a job, and its commands in the order in which they are used."""

COMMANDS: Final = tuple(command for _, commands in JOBS.values() for command in commands)
"""The commands, each in the module of its name."""


class LazyGroup(click.Group):
    """A group whose command modules are imported on first use, so that one command starts fast."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the order of `COMMANDS`."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one command."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = getattr(importlib.import_module(f"vsd_analytics.cli.{cmd_name}"), cmd_name)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands of a week with what they do, and the names of the others by job."""
        self.write_job(ctx, formatter, "week")
        rows = [(job, f"{title}: {', '.join(names)}") for job, (title, names) in JOBS.items() if job != "week"]
        with formatter.section("More, by job (vsd help JOB says what each does)"):
            formatter.write_dl(rows)

    def write_job(self, ctx: click.Context, formatter: click.HelpFormatter, job: str) -> None:
        """Write the commands of a job, each with its whole first sentence, wrapped rather than cut off."""
        title, names = JOBS[job]
        commands = {name: self.get_command(ctx, name) for name in names}
        rows = [(name, _first_sentence(c.help or "")) for name, c in commands.items() if c is not None]
        with formatter.section(title):
            formatter.write_dl(rows)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, proposing the nearest name when there is none."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            import difflib

            near = difflib.get_close_matches(args[0], COMMANDS, n=1)
            hint = f" Did you mean '{near[0]}'?" if near else ""
            if args[0] == "bench":
                hint = " It left the program with 2.0: python tests/benchmarks/bench_tools.py in the source measures."
            ctx.fail(f"No such command {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)


def _first_sentence(text: str) -> str:
    paragraph = " ".join(text.split("\n\n", maxsplit=1)[0].split())
    return paragraph.split(". ")[0].rstrip(".") + "."


@click.group(cls=LazyGroup, context_settings=CONTEXT_SETTINGS)
@click.option(
    "-C", "folder", metavar="DIR", default=".", help="Project folder (default: where vsd.toml is found upward)."
)
@click.option("--now", metavar="INSTANT", help="Use this instant as the clock (UTC unless it has an offset).")
@click.option("--quiet", is_flag=True, help="Print nothing but results and errors.")
@click.option("-v", "--verbose", is_flag=True, help="Show tracebacks of internal errors.")
@click.version_option(VERSION, prog_name="vsd")
@click.pass_context
def cli(ctx: click.Context, folder: str, now: str | None, quiet: bool, verbose: bool) -> None:
    """Turn the output of any visual social distancing engine into decisions about a space.

    \b
    Start with:
      vsd demo                      a made-up shop, from engine output to report
      vsd init                      describe your own site
      vsd ingest FILES...           read engine output
      vsd report --week last        the weekly page

    Exit codes: 0 done, 1 done but something needs you, 2 could not run, 130 interrupted.
    """
    ctx.obj = Project(folder=folder, now_text=now, quiet=quiet, verbose=verbose)
    if now is not None:
        instant(now, zone="UTC", what="--now")


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave the process with its exit code.

    Args:
        arguments: None = those of the process. After exit code 0 it then ends without taking apart what it
            imported.
    """
    if arguments is not None:
        sys.exit(run(cli, arguments))
    code = run(cli, sys.argv[1:])
    if code != 0:
        sys.exit(code)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):  # the reader closed the pipe
            stream.flush()
    if (spill := sys.modules.get("vsd_analytics.store.spill")) is not None:  # importing it for --help would be slow
        spill.leave()
    os._exit(0)


__all__ = ["COMMANDS", "JOBS", "cli", "main", "render_error"]
