"""Output of all commands: text, JSON, errors for people, progress bars."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.errors import CONTROL, ConfigError, VsdError

if TYPE_CHECKING:
    import pandas as pd

_JSON_DIGITS = 6  # more digits would differ between machines without meaning anything


def plain(text: str) -> str:
    """Return `text` without control characters, direction overrides and lone surrogates (newlines and tabs stay)."""
    return "\n".join(CONTROL.sub("\ufffd", line) for line in text.split("\n"))


def emit_json(value: Any) -> None:
    """Print one JSON object on standard output; NaN never appears, missing is null, control characters are escaped."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, default=_as_text)
    click.echo(CONTROL.sub(lambda match: f"\\u{ord(match[0]):04x}", text))


def _as_text(value: object) -> str:
    """Return what JSON has no type for as text: a reason as its sentence, a date as ISO 8601."""
    from vsd_analytics.answer import Reason

    if isinstance(value, Reason):
        from vsd_analytics.wording.reasons import reason_text

        return reason_text(value)
    return str(value)


def render_error(error: VsdError, *, word: str = "error") -> str:
    """Return the message of an error: what, where, why, how to fix it, code."""
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
    if error.fix:
        lines.append(f"  fix: {plain(error.fix)}")
    lines.append(f" more: vsd explain {error.code}")
    return "\n".join(lines)


def _short(text: str, n_chars: int = 160) -> str:
    text = CONTROL.sub("\ufffd", text).replace("\n", " ")
    return text if len(text) <= n_chars else text[: n_chars - 1] + "…"


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
    tqdm.monitor_interval = 0  # its thread would keep `ingest` from copying this process for a large file
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


@contextmanager
def facts_progress(*, quiet: bool) -> Iterator[tuple[Callable[[int], None], Callable[[int], None]]]:
    """Show progress over hours of facts; yield `on_plan` (more hours to compute) and `on_hours` (hours computed)."""
    with ExitStack() as at_end:
        bar: Any = None

        def plan(n_hours: int) -> None:
            nonlocal bar
            if n_hours and bar is None:  # a bar for nothing would be imported in vain
                bar = at_end.enter_context(progress(None, total=0, label="facts", unit="h", quiet=quiet))
            if n_hours:
                bar.total += n_hours

        def done(n_hours: int) -> None:
            if bar is not None:
                bar.update(n_hours)

        yield plan, done


def count(n: int, noun: str) -> str:
    """Return a number and its noun in singular or plural: `1 frame`, `2,000 frames`."""
    return f"{n:,} {noun}{'' if n == 1 else 's'}"


def table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of texts as lines with aligned columns; control characters and line ends in a text are replaced."""
    clean = [[plain(cell).replace("\n", " ") for cell in row] for row in rows]
    widths = [max(len(row[k]) for row in clean) for k in range(len(clean[0]))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in clean]


def rows_of(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a frame; what is missing is None."""
    rows: list[dict[str, Any]] = json.loads(frame.to_json(orient="records", double_precision=15))
    return rows


def rounded(value: Any) -> Any:
    """Return a JSON value with every float to 6 significant digits; infinity and NaN are None."""
    if isinstance(value, dict):
        return {k: rounded(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.{_JSON_DIGITS}g}") if math.isfinite(value) else None
    return value
