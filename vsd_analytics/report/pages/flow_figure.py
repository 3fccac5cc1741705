"""How people move over the floor, ready for the page: directions, desire lines, and a table of where they go next."""

from __future__ import annotations

from collections.abc import Sequence

from vsd_analytics.answer import Answers, Row, value_of
from vsd_analytics.figures.week.model_map import FloorMap
from vsd_analytics.report.draw import flow_maps
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.map_panels import MapFigure, MapPanel
from vsd_analytics.report.words import terms
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

Rows = Sequence[Row]


def flow_figure(report: WeekReport, floor: FloorMap) -> MapFigure | None:
    """Return the drawings of flow (M37, M42); None where no area asks for visits, or nothing is known.

    Args:
        report: The report.
        floor: The floor's map.
    """
    between, cells = (rows_of(report.answers, name) for name in ("flow", "walking_directions"))
    number, panels = report.week.number, []
    if cells:
        label = say("maps.flow_label_directions", floor=floor.title, number=number)
        drawing = flow_maps.mini_directions(floor, arrows_of(cells), cell_m=cell_side_m(cells), name="wd", label=label)
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
        rows=tuple(_row(r) for r in between if is_known(r)),
    )


def arrows_of(cells: Rows) -> list[flow_maps.Arrow]:
    """Return the rows of `walking_directions` as arrows."""
    return [
        flow_maps.Arrow(
            (number(c, "x_m"), number(c, "y_m")),
            value_of(c, "direction_deg").value,
            c["ways"] == "both",
            round(value_of(c, "n_people").value or 0),
        )
        for c in cells
    ]


def cell_side_m(cells: Rows) -> float:
    """Return the side of the cells of walking directions."""
    return number(cells[0], "cell_m")


def number(row: Row, name: str) -> float:
    """Return a fact of a row that is a number."""
    return float(str(row[name]))


def lines_of(between: Rows) -> list[flow_maps.DesireLine]:
    """Return the rows of `flow` as desire lines, without those of several areas together."""
    return [
        flow_maps.DesireLine(str(r["area_id"]), str(r["to_area_ids"]), per_open_h)
        for r in between
        if is_known(r) and (per_open_h := value_of(r, "per_open_h").value) is not None and not is_pooled(r)
    ]


def is_known(row: Row) -> bool:
    """Tell whether a row of `flow` has a share."""
    return value_of(row, "next_area_share").value is not None


def is_pooled(row: Row) -> bool:
    """Tell whether a row of `flow` is of several areas, each entered by few people."""
    return " " in str(row["to_area_ids"])


def doubts(between: Rows) -> list[str]:
    """Return sentences on what is not known of the rows of `flow`, or does not fit."""
    said = []
    if unknown := dict.fromkeys(str(r["name"]) for r in between if not is_known(r)):
        said.append(say("maps.flow_unknown", places=terms.joined(unknown)))
    return said + _misfits(between) + _partial(between)


def _misfits(between: Rows) -> list[str]:
    off = dict.fromkeys(str(r["name"]) for r in between if r["fits_arrivals"] is False)
    return [say("maps.flow_disagrees", places=terms.joined(off))] if off else []


def _partial(between: Rows) -> list[str]:
    unseen = dict.fromkeys(str(r["name"]) for r in between if r["in_view_only"] and is_known(r))
    return [say("maps.flow_in_view", places=terms.joined(unseen))] if unseen else []


def rows_of(answers: Answers, name: str) -> Rows:
    """Return the rows of an answer; none where it is absent."""
    answer = answers.get(name)
    return () if answer is None else answer.rows


def _said(between: Rows, cells: Rows) -> list[str]:
    """Return how to read the drawings, and what is not known or does not fit."""
    said = [say("maps.flow_read" if cells else "maps.flow_sub_lines")]
    if unknown := dict.fromkeys(str(r["name"]) for r in between if not is_known(r)):
        said.append(say("maps.flow_lost", places=terms.joined(unknown)))
    return said + _misfits(between)


def _detail(report: WeekReport, between: Rows, cells: Rows) -> list[str]:
    """Return what an arrow is, and of whom the shares of the table are."""
    said = []
    if cells:
        cell = fmt.distance(cell_side_m(cells), report.rules.distance_unit)
        said.append(say("maps.flow_sub", cell=cell, people=report.rules.mask_below))
    return said + _partial(between)


def _row(row: Row) -> tuple[str, ...]:
    to = say("maps.flow_other") if is_pooled(row) else str(row["to_name"])
    value, per_open_h = value_of(row, "next_area_share"), value_of(row, "per_open_h").value
    share = fmt.percent(value.value)
    if value.lo is not None:
        share = say("maps.flow_range", share=share, lo=fmt.percent(value.lo), hi=fmt.percent(value.hi))
    per_hour = fmt.MISSING if per_open_h is None else fmt.number(per_open_h)
    return say("maps.flow_way", start=row["name"], end=to), share, per_hour
