"""The maps of the planner's page: what each is for, its unit, and its fixed steps (never set by the data)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

Kind = Literal["violations", "exposure", "burden", "risk", "excess"]


@dataclass(frozen=True, slots=True)
class MapKind:
    """One map.

    Attributes:
        kind: Name in the page's address.
        metric: Catalogue id.
        name: What it is called.
        purpose: One sentence on what it is for.
        unit: Of its values, in words.
        suffix: Written after a value of the legend.
        steps: Lower ends of its five bands; empty for a ratio.
        diverging: Two steps of a difference or of a ratio, either side.
    """

    kind: Kind
    metric: str
    name: str
    purpose: str
    unit: str
    suffix: str
    steps: tuple[float, ...]
    diverging: tuple[float, float]


EXPOSURE_STEPS: Final = (0.5, 1.0, 2.0, 4.0, 8.0)
BURDEN_STEPS: Final = (10.0, 20.0, 40.0, 80.0, 160.0)
RISK_STEPS: Final = (5.0, 10.0, 20.0, 40.0, 80.0)
RATIO_STEPS: Final = (1.25, 2.0)


def map_kinds(heat_steps: tuple[float, ...], *, distance: str) -> tuple[MapKind, ...]:
    """Return the maps in the order of the page.

    Args:
        heat_steps: Steps of the report's map, from the settings.
        distance: The legal distance in words.
    """
    return (
        MapKind(
            "violations", "M0", "Violations",
            "The report's map: where to look first, as most violations happen where the colour is strongest.",
            "Violations per m² per open hour", "", heat_steps, _two(heat_steps),
        ),
        MapKind(
            "exposure", "M16", "Where people are",
            "Shows where people spend their time, so that a busy place is not taken for a badly laid out one.",
            "Person-minutes per m² per open hour", "", EXPOSURE_STEPS, _two(EXPOSURE_STEPS),
        ),
        MapKind(
            "burden", "M17", "Time too close",
            f"Shows where time within {distance} of somebody adds up: moving or widening such a place saves most.",
            "Person-seconds in violation per m² per open hour", "", BURDEN_STEPS, _two(BURDEN_STEPS),
        ),
        MapKind(
            "risk", "M18", "Share of time too close",
            f"Shows how likely a person there is within {distance} of somebody, however many people come by.",
            "Share of person-time in violation", "%", RISK_STEPS, _two(RISK_STEPS),
        ),
        MapKind(
            "excess", "M19", "More than the crowd explains",
            "Compares with people mixing by chance: above 1 they queue or stay together, which a layout can change.",
            "Time in violation over that of random mixing, all recorded hours of the week", "", (), RATIO_STEPS,
        ),
    )  # fmt: skip


def _two(steps: tuple[float, ...]) -> tuple[float, float]:
    """Return the steps of a difference: the second step of the map, and three times that."""
    first = steps[min(1, len(steps) - 1)]
    return first, 3 * first


def legend(kind: MapKind) -> tuple[str, ...]:
    """Write the bands of a map: 0.5–1, 1–2, ..., 8+."""
    plain = [f"{s:g}{kind.suffix}" for s in kind.steps]
    return tuple(f"{s:g}–{t}" for s, t in zip(kind.steps, plain[1:], strict=False)) + tuple(f"{p}+" for p in plain[-1:])


def diverging_legend(kind: MapKind) -> tuple[str, str, str, str]:
    """Write the bands of a difference, or of a ratio, from least to most."""
    low, high = kind.diverging
    if kind.kind == "excess":
        return f"under {1 / high:g}", f"{1 / high:g}–{1 / low:g}", f"{low:g}–{high:g}", f"{high:g}+"
    more = "points more" if kind.suffix else "more"
    fewer = "points less" if kind.suffix else "fewer" if kind.kind == "violations" else "less"
    return f"{high:g}+ {fewer}", f"{low:g}–{high:g} {fewer}", f"{low:g}–{high:g} {more}", f"{high:g}+ {more}"
