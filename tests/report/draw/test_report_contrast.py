"""Text and signs over drawings: contrast by WCAG 2, in the light, the dark and the printed page."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest

from vsd_analytics.report.draw import svg
from vsd_analytics.report.draw.floor_frame import ROOM
from vsd_analytics.report.pages.week import shipped_style

LEAST = 4.5
TEXTS = {
    # what is written: on what it may lie
    "ink": ("floor", "card"),
    "mut": ("fix", "soft", "card", "bg"),
    "acc": ("floor",),
    "t1": ("h1",),
    "t2": ("h2",),
    "t3": ("h3",),
    "t4": ("h4",),
    "t5": ("h5",),
}
SIGNS = {"ink": ("few1", "mor1"), "on2": ("few2", "mor2")}
HALOED = {"ink": "floor"}
"""Area names run over any heat: their halo of bare floor is what they are read against."""


def colours(mode: str) -> dict[str, str]:
    """Return the custom properties of a mode, later rules over earlier ones."""
    style = shipped_style()
    blocks = [(style[m.start() - 80 : m.start()], m.group(1)) for m in re.finditer(r":root \{([^}]*)\}", style)]
    found: dict[str, str] = {}
    for before, block in blocks:
        kind = "dark" if "prefers-color-scheme: dark" in before.rsplit("}", 1)[-1] else "light"
        kind = "print" if "@media print" in before.rsplit("}", 1)[-1] else kind
        if kind in ("light", mode):
            found |= dict(re.findall(r"--([a-z0-9]+): (#[0-9a-f]{3,6})", block))
    return found


def luminance(colour: str) -> float:
    digits = colour.lstrip("#")
    digits = "".join(c * 2 for c in digits) if len(digits) == 3 else digits
    parts = [int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a: str, b: str) -> float:
    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_the_formula_gives_the_known_ends() -> None:
    assert contrast("#000", "#fff") == pytest.approx(21)
    assert contrast("#767676", "#ffffff") == pytest.approx(4.54, abs=0.01)


@pytest.mark.parametrize("mode", ["light", "dark", "print"])
def test_text_and_signs_over_drawings_can_be_read(mode: str) -> None:
    known = colours(mode)
    assert len(known) > 25
    poor = [
        f"{text} on {ground}: {contrast(known[text], known[ground]):.2f}"
        for texts in (TEXTS, SIGNS)
        for text, grounds in texts.items()
        for ground in grounds
        if contrast(known[text], known[ground]) < LEAST
    ]
    assert poor == []
    for text, halo in HALOED.items():
        assert contrast(known[text], known[halo]) >= 7


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_more_is_more_unlike_the_floor(mode: str) -> None:
    known = colours(mode)
    for ramp in (("h1", "h2", "h3", "h4", "h5"), ("few1", "few2"), ("mor1", "mor2")):
        steps = [contrast(known[c], known["floor"]) for c in ramp]
        assert all(a < b for a, b in pairwise(steps)), ramp


def test_literal_colours_are_those_of_the_light_page() -> None:
    known = colours("light")
    assert [known[f"h{k}"] for k in range(1, 6)] == list(svg.RAMP_LIGHT)
    assert [known["few1"], known["few2"]] == list(svg.CHANGE_LIGHT["fewer"])
    assert [known["mor1"], known["mor2"]] == list(svg.CHANGE_LIGHT["more"])
    assert (known["fix"], known["wall"], known["soft"], known["edge"]) == (
        svg.FIXTURE,
        svg.WALL,
        ROOM,
        svg.FIXTURE_EDGE,
    )
