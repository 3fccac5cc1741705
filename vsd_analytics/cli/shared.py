"""What all commands share: the project at hand, output, errors for people, exit codes, instants and weeks."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, date, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from vsd_analytics.errors import CONTROL, ConfigError, UsageError, VsdError, disk_error

if TYPE_CHECKING:
    from vsd_analytics.site import Site

CONTEXT_SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 100}


@dataclass
class Project:
    """The project folder and clock a command works with (click's context object).

    Attributes:
        folder: As given by `-C`.
        now_text: As given by `--now`.
        quiet: Say nothing but results and errors.
        verbose: Show tracebacks.
    """

    folder: str
    now_text: str | None = None
    quiet: bool = False
    verbose: bool = False

    @cached_property
    def now(self) -> datetime:
        """Return the clock: `--now`, else the machine's, in UTC."""
        if self.now_text is None:
            return datetime.now(tz=UTC)
        return instant(self.now_text, zone="UTC", what="--now")

    @cached_property
    def root(self) -> Path:
        """Return the project folder: `-C`, or the nearest one upward that holds vsd.toml."""
        from vsd_analytics.config import find_project

        return find_project(Path(self.folder))

    @cached_property
    def site(self) -> Site:
        """Return the site as its vsd.toml describes it."""
        from vsd_analytics.config import load_site

        return load_site(self.root, environ=os.environ)

    def say(self, text: str) -> None:
        """Talk to the user on standard error."""
        if not self.quiet:
            click.echo(plain(text), err=True)


pass_project = click.make_pass_decorator(Project)
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")

F = TypeVar("F", bound=Callable[..., Any])


def plain(text: str) -> str:
    """Return `text` without control characters, direction overrides and lone surrogates (newlines and tabs stay)."""
    return "\n".join(CONTROL.sub("\ufffd", line) for line in text.split("\n"))


def emit_json(value: Any) -> None:
    """Print one JSON object on standard output; NaN never appears, missing is null, control characters are escaped."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, default=str)
    click.echo(CONTROL.sub(lambda found: f"\\u{ord(found[0]):04x}", text))


def render_error(error: VsdError, *, word: str = "error") -> str:
    """Return the message of an error: what, where, why, mend, code."""
    lines = [f"{word}[{error.code}]: {plain(error.what)}"]
    if error.where is not None:
        line = f", line {error.where.line}" if error.where.line is not None else ""
        lines.append(f"  --> {_short(error.where.file)}{line}")
        if error.where.text is not None:
            lines.append(f"   |  {_short(error.where.text)}")
            if error.where.column is not None:
                lines.append(f"   |  {' ' * (error.where.column - 1)}^ {_short(error.where.note or '')}".rstrip())
    if isinstance(error, ConfigError):
        lines += [
            f"  {text}"
            for p in error.problems
            for text in render_error(p, word="mistake").split("\n")
            if "more:" not in text
        ]
    if error.why:
        lines.append(f"  why: {plain(error.why)}")
    if error.mend:
        lines.append(f" mend: {plain(error.mend)}")
    lines.append(f" more: vsd explain {error.code}")
    return "\n".join(lines)


def _short(text: str, n_chars: int = 160) -> str:
    text = CONTROL.sub("\ufffd", text).replace("\n", " ")
    return text if len(text) <= n_chars else text[: n_chars - 1] + "…"


def run(command: click.Command, arguments: list[str]) -> int:
    """Run a click command and return its exit code, with every error told in one shape."""
    as_json = "--json" in arguments
    verbose = any(a in ("-v", "--verbose") for a in arguments)
    try:
        if not {"explain", "-h", "--help", "--version"} & set(arguments):
            refuse_unsupported(sys.platform)
        result = command.main(arguments, prog_name="vsd", standalone_mode=False)
        sys.stdout.flush()
        return result if isinstance(result, int) else 0
    except VsdError as error:
        _tell(error, as_json=as_json)
        return 2
    except click.exceptions.Exit as stop:
        return int(stop.exit_code)
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted", err=True)
        return 130
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return 2
    except click.ClickException as error:
        if isinstance(error, click.UsageError) and error.ctx is not None and not as_json:
            click.echo(error.ctx.get_usage(), err=True)
        _tell(UsageError(error.format_message(), mend="see vsd --help, or the command's own --help"), as_json=as_json)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        if verbose:
            raise
        what = f"{error.strerror or error}: {error.filename}" if error.filename else str(error)
        refused = VsdError(what, code="E120", mend="check the path, its permissions and the free space")
        _tell(disk_error(error) or refused, as_json=as_json)
        return 2
    except Exception as error:
        if verbose:
            raise
        what = f"an internal error stopped the command: {type(error).__name__}: {error}"
        internal = VsdError(what, code="E900", mend="run it again with -v and report what it prints")
        _tell(disk_error(error) or internal, as_json=as_json)
        return 2


def refuse_unsupported(platform: str) -> None:
    """Raise VsdError E130 on a platform whose file system cannot keep the store's promises.

    Args:
        platform: As `sys.platform` names it.
    """
    if platform in ("win32", "cygwin"):
        raise VsdError(
            "Windows is not supported",
            code="E130",
            why="the store needs file locks and durable renames as Linux and macOS have them",
            mend="run it on Linux or macOS, or inside WSL with the project on its own disk, not below /mnt",
        )


def _tell(error: VsdError, *, as_json: bool) -> None:
    if as_json:
        emit_json(error.as_dict())
    else:
        click.echo(render_error(error), err=True)


def instant(text: str, *, zone: str, what: str) -> datetime:
    """Parse an ISO instant; without an offset it is in `zone`.

    Raises:
        UsageError: E101, naming the option `what`.
    """
    from zoneinfo import ZoneInfo

    try:
        parsed = datetime.fromisoformat(text)
        _in_reach(parsed.date())
    except ValueError:
        raise UsageError(
            f"{what}: {text!r} is not a date and time", mend=f"{what} 2026-11-11T12:00 or with an offset, …T12:00+01:00"
        ) from None
    return parsed if parsed.tzinfo is not None else parsed.replace(tzinfo=ZoneInfo(zone))


_YEARS = range(1900, 2200)  # weeks before and after, and their instants in any zone, exist as well


def _in_reach(day: date) -> date:
    if day.year not in _YEARS:
        raise ValueError(f"{day} lies outside {_YEARS.start} to {_YEARS.stop - 1}")
    return day


def parse_week(text: str, *, last: date) -> date:
    """Return the Monday of an ISO week.

    Args:
        text: `2026-W46`, `last` (the last whole week of the stored data or clock), `last-2`.
        last: Monday that `last` stands for.

    Raises:
        UsageError: E101.
    """
    from datetime import timedelta

    try:
        if match := re.fullmatch(r"last(?:-(\d{1,4}))?", text):
            return _in_reach(last - timedelta(weeks=int(match[1] or 0)))
        if re.fullmatch(r"\d{4}-W\d{2}", text):
            return _in_reach(date.fromisoformat(f"{text}-1"))
    except (ValueError, OverflowError):
        pass
    raise UsageError(
        f"{text!r} is not a week",
        why="weeks are ISO weeks, Monday to Sunday",
        mend="--week 2026-W46, or last, or last-2",
    )


def parse_range(text: str) -> tuple[date, date]:
    """Return first and last local day of `2026-11-09..2026-11-15`, `2026-W46` or `2026-11-09`.

    Raises:
        UsageError: E101.
    """
    from datetime import timedelta

    try:
        if re.fullmatch(r"\d{4}-W\d{2}", text):
            monday = _in_reach(date.fromisoformat(f"{text}-1"))
            return monday, monday + timedelta(days=6)
        first, _, last = text.partition("..")
        days = _in_reach(date.fromisoformat(first)), _in_reach(date.fromisoformat(last or first))
    except ValueError:
        days = None
    if days is None or days[0] > days[1]:
        raise UsageError(f"{text!r} is not a range of days", mend="2026-11-09..2026-11-15, 2026-W46 or 2026-11-09")
    return days


@contextmanager
def progress(items: Iterable[Any] | None, *, total: int | None, label: str, unit: str, quiet: bool) -> Iterator[Any]:
    """Show a progress bar on a terminal once the work takes longer than a second.

    Args:
        items: Iterable to walk, or None to advance the bar by hand with `.update(n)`.
        total: Number of units.
        label: Words before the bar.
        unit: What is counted.
        quiet: Never show it.
    """
    from tqdm import tqdm

    scale = unit == "B"
    with tqdm(
        items,
        total=total,
        desc=label,
        unit=unit,
        unit_scale=scale,
        delay=1.0,
        disable=True if quiet else None,
        leave=False,
        file=sys.stderr,
    ) as bar:
        yield bar
