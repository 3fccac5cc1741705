"""From the cells of a table to raw records: times, numbers, foot points of boxes, ids."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.config.file_columns import FILE_BOX, FILE_NUMBERS, FILE_TAG, METRES
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch, Rejected
from vsd_analytics.ingest.reading.cell_values import floats_or_null, ids, numbers, tracks, trimmed
from vsd_analytics.ingest.reading.columns import TIME_OF_DAY, ColumnPlan, other_column_key
from vsd_analytics.ingest.reading.elapsed import elapsed_instants, unit_ms
from vsd_analytics.ingest.reading.instants import Instants, parse_instants
from vsd_analytics.ingest.reading.raw import floored, raw_table, rejected
from vsd_analytics.ingest.reading.where import rows_where

_MAX_MS = 2.0**53
LEFT_OUT = "by --where"
"""Why rows that the user does not want are left out."""


def raw_batch(
    plan: ColumnPlan,
    columns: Mapping[str, pa.Array],
    lines: np.ndarray,
    options: IngestOptions,
    *,
    decimal_comma: bool = False,
) -> RawBatch:
    """Return the records of some rows of a table.

    Args:
        plan: Which columns are read.
        columns: The columns of `plan`, by our names, each of the length of `lines`.
        lines: Line or record numbers.
        options: What the user says.
        decimal_comma: Numbers may have a comma for the point.

    Raises:
        pyarrow.ArrowException: A column is of a type that cannot hold what it should.
    """
    columns, lines, n_left_out = _chosen(plan, columns, lines, decimal_comma=decimal_comma)
    bad = _BadRows(plan, columns, lines)
    values: dict[str, np.ndarray] = {}
    for name in (c for c in columns if c in FILE_NUMBERS or c in FILE_BOX or c == "frame"):
        values[name], is_wrong = numbers(columns[name], decimal_comma=decimal_comma)
        bad.add(is_wrong, name, reason="not-a-number", what="a number")
    camera = ids(columns.get("camera_id"), default=options.camera, length=len(lines))
    if "ts" in columns:
        times = columns["ts"] if TIME_OF_DAY not in columns else date_and_time(columns["ts"], columns[TIME_OF_DAY])
        if decimal_comma:
            times = pc.replace_substring_regex(trimmed(times), r"^(\d{9,}),(\d+)$", r"\1.\2")
        instants = _instants(times, camera, options, plan)
        bad.add(instants.is_wrong, "ts", reason="not-a-time", what="a time")
    else:
        instants = _from_frames(values.pop("frame"), options)
        bad.add(instants.is_wrong, "frame", reason="not-a-time", what="a frame number")
    ts_ms = floored(instants.ms, options)
    values.pop("frame", None)
    for ours, unit in plan.units.items():
        values[ours] *= METRES[unit]
    bad.add(_not_boxes(values, length=len(lines)), plan.box, reason="bad-box", what="the side of a box with a size")
    _foot_points(values)
    if options.size_px is not None and "u_px" in values:
        values["u_px"], values["v_px"] = (values[c] * n for c, n in zip(("u_px", "v_px"), options.size_px, strict=True))
    is_good = pa.array(~bad.mask)
    good = {name: floats_or_null(v).filter(is_good) for name, v in values.items()}
    shared = {"camera": camera.filter(is_good), "ts_ms": ts_ms[~bad.mask], "line": lines[~bad.mask]}
    shared["zone"] = None if instants.zones is None else instants.zones.filter(is_good)
    if plan.kind == "pairs":
        # a table has one pair a row, so each pair is persons 0 and 1 of a frame message of its own
        sides = {t: ids(columns[t], default=None, length=len(lines)).filter(is_good) for t in ("track_a", "track_b")}
        table = raw_table("pairs", **shared, **sides, **good, person_a=0, person_b=1, quality="metric")
    else:
        track = tracks(columns.get("track_id"), length=len(lines)).filter(is_good)
        quality = "metric" if "x_m" in good else "relative"
        is_staff = None if FILE_TAG not in columns else _are_staff(columns[FILE_TAG].filter(is_good), options)
        table = raw_table("observations", **shared, track=track, **good, person=0, quality=quality, is_staff=is_staff)
    return RawBatch({plan.kind: table}, bad.rejected, notes=instants.notes, n_dropped=n_left_out)


def _are_staff(tags: pa.Array, options: IngestOptions) -> pa.Array:
    coded = trimmed(tags).dictionary_encode()
    return pa.array([options.is_staff(tag) for tag in coded.dictionary.to_pylist()], pa.bool_()).take(coded.indices)


def _chosen(
    plan: ColumnPlan, columns: Mapping[str, pa.Array], lines: np.ndarray, *, decimal_comma: bool
) -> tuple[dict[str, pa.Array], np.ndarray, dict[str, int]]:
    """Return our columns of the rows that fulfil `plan.where`, and how many do not."""
    ours = {name: column for name, column in columns.items() if name in plan.theirs}
    if not plan.where:
        return ours, lines, {}
    compared = {name: columns[other_column_key(name)] for name in plan.compared}
    is_chosen = rows_where(plan.where, compared, decimal_comma=decimal_comma)
    n_out = int(len(lines) - is_chosen.sum())
    keep = pa.array(is_chosen)
    return {n: c.filter(keep) for n, c in ours.items()}, lines[is_chosen], {LEFT_OUT: n_out} if n_out else {}


class _BadRows:
    """Collects rows that cannot be used, each with the first error found in it."""

    def __init__(self, plan: ColumnPlan, columns: Mapping[str, pa.Array], lines: np.ndarray) -> None:
        self._plan, self._columns, self._lines = plan, columns, lines
        self.mask = np.zeros(len(lines), dtype=bool)
        self.rejected: list[Rejected] = []

    def add(self, is_wrong: np.ndarray, name: str, *, reason: str, what: str) -> None:
        for i in np.flatnonzero(is_wrong & ~self.mask).tolist():
            cells = {c: _shown(column[i]) for c, column in self._columns.items()}
            detail = f"{self._plan.names[name]} is not {what}: {cells[name][:80]!r}"
            text = ", ".join(f"{c}={cell}" for c, cell in cells.items())
            self.rejected.append(rejected(int(self._lines[i]), reason=reason, detail=detail, record=text))
        self.mask |= is_wrong


def _shown(cell: pa.Scalar) -> str:
    try:
        return str(cell.as_py())[:200]
    except (ArithmeticError, ValueError, LookupError):  # a date outside Python's years, an unknown zone
        return f"a {cell.type} that cannot be shown"


def date_and_time(dates: pa.Array, times: pa.Array) -> pa.Array:
    """Return the texts of dates and times of day joined by a blank; a midnight behind the date is left out."""
    days = pc.replace_substring_regex(trimmed(dates), r"[T ]00:00(:00(\.0+)?)?$", "")
    clocks = pc.replace_substring_regex(trimmed(times), r"^(1899-12-3[01]|1900-01-0[01]|1970-01-01)[T ]", "")
    return pc.utf8_trim_whitespace(pc.binary_join_element_wise(days, clocks, " "))


def _instants(values: pa.Array, camera: pa.Array, options: IngestOptions, plan: ColumnPlan) -> Instants:
    """Parse times: since `start` where the user says so, else those without an offset by the clock of each camera."""
    if options.start is not None:
        unit = unit_ms(plan.time_format, plan.names["ts"])
        return elapsed_instants(values, start_ms=options.start, unit=unit)
    parse = partial(parse_instants, time_format=plan.time_format, offset_ms=plan.offset_ms)
    clocks = {c: options.clocks.get(c, options.frame_zone) for c in camera.unique().to_pylist()}
    zones = sorted(set(clocks.values()))
    if len(zones) < 2:
        return parse(values, zone=zones[0] if zones else options.frame_zone)
    read_in = np.full(len(values), None, dtype=object)
    zone_of = np.array([zones.index(clocks[c]) for c in camera.to_pylist()])
    ms, is_wrong = np.zeros(len(values), dtype=np.int64), np.zeros(len(values), dtype=bool)
    notes: list[str] = []
    for i, zone in enumerate(zones):
        at = np.flatnonzero(zone_of == i)
        some = parse(values.take(pa.array(at)), zone=zone)
        ms[at], is_wrong[at] = some.ms, some.is_wrong
        read_in[at] = None if some.zones is None else some.zones.to_numpy(zero_copy_only=False)
        notes += some.notes
    return Instants(ms, is_wrong, notes, pa.array(read_in, pa.string()))


def _from_frames(frames: np.ndarray, options: IngestOptions) -> Instants:
    ms = np.rint((options.start or 0) + (frames - (options.first_frame or 0.0)) / (options.fps or 1.0) * 1000)
    is_wrong = ~(np.abs(ms) < _MAX_MS)
    return Instants(np.where(is_wrong, 0, ms).astype(np.int64), is_wrong)


def _not_boxes(values: Mapping[str, np.ndarray], *, length: int) -> np.ndarray:
    """Return which rows have a box whose right side is left of its left one, or a box without any size."""
    if "width" in values:
        across, down = values["width"], values["height"]
    elif "right" in values:
        across, down = values["right"] - values["left"], values["bottom"] - values["top"]
    else:
        return np.zeros(length, dtype=bool)
    return np.asarray((across < 0) | ((across == 0) & (down == 0)))


def _foot_points(values: dict[str, np.ndarray]) -> None:
    """Replace boxes by their foot points: u = middle of left and right, v = bottom."""
    if "center_x" in values:
        values["u_px"], v_px = values.pop("center_x"), values.pop("center_y")
        values["v_px"] = v_px + np.abs(values.pop("height")) / 2
        del values["width"]
    if "left" not in values:
        return
    left, top = values.pop("left"), values.pop("top")
    if "right" in values:
        right, bottom = values.pop("right"), values.pop("bottom")
    else:
        right, bottom = left + values.pop("width"), top + values.pop("height")
    values["u_px"], values["v_px"] = (left + right) / 2, np.maximum(top, bottom)
