"""The first rows of a table as the file writes them, with the columns that nobody mapped."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa

from vsd_analytics.config.file_columns import FILE_COLUMNS
from vsd_analytics.ingest.reading.cell_values import numbers, trimmed
from vsd_analytics.ingest.reading.column_hints import Role, named_like
from vsd_analytics.ingest.reading.columns import ColumnPlan, other_column_key
from vsd_analytics.ingest.reading.table_file import TableFile
from vsd_analytics.ingest.reading.where import rows_where

HEAD_ROWS = 50_000
TEXTS_MAX = 40
"""Columns of texts whose names tell nothing that are looked at as well: what they hold may tell."""
VALUES_MAX = 200
"""Different values of a column that are remembered."""
SHOWN_ROWS = 3
_CHARS = 80
BOX_SIDES = ("left", "top", "right", "bottom", "width", "height")
WIDE = 1.25
"""People who stand are higher than wide; a box is clearly wider from this ratio on."""
SLIM = 3.5
"""Height over width. The median of real boxes of people is 2.3 to 3.3, of boxes drawn around bodies of a model 4."""
LASTING: tuple[Role, ...] = ("camera", "class", "storey", "absent", "present", "state", "unseen", "unit")
"""What is looked at to the end of a file: these columns have few values."""
_ROLES: tuple[Role, ...] = (*LASTING, "id", "confidence", "scores", "time", "date", "file", "third axis")


@dataclass(slots=True)
class BoxCounts:
    """What the sides of some boxes look like.

    Attributes:
        n: Boxes with sizes, or with a top and a bottom side.
        n_upside_down: Those whose bottom has the smaller number: y points up.
        n_mirrored: Those whose right side has the smaller number.
        n_wide: Boxes that are clearly wider than high.
        n_slim: Boxes that are slimmer than people are.
        n_like_corners: Boxes whose width and height are larger than their left and top sides, as far corners are.
    """

    n: int = 0
    n_upside_down: int = 0
    n_mirrored: int = 0
    n_wide: int = 0
    n_slim: int = 0
    n_like_corners: int = 0

    def add(self, sides: Mapping[str, np.ndarray]) -> None:
        """Take in the sides of some boxes, by our names."""
        if "bottom" in sides:
            heights, widths = sides["bottom"] - sides["top"], sides["right"] - sides["left"]
            self.n += int((heights != 0).sum() - np.isnan(heights).sum())
            self.n_upside_down += int((heights < 0).sum())
            self.n_mirrored += int((widths < 0).sum())
            self.n_wide += int((widths > WIDE * np.abs(heights)).sum())
            self.n_slim += int((np.abs(heights) > SLIM * np.abs(widths)).sum())
        elif "height" in sides:
            self.n += int((~np.isnan(sides["height"])).sum())
            self.n_wide += int((sides["width"] > WIDE * sides["height"]).sum())
            self.n_slim += int((sides["height"] > SLIM * sides["width"]).sum())
            if "left" in sides:
                is_beyond = (sides["width"] > sides["left"]) & (sides["height"] > sides["top"])
                self.n_like_corners += int(is_beyond.sum())


@dataclass(frozen=True, slots=True)
class TableHead:
    """How the columns of a table are read, and what its first rows hold.

    Attributes:
        plan: Which columns are read, and as what.
        ignored: Names of the columns that are not read, in the order of the file.
        values: How often each value occurs in an ignored column whose name tells what it holds, or that holds texts; at
            most `VALUES_MAX`. Rows that `--where` leaves out do not count.
        rows: The first rows by line: cells of the columns that are read, by their names.
        filtered: How often each value occurs in a column that `--where` compares, before it leaves out any row.
        boxes: What the sides of the boxes look like.
        n_columns: Columns of a file whose columns have no names and always mean the same; 0 = of others.
        parts: Names of the files that are read, of a folder or archive.
        unread: Names of the files of a folder or archive that hold data by their names, and are not read.
        passed_over: Paths of lists in a JSON message of whose entries one is read.
    """

    plan: ColumnPlan
    ignored: Sequence[str]
    values: Mapping[str, Counter[str]] = field(default_factory=dict)
    rows: Mapping[int, Mapping[str, str]] = field(default_factory=dict)
    filtered: Mapping[str, Counter[str]] = field(default_factory=dict)
    boxes: BoxCounts = field(default_factory=BoxCounts)
    n_columns: int = 0
    parts: Sequence[str] = ()
    unread: Sequence[str] = ()
    passed_over: Sequence[str] = ()

    def map_option(self, **columns: str) -> str | None:
        """Return the `--map` that reads columns as something else, or None where the format has columns of its own.

        Args:
            columns: By our name that they should have, our name that they are read by.
        """
        theirs = {ours: self.plan.names.get(read_as) for ours, read_as in columns.items()}
        if self.n_columns or any(name is None or set(",=") & set(name) for name in theirs.values()):
            return None
        return f"--map {shlex.quote(','.join(f'{ours}={name}' for ours, name in theirs.items()))}"


def head_of(file: TableFile, plan: ColumnPlan) -> TableHead:
    """Read the first rows of a table.

    Args:
        file: The table.
        plan: Its columns.

    Raises:
        InputError: The file cannot be read.
    """
    read = set(plan.theirs.values()) | set(plan.compared.values())
    names = file.header.names
    free = [i for i in range(len(names)) if i not in read]
    ignored = [names[i] for i in free if names[i] != f"_{i}"]
    watched = {**_texts(file, plan), **watched_columns(file, plan, _ROLES)}
    wanted = {**plan.theirs, **{other_column_key(name): i for name, i in (*watched.items(), *plan.compared.items())}}
    values: dict[str, Counter[str]] = {name: Counter() for name in (*watched, *plan.compared)}
    rows: dict[int, dict[str, str]] = {}
    boxes, n_rows = BoxCounts(), 0
    with file.readable():
        for chunk in file.chunks(wanted):
            some = slice(0, SHOWN_ROWS - len(rows))
            for at, line in enumerate(chunk.lines[some].tolist()):
                cells = {o: trimmed(chunk.columns[o].slice(at, 1))[0].as_py() for o in plan.theirs}
                rows[line] = {plan.names[o]: str(cell)[:_CHARS] for o, cell in cells.items()}
            cells_of = {name: chunk.columns[other_column_key(name)].slice(0, HEAD_ROWS - n_rows) for name in values}
            compared = {name: cells_of[name] for name in plan.compared}
            is_read = (
                pa.array(rows_where(plan.where, compared, decimal_comma=file.has_decimal_comma)) if compared else None
            )
            for name, counter in values.items():
                is_of_all = is_read is None or name in compared  # of those, a filter needs what it leaves out
                _count(trimmed(cells_of[name] if is_of_all else cells_of[name].filter(is_read)), counter)
            sides = {
                side: numbers(chunk.columns[side], decimal_comma=file.has_decimal_comma)[0]
                for side in BOX_SIDES
                if side in plan.theirs
            }
            boxes.add(sides)
            n_rows += len(chunk.lines)
            if n_rows >= HEAD_ROWS:
                break
    return TableHead(
        plan,
        ignored,
        {name: values[name] for name in watched},
        rows,
        {name: values[name] for name in plan.compared},
        boxes,
    )


def watched_columns(file: TableFile, plan: ColumnPlan, roles: Sequence[Role]) -> dict[str, int]:
    """Return the columns that are not read and whose names tell what they hold, by their names."""
    read = set(plan.theirs.values()) | set(plan.compared.values())
    names = file.header.names
    telling = {n for role in roles for n in named_like((n for i, n in enumerate(names) if i not in read), role)}
    telling -= set(FILE_COLUMNS) - {"camera_id", "track_id"}
    return {name: i for i, name in enumerate(names) if name in telling and file.can_read(i)}


def _texts(file: TableFile, plan: ColumnPlan) -> dict[str, int]:
    """Return the first `TEXTS_MAX` columns that are not read and that hold texts, by their names."""
    read = set(plan.theirs.values()) | set(plan.compared.values())
    names = file.header.names
    free = [i for i in range(len(names)) if i not in read and file.can_read(i) and file.has_text(i)]
    return {names[i]: i for i in free[:TEXTS_MAX] if names[i].lower() not in FILE_COLUMNS}


def values_of(texts: pa.Array) -> Counter[str]:
    """Return how often each text of a column occurs, of at most `VALUES_MAX`."""
    counter: Counter[str] = Counter()
    _count(texts, counter)
    return counter


def _count(texts: pa.Array, counter: Counter[str]) -> None:
    for value in texts.value_counts().to_pylist():
        text = value["values"][:_CHARS]
        if text and (text in counter or len(counter) < VALUES_MAX):
            counter[text] += value["counts"]
