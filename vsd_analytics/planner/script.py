"""The script of the planner's page, with the words and quantiles that it reads."""

from __future__ import annotations

import math
import re
from functools import cache
from typing import Any, Final

import numpy as np

from vsd_analytics.resources import shipped
from vsd_analytics.stats.quantiles import poisson_limits, t_quantile, z_quantile, zero_events_limit
from vsd_analytics.stats.rates import MIN_EVENTS
from vsd_analytics.wording import catalogue

SCRIPTS: Final = (
    "planner_rates.js",
    "planner_map.js",
    "planner_data.js",
    "planner.js",
    "planner_changes.js",
    "planner_replay.js",
    "planner_drawings.js",
    "planner_layout.js",
    "planner_start.js",
)
LAYERS: Final = {"flow": "planner_flow.js", "lines": "planner_lines.js"}
"""Scripts of layers over the map, which only pages with such a layer have."""
SAID: Final = "planner.script."
"""Sentences of the catalogue that the script says are those below this and these."""
SAID_TOO: Final = (
    *("format.tiny", "format.same", "format.fewer", "format.more", "format.no_change", "format.likely"),
    *("format.likely_fewer", "format.likely_more", "format.likely_between", "format.hours", "format.under_an_hour"),
    *("words.clear_fall", "words.clear_rise", "words.about_same", "words.cannot_tell"),
    *("words.too_little_data", "format.nearly_none", "format.nearly_all", "format.likely_signed"),
)


REASONS: Final = {
    "days": "level.days",
    "events": "level.events",
    "camera": "level.camera",
    "none_per_open_h": "level.none_per_open_h",
    "none_per_person_h": "level.none_per_person_h",
    "unrecorded": "level.unrecorded",
    "person_hours": "level.person_hours",
    "pairs": "change.pairs",
    "person_hours_each": "change.person_hours",
    "few": "change.few",
    "camera_both": "change.camera",
    "nobody": "nobody.on_camera",
    "masked": "hidden.few",
    "nobody_seen": "nobody.seen_open",
    "nobody_close": "nobody.close",
    "interval_person_hours": "level.interval_person_hours",
}
"""Reasons that the script gives, by its own short names: the same sentences as those of the statistics."""


def sentences() -> dict[str, str | dict[str, str]]:
    """Return the sentences the script says, with their places unfilled."""
    texts: dict[str, str | dict[str, str]] = {}
    for key, entry in catalogue.catalogue().items():
        if key.startswith(SAID) or key in SAID_TOO:
            forms = (
                catalogue.template(key)
                if isinstance(entry, str)
                else {form: catalogue.template(key, plural=form) for form in entry}
            )
            texts[key.removeprefix(SAID)] = forms
    for name, code in REASONS.items():
        text = catalogue.template(f"reason.{code}").replace("{least", "{n")
        texts[f"reason.{name}"] = re.sub(r"\{(\w+):[^}]*\}", r"{\1}", text)  # the script formats its numbers itself
    return texts


@cache
def script(layers: tuple[str, ...] = ()) -> str:
    """Return the page's only script.

    Args:
        layers: The layers of `LAYERS` that the page has.
    """
    return one_script((*SCRIPTS[:-1], *(LAYERS[layer] for layer in layers), SCRIPTS[-1]))


def one_script(names: tuple[str, ...]) -> str:
    """Return shipped scripts one after the other in one scope, without comments' lines."""
    folder = shipped("reports") / "static"
    text = "".join((folder / name).read_text(encoding="utf-8") for name in names)
    text = re.sub(r"^\s*/\*.*?\*/\s*$", "", text, flags=re.DOTALL | re.MULTILINE)
    lines = "".join(f"{line.strip()}\n" for line in text.splitlines() if line.strip())
    return f"(() => {{\n'use strict';\n{lines}}})();\n"


N_NODES: Final = 24
LARGEST_DF: Final = 60.0


def quantiles(confidence: float) -> dict[str, Any]:
    """Return what the page's formulas need at a confidence level.

    ln t as a function of u = 1/df is smooth; the page takes the polynomial through `N_NODES` Chebyshev nodes of
    u from 1/60 to 1 (barycentric formula, weights (-1)^i sin), which is right to ten digits there.

    Args:
        confidence: Between 0 and 1.

    Returns:
        `u`, `w`, `lnT`: nodes, weights and values; `z`: the normal quantile; `zero`: the rule of three.
    """
    angle = (2 * np.arange(N_NODES) + 1) * math.pi / (2 * N_NODES)
    low = 1 / LARGEST_DF
    u = low + (1 - low) * (1 + np.cos(angle)) / 2
    weights = (-1.0) ** np.arange(N_NODES) * np.sin(angle)
    return {
        "u": [float(f"{v:.17g}") for v in u],
        "w": [float(v) for v in weights],
        "lnT": [math.log(t_quantile(1 / float(v), confidence=confidence)) for v in u],
        "z": z_quantile(confidence=confidence),
        "zero": zero_events_limit(confidence=confidence),
    }


def few_events(confidence: float) -> list[tuple[float, float]]:
    """Return exact Poisson limits after 0, 1, ... violations, as far as changes use them."""
    return [poisson_limits(n, confidence=confidence) for n in range(MIN_EVENTS)]
