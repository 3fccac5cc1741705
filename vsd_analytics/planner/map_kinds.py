"""The maps of the planner's page: what each is for, its unit, and its fixed steps (never set by the data)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.format import plain

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
        first: The lowest step, as written in a legend; empty for a ratio.
        middle: What a difference, or a ratio, between the inner steps is called.
    """

    kind: Kind
    metric: str
    name: str
    purpose: str
    unit: str
    suffix: str
    steps: tuple[float, ...]
    diverging: tuple[float, float]
    first: str
    middle: str


EXPOSURE_STEPS: Final = (0.5, 1.0, 2.0, 4.0, 8.0)
BURDEN_STEPS: Final = (10.0, 20.0, 40.0, 80.0, 160.0)
RISK_STEPS: Final = (5.0, 10.0, 20.0, 40.0, 80.0)
RATIO_STEPS: Final = (1.25, 2.0)


def map_kinds(heat_steps: tuple[float, ...], *, distance: str, hotspot_days: int) -> tuple[MapKind, ...]:
    """Return the maps in the order of the page.

    Args:
        heat_steps: Steps of the report's map, from the settings.
        distance: The legal distance in words.
        hotspot_days: Days of the window that the hotspots and the map of excess are made of.
    """
    kinds: tuple[tuple[Kind, str, str, tuple[float, ...]], ...] = (
        ("violations", "M0", "", heat_steps),
        ("exposure", "M16", "", EXPOSURE_STEPS),
        ("burden", "M17", "", BURDEN_STEPS),
        ("risk", "M18", "%", RISK_STEPS),
        ("excess", "M20", "", ()),
    )
    return tuple(
        MapKind(
            kind,
            metric,
            say(f"planner.maps.{kind}.name"),
            say(f"planner.maps.{kind}.purpose", distance=distance),
            say(f"planner.maps.{kind}.unit", days=hotspot_days),
            suffix,
            steps,
            _two(steps) if steps else RATIO_STEPS,
            f"{plain(steps[0])}{suffix}" if steps else "",
            _middle(steps, suffix),
        )
        for kind, metric, suffix, steps in kinds
    )


def _middle(steps: tuple[float, ...], suffix: str) -> str:
    if not steps:
        return say("planner.legend.explained", low=plain(1 / RATIO_STEPS[0]), high=plain(RATIO_STEPS[0]))
    return say("planner.legend.points_within" if suffix else "planner.legend.within", n=plain(_two(steps)[0]))


def _two(steps: tuple[float, ...]) -> tuple[float, float]:
    """Return the steps of a difference: the second step of the map, and three times that."""
    first = steps[min(1, len(steps) - 1)]
    return first, 3 * first


def legend(kind: MapKind) -> tuple[str, ...]:
    """Write the bands of a map: 0.5–1, 1–2, ..., 8+."""
    texts = [f"{plain(s)}{kind.suffix}" for s in kind.steps]
    return tuple(f"{plain(s)}–{t}" for s, t in zip(kind.steps, texts[1:], strict=False)) + tuple(
        f"{p}+" for p in texts[-1:]
    )


def diverging_legend(kind: MapKind) -> tuple[str, str, str, str]:
    """Write the bands of a difference, or of a ratio, from least to most."""
    low, high = (plain(step) for step in kind.diverging)
    if kind.kind == "excess":
        least, less = (plain(1 / step) for step in reversed(kind.diverging))
        return say("planner.legend.under", high=least), f"{least}–{less}", f"{low}–{high}", f"{high}+"
    what = "points" if kind.suffix else "count" if kind.kind == "violations" else "amount"
    two = f"{low}–{high}", f"{high}+"
    fewer, more = ([say(f"planner.legend.{what}_{way}", n=n) for n in two] for way in ("fewer", "more"))
    return fewer[1], fewer[0], more[0], more[1]
