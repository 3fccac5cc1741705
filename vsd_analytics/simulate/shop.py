"""The made-up shop: walls, fixtures, areas and free floor, before and after the display was moved.

Floor metres, x to the right, y up, origin at the lower left corner of the shop. Everything is an axis-aligned
rectangle `(x0, y0, x1, y1)`, so that overlapping rectangles can describe the free floor: a straight walk inside one of
them hits nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.site.model import Area, Point

Rect = tuple[float, float, float, float]
FloatArray = NDArray[np.float64]

WIDTH_M = 24.0
DEPTH_M = 16.0
DOOR: Rect = (18.2, 0.0, 20.7, 0.0)
DOOR_IN: Rect = (19.7, 0.3, 20.4, 0.35)
DOOR_OUT: Rect = (18.5, 0.3, 19.3, 0.35)
BODY_RADIUS_M = 0.2
_GRID_M = 0.05


@dataclass(frozen=True, slots=True)
class ShopFixture:
    """An obstacle on the floor of the shop.

    Attributes:
        kind: "room", "shelf", "till", "counter", "display" or "trolleys".
        rect: Its footprint in floor metres.
        height_m: Its height, for camera pictures.
        label: What the site calls it.
        is_movable: True if staff could move it.
    """

    kind: str
    rect: Rect
    height_m: float
    label: str
    is_movable: bool = False


@dataclass(frozen=True, slots=True)
class ShelfStop:
    """A part of a shelf where people stop.

    Attributes:
        zone: Free rectangle it lies in.
        rect: Where people stand.
        weight: Relative share of stops.
    """

    zone: str
    rect: Rect
    weight: float


@dataclass(frozen=True, slots=True)
class WaitingLine:
    """A waiting line with one or more places of service.

    Attributes:
        approach: Free rectangle and part of it through which people come.
        zone: Free rectangle people wait in.
        head: Place of the first in the line.
        step: From one place in the line to the next, metres.
        stations: Zone and place of each place of service, in the order in which they open.
        capacity: Longest line, persons or groups.
    """

    approach: tuple[str, Rect]
    zone: str
    head: Point
    step: Point
    stations: tuple[tuple[str, Point], ...]
    capacity: int


DISPLAY_BEFORE: Rect = (18.8, 3.7, 20.0, 4.7)
DISPLAY_AFTER: Rect = (0.5, 5.6, 1.7, 6.6)

_SHELF_X = (5.0, 8.5, 12.0, 15.5)
_SHELF_Y = (7.6, 13.2)
_SHELF_WIDTH_M = 0.9
_TILL_X = (4.4, 7.3, 10.2, 13.1)
_TILL_WIDTH_M = 0.7

_FIXED: tuple[ShopFixture, ...] = (
    ShopFixture("room", (19.0, 11.0, WIDTH_M, DEPTH_M), 2.8, "Storeroom"),
    ShopFixture("room", (0.0, 0.0, 2.8, 3.4), 2.8, "Office"),
    ShopFixture("room", (0.0, 9.8, 1.4, 14.2), 2.2, "Pharmacy"),
    ShopFixture("counter", (1.4, 10.2, 2.0, 13.8), 1.1, "Counter"),
    *(
        ShopFixture("shelf", (x, _SHELF_Y[0], x + _SHELF_WIDTH_M, _SHELF_Y[1]), 1.6, f"Shelf {k}")
        for k, x in enumerate(_SHELF_X, start=1)
    ),
    ShopFixture("shelf", (3.0, 15.4, 18.8, DEPTH_M), 2.0, "Bakery and dairy"),
    ShopFixture("shelf", (23.4, 3.6, WIDTH_M, 10.4), 2.0, "Drinks"),
    ShopFixture("shelf", (19.2, 8.2, 21.6, 9.6), 0.9, "Fruit", is_movable=True),
    *(
        ShopFixture("till", (x, 1.3, x + _TILL_WIDTH_M, 3.2), 0.9, f"Till {4 - i}")
        for i, x in enumerate(reversed(_TILL_X))
    ),
    ShopFixture("trolleys", (22.5, 0.3, 23.8, 1.7), 1.0, "Trolleys", is_movable=True),
)


@dataclass(frozen=True, slots=True)
class Shop:
    """The shop with its display in one place.

    Attributes:
        display: Footprint of the display.
        fixtures: Everything nobody walks through, the display included.
        zones: Free rectangles by name; neighbours overlap.
        display_stops: Where people stand around the display.
        display_share: Share of singles and groups that stop at it.
    """

    display: Rect
    fixtures: tuple[ShopFixture, ...]
    zones: Mapping[str, Rect]
    display_stops: tuple[ShelfStop, ...]
    display_share: float

    def nearest_free(self, x_m: FloatArray, y_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions moved to the nearest free floor; positions on free floor stay as they are.

        Args:
            x_m: Floor x, any shape.
            y_m: Floor y, same shape.

        Returns:
            x and y of the same shape, on a 5 cm raster where they had to move.
        """
        blocked, near_x, near_y = _raster(self.fixtures)
        i, j = _cells(x_m, y_m)
        off = blocked[j, i] | (x_m < 0) | (x_m > WIDTH_M) | (y_m < 0) | (y_m > DEPTH_M)
        return np.where(off, near_x[j, i], x_m), np.where(off, near_y[j, i], y_m)

    def is_clear(self, x_m: FloatArray, y_m: FloatArray, to_x_m: FloatArray, to_y_m: FloatArray) -> NDArray[np.bool_]:
        """Return where the straight step to the second positions (at most about 1.5 m) crosses no fixture."""
        blocked = _raster(self.fixtures)[0]
        clear = np.ones(len(x_m), dtype=np.bool_)
        for share in (0.25, 0.5, 0.75, 1.0):
            x, y = x_m + share * (to_x_m - x_m), y_m + share * (to_y_m - y_m)
            i, j = _cells(x, y)
            clear &= ~blocked[j, i]
        return clear

    def is_free(self, x_m: FloatArray, y_m: FloatArray) -> NDArray[np.bool_]:
        """Return which positions are inside the walls and on no fixture (exact, not on the raster)."""
        free = (x_m >= 0) & (x_m <= WIDTH_M) & (y_m >= 0) & (y_m <= DEPTH_M)
        for fixture in self.fixtures:
            x0, y0, x1, y1 = fixture.rect
            free &= ~((x_m > x0) & (x_m < x1) & (y_m > y0) & (y_m < y1))
        return free


def _cells(x_m: FloatArray, y_m: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    i = np.clip((x_m / _GRID_M).astype(np.intp), 0, round(WIDTH_M / _GRID_M) - 1)
    j = np.clip((y_m / _GRID_M).astype(np.intp), 0, round(DEPTH_M / _GRID_M) - 1)
    return i, j


@cache
def _raster(fixtures: tuple[ShopFixture, ...]) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """Return, per 5 cm cell (row y, column x): blocked or not, and the centre of the nearest free cell."""
    from scipy.ndimage import distance_transform_edt

    xs = (np.arange(round(WIDTH_M / _GRID_M)) + 0.5) * _GRID_M
    ys = (np.arange(round(DEPTH_M / _GRID_M)) + 0.5) * _GRID_M
    margin = BODY_RADIUS_M
    inside_x, inside_y = (xs > margin) & (xs < WIDTH_M - margin), (ys > margin) & (ys < DEPTH_M - margin)
    blocked = ~(inside_y[:, None] & inside_x[None, :])
    for fixture in fixtures:
        x0, y0, x1, y1 = fixture.rect
        cols, rows = (xs > x0 - margin) & (xs < x1 + margin), (ys > y0 - margin) & (ys < y1 + margin)
        blocked |= rows[:, None] & cols[None, :]
    rows_near, cols_near = distance_transform_edt(blocked, return_distances=False, return_indices=True)
    return blocked, xs[cols_near], ys[rows_near]


_ZONES: dict[str, Rect] = {
    "front": (2.1, 5.7, 23.0, 7.3),
    "left": (2.1, 4.2, 4.65, 9.4),
    "pharmacy": (2.35, 8.0, 4.65, 15.0),
    "aisle-1": (6.25, 5.9, 8.15, 15.0),
    "aisle-2": (9.75, 5.9, 11.65, 15.0),
    "aisle-3": (13.25, 5.9, 15.15, 15.0),
    "right": (16.75, 5.9, 18.65, 15.0),
    "back": (2.35, 13.5, 18.65, 15.0),
    "fruit-front": (16.75, 5.9, 23.0, 7.9),
    "fruit-back": (16.75, 9.9, 23.0, 10.6),
    "fruit-side": (21.95, 5.9, 23.0, 10.6),
    "queue": (3.2, 3.6, 17.5, 6.3),
    **{f"till-{i + 1}": (x + _TILL_WIDTH_M + 0.3, 0.4, x + 2.6, 4.4) for i, x in enumerate(_TILL_X)},
    "exit-lane": (3.2, 0.3, 18.4, 1.0),
}
_HALL_BEFORE: dict[str, Rect] = {
    "hall": (14.9, 0.3, 21.6, 3.3),
    "hall-west": (14.9, 0.3, 18.4, 7.3),
    "hall-east": (20.4, 2.0, 23.0, 7.3),
    "hall-north": (14.9, 5.1, 23.0, 7.3),
}
_HALL_AFTER: dict[str, Rect] = {"hall": (14.9, 0.3, 22.2, 7.3)}


def _shop(display: Rect, hall: dict[str, Rect], stops: tuple[ShelfStop, ...], share: float) -> Shop:
    fixtures = (*_FIXED, ShopFixture("display", display, 1.5, "Display", is_movable=True))
    return Shop(display, fixtures, {**_ZONES, **hall}, stops, share)


SHOP_BEFORE = _shop(
    DISPLAY_BEFORE,
    _HALL_BEFORE,
    (
        ShelfStop("hall", (18.7, 2.7, 20.3, 3.3), 4.0),
        ShelfStop("hall-west", (17.9, 3.4, 18.4, 5.0), 3.0),
        ShelfStop("hall-east", (20.4, 3.4, 20.9, 5.0), 2.0),
        ShelfStop("hall-north", (18.7, 5.1, 20.1, 5.6), 2.0),
    ),
    0.55,
)
SHOP_AFTER = _shop(DISPLAY_AFTER, _HALL_AFTER, (ShelfStop("left", (2.1, 5.0, 2.8, 7.2), 1.0),), 0.12)


def _shelf_stops() -> tuple[ShelfStop, ...]:
    stops = []
    for k in range(3):
        left, right = _SHELF_X[k] + _SHELF_WIDTH_M, _SHELF_X[k + 1]
        weight = (1.3, 1.2, 1.5)[k]
        stops += [
            ShelfStop(f"aisle-{k + 1}", (left + 0.4, 8.0, left + 0.75, 12.8), weight),
            ShelfStop(f"aisle-{k + 1}", (right - 0.75, 8.0, right - 0.4, 12.8), weight),
        ]
    return tuple(stops)


STOPS: tuple[ShelfStop, ...] = (
    *_shelf_stops(),
    ShelfStop("pharmacy", (4.2, 8.2, 4.6, 12.8), 0.6),
    ShelfStop("right", (16.8, 8.0, 17.2, 12.8), 0.9),
    ShelfStop("back", (3.4, 14.5, 18.4, 14.9), 1.4),
    ShelfStop("back", (9.4, 14.1, 12.2, 14.9), 0.9),
    ShelfStop("fruit-front", (19.2, 7.4, 21.6, 7.8), 1.0),
    ShelfStop("right", (18.2, 8.2, 18.6, 9.6), 0.5),
    ShelfStop("fruit-side", (22.0, 6.0, 22.3, 9.6), 0.5),
    ShelfStop("fruit-side", (22.7, 6.0, 23.0, 10.2), 0.8),
)

CHECKOUT = WaitingLine(
    ("front", (5.5, 5.9, 13.5, 7.0)),
    "queue",
    (4.7, 5.0),
    (0.95, 0.0),
    tuple((f"till-{i + 1}", (x + _TILL_WIDTH_M + 0.8, 2.3)) for i, x in enumerate(_TILL_X)),
    12,
)
PHARMACY = WaitingLine(
    ("pharmacy", (3.2, 8.1, 4.4, 9.3)), "pharmacy", (3.0, 10.8), (0.05, -1.15), (("pharmacy", (2.6, 12.0)),), 5
)


def polygon(rect: Rect) -> tuple[Point, ...]:
    """Return the corners of a rectangle, counter-clockwise."""
    x0, y0, x1, y1 = rect
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


AREA_RECTS: dict[str, Rect] = {
    "checkout-queue": (3.6, 4.2, 14.2, 5.9),
    "entrance": (16.6, 0.0, 22.0, 6.0),
    "aisle-2-end": (8.6, 13.2, 12.9, 15.4),
    "pharmacy": (2.0, 9.8, 4.6, 13.8),
}
AREAS: tuple[Area, ...] = tuple(
    Area(area_id, name, "ground", polygon(AREA_RECTS[area_id]))
    for area_id, name in (
        ("checkout-queue", "Checkout queue"),
        ("entrance", "Main entrance"),
        ("aisle-2-end", "End of aisle 2"),
        ("pharmacy", "Pharmacy counter"),
    )
)
