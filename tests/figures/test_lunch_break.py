"""A break in the opening hours, written as `vsd init --help` writes it: it is neither missing nor an outage."""

from __future__ import annotations

import json
import tomllib
from datetime import UTC, datetime, timedelta
from pathlib import Path

import jsonschema
import pytest
from retention.aged_projects import vsd, write

from vsd_analytics.config.schema import SCHEMA_FILE

DAY = "2026-11-09"


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a shop that records its opening hours, but for half an hour after the break."""
    root = tmp_path_factory.mktemp("shop")
    words = ("--name", "Shop", "--timezone", "UTC", "--opening", "mon-sat 08:00-12:30 14:00-19:00", "--camera", "door")
    vsd(root, "init", "--no-input", *words)
    start = datetime(2026, 11, 9, tzinfo=UTC)
    spans = ((480, 750), (870, 1140))
    times = [start + timedelta(seconds=s) for a, b in spans for s in range(60 * a, 60 * b, 30)]
    frames = [{"v": 1, "camera": "door", "ts": at.isoformat(), "persons": []} for at in times]
    vsd(root, "ingest", str(write(root / "frames.jsonl", frames)))
    return root


def test_the_file_is_as_its_schema_says(shop: Path) -> None:
    config = tomllib.loads((shop / "vsd.toml").read_text(encoding="utf-8"))
    assert config["site"]["opening"] == {"mon-sat": ["08:00-12:30", "14:00-19:00"]}
    jsonschema.validate(config, json.loads(SCHEMA_FILE.read_text(encoding="utf-8")))


def test_the_break_is_closed_and_half_hours_around_it_are_whole(shop: Path) -> None:
    rows = json.loads(vsd(shop, "hours", "--range", DAY, "--json"))["hours"]
    hours = {int(row["start"][11:13]): row for row in rows}
    assert [h for h, row in hours.items() if row["state"] == "closed"] == [*range(8), 13, *range(19, 24)]
    assert (hours[12]["open_s"], hours[12]["state"]) == (1800, "full")
    assert hours[14]["state"] == "partial"
    assert {hours[h]["state"] for h in (*range(8, 13), *range(15, 19))} == {"full"}


def test_only_what_was_open_is_missing(shop: Path) -> None:
    answers = json.loads(vsd(shop, "coverage", "--range", DAY, "--json", code=None))["answers"]
    camera, *_ = answers["recorded"]["rows"]
    assert camera["scheduled_h"] == pytest.approx(9.5)
    assert camera["recorded_h"] == pytest.approx(9.0, abs=0.05)
    (outage,) = answers["camera_outages"]["rows"]
    open_h = outage["open_h"]["value"]
    assert open_h == pytest.approx(0.5, abs=0.02), "of the two hours without frames, one and a half are closed"
