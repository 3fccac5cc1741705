"""Numbers that the JSON file of a report has twice: in a section, as the page words it, and in an answer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

ENDS = ("value", "lo", "hi")
Pair = tuple[str, Any, Any]
"""What a number is, its value in the section, its value in the answer."""


def repeated(page: Mapping[str, Any]) -> Iterator[Pair]:
    """Yield each number that a section repeats, with that of its answer."""
    rows = {name: answer["rows"] for name, answer in page["answers"].items()}
    yield from _level(page["level"], rows)
    yield from _areas(page["areas"], rows)
    yield "coverage", page["coverage"]["share"], rows["recording"][0]["recorded_share"]["value"]
    yield from _trend(page["trend"], rows)
    yield from _readings(page["readings"], rows)
    yield from _outlook(page["outlook"], rows)
    yield from _changes(page["change_effects"], rows)


def _estimate(name: str, section: Mapping[str, Any] | None, value: Mapping[str, Any]) -> Iterator[Pair]:
    for end in ENDS:
        yield f"{name}.{end}", None if section is None else section[end], value[end]


def _level(level: Mapping[str, Any], rows: Mapping[str, Any]) -> Iterator[Pair]:
    [violations], [close], [people] = rows["violations"], rows["close_time"], rows["people"]
    for name in ("violation_rate", "encounter_rate"):
        yield from _estimate(f"level.{name}", level[name], violations[name])
    yield from _estimate("level.close_time_share", level["close_time_share"], close["close_time_share"])
    yield "level.people", level["people"]["value"], people["people"]["value"]
    yield "level.violations", level["violations"], violations["n_violations"]["value"]
    yield "level.exposure_h", level["exposure_h"], violations["exposure_h"]


def _areas(areas: list[Any], rows: Mapping[str, Any]) -> Iterator[Pair]:
    answered = {row["area_id"]: row for row in rows["areas"]}
    assert {area["area_id"] for area in areas} == answered.keys()
    for area in areas:
        row, name = answered[area["area_id"]], f"areas.{area['area_id']}"
        for rate in ("violation_rate", "encounter_rate", "close_time_share"):
            yield from _estimate(f"{name}.{rate}", area[rate], row[rate])
        yield f"{name}.exposure_h", area["exposure_h"], row["exposure_h"]
        if area["violation_rate"]["value"] is not None:
            yield f"{name}.share", area["share"], row["rates_share"]["value"]


def _trend(trend: Mapping[str, Any], rows: Mapping[str, Any]) -> Iterator[Pair]:
    answered = {row["week"]: row for row in rows["trend"]}
    for week in trend["weeks"] if trend["state"] == "ok" else ():
        row, name = answered[week["iso"]], f"trend.{week['iso']}"
        for rate, column in (("violation_rate",) * 2, ("encounter_rate",) * 2, ("close", "close_time_share")):
            yield from _estimate(f"{name}.{rate}", week[rate], row[column])
        yield f"{name}.coverage", week["coverage"], row["recorded_share"]["value"]


def _readings(readings: Mapping[str, Any] | None, rows: Mapping[str, Any]) -> Iterator[Pair]:
    answered = {row["reading"]: row for row in rows["readings"]}
    for reading, key in (("all", "all"), ("between", "between_groups")):
        section = None if readings is None else readings[reading]
        if section is not None:
            for rate in ("violation_rate", "encounter_rate"):
                yield from _estimate(f"readings.{reading}.{rate}", section[rate], answered[key][rate])
    if readings is not None:
        yield "readings.between_share", readings["between_share"], rows["between_groups"][0]["between_share"]["value"]


def _outlook(outlook: Mapping[str, Any] | None, rows: Mapping[str, Any]) -> Iterator[Pair]:
    answered = {(row["local_date"], row["local_hour"]): row["violation_rate"] for row in rows["forecast"]}
    for hour in [] if outlook is None else outlook["highest"]:
        yield from _estimate(f"outlook.{hour['day']}", hour, answered[hour["day"], hour["hour"]])


def _changes(changes: list[Any], rows: Mapping[str, Any]) -> Iterator[Pair]:
    answered = {row["entry"]: row for row in rows["changes"]}
    for change in changes:
        row, name = answered[change["number"]], f"change_effects.{change['number']}"
        for effect, column in (("effect", "encounter_rate_ratio"), ("violation_rate", "violation_rate_ratio")):
            estimate, ratio = change[effect], row[column]
            if estimate is not None:
                for end, key in (("value", "change"), ("lo", "change_lo"), ("hi", "change_hi")):
                    is_known = estimate[key] is not None
                    yield f"{name}.{effect}.{end}", 1 + estimate[key] if is_known else None, ratio[end]
