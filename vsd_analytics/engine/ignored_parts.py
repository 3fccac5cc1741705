"""Parts of a picture in which people do not count: a mirror, a screen, a window to the street.

Whoever has the feet there is left out before anything else is done with the people: a box in a mirror must not become a
whole body, calibrate the camera, or be followed. The floor there counts as not seen (`geometry.camera_views`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import Array
from vsd_analytics.site.model import Point

Polygons = Sequence[Sequence[Point]]


def in_parts(box: Array, ignore_px: Polygons) -> NDArray[np.bool_]:
    """Return which boxes end in a polygon: the middle of the bottom edge is in it or on its border.

    Args:
        box: Left, top, right, bottom in pixels, NaN where unknown, shape (n, 4).
        ignore_px: Corners of the polygons.
    """
    import shapely

    is_in = np.zeros(len(box), dtype=np.bool_)
    foot = np.column_stack([(box[:, 0] + box[:, 2]) / 2, box[:, 3]])
    known = np.isfinite(foot).all(axis=1)
    for corners in ignore_px:
        is_in[known] |= shapely.intersects_xy(shapely.Polygon(corners), *foot[known].T)
    return is_in


def engine_ignoring(engine: str, ignore_px: Polygons) -> str:
    """Return an engine's name with the parts that it ignores, so that weeks before and after are not compared."""
    if not ignore_px:
        return engine
    known = repr([[tuple(corner) for corner in corners] for corners in ignore_px])
    return f"{engine} ignoring {hashlib.blake2b(known.encode(), digest_size=4).hexdigest()}"
