"""Every number that a project's outputs share, by what it is: one key, and the value in each output that has it."""

from __future__ import annotations

import csv
import io
import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest

from vsd_analytics.api.project import open_project
from vsd_analytics.cli import main
from vsd_analytics.config.project import load_site
from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.hotspots import FloorHotspots, days_needed, hotspots
from vsd_analytics.figures.operator_counts import hours
from vsd_analytics.planner.planner_data import PlannerData, planner_pages
from vsd_analytics.render.json_form import as_json
from vsd_analytics.warehouse.warehouse import open_warehouse

PLACE = ("area_m2", "x_m", "y_m", "peak_x_m", "peak_y_m")
"""Where a hotspot is."""
Key = tuple[str, ...]
"""What a number is, and of which place, hour or day."""
IN_RATES = (
    "with used as (select camera_id, hour_start_ms from camera_hours, params "
    "where open_s > 0 and recorded_open_s > 0 and recorded_open_s >= params.partial_hour_share * open_s) "
)


@dataclass(frozen=True, slots=True)
class Outputs:
    """What one project says of one week: numbers by key and output, and the typed answers behind some of them."""

    numbers: Mapping[Key, Mapping[str, Any]]
    page: Mapping[str, Any]
    planner: PlannerData
    hotspots: FloorHotspots
    first_stored: date
    least_ratio: float


def command(root: Path, *arguments: str, now: datetime | None = None) -> Any:
    """Return the JSON that a command prints."""
    clock = [] if now is None else ["--now", now.isoformat()]
    return json.loads(_printed([*clock, "-C", str(root), *arguments, "--json"]))


def _printed(arguments: list[str]) -> str:
    with redirect_stdout(io.StringIO()) as printed, pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code in (0, 1, None), printed.getvalue()
    return printed.getvalue()


def outputs(root: Path, monday: date, folder: Path) -> Outputs:
    """Return what all outputs say of a week of a site of one floor.

    Args:
        root: The project.
        monday: First day of the week.
        folder: Where files are written.
    """
    site, week = load_site(root), f"{monday:%G-W%V}"
    sunday = monday + timedelta(days=6)
    numbers: dict[Key, dict[str, Any]] = defaultdict(dict)

    def note(output: str, values: Iterator[tuple[Key, Any]]) -> None:
        for key, value in values:
            numbers[key][output] = value

    _printed(["-C", str(root), "report", "--week", week, "--format", "json,csv", "--out", str(folder)])
    days = f"{monday}..{sunday}"
    _printed(["-C", str(root), "export", "--duckdb", str(folder / "week.duckdb"), "--range", days])
    page = json.loads((folder / f"{week}.json").read_text(encoding="utf-8"))
    note("page", _page(page))
    for name in ("hours", "areas"):
        rows = list(csv.DictReader((folder / f"{week}-{name}.csv").open(encoding="utf-8-sig")))
        note(f"{name}.csv", _hours_csv(rows) if name == "hours" else _areas_csv(rows))
    note("vsd hours", _command_hours(command(root, "hours", "--week", week), page))
    note("vsd coverage", _coverage(command(root, "coverage", "--week", week)))
    note("vsd groups", _groups(command(root, "groups", "--week", week)))
    for day in (monday + timedelta(days=k) for k in range(7)):
        now = datetime(day.year, day.month, day.day, 23, 59, tzinfo=site.zone)
        note("vsd today", _today(command(root, "today", "--exact", now=now), day))
    note("duckdb", _duckdb(folder / "week.duckdb"))
    note(
        "hotspots.csv",
        _hotspots_csv(list(csv.DictReader((folder / f"{week}-hotspots.csv").open(encoding="utf-8-sig")))),
    )
    note("vsd compare", _compare(command(root, "compare", f"{monday - timedelta(days=7):%G-W%V}", week)))
    note("vsd hours --by area", _hours_by_area(command(root, "hours", "--by", "area", "--week", week)))
    note("vsd heatmap", _heatmap(command(root, "heatmap", "--week", week)))
    with open_warehouse(site, monday, sunday) as warehouse:
        note("sql", _sql(warehouse))
        frame = hours(warehouse)
        note("Python", _python_hours(frame.to_dict("records"), page))
    first, _ = days_needed(site, sunday)
    with open_warehouse(site, first, sunday) as warehouse:
        found = hotspots(warehouse)
        stored = warehouse.rows("select min(local_date) as day from camera_hours where recorded_s > 0")[0]["day"]
    (planner,) = planner_pages(site, monday)
    note("planner", _planner(planner))
    (own,) = planner_pages(site.with_settings(mask_below=0), monday)  # the one for readers sums the whole floor only
    note("planner table", _planner_sums(own))
    note("page changes", _page_changes(page))
    for change in planner.changes:
        if change.answers is not None:
            printed = command(root, "compare", "--change", str(change.number))["answers"]
            note("planner changes", _change_tables({answer.name: as_json(answer) for answer in change.answers}))
            note("vsd compare --change", _change_tables(printed))
            note("Python change", _python_change(open_project(root).change(change.number)))
    note("vsd hotspots", _spots(command(root, "hotspots", "--week", week)))
    note("Python hotspots", _floor_hotspots(found))
    note("planner hotspots", _floor_hotspots(planner.hotspots))
    note("page hotspots", _page_spots(page))
    note("Python table of hotspots", _python_spots(open_project(root).week(week).hotspots))
    return Outputs(numbers, page, planner, found, stored, float(site.settings.hotspot_min_ratio))


def _page(page: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    level = page["level"]
    yield ("counted", "floor"), level["violations"]
    yield ("M0", "floor"), level["violation_rate"]["value"]
    yield ("M7", "floor"), level["encounter_rate"]["value"]
    yield ("M6", "floor"), level["close_time_share"]["value"] if level["close_time_share"] else None
    yield ("recorded share",), page["coverage"]["share"]
    by_day: dict[str, list[int | None]] = defaultdict(list)
    for cell in page["when"]["cells"]:
        if cell["state"] in ("closed", "not_over"):
            continue
        if not (cell["is_masked"] or cell["is_held_back"]):
            yield ("hour", _utc(cell["start"])), cell["violations"]
        by_day[cell["day"]].append(0 if cell["state"] == "no_data" else cell["violations"])
    for day, counts in by_day.items():
        if None not in counts and any(counts):
            yield ("day", day), sum(n for n in counts if n is not None)
    for area in page["areas"]:
        yield from _area(
            area["area_id"] or "rest", area["counted"], area["violation_rate"]["value"], area["encounter_rate"]["value"]
        )
        close = area["close_time_share"]
        yield ("M6", area["area_id"] or "rest"), close["value"] if close else None
    [between] = page["answers"]["between_groups"]["rows"]
    if between["between_share"]["value"] is not None:
        yield ("M9",), between["between_share"]["value"]
        yield ("M9 of",), between["n_violations"]["value"]


def _area(area: str, counted: Any, often: Any, risky: Any) -> Iterator[tuple[Key, Any]]:
    yield ("counted", area), counted
    yield ("M0", area), often
    yield ("M7", area), risky


def _utc(start: str) -> str:
    return str(round(datetime.fromisoformat(start).timestamp()))


def _hours_csv(rows: list[dict[str, str]]) -> Iterator[tuple[Key, Any]]:
    for row in rows:
        if row["violations"] and row["violations"].replace(".", "").isdigit():
            yield ("hour", _utc(row["start"])), float(row["violations"])


def _areas_csv(rows: list[dict[str, str]]) -> Iterator[tuple[Key, Any]]:
    for row in rows:
        if row["counted"].isdigit():
            yield ("counted", row["area"] or "rest"), int(row["counted"])


def _shown(page: Mapping[str, Any]) -> set[str]:
    return {_utc(c["start"]) for c in page["when"]["cells"] if c["violations"] is not None}


def _command_hours(told: Mapping[str, Any], page: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    yield from _python_hours(told["hours"], page)


def _python_hours(rows: Any, page: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    shown = _shown(page)
    for row in rows:
        if row["open_s"] == 3600 and _utc(row["start"]) in shown:  # all violations of the hour are in opening hours
            yield ("hour", _utc(row["start"])), row["n_violations"]


def _coverage(told: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    [whole] = [row for row in told["answers"]["recorded"]["rows"] if row["camera_id"] is None]
    yield ("recorded share",), whole["recorded_share"]["value"]


def _groups(told: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    [together] = told["answers"]["together"]["rows"]
    if together["between_share"]["value"] is not None:
        yield ("M9",), together["between_share"]["value"]
        yield ("M9 of",), together["n_violations"]["value"]


def _today(told: Mapping[str, Any], day: date) -> Iterator[tuple[Key, Any]]:
    (card,) = told["today"]
    answers = {name: answer["rows"] for name, answer in card["answers"].items()}
    [so_far] = [row for row in answers["today_days"] if row["local_date"] == str(day)]
    if so_far["n_violations"]["value"]:
        yield ("day", str(day)), so_far["n_violations"]["value"]
    zone = datetime.fromisoformat(card["at"]).tzinfo
    for row in answers["today_hours"]:
        if row["local_date"] == str(day) and row["n_violations"]["value"] is not None:
            start = datetime(day.year, day.month, day.day, row["local_hour"], tzinfo=zone)
            yield ("hour", str(round(start.timestamp()))), row["n_violations"]["value"]


def _duckdb(path: Path) -> Iterator[tuple[Key, Any]]:
    with duckdb.connect(str(path), read_only=True) as connection:
        for counted, often, close, recorded in connection.execute(
            "select violations, violations_per_open_h, close_time_share, recorded_share from weeks"
        ).fetchall():
            yield ("counted", "floor"), counted
            yield ("M0", "floor"), often
            yield ("M6", "floor"), close
            yield ("recorded share",), recorded
        for row in connection.execute(
            "select coalesce(area_id, 'rest'), violations, violations_per_open_h, violations_per_person_h from areas"
        ).fetchall():
            yield from _area(*row)
        for start, n in connection.execute(
            "select epoch(start_utc)::bigint, violations from hours where violations is not null"
        ).fetchall():
            yield ("hour", str(start)), n


def _sql(warehouse: Any) -> Iterator[tuple[Key, Any]]:
    [row] = warehouse.rows(
        IN_RATES
        + "select sum(n_violations_open) as n from camera_hours inner join used using (camera_id, hour_start_ms)"
    )
    yield ("counted", "floor"), row["n"]
    for row in warehouse.rows(
        IN_RATES + "select coalesce(area_id, 'rest') as area, sum(n_violations_open) as n, "
        "sum(violation_open_s) / nullif(sum(exposure_open_s), 0) as share "
        "from area_hours inner join used using (camera_id, hour_start_ms) group by all"
    ):
        yield ("counted", row["area"]), row["n"]
        yield ("M6", row["area"]), row["share"]
    for row in warehouse.rows(
        "select coalesce(area_id, 'rest') as area, sum(n_violations_open) as n from area_hours group by all"
    ):
        yield ("in opening hours", row["area"]), row["n"]
    [row] = warehouse.rows("select sum(violation_records) as n from hours")
    yield ("violation records",), row["n"]
    for row in warehouse.rows("select hour_start_ms, n_violations_open as n from hours where n_violations_open > 0"):
        yield ("hour", str(row["hour_start_ms"] // 1000)), row["n"]


def _hotspots_csv(rows: list[dict[str, str]]) -> Iterator[tuple[Key, Any]]:
    for row in rows:
        if row["kind"] == "tested" and row["ratio"]:
            for name in ("excess_ratio", "excess_min_per_week", "peak_x_m", "peak_y_m"):
                yield ("hotspot", row["number"], name), float(row["ratio" if name == "excess_ratio" else name])


def _compare(told: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    for place in told["answers"]["compared_places"]["rows"]:
        name = "floor" if place["kind"] == "floor" else place["area_id"] or "rest"
        yield ("counted", name), round(place["n_violations_after"]["value"])
        rates = {"M0": "violations_per_open_h", "M7": "violations_per_person_h", "M6": "close_time_share"}
        for metric, rate in rates.items():
            yield (metric, name), place[f"{rate}_after"]["value"]


def _hours_by_area(told: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    sums: dict[str, int] = defaultdict(int)
    for row in told["hours"]:
        sums[row["area_id"] or "rest"] += row["n_violations"] or 0
    for area, n in sums.items():
        yield ("in opening hours", area), n


def _heatmap(told: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    yield ("violation records",), sum(cell["records"] for cell in told["cells"])


def _place(place_id: str) -> str:
    return place_id.removeprefix("area:")


def _planner(planner: PlannerData) -> Iterator[tuple[Key, Any]]:
    for row in planner.places:
        yield ("M0", _place(row.place_id)), row.violation_rate.value
        yield ("M7", _place(row.place_id)), row.encounter_rate.value
        yield ("M6", _place(row.place_id)), row.close_time_share.value


def _planner_sums(planner: PlannerData) -> Iterator[tuple[Key, Any]]:
    """Return the shares that the page's script makes of its sums, and the counts."""
    panel = planner.week.panel
    for k, row in enumerate(planner.places):
        cameras = np.array(row.close_cameras[0])
        used = panel.is_counted & cameras[:, None]
        time = float(panel.exposure_ms[k][used].sum())
        if time and k not in planner.week.hidden:
            yield ("M6", _place(row.place_id)), float(panel.close_ms[k][used].sum()) / time
            yield ("counted", _place(row.place_id)), int(panel.n[k].sum())


EFFECTS = {"close": "close_time_share", "burden": "close_min_per_open_h", "violation_rate": "violations_per_open_h"}
"""Figures of a logged change on a page and in Python, and the row of `change_effects` that has each."""


def _change_tables(answers: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    """Return what the answers on a logged change say, as the planner and `vsd compare --change` have them."""
    [entry] = answers["logged_change"]["rows"]
    number = str(entry["entry"])
    yield ("change", number, "outcome"), entry["outcome"]
    yield ("change", number, "weeks"), str([entry["before_first"], entry["after_last"]])
    for row in answers["change_so_far"]["rows"]:
        yield ("change", number, "verdict"), row["so_far_verdict"]
        yield from _change(number, "running", row["so_far_change"])
        yield ("change", number, "e_value"), row["e_value"]["value"]
        yield ("change", number, "n_watched"), row["n_weeks_after"]
        yield ("change", number, "taken_up"), row["taken_up_share"]["value"]
    for name, effect in EFFECTS.items():
        for row in answers["change_effects"]["rows"]:
            if row["effect"] == effect:
                yield from _change(number, name, row["effect_change"])
    for row in answers["change_parts"]["rows"]:
        if row["part"] == "floor":
            yield from _change(number, "net", row["part_change"])
    for row in answers["change_places"]["rows"]:
        if row["place"] == "area":
            yield from _change(number, "people", row["place_people_change"])
    for row in answers["change_receivers"]["rows"]:
        yield from _change(number, f"received by {row['name']}", row["received_people_change"])


def _change(number: str, name: str, value: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    if value["value"] is not None:
        for part in ("value", "lo", "hi"):
            yield ("change", number, name, part), value[part]


def _page_changes(page: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    for change in page["change_effects"]:
        number = str(change["number"])
        yield ("change", number, "outcome"), change["outcome"]
        if change["before"] and change["after"]:
            yield ("change", number, "weeks"), str([change["before"][0], change["after"][1]])
        for name in ("running", "net", "people", *EFFECTS):
            estimate = change[name] or {"change": None}
            if estimate["change"] is not None:
                ends = {"lo": estimate["change_lo"], "hi": estimate["change_hi"]}
                yield from _change(number, name, {"value": estimate["change"], **ends})
        if change["running"]:
            yield ("change", number, "verdict"), change["running"]["verdict"]
            for key, name in (("e_value", "e_value"), ("n_watched", "n_watched"), ("taken_up", "moved_elsewhere")):
                yield ("change", number, key), change[name]
        for area in change["receivers"]:
            ends = {"value": area["change"], "lo": area["change_lo"], "hi": area["change_hi"]}
            yield from _change(number, f"received by {area['area_name']}", ends)


def _python_change(found: BeforeAfterFigure) -> Iterator[tuple[Key, Any]]:
    number = str(found.number)
    yield ("change", number, "outcome"), found.outcome
    net = None if found.floor is None else found.floor.net
    effects = {"running": found.running, "net": net, "people": found.people}
    for name, effect in (effects | {name: getattr(found, name) for name in EFFECTS}).items():
        if effect is not None and effect.value is not None:
            ends = {part: None if (n := getattr(effect, part)) is None else n - 1 for part in ("value", "lo", "hi")}
            yield from _change(number, name, ends)
    if found.running is not None:
        yield ("change", number, "verdict"), found.running.verdict
        yield ("change", number, "e_value"), found.running.e_value


def _spots(told: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    yield ("hotspots from",), told["first"]
    yield from _spot_rows(told["answers"]["hotspots"]["rows"])


def _page_spots(page: Mapping[str, Any]) -> Iterator[tuple[Key, Any]]:
    yield from _spot_rows(page["answers"]["hotspots"]["rows"])


def _spot_rows(rows: Any) -> Iterator[tuple[Key, Any]]:
    for row in rows:
        for name in ("excess_ratio", "n_violations", "excess_min_per_week"):
            if row[name]["value"] is not None:
                yield ("hotspot", str(row["rank"]), name), row[name]["value"]
        for name in PLACE:
            yield ("hotspot", str(row["rank"]), name), row[name]


def _python_spots(table: Any) -> Iterator[tuple[Key, Any]]:
    for row in table:
        for name in ("excess_ratio", "n_violations", "excess_min_per_week", *PLACE):
            yield ("hotspot", str(row["rank"]), name), row[name]


def _floor_hotspots(found: FloorHotspots) -> Iterator[tuple[Key, Any]]:
    yield ("hotspots from",), str(found.first)
    for spot in found.spots:
        for name, field in (("excess_ratio", "ratio"), ("n_violations", "n")):
            yield ("hotspot", str(spot.number), name), getattr(spot, field)
        yield ("hotspot", str(spot.number), "excess_min_per_week"), spot.excess_min_per_week
        for name in PLACE:
            yield ("hotspot", str(spot.number), name), getattr(spot.place, name)
