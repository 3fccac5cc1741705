"""A site does not change its past: vsd.toml must describe what is stored before figures are made."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
from warehouse.small_projects import DAY, HOUR, T0, Person, beats, make_site, open_days, put

from vsd_analytics.errors import ConfigError
from vsd_analytics.site.model import Area, Camera, Floor, Site
from vsd_analytics.warehouse.build import build

CAM, OTHER = Camera("cam", "Cam", "ground", hz=1.0), Camera("cam-2", "Other", "ground", hz=1.0)


def two_days(root: Path, *, other_from: int = 0) -> Site:
    """Return a site whose two cameras record an hour on Monday, and the first of them on Tuesday."""
    site = make_site(root, cameras=[CAM, OTHER])
    put(site, [*beats(T0, T0 + HOUR), *beats(T0 + DAY, T0 + DAY + HOUR), *beats(T0, T0 + HOUR, camera="cam-2")])
    put(site, [Person(T0 + 1000 * s, "a", 1000 * s, 2000) for s in range(12)])
    return site


def refusal(site: Site) -> str:
    with pytest.raises(ConfigError) as refused:
        build(site)
    assert refused.value.code == "E321"
    return " ".join(f"{p.what} {p.why} {p.fix}" for p in refused.value.problems)


def test_a_deleted_camera_with_stored_records_is_refused_with_the_lines_that_bring_it_back(tmp_path: Path) -> None:
    site = two_days(tmp_path)
    text = refusal(replace(site, cameras=(CAM,)))
    assert "cam-2" in text
    assert '[[camera]]\nid = "cam-2"\nname = "cam-2"\nto = "2026-11-10"' in text
    build(replace(site, cameras=(CAM, replace(OTHER, end_day=date(2026, 11, 10)))))


def test_a_camera_that_is_purged_may_be_deleted(tmp_path: Path) -> None:
    from datetime import UTC, datetime

    from vsd_analytics.retention.purge import Terms, purge_range

    site = two_days(tmp_path)
    terms = Terms(now=datetime(2026, 11, 20, tzinfo=UTC))
    purge_range(site, camera_id="cam-2", first_ms=T0 - DAY, after_ms=T0 + DAY, terms=terms)
    build(replace(site, cameras=(CAM,)))


def test_a_camera_on_another_floor_is_refused_unless_the_floor_was_renamed(tmp_path: Path) -> None:
    site = two_days(tmp_path)
    build(site)
    floors = (*site.floors, Floor("first", "First"))
    assert "was on floor 'ground'" in refusal(
        replace(site, floors=floors, cameras=(CAM, replace(OTHER, floor_id="first")))
    )
    renamed = tuple(replace(c, floor_id="first") for c in site.cameras)
    build(replace(site, floors=(Floor("first", "First"),), cameras=renamed))


def test_a_life_that_leaves_out_stored_records_is_refused(tmp_path: Path) -> None:
    site = two_days(tmp_path)
    late = replace(site, cameras=(replace(CAM, end_day=date(2026, 11, 10)), OTHER))
    assert 'to = "2026-11-11"' in refusal(late)
    early = replace(site, cameras=(replace(CAM, first_day=date(2026, 11, 10)), OTHER))
    assert 'from = "2026-11-09"' in refusal(early)
    fits = replace(CAM, first_day=date(2026, 11, 9), end_day=date(2026, 11, 11))
    build(replace(site, cameras=(fits, OTHER)))


@pytest.mark.parametrize("timezone", ["America/New_York", "Asia/Kolkata"])
def test_a_life_ends_at_local_midnight(tmp_path: Path, timezone: str) -> None:
    site = make_site(tmp_path, cameras=[CAM], timezone=timezone)
    put(site, beats(T0, T0 + 22 * HOUR, every=60_000))  # into Tuesday in both zones
    assert 'to = "2026-11-11"' in refusal(replace(site, cameras=(replace(CAM, end_day=date(2026, 11, 10)),)))
    build(replace(site, cameras=(replace(CAM, end_day=date(2026, 11, 11)),)))


def test_a_camera_that_is_gone_is_neither_down_nor_missing(tmp_path: Path) -> None:
    site = two_days(tmp_path)
    tuesday = "select state, cameras_down, recorded_share from hours where hour_start_ms = $ms"
    outages = "select count(*) as n from outages where camera_id = 'cam-2' and started_ms >= $day"
    values = {"ms": T0 + DAY}
    with open_days(site, "2026-11-09", "2026-11-10") as warehouse:
        assert warehouse.rows(tuesday, values)[0]["cameras_down"] == 1
    ended = replace(site, cameras=(CAM, replace(OTHER, end_day=date(2026, 11, 10))))
    with open_days(ended, "2026-11-09", "2026-11-10") as warehouse:
        assert warehouse.rows(tuesday, values) == [{"state": "full", "cameras_down": 0, "recorded_share": 1.0}]
        assert warehouse.rows(outages, {"day": T0 + DAY - 8 * HOUR}) == [{"n": 0}]
    gone = tuple(replace(c, end_day=date(2026, 11, 11)) for c in site.cameras)
    with open_days(replace(site, cameras=gone), "2026-11-10", "2026-11-11") as warehouse:
        states = warehouse.rows(tuesday, {"ms": T0 + 2 * DAY})
        assert states[0]["state"] == "no_data", "without any camera an hour is missing, not closed"


@pytest.mark.parametrize(
    ("polygon", "unit"),
    [
        (((100, 100), (1400, 100), (1400, 700)), "centimetres"),
        (((1000, 1000), (9000, 1000), (9000, 2000)), "millimetres"),
        (((5000, 5000), (5010, 5000), (5010, 5010)), None),
    ],
)
def test_an_area_far_from_all_records_is_refused_with_its_corners_in_metres(
    tmp_path: Path, polygon: tuple[tuple[float, float], ...], unit: str | None
) -> None:
    site = two_days(tmp_path)
    put(site, [Person(T0 + 60_000 + 1000 * s, "b", 14_000, 700 * s) for s in range(12)])
    near = Area("near", "Near", "ground", ((30, 0), (40, 0), (40, 9)))
    build(replace(site, areas=(near,)))
    text = refusal(replace(site, areas=(near, Area("far", "Far", "ground", polygon))))
    assert "'far' lies off" in text
    assert "'near'" not in text
    assert unit is None or unit in text
