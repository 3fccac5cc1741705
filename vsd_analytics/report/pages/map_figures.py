"""The figures beside the week's map, ready for the page: drawings with their findings, legends and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from markupsafe import Markup

from vsd_analytics.answer import Answers, Row, value_of
from vsd_analytics.figures.week.model_map import FloorMap
from vsd_analytics.report.draw import flow_maps, small_maps
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.contributions import contributions
from vsd_analytics.report.pages.figure_titles import changed_places
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say


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
    sentences = []
    if unknown := dict.fromkeys(str(r["name"]) for r in between if not is_known(r)):
        sentences.append(say("maps.flow_unknown", places=terms.joined(unknown)))
    return sentences + _misfits(between) + _partial(between)


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
    sentences = [say("maps.flow_read" if cells else "maps.flow_sub_lines")]
    if unknown := dict.fromkeys(str(r["name"]) for r in between if not is_known(r)):
        sentences.append(say("maps.flow_lost", places=terms.joined(unknown)))
    return sentences + _misfits(between)


def _detail(report: WeekReport, between: Rows, cells: Rows) -> list[str]:
    """Return what an arrow is, and of whom the shares of the table are."""
    sentences = []
    if cells:
        cell = fmt.distance(cell_side_m(cells), report.rules.distance_unit)
        sentences.append(say("maps.flow_sub", cell=cell, people=report.rules.mask_below))
    return sentences + _partial(between)


def _row(row: Row) -> tuple[str, ...]:
    to = say("maps.flow_other") if is_pooled(row) else str(row["to_name"])
    value, per_open_h = value_of(row, "next_area_share"), value_of(row, "per_open_h").value
    share = fmt.percent(value.value)
    if value.lo is not None:
        share = say("maps.flow_range", share=share, lo=fmt.percent(value.lo), hi=fmt.percent(value.hi))
    per_hour = fmt.MISSING if per_open_h is None else fmt.number(per_open_h)
    return say("maps.flow_way", start=row["name"], end=to), share, per_hour


@dataclass(frozen=True, slots=True, kw_only=True)
class MapFigures:
    """Everything drawn of the floor beside its map.

    Attributes:
        change: The week before, this week, the difference.
        footsteps: Footsteps beside violations.
        views: What each camera sees.
        flow: Which way people walk, and where they go from area to area.
    """

    change: MapFigure | None = None
    footsteps: MapFigure | None = None
    views: MapFigure | None = None
    flow: MapFigure | None = None


def map_figures(report: WeekReport) -> MapFigures:
    """Return the figures of a report.

    Args:
        report: The report.
    """
    floor = report.maps[0] if report.maps and report.maps[0].kind != "picture" else None
    if floor is None:
        return MapFigures()
    return MapFigures(
        change=_change(report, floor),
        footsteps=_footsteps(report, floor),
        views=_views(report, floor),
        flow=flow_figure(report, floor),
    )


def _change(report: WeekReport, floor: FloorMap) -> MapFigure | None:
    shown, previous = report.change_maps, report.previous
    if shown is None or previous is None:
        return None
    title, steps = changed_places(shown), report.rules.heat_steps
    floor_before = floor if shown.fixtures_before is None else replace(floor, fixtures=shown.fixtures_before)
    gone = small_maps.moved_away(floor, shown)
    weeks = (
        (previous, shown.before, "cb", floor_before, ()),
        (report.week, shown.now, "cn", floor, gone),
    )
    panels = [
        MapPanel(
            title=say("maps.change_before", number=week.number),
            drawing=small_maps.mini_heat(
                place,
                bands,
                gone=left,
                name=name,
                steps=steps,
                label=say("maps.change_label_week", floor=floor.title, number=week.number),
            ),
        )
        for week, bands, name, place, left in weeks
    ]
    label = say("maps.change_label", before=previous.number, now=report.week.number, title=title)
    added = contributions(report)
    parts = [(p.area_id, p.name, p.value) for p in added.parts] if added is not None else []
    numbers = {area_id: value for area_id, _, value in parts if area_id is not None}
    drawing = small_maps.mini_change(floor, shown, name="cd", label=label, numbers=numbers)
    moved = say("maps.change_moved", names=terms.joined(dict.fromkeys(f.name for f in gone))) if gone else ""
    low, high = (fmt.plain(s) for s in shown.steps)
    return MapFigure(
        title=title,
        unit=say("maps.change_sub", hours=fmt.count(shown.hours_compared)) + moved,
        moved=moved,
        panels=(*panels, MapPanel(title=say("maps.change_difference"), drawing=drawing)),
        keys=(
            Key(style="f2", sign="−", text=say("maps.change_strong_fewer", high=high)),
            Key(style="f1", sign="−", text=say("maps.change_weak_fewer", low=low, high=high)),
            Key(style="m1", sign="+", text=say("maps.change_weak_more", low=low, high=high)),
            Key(style="m2", sign="+", text=say("maps.change_strong_more", high=high)),
        ),
        summary=say("maps.change_table"),
        region=say("maps.change_table_region"),
        caption=say("maps.change_caption", before=previous.number, now=report.week.number),
        head=(say("maps.area"), say("maps.change_adds")),
        rows=tuple((name, value) for _, name, value in parts),
    )


def _footsteps(report: WeekReport, floor: FloorMap) -> MapFigure | None:
    steps = report.footsteps
    if steps is None:
        return None
    number = report.week.number
    total = report.level.exposure_h
    rows = [
        (a.name, a.exposure_h / total, a.share)
        for a in report.areas
        if total and a.exposure_h is not None and a.share is not None
    ]
    named = [a.name for a in report.areas if a.area_id is not None]
    top = next((r for r in rows if r[0] in named), None)
    title = say("maps.steps_title_bare")
    if top is not None and report.state in ("normal", "first_week", "settings_changed"):
        title = say("maps.steps_title", area=top[0], violations=fmt.percent(top[2]), time=fmt.percent(top[1]))
    else:
        rows = []
    left = small_maps.mini_footsteps(
        floor, steps, name="fl", label=say("maps.steps_label_left", floor=floor.title, number=number)
    )
    right = small_maps.mini_heat(
        floor,
        floor.bands,
        name="fr",
        steps=report.rules.heat_steps,
        label=say("maps.steps_label_right", floor=floor.title, number=number),
    )
    return MapFigure(
        title=title,
        unit=say(
            "maps.steps_sub",
            cell=fmt.distance(steps.cell_m, report.rules.distance_unit),
            tracks=steps.min_tracks,
            number=number,
        ),
        panels=(
            MapPanel(title=say("maps.steps_left"), drawing=left),
            MapPanel(title=say("maps.steps_right"), drawing=right),
        ),
        keys=(),
        summary=say("maps.change_table"),
        region=say("maps.steps_region"),
        caption=say("maps.steps_caption", number=number),
        head=(say("maps.area"), say("maps.steps_time"), say("maps.steps_violations")),
        rows=tuple((name, fmt.percent(time), fmt.percent(share)) for name, time, share in rows),
    )


def _views(report: WeekReport, floor: FloorMap) -> MapFigure | None:
    shown = report.views
    if shown is None:
        return None
    shared, unseen = (fmt.percent(v / shown.floor_m2) for v in (shown.shared_m2, shown.unseen_m2))
    key = say("maps.views_title", shared=shared, unseen=unseen)
    if shown.unseen_m2 < 0.005 * shown.floor_m2:
        key = say("maps.views_title_all", shared=shared)
    drawing = small_maps.mini_views(floor, shown, name="vw", label=say("maps.views_label", floor=floor.title))
    keys = [Key(style="ov", text=say("maps.views_legend_one"))]
    if shown.shared:
        keys.append(Key(style="sv", text=say("maps.views_legend_many")))
    return MapFigure(
        title=key,
        unit=say("maps.views_sub"),
        panels=(MapPanel(title="", drawing=drawing),),
        keys=tuple(keys),
        summary=say("maps.change_table"),
        region=say("maps.views_region"),
        caption=say("maps.views_caption"),
        head=(say("maps.views_camera"), say("maps.views_seen"), say("maps.views_alone")),
        rows=tuple(
            (f"{v.label} {v.name}", f"{fmt.number(v.area_m2)} m²", f"{fmt.number(v.alone_m2)} m²")
            for v in shown.cameras
        ),
    )
