"""Runs the command line: every error in one shape, and the exit code."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from difflib import SequenceMatcher
from typing import Final

import click

from vsd_analytics.cli.output import emit_json, render_error
from vsd_analytics.errors import UsageError, VsdError, disk_error
from vsd_analytics.owners import denied

BEYOND_CORE: Final = frozenset(
    {"babel", "contourpy", "cv2", "jinja2", "markupsafe", "matplotlib", "PIL", "resvg_py", "scipy"}
)
"""Libraries that commands of `deploy/core-requirements.txt` do without: they draw, measure pictures and test."""


def run(command: click.Command, arguments: list[str]) -> int:
    """Run a click command and return its exit code, printing every error in one shape.

    Args:
        command: The command.
        arguments: Those of the command line.
    """
    as_json = "--json" in arguments
    verbose = any(a in ("-v", "--verbose") for a in arguments)
    try:
        if not {"explain", "-h", "--help", "--version"} & set(arguments):
            refuse_unsupported(sys.platform)
        result = command.main(arguments, prog_name="vsd", standalone_mode=False)
        sys.stdout.flush()
        return result if isinstance(result, int) else 0
    except VsdError as error:
        _print_error(error, as_json=as_json)
        return 2
    except click.exceptions.Exit as stop:
        return int(stop.exit_code)
    except (click.Abort, KeyboardInterrupt) as stop:
        if isinstance(stop.__context__, EOFError):
            click.echo(err=True)  # ends the line of the question
            _print_error(_nobody_answers(), as_json=as_json)
            return 2
        click.echo("interrupted", err=True)
        return 130
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return 2
    except click.ClickException as error:
        if isinstance(error, click.UsageError) and error.ctx is not None and not as_json:
            click.echo(error.ctx.get_usage(), err=True)
        near = _nearest_first(error)
        fix = f"write {near[0]}" if near else "see vsd --help, or the command's own --help"
        _print_error(UsageError(error.format_message(), fix=fix), as_json=as_json)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        if verbose:
            raise
        what = f"{error.strerror or error}: {error.filename}" if error.filename else str(error)
        why, fix = denied(error)
        refused = VsdError(what, code="E120", why=why, fix=fix)
        _print_error(disk_error(error) or refused, as_json=as_json)
        return 2
    except Exception as error:
        if verbose:
            raise
        library = (error.name or "").partition(".")[0] if isinstance(error, ModuleNotFoundError) else ""
        if library in BEYOND_CORE:
            _print_error(_needs_the_rest(library), as_json=as_json)
            return 2
        what = f"an internal error stopped the command: {type(error).__name__}: {error}"
        internal = VsdError(what, code="E900", fix="run it again with -v and report what it prints")
        _print_error(disk_error(error) or internal, as_json=as_json)
        return 2


def _nearest_first(error: click.ClickException) -> list[str]:
    """Return the options or commands that were meant: those that begin with the word first; click sorts by alphabet."""
    word = str(getattr(error, "option_name", None) or getattr(error, "command_name", None) or "")
    known: list[str] = list(getattr(error, "possibilities", None) or ())
    return sorted(known, key=lambda name: (not name.startswith(word), -SequenceMatcher(None, word, name).ratio()))


def _nobody_answers() -> VsdError:
    return UsageError(
        "the command asked a question, and its input ended without an answer",
        fix="answer with options, as --help lists them, or add --no-input to vsd init",
    )


def _needs_the_rest(library: str) -> VsdError:
    return VsdError(
        f"this command needs the library {library}, which is not installed",
        code="E107",
        why="the core installation takes messages and files in, and makes no figures, maps or pages",
        fix="pip install vsd-analytics   (here, or on the machine that makes the reports)",
    )


def refuse_unsupported(platform: str) -> None:
    """Raise VsdError E130 on a platform whose file system lacks what the store needs.

    Args:
        platform: As `sys.platform` names it.
    """
    if platform in ("win32", "cygwin"):
        raise VsdError(
            "the commands do not run on Windows",
            code="E130",
            why="the store needs file locks and durable renames as Linux and macOS have them",
            fix="run them on Linux or macOS, or inside WSL with the project on its own disk, not below /mnt; "
            "to read a project in Python, vsd_analytics.open needs no locks",
        )


def _print_error(error: VsdError, *, as_json: bool) -> None:
    if as_json:
        emit_json(error.as_dict())
    else:
        click.echo(render_error(error), err=True)


@contextmanager
def stop_signals(*, is_second_final: bool = False) -> Iterator[threading.Event]:
    """Yield an event that SIGTERM and Ctrl-C set instead of ending the process.

    Args:
        is_second_final: The second of them interrupts the command at once.
    """
    stopped = threading.Event()

    def note(*_: object) -> None:
        if is_second_final and stopped.is_set():
            raise KeyboardInterrupt
        stopped.set()

    before = {s: signal.signal(s, note) for s in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield stopped
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
