"""What the engine found: places and near pairs of the people of one camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import Array, People
from vsd_analytics.engine.safe_space import SafeSpaces

NO_FOOT: Final = "no foot, or no body above it"
ABOVE_HORIZON: Final = "at or above the horizon"
OFF_PLANES: Final = "outside all planes"
"""Why a person has no place."""
IGNORED: Final = "in a part of the picture that is ignored"
"""Why a person is none: a mirror, a screen, a window (`ignore_px` of the camera)."""

Quality = Literal["metric", "body", "relative"]


@dataclass(frozen=True, slots=True)
class Seen:
    """Persons with their places, and the pairs among them.

    Attributes:
        people: The persons that count.
        uv: Foot points in pixels, shape (n, 2); NaN where unknown.
        xy: Floor metres, shape (n, 2); None for a method without metres.
        a: Row of the first person of each near pair, shape (m,).
        b: Row of the second.
        distance_m: Their distance, shape (m,).
        quality: Of the distances.
        engine: Name and parameters, as the messages carry it.
        left_out: Persons that do not count, by reason.
        sd_m: Standard deviation of the distances, shape (m,); None where it is unknown.
        spaces: Safe space of each person; None where nothing maps the floor to the picture.
        has_planes: People are on several planes, so no reader can derive places from pixels, or distances from places.
    """

    people: People
    uv: Array
    xy: Array | None
    a: NDArray[np.intp]
    b: NDArray[np.intp]
    distance_m: Array
    quality: Quality
    engine: str
    left_out: dict[str, int]
    sd_m: Array | None = None
    spaces: SafeSpaces | None = None
    has_planes: bool = False
