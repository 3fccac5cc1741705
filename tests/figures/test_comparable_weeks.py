"""What may be compared: cameras that measured alike in both weeks; and what the page says of the others."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report import ingested_worlds as w

from vsd_analytics.answer import Reason
from vsd_analytics.config import load_site
from vsd_analytics.figures.comparable import has_other_rules
from vsd_analytics.report.pages.json_and_csv import from_json, to_json
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.store.seals import UnitSeal
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.camera_days import hourly_inputs
from vsd_analytics.warehouse.sealed import SealedRange
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.wording.reasons import reason_text

OLD, NEW = "2026-10-01T00:00:00+01:00", "2026-11-12T08:00:00+01:00"


def busy(day: int, hour: int) -> Mapping[w.Place, int]:
    return {w.QUEUE: 20 + day, w.DOOR: 9 + hour % 3}


def quieter(day: int, hour: int) -> Mapping[w.Place, int]:
    return {w.QUEUE: 10 + day, w.DOOR: 9 + hour % 3}


def pixels(track: str, x: float, y: float) -> dict[str, Any]:
    return {"id": track, "u_px": 100 * x, "v_px": 100 * y}


def calibrate(root: Path, camera: str, *since: tuple[float, str]) -> None:
    """Write calibrations of a camera: metres per hundred pixels, and from when."""
    folder = root / "calibration"
    folder.mkdir(parents=True, exist_ok=True)
    entries = []
    for k, (scale, start) in enumerate(since):
        np.savetxt(folder / f"{camera}-{k}.txt", np.diag([scale / 100, 0.01, 1.0]))
        entries.append(f'[[calibration]]\nhomography = "calibration/{camera}-{k}.txt"\nfrom = {start}\n')
    (folder / f"{camera}.toml").write_text("".join(entries), encoding="utf-8")


def text_of(page: str) -> str:
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", page)).split())


def toml(**options: Any) -> str:
    """Return a site that is open for an hour a day, so that its weeks are soon made."""
    return w.toml(opening='{ mon-sun = "09:00-10:00" }', **options)


def two_weeks(counts: Callable[[int, int], Mapping[w.Place, int]] = busy, **options: Any) -> list[Any]:
    return [w.messages(busy, monday=w.BEFORE, hours=(9, 10), **options), w.messages(counts, hours=(9, 10), **options)]


def test_camera_calibrated_anew_is_left_out_of_the_comparison_and_named(tmp_path: Path) -> None:
    calibrate(tmp_path, "cam-1", (1.0, OLD), (1.3, NEW))
    calibrate(tmp_path, "cam-2", (1.0, OLD))
    config = toml(cameras=("cam-1", "cam-2"))
    streams = [*two_weeks(say=pixels), *two_weeks(quieter, say=pixels, camera="cam-2")]
    both = w.report(w.world(tmp_path, config, *streams))
    calibrate(tmp_path / "alone", "cam-2", (1.0, OLD))
    streams = two_weeks(quieter, say=pixels, camera="cam-2")
    alone = w.report(w.world(tmp_path / "alone", toml(cameras=("cam-2",)), *streams))
    assert both.state == "normal"
    assert [reason_text(c.not_compared) for c in both.coverage.cameras] == [
        "it was recalibrated on Thu 12 Nov, 08:00",
        "",
    ]
    violation_rate, other = both.level.violation_rate, alone.level.violation_rate
    assert violation_rate.value is not None
    assert other.value is not None
    assert violation_rate.value > 1.5 * other.value, "the level is of both cameras"
    assert (violation_rate.change, violation_rate.change_lo, violation_rate.verdict) == (
        other.change,
        other.change_lo,
        other.verdict,
    )
    page = text_of(render_html(both))
    assert "in hours recorded in both. Without Camera 1: it was recalibrated on Thu 12 Nov, 08:00." in page
    assert both.story is not None
    told = both.story.things[-1]
    assert (told.kind, told.title, told.target) == ("distrust", "Camera 1 is not compared", "changed")
    assert told.text == "It was recalibrated on Thu 12 Nov, 08:00. The changes come from the other cameras."
    assert told.text in page
    assert from_json(to_json(both)).coverage.cameras[0].not_compared == Reason(
        "text", text="it was recalibrated on Thu 12 Nov, 08:00"
    )


def test_new_calibration_that_moves_who_owns_the_floor_leaves_nothing_to_compare(tmp_path: Path) -> None:
    calibrate(tmp_path, "cam-1", (1.0, OLD), (1.3, NEW))
    calibrate(tmp_path, "cam-2", (1.1, OLD))
    config = toml(cameras=("cam-1", "cam-2"), camera="picture_px = [2000, 1500]")
    streams = [*two_weeks(say=pixels), *two_weeks(say=pixels, camera="cam-2")]
    report = w.report(w.world(tmp_path, config, *streams))
    assert report.state == "settings_changed"
    assert report.level.violation_rate.verdict is None


@pytest.mark.parametrize(
    ("calibrations", "say"),
    [
        (((1.0, OLD), (1.1, NEW)), w.person),
        (((1.0, OLD), (1.0, NEW)), pixels),
        (((1.1, OLD),), pixels),
        (((1.0, OLD), (1.1, "2026-11-02T00:00:00+01:00"), (1.2, "2026-11-15T20:00:00+01:00")), pixels),
    ],
    ids=["metres go through none", "the same numbers", "one for all time", "before and after both weeks"],
)
def test_weeks_measured_alike_are_compared(tmp_path: Path, calibrations: Any, say: w.Say) -> None:
    calibrate(tmp_path, "cam-1", *calibrations)
    report = w.report(w.world(tmp_path, toml(), *two_weeks(say=say)))
    assert report.state == "normal"
    assert report.coverage.cameras[0].not_compared is None


def test_recalibrating_all_of_both_weeks_makes_them_comparable_again(tmp_path: Path) -> None:
    calibrate(tmp_path, "cam-1", (1.0, OLD), (1.1, NEW))
    site = w.world(tmp_path, toml(), *two_weeks(say=pixels))
    build(site)
    calibrate(tmp_path, "cam-1", (1.1, OLD))
    assert w.report(load_site(tmp_path)).state == "normal"


def every(seconds: int, messages: Any) -> list[dict[str, Any]]:
    """Return messages thinned out to one in so many seconds."""
    return [m for m in messages if datetime.fromisoformat(m["ts"].replace("Z", "+00:00")).timestamp() % seconds == 0]


def test_another_frame_rate_is_reported_and_compared(tmp_path: Path) -> None:
    before, now = two_weeks()
    report = w.report(w.world(tmp_path, toml(), before, every(40, now)))
    assert report.state == "normal"
    (line,) = [line for line in report.log if line.kind == "detected"]
    assert line.at == w.rome(0, 0)
    assert line.text == (
        "Camera 1: a frame every 40 seconds instead of every 20 seconds. This alone changes counts by a few percent."
    )
    assert line.text in text_of(render_html(report))


def test_the_same_frame_rate_is_not_reported(tmp_path: Path) -> None:
    report = w.report(w.world(tmp_path, toml(), *two_weeks()))
    assert report.log == ()


def numbered(messages: Any, *, without: set[int] = frozenset()) -> list[dict[str, Any]]:  # type: ignore[assignment]
    return [{**m, "seq": i} for i, m in enumerate(messages) if i not in without]


def test_messages_that_never_arrived_are_one_line_of_the_data_section(tmp_path: Path) -> None:
    report = w.report(
        w.world(tmp_path, toml(), numbered(w.messages(busy, hours=(9, 10)), without={5, 1000, 1001, 1002}))
    )
    assert (report.coverage.missing_messages, report.coverage.message_gaps) == (4, 2)
    assert "4 messages of the engine never arrived (or went to quarantine), in 2 gaps." in text_of(render_html(report))
    told = from_json(to_json(report)).coverage
    assert (told.missing_messages, told.message_gaps) == (4, 2)


def test_complete_numbers_are_zero_missing_and_no_numbers_are_unknown(tmp_path: Path) -> None:
    complete = w.report(w.world(tmp_path / "all", toml(), numbered(w.messages(busy, hours=(9, 10), days=[0]))))
    silent = w.report(w.world(tmp_path / "none", toml(), w.messages(busy, hours=(9, 10), days=[0])))
    assert complete.coverage.missing_messages == 0
    assert silent.coverage.missing_messages is None
    for report in (complete, silent):
        assert "never arrived" not in render_html(report)


def test_purged_hours_of_other_rules_are_not_compared(tmp_path: Path) -> None:
    site = w.world(tmp_path, toml(), w.messages(busy, hours=(9, 10), days=range(2)))
    with open_warehouse(site, w.MONDAY, w.MONDAY + timedelta(days=1)) as warehouse:
        hours = sorted(warehouse.built.fingerprints)
        span = {"first_ms": hours[0] * 3_600_000, "end_ms": (hours[-1] + 1) * 3_600_000}
        today = hourly_inputs(site)

        def sealed(sql: str) -> bool:
            seal = UnitSeal(fingerprint="0" * 16, causes={"sql": sql, "settings": today.settings}, facts={})
            warehouse.built = replace(warehouse.built, sealed=SealedRange({hours[0]: seal}))
            return has_other_rules(warehouse, **span)

        assert not has_other_rules(warehouse, **span)
        assert not sealed(today.sql)
        assert sealed("another")
