"""Banded heat: from a density grid to outlines in floor metres, and from there onto a camera picture."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from vsd_analytics.figures.week.model_map import MapBand, Point, Polygon, Ring

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

MAP_AXES: Final = 2
"""Maps are rows by columns."""
RING_POINTS: Final = 3
"""Fewer corners enclose nothing."""
PER_CURVE: Final = 3
"""Points on each curved piece of an outline."""
SMALLEST_PX2: Final = 4.0
"""Smaller patches on a camera picture cannot be seen."""


def heat_bands(
    density: ArrayLike,
    *,
    cell_m: float,
    origin_m: Point,
    steps: Sequence[float],
    tolerance_m: float | None = None,
) -> tuple[MapBand, ...]:
    """Return the outlines of the floor whose density is at least each step.

    Outlines are linear contours of the values at cell centres (contourpy), simplified by Douglas-Peucker. The outside
    of the grid and NaN (floor no camera sees) count as 0, so that every outline is closed.

    Args:
        density: Violations per m2 per open hour, shape (n_y, n_x); row 0 is the lowest y.
        cell_m: Side of a cell, metres.
        origin_m: Lower left corner of cell [0, 0], floor metres.
        steps: Lower ends of the bands, rising.
        tolerance_m: Largest shift of an outline by simplification; default a third of a cell.

    Returns:
        One band per step that is reached, weakest first. Each polygon is its outer ring, counter-clockwise, and its
        holes; rings are not closed by repetition. Sorted, so equal input gives equal bytes.
    """
    import contourpy
    import cv2
    import numpy as np

    grid = np.nan_to_num(np.asarray(density, dtype=np.float64), nan=0.0)
    if grid.ndim != MAP_AXES:
        raise ValueError(f"density must be 2-D, is {grid.ndim}-D")
    padded = np.pad(grid, 1)
    n_y, n_x = padded.shape
    x = origin_m[0] + (np.arange(n_x) - 0.5) * cell_m
    y = origin_m[1] + (np.arange(n_y) - 0.5) * cell_m
    generator = contourpy.contour_generator(x, y, padded, fill_type=contourpy.FillType.OuterOffset)
    tolerance = cell_m / 3 if tolerance_m is None else tolerance_m
    smallest = cell_m**2
    bands = []
    for lower in steps:
        filled: Any = generator.filled(lower, np.inf)
        points, offsets = filled
        polygons = []
        for outline, ends in zip(points, offsets, strict=True):
            rings = []
            for start, end in pairwise(ends):
                thin = cv2.approxPolyDP(outline[start : end - 1].astype(np.float32), tolerance, True)[:, 0]
                if len(thin) >= RING_POINTS and abs(_signed_area(thin)) >= smallest:
                    rings.append(_ring(thin))
                elif not rings:
                    break
            if rings:
                polygons.append(tuple(rings))
        if polygons:
            bands.append(MapBand(lower=float(lower), polygons=tuple(sorted(polygons))))
    return tuple(bands)


def sampled(ring: Ring, *, sharp: Sequence[bool]) -> Ring:
    """Return points of the curve that the page draws through a ring: quadratic pieces between midpoints of its edges.

    Args:
        ring: The ring.
        sharp: For each point, whether the curve runs straight to it and on, as along a wall.
    """
    n = len(ring)
    curve: list[Point] = []
    for k, (control, is_sharp) in enumerate(zip(ring, sharp, strict=True)):
        if is_sharp:
            curve.append(control)
            continue
        ends = [((control[0] + p[0]) / 2, (control[1] + p[1]) / 2) for p in (ring[k - 1], ring[(k + 1) % n])]
        for i in range(PER_CURVE):
            t = (i + 0.5) / PER_CURVE
            weights = ((1 - t) ** 2, 2 * t * (1 - t), t**2)
            points = (ends[0], control, ends[1])
            x, y = (sum(w * p[axis] for w, p in zip(weights, points, strict=True)) for axis in (0, 1))
            curve.append((x, y))
    return tuple(curve)


def project_polygons(
    polygons: Sequence[Polygon], *, homography: ArrayLike, size_px: tuple[int, int]
) -> tuple[Polygon, ...]:
    """Return floor polygons as a camera sees them.

    Args:
        polygons: Rings in floor metres.
        homography: 3x3, image pixels to floor metres; its inverse is used.
        size_px: Width and height of the picture; what lies outside is cut away.

    Returns:
        Polygons in pixels, y down. Floor behind the camera's horizon is cut off before projecting (near-plane
        clipping), so that nothing folds over.
    """
    import numpy as np
    from shapely.geometry import Polygon as Shape
    from shapely.geometry import box

    floor_to_px = np.linalg.inv(np.asarray(homography, dtype=np.float64))
    centre = np.asarray(homography, dtype=np.float64) @ (size_px[0] / 2, size_px[1] * 0.75, 1.0)
    if (floor_to_px @ centre)[2] / centre[2] < 0:
        floor_to_px = -floor_to_px
    frame = box(0, 0, *size_px)
    # scale so that w is 1 at the lower middle of the picture; nearer to the horizon than 1/50 of that is cut
    w_near = (floor_to_px @ (centre / centre[2]))[2] / 50
    shown: list[Polygon] = []
    for rings in polygons:
        projected = [ring for r in rings if len(ring := _project_ring(r, floor_to_px, w_near)) >= RING_POINTS]
        if not projected:
            continue
        shape = Shape(projected[0], projected[1:]).buffer(0).intersection(frame)
        parts = getattr(shape, "geoms", [shape])
        for part in parts:
            if part.geom_type == "Polygon" and part.area >= SMALLEST_PX2:
                rings_px = [part.exterior, *part.interiors]
                shown.append(tuple(tuple((float(a), float(b)) for a, b in r.coords[:-1]) for r in rings_px))
    return tuple(shown)


def _project_ring(ring: Ring, floor_to_px: NDArray[np.float64], w_near: float) -> list[Point]:
    """Cut the ring at w = w_near (Sutherland-Hodgman on one plane) and divide."""
    import numpy as np

    homogeneous = np.column_stack([np.asarray(ring, dtype=np.float64), np.ones(len(ring))]) @ floor_to_px.T
    kept = []
    for here, after in zip(homogeneous, np.roll(homogeneous, -1, axis=0), strict=True):
        if here[2] >= w_near:
            kept.append(here)
        if (here[2] >= w_near) != (after[2] >= w_near):
            t = (w_near - here[2]) / (after[2] - here[2])
            kept.append(here + t * (after - here))
    return [(float(p[0] / p[2]), float(p[1] / p[2])) for p in kept]


def _signed_area(points: NDArray[np.float32]) -> float:
    x, y = points[:, 0].astype(float), points[:, 1].astype(float)
    return float(
        (x * (y.take(range(1, len(y) + 1), mode="wrap")) - y * x.take(range(1, len(x) + 1), mode="wrap")).sum() / 2
    )


def _ring(points: NDArray[np.float32]) -> Ring:
    return tuple((round(float(x), 4), round(float(y), 4)) for x, y in points)
