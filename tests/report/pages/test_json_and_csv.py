"""JSON and CSV files: valid, stable, complete, and honest about what is missing."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import jsonschema
import numpy as np
import pandas as pd
import pytest
from report import sample_sections as sections
from report import sample_weeks as weeks
from report.sample_space import five_areas

from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.render.significant import significant
from vsd_analytics.report.pages.json_and_csv import (
    from_json,
    json_schema,
    rounded,
    to_csv,
    to_json,
)
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.store.spreadsheet import safe_cell


@pytest.mark.parametrize("name", list(weeks.ALL))
def test_the_json_file_is_valid_and_renders_the_same_page(name: str) -> None:
    report = weeks.ALL[name]()
    data = to_json(report)
    jsonschema.Draft202012Validator(json_schema()).validate(json.loads(data))
    again = from_json(data)
    assert render_html(again) == render_html(report)
    assert to_json(again) == data


def test_a_file_of_version_1_has_no_answers_and_its_page_says_so() -> None:
    data = json.loads(to_json(five_areas()))
    del data["answers"]
    data["figures"]["M39"] = {**data["figures"]["M0"], "rows": [{"place": "Till", "key": "mean", "value": 1.2}]}
    page = render_html(from_json(json.dumps(data).encode()))
    assert "The file is of version 1" in page
    assert 'id="waiting"' not in page
    assert "The file is of version 1" not in render_html(five_areas())


def test_the_schema_documents_itself_and_refuses_what_is_wrong() -> None:
    schema = json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    estimate = schema["$defs"]["Estimate"]["properties"]
    assert estimate["change"]["description"].startswith("Relative change")
    assert estimate["change"]["x-unit"] == "share"
    assert schema["$defs"]["Level"]["properties"]["violation_rate"]["x-metric"] == "M0"
    wrong = json.loads(to_json(weeks.normal()))
    wrong["level"]["violation_rate"]["verdict"] = "improved"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(schema).validate(wrong)


def test_missing_is_null_with_a_state() -> None:
    data = json.loads(to_json(weeks.exposure_unknown()))
    assert data["level"]["encounter_rate"] | {"reason": None} == {
        **dict.fromkeys(("value", "lo", "hi", "previous", "change", "change_lo", "change_hi", "verdict")),
        **{"hours_compared": None, "state": "not_measurable", "reason": None},
    }
    assert data["figures"]["M12"]["value"] is None
    assert data["figures"]["M12"]["state"] == "not_measurable"


def test_keys_are_sorted_and_floats_have_six_digits() -> None:
    report = weeks.normal()
    report = replace(report, level=replace(report.level, violation_rate=Estimate(value=1 / 3, lo=123456.789)))
    data = to_json(report)
    assert b'"value": 0.333333' in data
    assert b'"lo": 123457.0' in data
    loaded = json.loads(data)
    assert list(loaded) == sorted(loaded)
    assert significant(float("nan")) is None
    assert rounded(rounded(report)) == rounded(report)


def test_hours_have_one_row_each_and_no_invented_zero() -> None:
    report = weeks.normal()
    rows = list(csv.DictReader(io.StringIO(to_csv(report)["hours.csv"])))
    assert list(rows[0]) == ["site", "floor", "area", "start", "open", "recorded_minutes", "violations", "state"]
    assert len(rows) == 168
    by_start = {r["start"]: r for r in rows}
    assert by_start["2026-11-11T08:00:00+01:00"]["violations"] == ""
    assert by_start["2026-11-11T08:00:00+01:00"]["state"] == "no_data"
    assert by_start["2026-11-09T08:00:00+01:00"]["violations"] == ""
    assert by_start["2026-11-09T08:00:00+01:00"]["state"] == "masked"
    assert by_start["2026-11-09T20:00:00+01:00"]["violations"] == "0"
    assert by_start["2026-11-09T03:00:00+01:00"]["open"] == "no"
    assert sum(r["open"] == "yes" for r in rows) == 86


def test_areas_hold_the_figures_and_hide_what_is_masked() -> None:
    rows = {r["name"]: r for r in csv.DictReader(io.StringIO(to_csv(weeks.masked())["areas.csv"]))}
    assert float(rows["Main entrance"]["change"]) == pytest.approx(-0.43)
    assert rows["Main entrance"]["verdict"] == "clear_fall"
    assert {"per_person_hour_lo", "per_person_hour_hi", "per_person_hour_state"} <= rows["Main entrance"].keys()
    shown = {k: v for k, v in rows["Pharmacy counter"].items() if v}
    assert set(shown) == {"site", "floor", "week", "area", "name", "recorded_share", "state", "per_person_hour_state"}
    assert shown["state"] == "masked"


def test_hotspots_are_the_cards_and_hide_the_rate_of_an_area_that_is_hidden() -> None:
    report = sections.MORE["complete"]()
    assert report.spots is not None
    cards = report.spots.cards
    rows = list(csv.DictReader(io.StringIO(to_csv(report)["hotspots.csv"])))
    assert [(int(r["number"]), r["name"], r["area"]) for r in rows] == [
        (c.number, c.name, c.area_id or "") for c in cards
    ]
    card = next(c for c in cards if c.violation_rate is not None and c.area_id is not None)
    row = rows[cards.index(card)]
    assert card.violation_rate is not None
    assert float(row["per_open_hour"]) == pytest.approx(card.violation_rate.value, rel=1e-5)
    assert row["state"] == card.violation_rate.state
    areas = tuple(replace(a, is_held_back=a.area_id == card.area_id) for a in report.areas)
    hidden = list(csv.DictReader(io.StringIO(to_csv(replace(report, areas=areas))["hotspots.csv"])))[cards.index(card)]
    assert (hidden["per_open_hour"], hidden["lo"], hidden["hi"], hidden["state"]) == ("", "", "", "held_back")
    assert to_csv(weeks.ALL["no_data"]())["hotspots.csv"].count("\n") == 1


def test_no_name_becomes_a_formula() -> None:
    assert safe_cell("=1+1") == "'=1+1"
    assert safe_cell("Aisle 2") == "Aisle 2"
    text = to_csv(weeks.hostile())["areas.csv"]
    cells = [c for row in csv.reader(io.StringIO(text)) for c in row]
    assert not [c for c in cells if c.startswith("=")]


def test_numpy_scalars_become_plain_numbers() -> None:
    report = weeks.normal()
    level = replace(report.level, violation_rate=Estimate(value=np.float64(12.5)), violations=np.int64(7))
    made = pd.Timestamp("2026-11-16 06:00", tz="Europe/Rome")
    data = json.loads(to_json(replace(report, level=level, generated_at=made)))
    assert data["generated_at"] == "2026-11-16T06:00:00+01:00"
    assert (data["level"]["violation_rate"]["value"], data["level"]["violations"]) == (12.5, 7)
