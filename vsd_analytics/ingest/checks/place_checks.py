"""Checks of positions on the floor: units, axes, and places that are no places (W220)."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import pandas as pd

from vsd_analytics.config.file_columns import FILE_BOX, METRES
from vsd_analytics.ingest.checks.check_case import (
    ROWS_MIN,
    Case,
    SourceCheck,
    SourceWarning,
    floor_bounds_m,
    has_positions,
    has_tracks,
    is_on_floor,
    quoted,
)
from vsd_analytics.ingest.checks.sample import Floats, Sample, Ways, extent, is_known, is_last, steps
from vsd_analytics.ingest.reading.column_hints import named_like, names_degrees, names_motion
from vsd_analytics.ingest.reading.table_head import TableHead
from vsd_analytics.ingest.reading.units import LENGTHS, PIXELS, unit_in_name

SPEED_MAX_M_S: Final = 8.0
"""Nobody's usual speed: a sprint. Millimetres read as metres give 1,000 m/s, pixels about 100."""
WALK_MAX_M_S: Final = 2.5
"""Most people hardly ever walk faster; positions in feet read as metres give 3 to 5 m/s."""
HURRY_MAX_M_S, HURRY_SHARE = 3.2, 0.1
"""No more than `HURRY_SHARE` of people's steps are faster. Where many people stand, half of the steps show no unit."""
USUAL_SHARE: Final = 0.5
"""Positions beyond `coordinate_max_m` are single bad rows while at least this share is within it."""
SPAN_MAX_M: Final = 200.0
"""Without a plan, positions further apart than this come from a wrong unit rather than from one floor."""
NEAR_M: Final = 2.0
FLAT_M, WIDE_M = 0.5, 6.0
"""Positions on one line: within `FLAT_M` on one axis and over `WIDE_M` on the other."""
SAME_PLACE_SHARE: Final = 0.02
LEFT_S, LEFT_SHARE = 20.0, 0.3
"""Nobody's measured place is the same to the last digit for so long; a share of all tracks. None in fifteen real
recordings ends like this."""
REPEATED_SHARE: Final = 0.2
"""Of other steps, from which coarse places repeat themselves: at most .14 in fifteen real recordings."""
_USUAL_PLACEHOLDERS: Final = (0.0, -1.0, -999.0, -9999.0, 9999.0)
WALK_M_S: Final = 1.3
"""Speed of people who walk, by which a unit is proposed."""
_UNITS_TRIED: Final = ("mm", "cm", "ft")


def _units(case: Case) -> Iterator[SourceWarning]:
    if case.head is not None:
        yield from _named_units(case.head)
    sample = case.sample
    speeds = sample.speeds_m_s
    yield from _too_fast(case, speeds)
    is_walking = len(speeds) >= ROWS_MIN and 0 < float(np.median(speeds)) <= SPEED_MAX_M_S
    yield from _far_out(case, is_walking=is_walking)


def _named_units(head: TableHead) -> Iterator[SourceWarning]:
    """Yield warnings about columns whose names say another unit."""
    names = head.plan.names
    if "x_m" in names and names["x_m"] == names.get("y_m"):
        what = f"x_m and y_m are both read from {names['x_m'][:80]!r}"
        yield SourceWarning(what, "everybody would be on one line", "map each to a column of its own", is_sure=True)
    for ours, theirs in names.items():
        unit = unit_in_name(theirs) if theirs.lower() != ours else None
        if ours in LENGTHS and names_degrees(theirs):
            yield SourceWarning(
                f"{ours} is read from {theirs[:80]!r}, which names an angle",
                "degrees are no metres: everybody would stand within a metre, or far from where they are",
                "convert positions to metres of the floor before the export",
                is_sure=True,
            )
        if ours in LENGTHS and names_motion(theirs):
            yield SourceWarning(
                f"{ours} is read from {theirs[:80]!r}, which names a speed",
                "a speed is no place: everybody would stand near one point",
                "map the columns that hold the place",
                is_sure=True,
            )
        if ours in LENGTHS and unit == PIXELS:
            yield SourceWarning(
                f"{ours} is read from {theirs[:80]!r}, which names pixels",
                "pixels are no metres: distances would be hundreds of times too large",
                f"{_as_pixels(head)} for points of the picture; the camera needs a calibration",
                is_sure=True,
            )
        elif (ours in FILE_BOX or ours in ("u_px", "v_px")) and unit in METRES:
            yield SourceWarning(
                f"{ours} is read from {theirs[:80]!r}, which names a unit of length",
                "lengths on the floor are no pixels",
                f"{as_metres(head)}: columns that name their unit are converted to metres",
                is_sure=True,
            )


def _too_fast(case: Case, speeds: Floats) -> Iterator[SourceWarning]:
    """Yield the warning about people who would move faster than people do; speeds are those of all steps, m/s."""
    sample = case.sample
    if len(speeds) >= ROWS_MIN and (median := float(np.median(speeds))) > SPEED_MAX_M_S:
        what = f"people would move at {median:,.0f} m/s: half of the steps are faster"
        yield SourceWarning(what, "positions are hardly in metres, or ids change people", unit_fix(case), is_sure=True)
    elif len(walked := sample.walked_m_s) >= ROWS_MIN and (median := float(np.median(walked))) > WALK_MAX_M_S:
        what = f"people would walk at {median:.1f} m/s: half of the steps of a second or longer are faster"
        fix = "--unit ft (or yd, dm) if they are; where times come from frame numbers, check their rate (--hz)"
        why = "most people walk at 0.5 to 1.6 m/s; feet read as metres look like this"
        yield SourceWarning(what, why, fix, is_sure=median > SPEED_MAX_M_S)
    elif len(walked) >= 5 * ROWS_MIN and (fast := float(np.quantile(walked, 1 - HURRY_SHARE))) > HURRY_MAX_M_S:
        what = f"a tenth of the steps of a second or longer would be faster than {fast:.1f} m/s"
        why = "hardly anybody runs; feet and other units read as metres look like this, and ids that change people"
        yield SourceWarning(what, why, "--unit ft (or yd, dm) if they are; else look at the track ids")


def unit_fix(case: Case) -> str:
    """Return how to state the unit; first comes the one in which the faster steps are those of people who walk."""
    speeds = case.sample.speeds_m_s if not case.sample.is_pairs else ()
    fast = float(np.quantile(speeds, 1 - HURRY_SHARE)) if len(speeds) >= ROWS_MIN else 0.0
    units: Sequence[str] = _UNITS_TRIED
    if fast > 0:
        units = sorted(_UNITS_TRIED, key=lambda unit: abs(math.log(fast * METRES[unit] / WALK_M_S)))
    as_lengths = f"--unit {units[0]} (or {', '.join(units[1:])}) if they are lengths"
    return f"{as_lengths}; {_as_pixels(case.head)} if they are pixels" if not case.sample.is_pairs else as_lengths


def _as_pixels(head: TableHead | None) -> str:
    """Return how to read the columns of floor metres as points of the picture."""
    option = None if head is None else head.map_option(u_px="x_m", v_px="y_m")
    return option or "let the engine write them as u_px, v_px"


def as_metres(head: TableHead | None) -> str:
    """Return how to read points of the picture, or corners of boxes, as floor metres."""
    option = None
    if head is not None:
        across, along = ("left", "top") if "left" in head.plan.names else ("u_px", "v_px")
        option = head.map_option(x_m=across, y_m=along)
    return option or "let the engine write them as x_m, y_m"


def _states_unit(case: Case) -> bool:
    """Return whether the columns of places name their unit, so that the user cannot state another."""
    return case.head is not None and any(
        unit_in_name(case.head.plan.names.get(o, o)) is not None
        for o in ("x_m", "y_m")
        if case.head.plan.names.get(o, o) != o
    )


def _far_out(case: Case, *, is_walking: bool) -> Iterator[SourceWarning]:
    """W220: positions beyond the floor. People who move as fast as people do are in metres, on a large floor."""
    places = case.sample.floor_m[is_known(case.sample.floor_m)]
    is_stored = (np.abs(places) <= case.site.settings.coordinate_max_m).all(axis=1)
    if is_stored.sum() >= USUAL_SHARE * len(places):  # the others are bad rows and say nothing of the unit
        places = places[is_stored]
    if len(places) < ROWS_MIN:
        return
    x, y = places.T
    n_ids = len(case.sample.track.names)
    if len(places) >= 5 * ROWS_MIN and n_ids > 2 and 0 < max(np.ptp(x), np.ptp(y)) <= 1:
        is_share = bool(((x >= 0) & (x <= 1) & (y >= 0) & (y <= 1)).all())
        more = ": every position is between 0 and 1" if is_share else f": x {x.min():.4g} to {x.max():.4g}"
        what = f"{n_ids:,} people would all be within one square metre{more}"
        why = f"{'shares of a picture or of a plan' if is_share else 'degrees'}, and kilometres, look like this"
        is_floor_in_km = FLAT_M < 1000 * max(np.ptp(x), np.ptp(y)) < SPAN_MAX_M and not _states_unit(case)
        in_km = "; --unit km if they are" if is_floor_in_km else ""
        fix = (
            f"{_as_pixels(case.head)} with --size WIDTHxHEIGHT if they are shares of the picture{in_km}"
            if is_share
            else f"convert them to metres of the floor before the export{in_km}"
        )
        yield SourceWarning(what, why, fix, is_sure=True)
        return
    usual = extent(places, tail=0.05)
    assert usual is not None
    spread_x, spread_y = usual[1] - usual[0], usual[3] - usual[2]
    shown = f"x {usual[0]:,.1f} to {usual[1]:,.1f} m, y {usual[2]:,.1f} to {usual[3]:,.1f} m"
    bounds = floor_bounds_m(case)
    if bounds is None:
        if max(spread_x, spread_y) > SPAN_MAX_M:
            why = f"most floors are smaller than {SPAN_MAX_M:g} m; other units look like this"
            yield SourceWarning(f"positions reach over {shown}", why, unit_fix(case), is_sure=not is_walking)
        return
    left, right, low, high = bounds
    outside = f"the plan or view reaches over x {left:,.1f} to {right:,.1f} m, y {low:,.1f} to {high:,.1f} m"

    def share_beyond(x: np.ndarray, y: np.ndarray, more_x: float, more_y: float) -> float:
        is_in = (x >= left - more_x) & (x <= right + more_x) & (y >= low - more_y) & (y <= high + more_y)
        return 1.0 - float(is_in.mean())

    far = share_beyond(x, y, max(5.0, (right - left) / 4), max(5.0, (high - low) / 4))
    near = share_beyond(x, y, NEAR_M, NEAR_M)
    turned = {
        "x and y seem to be exchanged: map each to the other column": (y, x),
        "y seems to point down: export it upwards from the lower left corner of the plan": (x, -y),
        "y seems to be negative downwards: add the height of the plan to it": (x, y + high - low),
    }
    fits = next((fix for fix, (a, b) in turned.items() if share_beyond(a, b, 0.5, 0.5) < 0.01), None)
    if near > 0.2 and fits is not None:
        what = f"{near:.0%} of the positions are outside the floor: {shown}"
        yield SourceWarning(what, outside, fits, is_sure=True)
    elif far > 0.5:
        what = f"{far:.0%} of the positions are far outside the floor: {shown}"
        yield SourceWarning(
            what, outside, f"{unit_fix(case)}; or correct plan_origin_m and plan_m_per_px", is_sure=True
        )
    elif near > 0.1:
        what = f"{near:.0%} of the positions are outside the floor: {shown}"
        fix = f"{unit_fix(case)}; or correct plan_origin_m and plan_m_per_px"
        yield SourceWarning(what, outside, fix, is_sure=near > 0.5)


def _axes(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if sample.n < 5 * ROWS_MIN or len(sample.track.names) == 1:
        return
    if (usual := extent(sample.floor_m)) is None:
        return
    left, right, bottom, top = usual
    spreads = {"x_m": right - left, "y_m": top - bottom}
    flat, wide = sorted(spreads, key=lambda axis: spreads[axis])
    if spreads[flat] > FLAT_M or spreads[wide] < WIDE_M:
        return
    ignored = [] if case.head is None else case.head.ignored
    third = named_like(ignored, "third axis")
    low = left if flat == "x_m" else bottom
    yield SourceWarning(
        f"everybody would be on one line: {flat} is {low:.2f} to {low + spreads[flat]:.2f} m, {wide} reaches over "
        f"{spreads[wide]:,.0f} m",
        f"{flat} may be the height above the floor, as where the second axis points up",
        f"--map {shlex.quote(f'{flat}={third[0]}')}, where it lies on the floor"
        if third
        else "export the two axes that lie on the floor",
        is_sure=bool(third),
    )


def _placeholders(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if sample.n < 5 * ROWS_MIN:
        return
    for is_metric in (True, False):
        places = sample.floor_m if is_metric else sample.picture_px
        places = places[is_known(places)]
        if not len(places):
            continue
        across, up = places.T
        usual = Counter(across[(across == up) & np.isin(across, _USUAL_PLACEHOLDERS)].tolist()).most_common()
        written = [(value, value) for value, n in usual if SAME_PLACE_SHARE * len(places) <= n < len(places)]
        jumped_to = set(_jumped_to(sample, sample.ways if is_metric else sample.picture_ways)) - set(written)
        for x, y in [*written, *sorted(jumped_to)]:
            n_there = int(((across == x) & (up == y)).sum())
            names = {} if case.head is None else case.head.plan.names
            column = next((names[ours] for ours in ("x_m", "u_px") if ours in names), None)
            yield SourceWarning(
                f"{n_there:,} of {len(places):,} positions are exactly {x:g}, {y:g}",
                "engines write such a place for people whom they have lost; they would all stand close together there",
                "leave these rows out of the export" if column is None else f'--where "{quoted(column)} != {x:g}"',
                is_sure=n_there >= SAME_PLACE_SHARE * len(places),
            )


def _left_standing(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    ways = sample.ways
    is_moved = ways.is_first | (np.diff(ways.places, axis=0, prepend=0) != 0).any(axis=1)
    first, last = np.flatnonzero(ways.is_first), np.flatnonzero(is_last(ways.is_first))
    arrived = np.maximum.accumulate(np.where(is_moved, np.arange(len(ways)), 0))[last]
    has_come = arrived > first  # whoever never moves was not lost on the way
    still_s = (ways.ts_ms[last] - ways.ts_ms[arrived]) / 1000
    n_after = last - arrived
    is_left = has_come & (still_s >= LEFT_S) & (n_after >= ROWS_MIN)
    n_before = len(ways) - int(n_after.sum())
    n_repeated = int((~is_moved).sum()) - int(n_after.sum())
    if is_left.sum() >= max(ROWS_MIN / 2, LEFT_SHARE * len(last)) and n_repeated < REPEATED_SHARE * n_before:
        yield SourceWarning(
            f"{is_left.sum():,} of {len(last):,} tracks end at one place, the same to the last digit for "
            f"{np.median(still_s[is_left]):,.0f} s ({n_after[is_left].sum():,} rows)",
            "engines repeat the last place of people whom they have lost; others would be close to them there",
            "leave these rows out of the export, as by how long ago the tracker saw the person",
        )


def _jumped_to(sample: Sample, ways: Ways) -> list[tuple[float, float]]:
    """Return the places to which the ids of several people jump again and again, and from which they come back."""
    _, is_jump = steps(sample, ways, fast_m_s=SPEED_MAX_M_S)
    is_there_and_back = is_jump & np.roll(is_jump, -1)  # the first record is no jump
    if is_there_and_back.sum() < ROWS_MIN:
        return []
    (x, y), track_no = ways.places[is_there_and_back].T, ways.track_no[is_there_and_back]
    places = pd.Series(track_no).groupby([x, y]).agg(["size", "nunique"])
    return list(places.index[(places["size"] >= ROWS_MIN) & (places["nunique"] > 2)])


UNIT_CHECK: Final = SourceCheck("W220", is_on_floor, _units, "positions that are not metres")
PLACE_CHECKS: Final = (
    UNIT_CHECK,
    SourceCheck(
        "W220",
        has_positions,
        _axes,
        "positions on one line, because one of the axes read is the height above the floor",
    ),
    SourceCheck(
        "W220",
        has_positions,
        _placeholders,
        "one place written for people whom the engine lost: 0, 0, or where many ids jump to and come back from",
    ),
    SourceCheck(
        "W222",
        has_tracks,
        _left_standing,
        "tracks that end with one place again and again: the engine repeats where it saw the person last",
    ),
)
