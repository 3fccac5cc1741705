"""Small drawings side by side, with their finding, legend and table, as the templates show them."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup


@dataclass(frozen=True, slots=True, kw_only=True)
class MapPanel:
    """One small drawing and the lines above it."""

    title: str
    drawing: Markup


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """One entry of a legend: the class of its swatch, a sign before its text, the text."""

    style: str
    text: str
    sign: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class MapFigure:
    """Small drawings side by side.

    Attributes:
        title: The finding.
        unit: What is drawn.
        detail: More on it, folded with the table.
        panels: The drawings.
        keys: The legend.
        summary: What opens the table.
        region: Name of the table for those who hear the page.
        caption: Caption of the table.
        head: Heads of its columns.
        rows: Its rows, texts.
        moved: What was moved between the weeks drawn, for the end of a line.
    """

    title: str
    unit: str
    panels: tuple[MapPanel, ...]
    keys: tuple[Key, ...]
    summary: str
    region: str
    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    moved: str = ""
    detail: str = ""
