"""The planner's page as one HTML file: one style, one script, one block of data, no request, the same bytes always."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely
from markupsafe import Markup

from vsd_analytics.answer import Row
from vsd_analytics.figures.cell_hours import CELL_M as RISK_CELL_M
from vsd_analytics.figures.hotspot_answers import hotspot_answers, window_holds
from vsd_analytics.figures.hotspots import FloorSpot
from vsd_analytics.figures.maps import MIN_EXPOSURE_H, SIGMA_M
from vsd_analytics.figures.share.counts import mask_of
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.results import WeekRef
from vsd_analytics.planner import cell_counts, map_kinds
from vsd_analytics.planner.change_words import ChangeWords, change_words
from vsd_analytics.planner.drawing import PlannerDrawing, drawing_of, frame_of, spot_id
from vsd_analytics.planner.encode import PackedNumbers, packed_numbers
from vsd_analytics.planner.layouts import movable
from vsd_analytics.planner.lines_layer import LinesLayer, lines_layer
from vsd_analytics.planner.logged_changes import PlannerChange
from vsd_analytics.planner.planner_data import PlaceRow, PlannerData
from vsd_analytics.planner.replay import replay_meta
from vsd_analytics.planner.script import few_events, quantiles, script, sentences
from vsd_analytics.planner.space_use import SpaceUseView, space_use_view
from vsd_analytics.report.model.spot_names import place_name
from vsd_analytics.report.pages.spot_cards import watched
from vsd_analytics.report.pages.week import policy_hash, rendered, shipped_style
from vsd_analytics.stats.earlier_days import LARGEST, PRIOR_CORRELATION, PRIOR_DAYS
from vsd_analytics.stats.rates import MIN_EVENTS, MIN_HISTORY_WEEKS, SMALL_COUNT
from vsd_analytics.stats.weekly_steps import PRIOR_DF, PRIOR_EXTRA, PRIOR_WEEK_SD
from vsd_analytics.version import VERSION
from vsd_analytics.wording import catalogue
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.languages import days
from vsd_analytics.wording.reasons import reason_text, text_or_none
from vsd_analytics.wording.terms import capital, joined, verdict_words

ROUGH_H: Final = 3.0
"""Selections with fewer recorded hours are marked as rough."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannerFigureRow:
    """The report's figures of a place, as texts."""

    name: str
    violation_rate: str = fmt.MISSING
    violation_rate_likely: str = ""
    close: str = fmt.MISSING
    close_likely: str = ""
    encounter_rate: str = fmt.MISSING
    encounter_rate_likely: str = ""
    previous: str = fmt.MISSING
    change: str = ""
    change_likely: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannerPage:
    """Everything the template may use; each field is one variable."""

    data: PlannerData
    title: str
    week: str
    weeks: tuple[str, ...]
    span: tuple[str, str]
    span_before: tuple[str, str] | None
    style: Markup
    style_hash: str
    script: Markup
    script_hash: str
    meta: Markup
    packed: PackedNumbers
    maps: tuple[map_kinds.MapKind, ...]
    legends: dict[str, tuple[str, ...]]
    diverging: dict[str, tuple[str, ...]]
    days: tuple[tuple[int, str], ...]
    other_week: str | None
    hours: tuple[int, int]
    drawing: PlannerDrawing | None
    rows: tuple[PlannerFigureRow, ...]
    spots: tuple[tuple[str, str, Row], ...]
    changes: tuple[ChangeWords, ...]
    has_pairs: bool
    use: SpaceUseView | None
    lines: LinesLayer | None
    watching: tuple[str, ...]
    is_made_up: bool
    mask: int
    distance: str
    least_time: str
    version: str
    is_at_desk: bool


def render_planner(data: PlannerData, *, is_at_desk: bool = False) -> str:
    """Return the page.

    Args:
        data: What it knows.
        is_at_desk: It is served by the desk, and links to the other pages there.
    """
    return rendered("planner.html.j2", _page(data, is_at_desk=is_at_desk))


def _page(data: PlannerData, *, is_at_desk: bool) -> PlannerPage:
    site, week = data.site, data.week.ref
    drawing = None if data.shown is None else drawing_of(data)
    lines = lines_layer(data.lines, site.lines, None if data.shown is None else frame_of(data.shown))
    style = shipped_style("planner.css") + (shipped_style("planner_lines.css") if lines else "") + _sizes(drawing)
    has_layer = {"flow": drawing is not None and drawing.flow is not None, "lines": lines is not None}
    code = script(tuple(layer for layer, is_there in has_layer.items() if is_there))
    refs = [week] + ([data.before.ref] if data.before is not None else [])
    weeks = tuple(_week_name(r, year=week.year) for r in refs)
    distance = fmt.distance(site.settings.distance_m, site.settings.distance_unit)
    maps = map_kinds.map_kinds(
        tuple(site.settings.heat_steps), distance=distance, hotspot_days=int(site.settings.hotspot_days)
    )
    if data.is_shared:
        maps = tuple(m for m in maps if m.kind != "excess")
    hours = _hours(data)
    title = catalogue.say(
        "planner.title", site=site.name, floor=data.floor.name, weeks=joined(weeks[::-1]), year=week.year
    )
    meta = _meta(data, weeks=tuple(capital(w) for w in weeks), maps=maps, hours=hours, drawing=drawing)
    if lines is not None:
        meta = {**meta, "words": {**meta["words"], **lines.words}, "lines": lines.meta}
    return PlannerPage(
        data=data,
        title=title,
        week=weeks[0],
        weeks=tuple(capital(w) for w in weeks),
        other_week=weeks[1] if len(weeks) > 1 else None,
        span=fmt.date_span(week.monday, week.sunday),
        span_before=None if data.before is None else fmt.date_span(data.before.ref.monday, data.before.ref.sunday),
        style=Markup(style),
        style_hash=policy_hash(style),
        script=Markup(code),
        script_hash=policy_hash(code),
        meta=Markup(_json(meta)),
        packed=packed_numbers(data),
        maps=maps,
        legends={m.kind: map_kinds.legend(m) for m in maps},
        diverging={m.kind: map_kinds.diverging_legend(m) for m in maps},
        days=tuple(enumerate(days())),
        hours=hours,
        drawing=drawing,
        rows=tuple(_figures(data, k, row) for k, row in enumerate(data.places)),
        spots=_spot_rows(data),
        changes=tuple(change_words(c, day=week.sunday) for c in data.changes),
        has_pairs=data.before is not None or any(c.before is not None for c in data.changes),
        use=space_use_view(data.space),
        lines=lines,
        watching=tuple(dict.fromkeys(watched(place_name(s.place), s.changed_on) for s in data.hotspots.watching)),
        is_made_up=data.is_made_up,
        is_at_desk=is_at_desk,
        mask=mask_of(site).below,
        distance=distance,
        least_time=fmt.seconds(site.settings.episode_min_s),
        version=VERSION,
    )


def _week_name(ref: WeekRef, *, year: int) -> str:
    """Return week 46; week 52, 2025 where the year is not the page's."""
    if ref.year == year:
        return catalogue.say("words.week", number=ref.number)
    return catalogue.say("words.week_year", number=ref.number, year=ref.year)


def _spot_rows(data: PlannerData) -> tuple[tuple[str, str, Row], ...]:
    """Return each hotspot's id and name on the page, and its row of the answer."""
    hotspots = data.hotspots
    table, *_ = hotspot_answers(hotspots, window_holds(data.site, hotspots, inputs=""))
    return tuple((spot_id(s), place_name(s.place), row) for s, row in zip(hotspots.spots, table.rows, strict=True))


def _json(value: Any) -> str:
    """Return JSON that is safe inside a script element."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _hours(data: PlannerData) -> tuple[int, int]:
    """Return the first hour that is open on any day, and the one after the last."""
    panels = [data.week.panel, data.history] + ([data.before.panel] if data.before is not None else [])
    hours = np.concatenate([p.hour for p in panels])
    return (int(hours.min()), int(hours.max()) + 1) if hours.size else (0, 24)


def _meta(
    data: PlannerData,
    *,
    weeks: tuple[str, ...],
    maps: Sequence[map_kinds.MapKind],
    hours: tuple[int, int],
    drawing: PlannerDrawing | None,
) -> dict[str, Any]:
    """Return what the script must know beside the packed data."""
    settings = data.site.settings
    confidence = settings.confidence
    grid = None if data.shown is None else cell_counts.grid_of(data.shown.extent)
    has_cells = [w is not None and w.cells is not None for w in (data.week, data.before)]
    return {
        "file": f"{data.site.site_id}-{data.floor.floor_id}-{data.week.ref.iso}",
        "words": sentences(),
        "weeks": weeks,
        "hours": hours,
        "cameras": len(data.cameras),
        "isShared": int(data.is_shared),
        "rows": 1 if data.is_shared else len(data.cameras),
        "byHour": 1 if data.is_shared else len(data.places),
        "able": [int(c) for c in data.places[0].cameras],
        "comparable": _by_row(data, data.comparable),
        "ranked": [int(w is not None and w.is_ranked) for w in (data.week, data.before)],
        "hasBefore": data.before is not None,
        "hasPast": bool(data.history.day.size),
        "hasCells": [int(h) for h in has_cells],
        "notCompared": text_or_none(data.why_not_compared),
        "noViolations": text_or_none(data.why_no_violations),
        "noExposure": text_or_none(data.why_no_exposure),
        "hasSeen": data.seen is not None and grid is not None,
        "changes": [_change_of_log_meta(c) for c in data.changes],
        "places": [_place_meta(data, k, row) for k, row in enumerate(data.places)],
        "spots": [] if grid is None else [_spot_meta(s, grid) for s in data.hotspots.spots],
        "rules": {
            "minDays": settings.min_days,
            "minExposure": settings.min_exposure_h,
            "minEvents": MIN_EVENTS,
            "smallCount": SMALL_COUNT,
            "minWeeks": MIN_HISTORY_WEEKS,
            "aboutSame": settings.about_same_share,
            "stepExtra": PRIOR_EXTRA,
            "weekSd": PRIOR_WEEK_SD,
            "stepDf": PRIOR_DF,
            "correlation": PRIOR_CORRELATION,
            "priorDays": PRIOR_DAYS,
            "correlationMost": LARGEST,
            "mask": mask_of(data.site).below,
            "rough": ROUGH_H,
            "q": quantiles(confidence),
            "q2": quantiles((1 + confidence) / 2),
            "poisson": few_events((1 + confidence) / 2),
        },
        "maps": {m.kind: {"kind": m.kind, "unit": m.unit, "steps": m.steps, "diverging": m.diverging} for m in maps},
        "fixtures": [] if data.shown is None else movable(data.shown.fixtures),
        "floor": data.floor.floor_id,
        "range": f"{data.week.ref.monday}..{data.week.ref.sunday}",
        "freeWay": settings.free_way_m,
        "extent": None if data.shown is None else data.shown.extent,
        "replay": None if data.replay is None else replay_meta(data.replay),
        "size": (drawing.width, drawing.height) if drawing is not None else (100, 100),
        "grid": None if grid is None else _grid_meta(data, grid),
    }


def _by_row(data: PlannerData, flags: Sequence[bool]) -> list[int]:
    """Return flags by camera as flags by row of the panels of hours: for readers one row, of all cameras together."""
    if data.is_shared:
        return [int(all(flag for flag, is_able in zip(flags, data.places[0].cameras, strict=True) if is_able))]
    return [int(flag) for flag in flags]


def _grid_meta(data: PlannerData, grid: cell_counts.CellGrid) -> dict[str, Any]:
    return {
        "x0": grid.x0,
        "y0": grid.y0,
        "nx": grid.n_x,
        "ny": grid.n_y,
        "fine": cell_counts.FINE_M,
        "cellsAcross": round(cell_counts.SQUARE_M / cell_counts.CELL_M),
        "fineAcross": round(cell_counts.SQUARE_M / cell_counts.FINE_M),
        "sigma": data.site.settings.smoothing_m / cell_counts.FINE_M,
        "sigmaRisk": SIGMA_M / cell_counts.FINE_M,
        "leastRisk": MIN_EXPOSURE_H * (cell_counts.FINE_M / RISK_CELL_M) ** 2,
    }


def _place_meta(data: PlannerData, index: int, row: PlaceRow) -> dict[str, Any]:
    hidden = [w.hidden.get(index) if w is not None else None for w in (data.week, data.before)]
    changes: dict[str, Any] = {}
    measured = {"violationRate": row.violation_rate, "close": row.close_time_share, "encounterRate": row.encounter_rate}
    if data.before is not None and data.why_not_compared is None and not any(hidden):
        changes = {name: _change_meta(estimate) for name, estimate in measured.items()}
    return {
        "id": row.place_id,
        "name": row.name,
        "index": index,
        "cameras": [int(c) for c in row.cameras],
        "hidden": [text_or_none(why) for why in hidden],
        "past": int(row.has_history),
        "rows": [1] if data.is_shared else [int(c) for c in row.cameras],
        "close": [_by_row(data, cameras) for cameras in row.close_cameras],
        "report": changes,
        "week": {name: _level_meta(estimate) for name, estimate in measured.items()} if data.is_shared else {},
    }


def _level_meta(estimate: Estimate) -> dict[str, Any]:
    """Return the report's figure of the whole week, which a page for readers shows of a place."""
    reason = text_or_none(estimate.reason)
    return {"rate": estimate.value, "lo": estimate.lo, "hi": estimate.hi, "reason": reason}


def _change_of_log_meta(change: PlannerChange) -> dict[str, Any]:
    return {
        "number": change.number,
        "area": None if change.area is None else f"area:{change.area.area_id}",
        "spans": change_words(change).spans,
        "hasCells": int(change.before is not None and change.before.time is not None),
    }


def _spot_meta(spot: FloorSpot, grid: cell_counts.CellGrid) -> dict[str, Any]:
    """Return a hotspot as a place of whole squares: those whose middle lies in it."""
    x, y = np.meshgrid(grid.x0 + np.arange(grid.n_x) + 0.5, grid.y0 + np.arange(grid.n_y) + 0.5)
    inside = np.zeros(x.shape, dtype=np.bool_)
    for outer, *holes in spot.place.polygons:
        inside |= shapely.contains_xy(shapely.Polygon(outer, holes), x, y)
    name = catalogue.say("planner.hotspot", number=spot.number, place=place_name(spot.place))
    return {"id": spot_id(spot), "name": name, "squares": np.flatnonzero(inside).tolist()}


def _change_meta(estimate: Estimate) -> dict[str, Any] | None:
    """Return the report's change, which the page tells where the whole week is selected."""
    if estimate.change is None or estimate.change_lo is None or estimate.verdict is None:
        return None
    hi = estimate.change_hi
    return {
        "theta": 1 + estimate.change,
        "previous": estimate.previous,
        "lo": 1 + estimate.change_lo,
        "hi": None if hi is None else 1 + hi,
        "verdict": estimate.verdict,
    }


def _figures(data: PlannerData, index: int, row: PlaceRow) -> PlannerFigureRow:
    """Return the report's figures of a place as texts."""
    hidden = data.week.hidden.get(index)
    hidden_before = data.before.hidden.get(index) if data.before is not None else None
    violation_rate, encounter_rate, close = row.violation_rate, row.encounter_rate, row.close_time_share
    if hidden is not None:
        return PlannerFigureRow(name=row.name, violation_rate_likely=reason_text(hidden))
    changes = hidden_before is None and violation_rate.verdict is not None and violation_rate.previous is not None
    clear = violation_rate.verdict in ("clear_fall", "clear_rise")
    verdict = verdict_words(violation_rate) if changes else ""
    return PlannerFigureRow(
        name=row.name,
        violation_rate=fmt.number(violation_rate.value),
        violation_rate_likely=fmt.likely_level(violation_rate) or reason_text(violation_rate.reason),
        close=fmt.percent(close.value),
        close_likely=fmt.likely_level(close, written=fmt.percent) or reason_text(close.reason),
        encounter_rate=fmt.number(encounter_rate.value),
        encounter_rate_likely=fmt.likely_level(encounter_rate) or reason_text(encounter_rate.reason),
        previous=fmt.number(violation_rate.previous) if changes else fmt.MISSING,
        change=f"{verdict}, {fmt.fewer_more(violation_rate.change)}" if changes and clear else verdict,
        change_likely=fmt.likely_change(violation_rate) if changes else "",
    )


def _sizes(drawing: PlannerDrawing | None) -> str:
    """Return the style's part that depends on the floor: the shape of the map."""
    if drawing is None:
        return ""
    w, h = drawing.width, drawing.height
    shape = f"aspect-ratio:{w}/{h};max-width:min(100%,calc(var(--tall)*{w / h:.4f}))"
    return f"#plan{{--u:{w / 900:.3f}}}.map{{{shape}}}\n"
