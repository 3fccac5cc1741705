"""How people move over the floor, ready for the page: directions, desire lines, and a table of where they go next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vsd_analytics.figures.week.model_map import FloorMap
from vsd_analytics.figures.week.results import Figure
from vsd_analytics.report.draw import flow_maps
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.map_panels import MapFigure, MapPanel
from vsd_analytics.report.words import terms
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

Rows = Sequence[Mapping[str, Any]]


def flow_figure(report: WeekReport, floor: FloorMap) -> MapFigure | None:
    """Return the drawings of flow (M37, M42); None where no area asks for visits, or nothing is known.

    Args:
        report: The report.
        floor: The floor's map.
    """
    between, cells = (rows_of(report.figures, key) for key in ("M37", "M42"))
    number, panels = report.week.number, []
    if cells:
        label = say("maps.flow_label_directions", floor=floor.title, number=number)
        drawing = flow_maps.mini_directions(floor, arrows_of(cells), cell_m=cells[0]["cell_m"], name="wd", label=label)
        panels.append(MapPanel(title=say("maps.flow_directions"), drawing=drawing))
    if lines := lines_of(between):
        label = say("maps.flow_label_lines", floor=floor.title, number=number)
        drawing = flow_maps.mini_desire_lines(floor, lines, name="dl", label=label)
        panels.append(MapPanel(title=say("maps.flow_lines"), drawing=drawing))
    if not panels:
        return None
    return MapFigure(
        title=say("maps.flow_title"),
        unit=" ".join(_said(between, cells)),
        detail=" ".join(_detail(report, between, cells)),
        panels=tuple(panels),
        keys=(),
        summary=say("waiting.words"),
        region=say("maps.flow_region"),
        caption=say("maps.flow_caption", number=number),
        head=tuple(say(f"maps.flow_{key}") for key in ("from_to", "share", "per_hour")),
        rows=tuple(_row(r) for r in between if r["value"] is not None),
    )


def arrows_of(cells: Rows) -> list[flow_maps.Arrow]:
    """Return the rows of M42 as arrows."""
    return [flow_maps.Arrow((c["x_m"], c["y_m"]), c["value"], c["ways"] == "both", c["n_people"]) for c in cells]


def lines_of(between: Rows) -> list[flow_maps.DesireLine]:
    """Return the rows of M37 as desire lines, without those of several areas together."""
    return [
        flow_maps.DesireLine(r["area"], r["to_areas"], r["per_open_h"])
        for r in between
        if r["value"] is not None and r["per_open_h"] is not None and " " not in r["to_areas"]
    ]


def doubts(between: Rows) -> list[str]:
    """Return sentences on what is not known of the rows of M37, or does not fit."""
    said = []
    if unknown := dict.fromkeys(r["place"] for r in between if r["value"] is None):
        said.append(say("maps.flow_unknown", places=terms.joined(unknown)))
    return said + _misfits(between) + _partial(between)


def _misfits(between: Rows) -> list[str]:
    off = dict.fromkeys(r["place"] for r in between if r["fits_arrivals"] is False)
    return [say("maps.flow_disagrees", places=terms.joined(off))] if off else []


def _partial(between: Rows) -> list[str]:
    unseen = dict.fromkeys(r["place"] for r in between if r.get("in_view_only") and r["value"] is not None)
    return [say("maps.flow_in_view", places=terms.joined(unseen))] if unseen else []


def rows_of(figures: Mapping[str, Figure], metric: str) -> Rows:
    """Return the rows of a figure; none where it is absent or not known."""
    figure = figures.get(metric)
    return () if figure is None or figure.rows is None else figure.rows


def _said(between: Rows, cells: Rows) -> list[str]:
    """Return how to read the drawings, and what is not known or does not fit."""
    said = [say("maps.flow_read" if cells else "maps.flow_sub_lines")]
    if unknown := dict.fromkeys(r["place"] for r in between if r["value"] is None):
        said.append(say("maps.flow_lost", places=terms.joined(unknown)))
    return said + _misfits(between)


def _detail(report: WeekReport, between: Rows, cells: Rows) -> list[str]:
    """Return what an arrow is, and of whom the shares of the table are."""
    said = []
    if cells:
        cell = fmt.distance(cells[0]["cell_m"], report.rules.distance_unit)
        said.append(say("maps.flow_sub", cell=cell, people=report.rules.mask_below))
    return said + _partial(between)


def _row(row: Mapping[str, Any]) -> tuple[str, ...]:
    to = say("maps.flow_other") if " " in row["to_areas"] else row["to"]
    share = fmt.percent(row["value"])
    if row["lo"] is not None:
        share = say("maps.flow_range", share=share, lo=fmt.percent(row["lo"]), hi=fmt.percent(row["hi"]))
    per_hour = fmt.MISSING if row["per_open_h"] is None else fmt.number(row["per_open_h"])
    return say("maps.flow_way", start=row["place"], end=to), share, per_hour
