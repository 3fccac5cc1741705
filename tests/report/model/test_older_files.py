"""A JSON file that an older version wrote is the same report with the names of today."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.report.model.older_files import OLD_VERDICTS, RENAMED, brought_up_to_date
from vsd_analytics.report.model.week import SCHEMA, WeekReport
from vsd_analytics.report.pages.json_and_csv import from_json, to_json
from vsd_analytics.site_index.read_reports import read_report_json

OF_1_1 = Path(__file__).parents[2] / "released" / "week-of-1.1.0.json.gz"
"""The week of `1.1.0.zip`, as version 1.1.0 wrote it with `--format json`."""
BEFORE = {new: old for old, new in RENAMED.items()}


def as_version_1(value: Any) -> Any:
    """Return a decoded report with the names of version 1, so that its way back can be tried on every week."""
    if isinstance(value, dict):
        return {BEFORE.get(key, key): as_version_1(inner) for key, inner in value.items()}
    return [as_version_1(inner) for inner in value] if isinstance(value, list) else value


@pytest.mark.parametrize("make", [*weeks.ALL.values(), sections.complete, sections.twelve_weeks, sections.refused])
def test_every_week_in_the_names_of_version_1_is_read_as_it_was(make: Callable[[], WeekReport]) -> None:
    today = to_json(make())
    old = json.dumps({**as_version_1(json.loads(today)), "schema": "vsd.report.week/1"}).encode()
    assert b'"often"' in old
    assert from_json(old) == from_json(today)


def test_a_file_of_version_1_1_is_read_with_all_its_figures(tmp_path: Path) -> None:
    data = gzip.decompress(OF_1_1.read_bytes())
    then, now = json.loads(data), from_json(data)
    assert now.level.violation_rate.value == then["level"]["often"]["value"] > 0
    assert now.level.encounter_rate.value == then["level"]["risky"]["value"]
    assert now.level.close_time_share is not None
    assert now.level.close_time_share.value == then["level"]["close_share"]["value"]
    assert [a.violation_rate.value for a in now.areas] == [a["often"]["value"] for a in then["areas"]]
    assert now.schema == SCHEMA
    path = tmp_path / f"{now.week.iso}.json"
    path.write_bytes(data)
    assert read_report_json(path).level.violation_rate.value == now.level.violation_rate.value


def test_a_file_of_today_is_left_as_it_is_whatever_its_keys_are() -> None:
    today = {"schema": SCHEMA, "often": 1, "verdict": "no_clear_change"}
    assert brought_up_to_date(today) is today


@pytest.mark.parametrize("old", OLD_VERDICTS)
def test_old_verdicts_are_read_as_those_of_today(old: str) -> None:
    read = brought_up_to_date({"schema": "vsd.report.week/1", "level": {"often": {"verdict": old}}})
    assert read["level"]["violation_rate"]["verdict"] == OLD_VERDICTS[old]
