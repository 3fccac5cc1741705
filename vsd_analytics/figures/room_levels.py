"""Levels of service by the floor that people have: Fruin's of a walkway, IATA's of a queue."""

from __future__ import annotations

from typing import Final

SQUARE_FOOT_M2: Final = 0.3048**2
ROOM_M2: Final = tuple(feet * SQUARE_FOOT_M2 for feet in (35, 25, 15, 10, 5))
"""Least floor for each person of levels of service A to E of walkways; below the last is F. Source: Fruin, Pedestrian
Planning and Design (1971), in square feet."""
LEVELS: Final = "ABCDEF"
IATA_M2: Final = (1.2, 1.0)
"""Room of a person who queues for a control, m²: from 1.2 over-design, from 1.0 optimum, below it sub-optimum. Source:
IATA Airport Development Reference Manual, level of service."""
IATA_LEVELS: Final = ("over_design", "optimum", "sub_optimum")


def density_edges() -> tuple[tuple[float, float | None], ...]:
    """Return the densities in people per m² above which each of `LEVELS` begins, and up to which it goes."""
    limits = [1 / room for room in ROOM_M2]
    return tuple(zip([0.0, *limits], [*limits, None], strict=True))


def level_of(density: float) -> int:
    """Return the place in `LEVELS` of a density in people per m²; a limit belongs to the roomier level."""
    return sum(density * room > 1 for room in ROOM_M2)


def iata_level_of(density: float) -> int:
    """Return the place in `IATA_LEVELS` of a density in people per m²; a limit belongs to the roomier level."""
    return sum(density * room > 1 for room in IATA_M2)
