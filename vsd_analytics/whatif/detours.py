"""Whose path a new fixture blocks, and the way around it on their own side, companions together.

Everybody else walks as recorded. A blocked path is pushed sideways until it clears the fixture, and returns to itself
over the approach. Nobody passes on a side with a fixture; between two fixtures there is no way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from vsd_analytics.site.model import Point
from vsd_analytics.whatif.arrays import Bools, Floats, Ints
from vsd_analytics.whatif.floor_records import ALONE, FloorRecords

CLEARANCE_M: Final = 0.3
"""Distance of a walker's middle from a fixture: half the width of a body and a little air."""
APPROACH_M: Final = 2.5
"""Way over which a path bends aside before a fixture, and back behind it."""
_TIGHT_M: Final = 0.2
"""A place nearer to another fixture than this is no place to walk."""
_STANDS_M: Final = 0.5
"""Whoever comes no farther than this across the place is standing: a direction is not known."""

_TOGETHER_S: Final = 30.0
"""Companions who reach the place within this time of each other pass it together."""


@dataclass(frozen=True, slots=True)
class Detours:
    """What a fixture does to the paths of some records.

    Attributes:
        touched: Tracks whose path it blocks.
        n_standing: Of these, those that stand where it would be.
        n_no_way: Of these, those with a fixture on both sides.
        rows: Records that move.
        x_m, y_m: Where all records are then.
    """

    touched: Ints
    n_standing: int
    n_no_way: int
    rows: Ints
    x_m: Floats
    y_m: Floats


def detours(
    records: FloorRecords, polygon: tuple[Point, ...], *, solid: shapely.Geometry | None,
    clearance_m: float = CLEARANCE_M, approach_m: float = APPROACH_M,
) -> Detours:  # fmt: skip
    """Return whose path a polygon blocks, and where they walk instead.

    Args:
        records: People around it.
        polygon: Its corners, floor metres; what is hollow in it counts as filled.
        solid: What else nobody walks through; None = nothing is known.
        clearance_m: Distance that a walker keeps from it.
        approach_m: Way over which a path bends.
    """
    hull = shapely.convex_hull(shapely.Polygon(polygon))
    is_blocked = blocked(records, hull.buffer(clearance_m))
    if not is_blocked.any():
        return Detours(np.zeros(0, np.int64), 0, 0, np.zeros(0, np.int64), records.x_m, records.y_m)
    everybody, own = records, _of_people(records.track, is_blocked)
    records, is_blocked = records.part(own), is_blocked[own]
    x_m, y_m = records.x_m.copy(), records.y_m.copy()
    near = inside_of(hull.buffer(clearance_m + approach_m), x_m, y_m)
    rows, walk = _passes(records, is_blocked, near | is_blocked)
    n_passes = int(walk[-1]) + 1
    first, last = _ends(walk, is_blocked[rows])
    span = np.column_stack([x_m[rows[last]] - x_m[rows[first]], y_m[rows[last]] - y_m[rows[first]]])
    length = np.hypot(*span.T)
    is_standing = length < _STANDS_M
    ahead = np.where(is_standing[:, None], [1.0, 0.0], span / np.maximum(length, 1e-9)[:, None])
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    corners = shapely.get_coordinates(hull) - (centre := shapely.get_coordinates(hull.centroid)[0])
    middle = (np.column_stack([x_m, y_m])[rows[first]] + np.column_stack([x_m, y_m])[rows[last]]) / 2 - centre
    side = np.where((middle * left).sum(axis=1) >= 0, 1.0, -1.0)
    side = _with_company(side, records.company[rows[first]], records.t_s[rows[first]])
    place = np.column_stack([x_m[rows], y_m[rows]]) - centre
    along, across = ((place * way[walk]).sum(axis=1) for way in (ahead, left))
    reach, width = corners @ ahead.T, corners @ left.T
    over = np.maximum(reach.min(axis=0)[walk] - along, along - reach.max(axis=0)[walk]) - clearance_m
    bend = 0.5 + 0.5 * np.cos(np.pi * np.clip(over / approach_m, 0, 1))
    sides = {}
    for sign, edge in ((1.0, width.max(axis=0) + clearance_m), (-1.0, -width.min(axis=0) + clearance_m)):
        push = sign * np.maximum(edge[walk] - sign * across, 0) * bend
        moved = np.column_stack([x_m[rows], y_m[rows]]) + push[:, None] * left[walk]
        sides[sign] = moved, _hits(moved, x_m[rows], y_m[rows], walk, n_passes, solid)
    is_free = np.where(side > 0, ~sides[1.0][1], ~sides[-1.0][1])
    other_free = np.where(side > 0, ~sides[-1.0][1], ~sides[1.0][1])
    side = np.where(is_free | ~other_free, side, -side)
    has_way = is_free | other_free | is_standing
    new = np.where((side > 0)[walk, None], sides[1.0][0], sides[-1.0][0])
    standing = rows[is_standing[walk]]
    new[is_standing[walk]] = _outside(x_m[standing], y_m[standing], hull.buffer(clearance_m))
    goes = has_way[walk]
    x_m[rows[goes]], y_m[rows[goes]] = new[goes].T
    track = records.track[rows[first]]
    shifted = rows[goes & (np.hypot(x_m[rows] - records.x_m[rows], y_m[rows] - records.y_m[rows]) > 0)]
    all_x_m, all_y_m = everybody.x_m.copy(), everybody.y_m.copy()
    all_x_m[own], all_y_m[own] = x_m, y_m
    n_standing, n_no_way = np.unique(track[is_standing]).size, np.unique(track[~has_way]).size
    return Detours(np.unique(track), n_standing, n_no_way, own[shifted], all_x_m, all_y_m)


def blocked(records: FloorRecords, shape: shapely.Geometry) -> Bools:
    """Return which records are the ends of a step that a shape blocks, or lie in it, shape (n_records,)."""
    left, low, right, high = shape.bounds
    x, y = records.x_m, records.y_m
    is_blocked = inside_of(shape, x, y)
    joined = records.joins_next
    meets = [np.minimum(v[1:], v[:-1]) <= most for v, most in ((x, right), (y, high))]
    meets += [np.maximum(v[1:], v[:-1]) >= least for v, least in ((x, left), (y, low))]
    steps = np.flatnonzero(joined & np.logical_and.reduce(meets))
    ends = np.stack([np.column_stack([x[steps], y[steps]]), np.column_stack([x[steps + 1], y[steps + 1]])], axis=1)
    crossed = steps[shapely.intersects(shape, shapely.linestrings(ends))] if steps.size else steps
    is_blocked[crossed], is_blocked[crossed + 1] = True, True
    return is_blocked


def _of_people(track: Ints, chosen: Bools) -> Ints:
    """Return the rows of all records of the people of some, given the people of records in order."""
    person = np.cumsum(np.diff(track, prepend=track[:1]) != 0)
    is_theirs = np.zeros(int(person[-1]) + 1, np.bool_)
    is_theirs[person[chosen]] = True
    return np.flatnonzero(is_theirs[person])


def _passes(records: FloorRecords, is_blocked: Bools, is_near: Bools) -> tuple[Ints, Ints]:
    """Return the records of blocked stretches near the fixture, and the number of the stretch of each."""
    goes_on = np.zeros(is_near.size, np.bool_)
    goes_on[1:] = records.joins_next & is_near[1:] & is_near[:-1]
    stretch = np.cumsum(~goes_on)
    has_block = np.zeros(int(stretch[-1]) + 1, np.bool_)
    has_block[stretch[is_blocked]] = True
    rows = np.flatnonzero(is_near & has_block[stretch])
    return rows, np.unique(stretch[rows], return_inverse=True)[1].ravel()


def _ends(walk: Ints, is_blocked: Bools) -> tuple[Ints, Ints]:
    """Return the first and the last blocked position of each stretch."""
    at = np.flatnonzero(is_blocked)
    blocked_walk = walk[at]
    starts = np.flatnonzero(np.r_[True, blocked_walk[1:] != blocked_walk[:-1]])
    return at[starts], at[np.r_[starts[1:], blocked_walk.size] - 1]


def _with_company(side: Floats, company: Ints, t_s: Floats) -> Floats:
    """Return the sides on which people pass: companions who come together take the side of most of them."""
    order = np.lexsort((t_s, company))
    own, at = company[order], t_s[order]
    is_new = np.ones(order.size, np.bool_)
    is_new[1:] = (own[1:] != own[:-1]) | (own[1:] == ALONE) | (np.diff(at) > _TOGETHER_S)
    party = np.empty(order.size, np.int64)
    party[order] = np.cumsum(is_new) - 1
    return np.where(np.bincount(party, weights=side)[party] >= 0, 1.0, -1.0)


def _hits(moved: Floats, x_m: Floats, y_m: Floats, walk: Ints, n_passes: int, solid: shapely.Geometry | None) -> Bools:
    """Return which stretches would go through another fixture where they did not before."""
    hits = np.zeros(n_passes, np.bool_)
    if solid is not None:
        tight = solid.buffer(_TIGHT_M)
        enters = inside_of(tight, *moved.T) & ~inside_of(tight, x_m, y_m)
        hits[walk[enters]] = True
    return hits


def _outside(x_m: Floats, y_m: Floats, shape: shapely.Geometry) -> Floats:
    """Return the nearest places outside a shape of those who stand in it; all others stay where they are."""
    places = np.column_stack([x_m, y_m])
    inside = inside_of(shape, x_m, y_m)
    points = shapely.points(places[inside])
    edge = shape.exterior
    places[inside] = shapely.get_coordinates(
        shapely.line_interpolate_point(edge, shapely.line_locate_point(edge, points))
    )
    return places


def inside_of(shape: shapely.Geometry, x_m: Floats, y_m: Floats) -> Bools:
    """Return which places lie in a shape; an empty one is the whole floor."""
    if shape.is_empty:
        return np.ones(x_m.size, np.bool_)
    left, low, right, high = shape.bounds
    inside: Bools = (x_m >= left) & (x_m <= right) & (y_m >= low) & (y_m <= high)
    rows = np.flatnonzero(inside)
    shapely.prepare(shape)
    inside[rows] = shapely.contains_xy(shape, x_m[rows], y_m[rows])
    return inside
