"""Which way people walk through each cell of a floor (M42): the direction field of the page's map of flow.

Everybody who walks through a cell counts once, whoever stands in it does not. A cell has one arrow where people walk
one way, two heads where they walk both ways along one line, and none where they cross it anyhow. Each is tested
(Rayleigh), since few people who walk anywhere have a mean direction, too.

Source: Mardia and Jupp, Directional Statistics (2000), ch. 6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from vsd_analytics.figures.panels import Array
from vsd_analytics.figures.periods import Period

Ways = Literal["one", "both", "any"]
MIN_PEOPLE: Final = 5
"""A cell is shown when at least this many different tracks walked through it."""
CHANCE: Final = 0.01
"""How often people who walk anywhere have so clear a direction in a cell."""
LEAST_AGREEMENT: Final = 0.3
"""A mean of unit vectors shorter than this is no direction worth an arrow, however many people made it."""
MOST_ACROSS: Final = 26
"""Cells across the floor at most: more arrows cannot be read on a phone."""


@dataclass(frozen=True, slots=True)
class WalkCell:
    """People who walk through one cell.

    Attributes:
        x_m, y_m: Its middle, floor metres.
        ways: "one", "both" along a line, or "any".
        direction_deg: Counter-clockwise from the x axis; of both ways, one of the two; None for any.
        agreement: Length of the mean of their unit vectors, 0 to 1; of both ways, that of the doubled angles.
        n_people: How many at least.
    """

    x_m: float
    y_m: float
    ways: Ways
    direction_deg: float | None
    agreement: float
    n_people: int


@dataclass(frozen=True, slots=True)
class WalkField:
    """The cells of a floor that enough people walk through.

    Attributes:
        cell_m: Their side: 1 m, on large floors 2, 4 or more.
        cells: Lower left first.
    """

    cell_m: float
    cells: tuple[WalkCell, ...]


def walking_directions(period: Period) -> WalkField:
    """Return the direction of people in each cell: that of the sum of their unit vectors.

    A cell of several metres has, as its number of people, that of its busiest square metre: nobody counts twice.
    """
    rows = period.data.warehouse.table(
        "select cx, cy, sum(n_walkers)::double as n, sum(n_people)::double as n_people, sum(east) as east, "
        "sum(north) as north, sum(along_x) as along_x, sum(along_y) as along_y from walks "
        "where floor_id = $floor and local_date between $first and $last group by cx, cy order by cy, cx",
        {"floor": period.data.floor.floor_id, "first": period.first, "last": period.last},
    )
    columns = [np.asarray(rows[name].to_numpy(), dtype=np.float64) for name in rows.column_names]
    if not len(columns[0]):
        return WalkField(1.0, ())
    cx, cy, n, n_people, *sums = columns
    across = max(float(v.max() - v.min()) + 1 for v in (cx, cy))
    side = 1
    while across / side > MOST_ACROSS:
        side *= 2
    places, at = np.unique(np.column_stack([cy // side, cx // side]), axis=0, return_inverse=True)
    people = np.zeros(len(places))
    np.maximum.at(people, at.ravel(), n_people)
    total, *vectors = (np.bincount(at.ravel(), weights=v) for v in (n, *sums))
    least = period.data.mask.least(MIN_PEOPLE)
    means = np.column_stack(vectors) / total[:, None]
    return WalkField(
        float(side),
        tuple(
            _cell((float(places[k, 1]) + 0.5) * side, (float(places[k, 0]) + 0.5) * side, means[k], int(people[k]))
            for k in np.flatnonzero(people >= least).tolist()
        ),
    )


def _cell(x_m: float, y_m: float, mean: Array, n: int) -> WalkCell:
    east, north, along_x, along_y = mean.tolist()
    one, both = math.hypot(east, north), math.hypot(along_x, along_y)
    if is_directed(one, n):
        return WalkCell(x_m, y_m, "one", math.degrees(math.atan2(north, east)), one, n)
    if is_directed(both, n):
        return WalkCell(x_m, y_m, "both", math.degrees(math.atan2(along_y, along_x)) / 2, both, n)
    return WalkCell(x_m, y_m, "any", None, one, n)


def is_directed(agreement: float, n: int) -> bool:
    """Tell whether n unit vectors whose mean has this length have a direction.

    Rayleigh test: p = exp(sqrt(1 + 4 n + 4 (n^2 - (n R)^2)) - (1 + 2 n)).
    """
    p = math.exp(math.sqrt(1 + 4 * n + 4 * n**2 * max(0.0, 1 - agreement**2)) - (1 + 2 * n))
    return agreement >= LEAST_AGREEMENT and p <= CHANCE
