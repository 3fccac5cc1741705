"""The machine-readable forms of the page: JSON with every figure, its JSON Schema, and CSV tables."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
from collections import ChainMap
from typing import Any, Final

import msgspec

from vsd_analytics.answer import Answers, Reason
from vsd_analytics.figures.week import model_estimate, model_map, model_recording, model_sections, results
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import SpotCard
from vsd_analytics.figures.week.results import AreaRow, HourCell
from vsd_analytics.render.json_form import ANSWERS_SCHEMA, as_json, rounded_answers
from vsd_analytics.render.json_form import from_json as answer_from_json
from vsd_analytics.render.significant import rounded as rounded_json
from vsd_analytics.report.model import week, week_agenda
from vsd_analytics.report.model.older_files import brought_up_to_date
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.figures_by_id import figures_by_id
from vsd_analytics.report.pages.story import finish
from vsd_analytics.store.spreadsheet import safe_cell
from vsd_analytics.wording.reasons import decode_reason, reason_schema, reason_text

HOURS_COLUMNS: Final = ("site", "floor", "area", "start", "open", "recorded_minutes", "violations", "state")
AREAS_COLUMNS: Final = (
    *("site", "floor", "week", "area", "name", "counted", "per_open_hour", "lo", "hi", "previous"),
    *(
        "change",
        "change_lo",
        "change_hi",
        "verdict",
        "share",
        "exposure_h",
        "per_person_hour",
        "recorded_share",
        "state",
    ),
    *("per_person_hour_lo", "per_person_hour_hi", "per_person_hour_state"),
)


HOTSPOTS_COLUMNS: Final = (
    *("site", "floor", "week", "number", "name", "area", "peak_x_m", "peak_y_m", "kind", "per_open_hour", "lo", "hi"),
    *(
        "ratio",
        "ratio_lo",
        "ratio_hi",
        "excess_min_per_week",
        "new",
        "since",
        "days_present",
        "recorded_share",
        "sureness",
    ),
    *("state", "ratio_state"),
)


def rounded(report: WeekReport) -> WeekReport:
    """Return the report with every float rounded to 6 significant digits, as the JSON file has them."""
    whole: list[Reason | Answers] = []

    def put(value: Any) -> Any:
        if not isinstance(value, Reason | Answers):
            return _plain(value)
        whole.append(rounded_answers(value) if isinstance(value, Answers) else value)
        return len(whole) - 1

    def take(_kind: type, index: int) -> Reason | Answers:
        return whole[index]

    # a reason stays itself, code and values, and so does an answer: they go round by their places in a list
    plain = rounded_json(msgspec.to_builtins(report, enc_hook=put))
    return msgspec.convert(plain, WeekReport, dec_hook=take)


def to_json(report: WeekReport) -> bytes:
    """Return the JSON text of the report: sorted keys, floats with 6 significant digits, one trailing newline.

    A missing number is null beside a `state`, never 0. The sentences of the page are under `story`.
    """
    data = rounded_json(_builtins(finish(rounded(report))))
    return (json.dumps(data, sort_keys=True, ensure_ascii=False, allow_nan=False, indent=1) + "\n").encode()


def figures_json(report: WeekReport) -> dict[str, Any]:
    """Return all figures of a report by catalogue id as JSON can hold them: what HTTP and the DuckDB file give."""
    plain: dict[str, Any] = rounded_json(msgspec.to_builtins(figures_by_id(rounded(report)), enc_hook=_plain))
    return plain


def from_json(data: bytes) -> WeekReport:
    """Return the report that a JSON text was made from, also one of version 1; rendering it gives the same page."""
    decoded = brought_up_to_date(msgspec.json.decode(data))
    return msgspec.convert(decoded, WeekReport, dec_hook=_decode)


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of the JSON text; each property has its help, unit and catalogue id."""
    schema = msgspec.json.schema(WeekReport, schema_hook=_schema_of)
    kinds = ChainMap(
        *(vars(m) for m in (week, week_agenda, results, model_estimate, model_map, model_recording, model_sections))
    )
    for name, definition in schema["$defs"].items():
        kind = kinds[name]
        for field in dataclasses.fields(kind):
            property_ = definition["properties"][field.name]
            metadata = dict(field.metadata)
            if "$ref" in property_:
                property_ = definition["properties"][field.name] = {"allOf": [property_]}
            property_["description"] = metadata.pop("help")
            property_ |= {f"x-{key}": value for key, value in metadata.items()}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": week.SCHEMA, "title": "Weekly report"}
    return {**head, **schema}


def to_csv(report: WeekReport) -> dict[str, str]:
    """Return the CSV tables by file name: one row per hour of the floor, per area, per numbered spot.

    `hours.csv` has one row per local hour with the area `all`; a count too small to print is empty with the state
    `masked`, one that would tell such a count with the state `held_back`. Times are ISO 8601 with offset. Names that a
    spreadsheet would take for a formula get an apostrophe before them. Each rate has the ends of its 95 %
    interval (`lo`, `hi`) and its `state`; counts and shares of counts are exact and have none.
    """
    report = rounded(report)
    place = (report.site.site_id, report.site.floor_id)
    hours = [(*place, "all", *_hour(c)) for c in report.when.cells]
    areas = [(*place, report.week.iso, *_area(a)) for a in report.areas]
    spots = [(*place, report.week.iso, *row) for row in _spots(report)]
    return {
        "hours.csv": _csv(HOURS_COLUMNS, hours),
        "areas.csv": _csv(AREAS_COLUMNS, areas),
        "hotspots.csv": _csv(HOTSPOTS_COLUMNS, spots),
    }


def _hour(cell: HourCell) -> tuple[Any, ...]:
    is_open = cell.state != "closed"
    minutes = None if cell.share is None or not is_open else round(cell.share * 60, 1)
    state = "masked" if cell.is_masked else "held_back" if cell.is_held_back else cell.state
    return cell.start.isoformat(), "yes" if is_open else "no", minutes, cell.violations, state


def _area(row: AreaRow) -> tuple[Any, ...]:
    if row.is_masked or row.is_held_back:
        state = "masked" if row.is_masked else "held_back"
        return row.area_id or "", safe_cell(row.name), *(None,) * 12, row.recorded_share, state, None, None, state
    violation_rate, encounter_rate = row.violation_rate, row.encounter_rate or Estimate(value=None)
    return (
        row.area_id or "",
        safe_cell(row.name),
        row.counted,
        *(
            violation_rate.value,
            violation_rate.lo,
            violation_rate.hi,
            violation_rate.previous,
            violation_rate.change,
            violation_rate.change_lo,
            violation_rate.change_hi,
        ),
        violation_rate.verdict,
        row.share,
        row.exposure_h,
        encounter_rate.value,
        row.recorded_share,
        violation_rate.state,
        *(
            encounter_rate.lo,
            encounter_rate.hi,
            row.encounter_rate.state if row.encounter_rate is not None else "not_measurable",
        ),
    )


def _spots(report: WeekReport) -> list[tuple[Any, ...]]:
    """Return a row per numbered spot; the rate of an area that may not be printed is not printed here either."""
    if report.spots is None:
        return []
    hidden = {a.area_id for a in report.areas if a.is_masked or a.is_held_back}
    return [_spot(c, report.spots.kind, is_rate_shown=c.area_id not in hidden) for c in report.spots.cards]


def _spot(card: SpotCard, kind: str, *, is_rate_shown: bool) -> tuple[Any, ...]:
    nothing = Estimate(value=None)
    violation_rate = card.violation_rate if card.violation_rate is not None and is_rate_shown else nothing
    ratio, seen = card.ratio or nothing, card.evidence
    return (
        *(card.number, safe_cell(card.name), card.area_id, *(card.at or (None, None)), kind),
        *(
            violation_rate.value,
            violation_rate.lo,
            violation_rate.hi,
            ratio.value,
            ratio.lo,
            ratio.hi,
            card.excess_min_per_week,
        ),
        None if card.is_new is None else "yes" if card.is_new else "no",
        card.since.isoformat() if card.since else None,
        *((seen.days_present, seen.recorded_share, seen.sureness) if seen else (None, None, None)),
        *(
            (violation_rate.state if is_rate_shown else "held_back") if card.violation_rate is not None else None,
            _state(card.ratio),
        ),
    )


def _state(estimate: Estimate | None) -> str | None:
    return None if estimate is None else estimate.state


def _csv(columns: tuple[str, ...], rows: list[tuple[Any, ...]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(["" if v is None else v for v in row] for row in rows)
    return out.getvalue()


def _decode(kind: type, value: Any) -> Any:
    """Return what msgspec has no type for: answers, and reasons as their sentences."""
    if kind is Answers:
        return Answers(answer_from_json(answer) for answer in value.values())
    return decode_reason(kind, value)


def _schema_of(kind: type) -> dict[str, Any]:
    return ANSWERS_SCHEMA if kind is Answers else reason_schema(kind)


def _builtins(report: WeekReport) -> Any:
    """Return dicts, lists, numbers and ISO texts; numpy scalars and pandas instants become plain ones."""
    return msgspec.to_builtins(report, enc_hook=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, Answers):
        return {answer.name: as_json(answer) for answer in value}
    if isinstance(value, Reason):
        return reason_text(value)
    for convert in ("item", "to_pydatetime"):
        if hasattr(value, convert):
            return getattr(value, convert)()
    raise TypeError(f"a report cannot hold {type(value).__name__}")
