"""Options of the commands that read engine files: `check`, `ingest`, `quarantine replay`."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.options import F, choice_option
from vsd_analytics.cli.project import Project
from vsd_analytics.config.file_columns import MAP_COLUMNS, METRES
from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.formats.adapters import formats
from vsd_analytics.site.instants import instant

if TYPE_CHECKING:
    from vsd_analytics.ingest.reading.adapter import IngestOptions


import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from vsd_analytics.errors import InputError, Where
from vsd_analytics.settings import Settings


def file_options(command: F) -> F:
    """Add the options that say how to read engine files; they have the names of the fields of `IngestOptions`."""
    options: list[Callable[[Any], Any]] = [
        click.option("--format", metavar="NAME", help=f"{', '.join(formats())}; else detected."),
        click.option("--camera", metavar="ID", help="Camera of records that name none."),
        click.option(
            "--columns", metavar="NAMES", help="Headerless table: our names in the file's order; _ ignores a column."
        ),
        click.option(
            "--map", metavar="OURS=THEIRS", multiple=True, help="Column renames; repeat or separate by commas."
        ),
        click.option(
            "--period",
            "period_s",
            type=float,
            metavar="SECONDS",
            help="Sampling period: records of one period are one frame.",
        ),
        click.option(
            "--hz", "--fps", "fps", type=float, metavar="N", help="Frames per second, for files with frame numbers."
        ),
        click.option(
            "--start",
            metavar="INSTANT",
            help="Time of the first frame, for frame numbers and times counted from the beginning.",
        ),
        click.option(
            "--first-frame",
            type=float,
            metavar="N",
            help="Number of the frame at --start (default: the format's first).",
        ),
        click.option(
            "--coordinates", type=click.Choice(["floor", "image"]), help="Which of a format's coordinates to use."
        ),
        choice_option(
            "--method",
            choices=["center-points", "four-corner"],
            default="center-points",
            help="smart-social-distancing: its distance method.",
        ),
        click.option(
            "--resolution",
            "resolution_px",
            metavar="WxH",
            default="640x480",
            show_default=True,
            help="smart-social-distancing: resolution boxes were logged at.",
        ),
        click.option(
            "--threshold",
            "threshold_m",
            type=float,
            default=1.5,
            show_default=True,
            metavar="METRES",
            help="smart-social-distancing: its distance limit.",
        ),
        click.option(
            "--per-camera", is_flag=True, help="wildtrack: each view's boxes as a camera of its own, C1 to C7."
        ),
        click.option("--engine", metavar="NAME", help="Engine name and version, where the files do not say."),
        click.option(
            "--unit",
            type=click.Choice(list(METRES)),
            help="Unit of positions and distances whose column names none (default: m).",
        ),
        click.option("--where", metavar="FILTER", help="Tables: rows to read, such as \"class_name = 'person'\"."),
        click.option("--zone", metavar="ZONE", help="Time zone of times without an offset, such as Europe/Rome."),
        click.option(
            "--time-format",
            metavar="FORMAT",
            help='How times are written, such as "%d/%m/%Y %H:%M:%S"; since --start: s, ms, us or ns.',
        ),
        click.option(
            "--size",
            "size_px",
            metavar="WxH",
            help="Size of the picture, for positions given as shares of it (0 to 1).",
        ),
        click.option(
            "--persons",
            metavar="PATH",
            help="JSON messages: where the list of persons is, such as data.people, or frames.*.people.",
        ),
        click.option(
            "--no-list-is-nobody",
            is_flag=True,
            default=None,
            help="JSON messages: one without the list of --persons is a frame without persons.",
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


def ingest_options(project: Project, given: dict[str, Any]) -> IngestOptions:
    """Return the checked values of `file_options`.

    Raises:
        UsageError: E101, a value is malformed or out of range, or two options contradict each other.
    """
    from vsd_analytics.ingest.reading.adapter import IngestOptions

    renames = renames_of(given["map"])
    if given["where"] is not None:
        from vsd_analytics.ingest.reading.where import parse_where

        parse_where(given["where"])
    if given["time_format"] is not None:
        from vsd_analytics.ingest.reading.time_formats import checked_format

        checked_format(given["time_format"])
    for name in ("period_s", "fps", "threshold_m"):
        if given[name] is not None and not 0 < given[name] < 1e6:
            option = "hz" if name == "fps" else name.removesuffix("_s").removesuffix("_m")
            raise UsageError(f"--{option} must be greater than 0")
    if given["first_frame"] is not None and not abs(given["first_frame"]) < 1e15:
        raise UsageError("--first-frame must be a number of a frame")
    if given["per_camera"] and given["camera"] is not None:
        raise UsageError("--per-camera names the cameras C1 to C7 itself", fix="leave out --camera")
    start = None
    if given["start"] is not None:
        start = round(instant(given["start"], zone=project.site.timezone, what="--start").timestamp() * 1000)
    columns, zone, size = given["columns"], given["zone"], given["size_px"]
    read = {
        "columns": None if columns is None else tuple(c.strip() for c in columns.split(",")),
        "map": renames,
        "start": start,
        "resolution_px": _size_px("--resolution", given["resolution_px"], example="640x480"),
        "zone": None if zone is None else _zone(zone),
        "size_px": None if size is None else _size_px("--size", size, example="1280x720"),
    }
    return IngestOptions(**{**given, **read})


def _size_px(option: str, text: str, *, example: str) -> tuple[int, int]:
    size = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if size is None or "0" in size.groups():
        raise UsageError(f"{option} {text!r} is not WIDTHxHEIGHT", fix=f"{option} {example}")
    return int(size[1]), int(size[2])


def _zone(name: str) -> str:
    from vsd_analytics.config.values import is_zone, nearest_zone

    if not is_zone(name):
        raise UsageError(f"there is no time zone {name!r}", fix=f"--zone {nearest_zone(name) or 'Europe/Rome'}")
    return name


def renames_of(given: Sequence[str]) -> dict[str, str]:
    """Return the column renames of `--map`, ours to theirs.

    A column that a later `--map` calls something else is no longer what an earlier one called it.

    Raises:
        UsageError: E101, one is not OURS=THEIRS, or no column of ours is called so.
    """
    from vsd_analytics.errors import nearest

    renames: dict[str, str] = {}
    said_at: dict[str, int] = {}
    for at, text in ((at, part) for at, option in enumerate(given) for part in option.split(",")):
        ours, equals, theirs = text.partition("=")
        if not equals or not ours.strip() or not theirs.strip():
            raise UsageError(f"--map {text!r} is not OURS=THEIRS", fix="--map ts=time")
        if ours.strip() not in MAP_COLUMNS:
            begin = (name for name in MAP_COLUMNS if name.startswith(ours.strip().lower()))
            near = nearest(ours.strip(), MAP_COLUMNS) or next(begin, None)
            raise UsageError(
                f"--map {text!r}: no column of ours is called {ours.strip()!r}",
                why=f"ours: {', '.join(MAP_COLUMNS)}",
                fix=f"--map {shlex.quote(f'{near}={theirs.strip()}')}"
                if near
                else "write the name of one of our columns",
            )
        renames = {o: t for o, t in renames.items() if t != theirs.strip() or said_at[o] == at}
        renames[ours.strip()] = theirs.strip()
        said_at[ours.strip()] = at
    return renames


NAME = "standard input"


@contextmanager
def with_standard_input(files: Sequence[str], settings: Settings) -> Iterator[tuple[list[Path], Mapping[Path, str]]]:
    """Yield the paths of files, `-` being a copy of standard input, and what messages call that copy.

    Files are read more than once: first their beginning, to see what they are. So a pipe is copied.

    Raises:
        InputError: E206, more than `unpack_max_gb` come through it.
    """
    if "-" not in files:
        yield [Path(f) for f in files], {}
        return
    with tempfile.TemporaryDirectory(prefix="vsd-input-") as folder:
        copy = Path(folder) / "input"
        _copy(copy, int(settings.unpack_max_gb * 10**9))
        yield [copy if f == "-" else Path(f) for f in files], {copy: NAME}


def _copy(path: Path, most: int) -> None:
    n_bytes = 0
    with path.open("wb") as f:
        while data := sys.stdin.buffer.read(1 << 20):
            n_bytes += len(data)
            if n_bytes > most:
                raise InputError(
                    f"{NAME} has more than {most:,} bytes",
                    code="E206",
                    where=Where(NAME),
                    why="it is copied to a file before it is read",
                    fix="split it, or raise unpack_max_gb under [ingest] in vsd.toml",
                )
            f.write(data)
