"""Finding our columns among those of a table, and an error that helps when one is missing."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from vsd_analytics.config.camera_in_name import camera_named
from vsd_analytics.config.file_columns import FILE_TAG, MAP_COLUMNS, METRES, PLACES
from vsd_analytics.config.row_filter import RowCondition
from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.cell_values import is_number
from vsd_analytics.ingest.reading.column_guess import (
    completed,
    nearest_name,
    proposed_columns,
    proposed_pairs,
    renames_option,
)
from vsd_analytics.ingest.reading.column_hints import (
    POINTS,
    is_whole_box,
    letters,
    of_another_person,
    place_like,
    time_like,
)
from vsd_analytics.ingest.reading.instants import offset_in_name
from vsd_analytics.ingest.reading.table_file import Header
from vsd_analytics.ingest.reading.units import LENGTHS, unit_in_name
from vsd_analytics.ingest.reading.where import parse_where
from vsd_analytics.schema import TableName

_FLOOR, _PIXELS = PLACES[:2]

TIME_OF_DAY = "ts+"
"""Key of the second column of `--map ts=date+time`."""

_PAIR = ("track_a", "track_b", "x_a_m", "y_a_m", "x_b_m", "y_b_m", "distance_m", "distance_sd_m")


@dataclass(frozen=True, slots=True)
class ColumnPlan:
    """How the columns of one table are read.

    Attributes:
        kind: "observations" or "pairs".
        theirs: Number of the file's column for each of our names that is read.
        names: Their names, by ours.
        units: Unit of each of our columns in metres that is not in metres, see `file_columns.METRES`.
        where: Comparisons that a row must fulfil.
        compared: Number of the file's column for each column of `where`.
        time_format: How texts in `ts` are written, in the words of strptime; None = ISO 8601.
    """

    kind: TableName
    theirs: Mapping[str, int]
    names: Mapping[str, str]
    units: Mapping[str, str] = field(default_factory=dict)
    where: tuple[RowCondition, ...] = ()
    compared: Mapping[str, int] = field(default_factory=dict)
    time_format: str | None = None

    @property
    def offset_ms(self) -> int | None:
        """Return how far ahead of UTC the name of the column of times says that they are; None = it says nothing."""
        return offset_in_name(self.names.get("ts", ""))

    @property
    def wanted(self) -> dict[str, int]:
        """Return the columns to read: ours by our names, those of `where` by `beside` of theirs."""
        return {**self.theirs, **{other_column_key(name): i for name, i in self.compared.items()}}

    @property
    def box(self) -> str:
        """Return the column that a bad box is reported by."""
        return next((c for c in ("right", "width") if c in self.theirs), "ts")

    def only_where(self) -> ColumnPlan:
        """Return the plan that reads only camera and time, whatever else is wrong with a row."""
        theirs = {ours: i for ours, i in self.theirs.items() if ours in ("ts", TIME_OF_DAY, "frame", "camera_id")}
        return ColumnPlan("observations", theirs, self.names, time_format=self.time_format)


def other_column_key(name: str) -> str:
    """Return the key of a column that is read beside ours, which no column of ours has."""
    return f"beside {name}"


def plan_columns(source: Source, options: IngestOptions, header: Header, *, kind: TableName | None) -> ColumnPlan:
    """Find our columns among a file's.

    Args:
        source: For messages.
        options: `map` renames; `camera`, `fps` and `start` replace columns.
        header: The file's columns.
        kind: Table that the user named, or None to decide by the columns.

    Raises:
        InputError: E203 naming the column that is missing, with a `--map` of all columns that are recognised; or the
            column whose name states another unit than `--unit`; E207 frame numbers without a rate.
        UsageError: E101, `--where` is not understood.
    """
    positions = _found(source, options, header)
    place: tuple[str, ...] = _PAIR
    if kind is None:
        kind = "pairs" if "track_a" in positions or "distance_m" in positions else "observations"
    proposed = proposed_columns(header, positions, kind=kind)
    has_place = any(set(columns) <= set(positions) for columns in PLACES)
    pair = {} if kind == "pairs" or has_place else proposed_pairs(header)
    if pair:
        proposed = {ours: theirs for ours, theirs in proposed.items() if ours in ("ts", "camera_id")} | pair
    if "ts" not in positions and "frame" not in positions:
        raise _missing(source, "ts", header, "without a time nothing can be counted by hour", proposed)
    if kind == "pairs":
        if "distance_m" not in positions and not {"x_a_m", "y_a_m", "x_b_m", "y_b_m"} <= set(positions):
            raise _missing(source, "distance_m", header, "a pair needs a distance or both positions", proposed)
        for column in ("track_a", "track_b"):
            if column not in positions:
                raise _missing(source, column, header, "without it pairs cannot be distinguished", proposed)
    else:
        place = max(PLACES, key=lambda columns: len(set(columns) & set(positions)) / len(columns))
        lacking = [c for c in place if c not in positions]
        if lacking and pair:
            raise _missing(source, lacking[0], header, "a row seems to be two people", proposed)
        if lacking and (other := _not_a_place_a_row(source, header)) is not None:
            raise other
        if lacking:
            why, taken = "without a position no distance can be measured", [header.names[i] for i in positions.values()]
            raise _missing(source, lacking[0], header, why, proposed, taken=taken)
        place = ("track_id", FILE_TAG, *place, *(_PIXELS if place == _FLOOR else ()))
    if "ts" not in positions and (options.fps is None or options.start is None):
        if (time := time_like(header.names)) is not None:
            why = "frame numbers need --hz and --start, and the file seems to have times"
            raise _missing(source, "ts", header, why, {"ts": time, **proposed})
        raise InputError(
            f"{source.file_name} has frame numbers but no times",
            code="E207",
            where=Where(source.name),
            why="a frame number becomes a time only with the frame rate and the time of the first frame",
            fix="add --hz 25 --start 2026-11-09T08:00:00+01:00",
        )
    if "camera_id" not in positions and options.camera is None:
        why = "the site has several cameras, and nothing says which one saw this"
        camera_name = camera_named(source.file_name, options.clocks)  # these have all names of cameras
        raise _missing(
            source, "camera_id", header, why, proposed, named=None if camera_name is None else camera_name.camera
        )
    wanted = {*(("ts", TIME_OF_DAY) if "ts" in positions else ("frame",)), "camera_id", *place}
    theirs = {ours: i for ours, i in positions.items() if ours in wanted}
    names = {ours: header.names[i] for ours, i in theirs.items()}
    where = () if options.where is None else parse_where(options.where)
    compared = {c.column: _their_column(source, c.column, header) for c in where}
    return ColumnPlan(kind, theirs, names, _units(source, names, options), where, compared)


def _not_a_place_a_row(source: Source, header: Header) -> InputError | None:
    """Return the error of a table whose rows hold several people, or whose cells a whole box: no `--map` helps."""
    if place_like(header.names):
        return None
    several = [n for n in header.names if re.search(r"\d", n) and of_another_person(n, header.names)]
    if len(several) >= 4:
        why = f"a row seems to hold several people; found: {', '.join(name[:40] for name in several[:4])}"
        fix = "write one row for each of them: time, id, and metres or a box in pixels"
        return _unfit(source, header, "has no place of one person in a row", why=why, fix=fix)
    if (box := next(filter(is_whole_box, header.names), None)) is not None:
        why, fix = f"{box[:40]!r} seems to hold a whole box", "write left, top, right, bottom as columns of their own"
        return _unfit(source, header, "has no columns of a place", why=why, fix=fix)
    if (point := next((n for n in header.names if letters(n) in POINTS), None)) is not None:
        why, fix = f"{point[:40]!r} seems to hold a whole place", "write x and y as columns of their own"
        return _unfit(source, header, "has no columns of a place", why=why, fix=fix)
    return None


def _units(source: Source, names: Mapping[str, str], options: IngestOptions) -> dict[str, str]:
    """Return the unit of each column that is not in metres: as its own name says, else as the user says."""
    units = {}
    for ours in (c for c in LENGTHS if c in names):
        stated = unit_in_name(names[ours]) if names[ours].lower() != ours else None
        unit = stated if stated in METRES and stated != "m" else options.unit or "m"
        if options.unit not in (None, unit):
            raise InputError(
                f"--unit {options.unit} contradicts the column {names[ours][:80]!r} of {source.file_name}",
                code="E203",
                where=Where(source.name),
                why=f"its name says {unit}",
                fix="leave out --unit: columns that name their unit are converted",
            )
        if unit != "m":
            units[ours] = unit
    return units


def _their_column(source: Source, name: str, header: Header) -> int:
    for names in (list(header.names), [n.strip().lower() for n in header.names]):
        for wanted in (name, name.lower()):
            if wanted in names:
                return names.index(wanted)
    raise no_compared_column(source, name, header)


def no_compared_column(source: Source, name: str, header: Header) -> InputError:
    """Return the error of a filter that compares a column that is not there: E203, with the nearest that is."""
    near = nearest_name(name, [n for n in header.names[:1000] if len(n) <= 100])
    return InputError(
        f"{source.file_name} has no column {name!r}, which --where compares",
        code="E203",
        where=Where(source.name, header.line, header.text),
        why=f"found: {', '.join(n[:40] for n in header.names[:20])}",
        fix=f"compare {near} instead" if near else "compare one of its columns",
    )


def _found(source: Source, options: IngestOptions, header: Header) -> dict[str, int]:
    exact = {n: i for i, n in enumerate(header.names)}
    loose = {n.strip().lower(): i for i, n in reversed(list(enumerate(header.names)))}
    # a column that the user calls something else is not read by its own name as well
    renamed = {part.strip().lower() for theirs in options.map.values() for part in (theirs, *theirs.split("+"))}
    positions = {}
    for ours in MAP_COLUMNS:
        if ours == FILE_TAG and ours not in {*options.map, *options.site_map}:
            continue
        named = tuple(n for n in (options.site_map.get(ours, ours), ours) if n.lower() not in renamed)
        wanted = (options.map[ours],) if ours in options.map else named
        at = next(
            (names[n] for w in wanted for names, n in ((exact, w), (loose, w.strip().lower())) if n in names), None
        )
        if at is not None:
            _refuse_same_names(source, header, at)
            positions[ours] = at
        elif ours == "ts" and wanted and (both := _date_and_time(wanted[0], exact, loose)) is not None:
            positions["ts"], positions[TIME_OF_DAY] = both
        elif ours in options.map:
            raise _missing(source, wanted[0], header, f"--map says that it is our {ours}", ours=ours)
    return positions


def _refuse_same_names(source: Source, header: Header, at: int) -> None:
    """Raise InputError (E203) when two columns have the name of one that is read: nobody knows which is meant."""
    name = header.names[at].strip().lower()
    same = [i + 1 for i, other in enumerate(header.names) if other.strip().lower() == name]
    is_twice = header.names[at] in header.repeated
    if (len(same) > 1 or is_twice) and not header.names[at].startswith("_"):
        places = f": {', '.join(map(str, same[:5]))}" if not is_twice else ""
        raise InputError(
            f"{source.file_name} has more than one column {header.names[at]!r}{places}",
            code="E203",
            where=Where(source.name, header.line, header.text),
            why="the two may differ, and only one can be read",
            fix="rename the one you do not mean, or read another with --map",
        )


def _date_and_time(wanted: str, exact: Mapping[str, int], loose: Mapping[str, int]) -> tuple[int, int] | None:
    """Return the two columns of a name such as `date+time`, or None when it is not two columns of the file."""
    parts = [part.strip() for part in wanted.split("+")]
    at = [exact.get(part, loose.get(part.lower())) for part in parts]
    if len(at) != 2 or at[0] is None or at[1] is None:
        return None
    return at[0], at[1]


_INSTANT = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d")
_UNIX_MIN = 1e8
"""Larger numbers are seconds since 1970, and neither ids nor places."""
_ULTRALYTICS = frozenset({"name", "class", "confidence", "box"})
"""Columns of `to_csv` and `to_json` of its results."""
_COUNTS = frozenset(
    {"count", "counts", "enter", "entered", "entries", "exit", "exited", "exits", "in_count", "leave", "leaves"}
    | {"line_in", "line_out", "occupancy", "out_count", "people_count", "person_count", "visitors"}
    | {"detectedobjects", "violatingobjects", "noinfringement", "lowinfringement", "highinfringement"}
)
"""Columns of engines that count people at a line or in a room, and place nobody."""


def _missing(
    source: Source,
    column: str,
    header: Header,
    why: str,
    proposed: Mapping[str, str] | None = None,
    *,
    ours: str | None = None,
    named: str | None = None,
    taken: Collection[str] = (),
) -> InputError:
    """Return the error of a table that lacks a column that is needed: E203, with the nearest of its own."""
    shown = [n for n in header.names if not n.startswith("_")]
    listed = f"found: {', '.join(n[:40] for n in shown[:20])}"
    if (other := _other_file(source, column, header, shown, why)) is not None:
        return other
    is_pair = proposed is not None and not {"x_a_m", "distance_m"}.isdisjoint(proposed)
    renames = (
        dict(proposed or {})
        if is_pair
        else completed(proposed or {}, ours or column, header, wanted=column, taken=taken)
    )
    near = renames.get(ours or column)
    counts = [n for n in shown if n.lower() in _COUNTS]
    if counts and not place_like(shown) and (column == "ts" or (column == "x_m" and near not in shown)):
        return _unfit(
            source,
            header,
            "has counts of people and no places",
            why=f"{counts[0][:40]!r} says how many people, and distances need the place of each; {listed}",
            fix="let the engine write a row for each person and frame: time, id, and metres or a box in pixels",
        )
    at = header.text.find(near) + 1 if header.text and near else 0
    if header.line is None and header.text is not None:
        fix = f"name it in --columns: {column}, at its place in the order of the file's columns"
    else:
        chosen = [f"--camera {named or 'ID'}"] if column == "camera_id" and near is None else []
        fix = " ".join([*chosen, *filter(None, [renames_option(renames)])])
    if named is not None:
        fix += f"; vsd check {source.file_name} --save NAME makes a profile that reads the camera from such names"
    return InputError(
        f"{source.file_name} has no column {column!r}",
        code="E203",
        where=Where(source.name, header.line, header.text, at or None, "did you mean this column?" if at else None),
        why=f"{why}; {listed}",
        fix=fix,
    )


def _other_file(source: Source, column: str, header: Header, shown: list[str], why: str) -> InputError | None:
    """Return the error of a file that no renamed column makes a table: one without a header, or of one picture."""
    if shown and header.line is not None and (all(map(is_number, shown)) or any(map(_INSTANT.match, shown))):
        return _unfit(
            source,
            header,
            f"has no column {column!r}",
            why=f"{why}; the first line holds values, so the file seems to have no header",
            fix=f"--columns {','.join(_likely_names(header.names))} (our names in the order of the file's columns; _ "
            "for one to ignore)",
        )
    if {"_field", "_value"} <= {*header.names}:
        return _unfit(
            source,
            header,
            "is an export of InfluxDB with one value a row",
            why="the two coordinates of a place are in two rows",
            fix='pivot it first: |> pivot(rowKey: ["_time", "track"], columnKey: ["_field"], valueColumn: "_value")',
        )
    if column == "ts" and set(shown) >= _ULTRALYTICS:
        return _unfit(
            source,
            header,
            "has neither times nor frame numbers",
            why="these are results of ultralytics for one picture, and they do not say which",
            fix="let it write a file for each frame (save_txt=True), then: vsd engine run labels/ --camera ID --size "
            "WIDTHxHEIGHT --hz 25 --start INSTANT --out frames.jsonl",
        )
    return None


def _likely_names(values: Sequence[str]) -> list[str]:
    """Return our names for the columns of a file without a header, by its first values: a time, an id, and a place."""
    ours = ["_"] * len(values)
    at = next((i for i, v in enumerate(values) if _INSTANT.match(v) or (is_number(v) and float(v) > _UNIX_MIN)), 0)
    ours[at] = "ts"
    for name in ("y_m", "x_m"):
        free = [i for i, v in enumerate(values) if ours[i] == "_" and is_number(v)]
        if free:
            ours[free[-1]] = name
    rest = [i for i, name in enumerate(ours) if name == "_" and i > at]
    for name, i in zip(("track_id", "camera_id"), reversed(rest), strict=False):
        if name == "track_id" or not is_number(values[i]):
            ours[i] = name
    return ours


def _unfit(source: Source, header: Header, what: str, *, why: str, fix: str) -> InputError:
    where = Where(source.name, header.line, header.text)
    return InputError(f"{source.file_name} {what}", code="E203", where=where, why=why, fix=fix)
