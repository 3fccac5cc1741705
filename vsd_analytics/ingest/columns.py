"""Finding our columns among those of a table, and an error that helps when one is missing."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.adapter import IngestOptions, Source
from vsd_analytics.ingest.cell_values import is_number
from vsd_analytics.schema import TableName

NUMBERS = ("x_m", "y_m", "u_px", "v_px", "x_a_m", "y_a_m", "x_b_m", "y_b_m", "distance_m", "distance_sd_m")
BOX = ("left", "top", "right", "bottom", "width", "height")
TEXTS = ("camera_id", "track_id", "track_a", "track_b")
KNOWN = ("ts", "frame", *TEXTS, *NUMBERS, *BOX)

_FLOOR: tuple[str, ...] = ("x_m", "y_m")
_PIXELS: tuple[str, ...] = ("u_px", "v_px")
_PLACES: tuple[tuple[str, ...], ...] = (
    _FLOOR,
    _PIXELS,
    ("left", "top", "right", "bottom"),
    ("left", "top", "width", "height"),
)

_PAIR = ("track_a", "track_b", "x_a_m", "y_a_m", "x_b_m", "y_b_m", "distance_m", "distance_sd_m")


@dataclass(frozen=True, slots=True)
class Header:
    """The columns of one table, as the file gives them.

    Attributes:
        names: Column names, each once.
        line: Number of the header line; None without a header.
        text: That line, or the first record of a headerless file; None in Parquet.
    """

    names: Sequence[str]
    line: int | None = None
    text: str | None = None


@dataclass(frozen=True, slots=True)
class ColumnPlan:
    """How the columns of one table are read.

    Attributes:
        kind: "observations" or "pairs".
        theirs: Number of the file's column for each of our names that is read.
        names: Their names, by ours.
    """

    kind: TableName
    theirs: Mapping[str, int]
    names: Mapping[str, str]

    def only_where(self) -> ColumnPlan:
        """Return the plan that reads only camera and time, whatever else is wrong with a row."""
        theirs = {ours: i for ours, i in self.theirs.items() if ours in ("ts", "frame", "camera_id")}
        return ColumnPlan("observations", theirs, self.names)


def plan_columns(source: Source, options: IngestOptions, header: Header, *, kind: TableName | None) -> ColumnPlan:
    """Find our columns among a file's.

    Args:
        source: For messages.
        options: `map` renames; `camera`, `fps` and `start` replace columns.
        header: The file's columns.
        kind: Table that the user named, or None to decide by the columns.

    Raises:
        InputError: E203 naming the column that is missing and the nearest one found; E207 frame numbers without a rate.
    """
    found = _found(source, options, header)
    place: tuple[str, ...] = _PAIR
    if kind is None:
        kind = "pairs" if "track_a" in found or "distance_m" in found else "observations"
    if "ts" not in found and "frame" not in found:
        raise _missing(source, "ts", header, "without a time nothing can be counted by hour")
    if kind == "pairs":
        if "distance_m" not in found and not {"x_a_m", "y_a_m", "x_b_m", "y_b_m"} <= set(found):
            raise _missing(source, "distance_m", header, "a pair needs a distance or both positions")
        for column in ("track_a", "track_b"):
            if column not in found:
                raise _missing(source, column, header, "without it pairs cannot be distinguished")
    else:
        place = max(_PLACES, key=lambda columns: len(set(columns) & set(found)) / len(columns))
        lacking = [c for c in place if c not in found]
        if lacking:
            raise _missing(source, lacking[0], header, "without a position no distance can be measured")
        place = ("track_id", *place, *(_PIXELS if place == _FLOOR else ()))
    if "ts" not in found and (options.fps is None or options.start is None):
        raise InputError(
            f"{source.path.name} has frame numbers but no times",
            code="E207",
            where=Where(source.name),
            why="a frame number becomes a time only with the frame rate and the time of the first frame",
            fix="add --fps 25 --start 2026-11-09T08:00:00+01:00",
        )
    if "camera_id" not in found and options.camera is None:
        raise _missing(
            source, "camera_id", header, "the site has several cameras, and nothing says which one saw this",
            fix="--camera ID",
        )  # fmt: skip
    wanted = {"ts" if "ts" in found else "frame", "camera_id", *place}
    theirs = {ours: i for ours, i in found.items() if ours in wanted}
    return ColumnPlan(kind, theirs, {ours: header.names[i] for ours, i in theirs.items()})


def unique_names(names: Sequence[str]) -> list[str]:
    """Return names that are all different: blank, `_` and repeated ones become `_` and the column's number."""
    seen: set[str] = set()
    unique = []
    for i, name in enumerate(names):
        is_taken = not name or name == "_" or name in seen
        seen.add(name)
        unique.append(f"_{i}" if is_taken else name)
    return unique


def _found(source: Source, options: IngestOptions, header: Header) -> dict[str, int]:
    exact = {n: i for i, n in enumerate(header.names)}
    loose = {n.strip().lower(): i for i, n in reversed(list(enumerate(header.names)))}
    found = {}
    for ours in KNOWN:
        wanted = (options.map[ours],) if ours in options.map else (options.site_map.get(ours, ours), ours)
        at = next(
            (names[n] for w in wanted for names, n in ((exact, w), (loose, w.strip().lower())) if n in names), None
        )
        if at is not None:
            found[ours] = at
        elif ours in options.map:
            raise _missing(source, wanted[0], header, f"--map says that it is our {ours}", ours=ours)
    return found


def _missing(
    source: Source, column: str, header: Header, why: str, *, ours: str | None = None, fix: str | None = None
) -> InputError:
    shown = [n for n in header.names if not n.startswith("_")]
    found = f"found: {', '.join(n[:40] for n in shown[:20])}"
    if shown and header.line is not None and all(is_number(n) for n in shown):
        return InputError(
            f"{source.path.name} has no column {column!r}",
            code="E203",
            where=Where(source.name, header.line, header.text),
            why=f"{why}; the first line holds numbers, so the file seems to have no header",
            fix="--columns ts,track_id,x_m,y_m (our names in the order of the file's columns; _ for one to ignore)",
        )
    # a column with one of our names is not another one under a wrong name, so it is no suggestion
    free = shown if ours is not None else [n for n in shown if n.lower() not in KNOWN]
    near = _nearest(column, [n for n in free[:1000] if len(n) <= 100]) if fix is None else None
    at = header.text.find(near) + 1 if header.text and near else 0
    if fix is None and header.line is None and header.text is not None:
        fix = f"name it in --columns: {column}, at its place in the order of the file's columns"
    if fix is None:
        fix = f"--map {ours or column}={near or 'THEIR_NAME'}      (or in vsd.toml, under [ingest.map])"
    return InputError(
        f"{source.path.name} has no column {column!r}",
        code="E203",
        where=Where(source.name, header.line, header.text, at or None, "did you mean this column?" if at else None),
        why=f"{why}; {found}",
        fix=fix,
    )


def _nearest(column: str, names: Sequence[str]) -> str | None:
    lower = {n.lower(): n for n in reversed(names)}
    close = difflib.get_close_matches(column.lower(), lower, n=1, cutoff=0.3)
    if close:
        return lower[close[0]]
    stem = column.lower().split("_")[0]
    return next((n for n in names if n.lower() in column.lower() or stem in n.lower()), None)
