"""A camera that loses people beside its neighbours is a doubt on changes of its areas; its words name both causes."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import pytest
from planted_changes import planted, site_of

from vsd_analytics.figures.before_after import BeforeAfterFigure, before_after
from vsd_analytics.figures.camera_watch import watch, watch_days
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.site.calendar import Calendar, Event
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.stored_days import Extent
from vsd_analytics.wording.reasons import reason_text

FIRST = date(2026, 8, 3)
CHANGE = 12 * 7 + 1
N_DAYS = 12 * 7 + 3 + 6 * 7
CAMERAS = {"queue": "cam", "door": "cam-2", "aisle": "cam-2", "fruit": "cam-3", "bakery": "cam-3", "back": "cam-4"}


def people(area_id: str, day: int, *, drifting: str = "queue", to: float = 0.8) -> float:
    wave = 1 + 0.02 * ((3 * day + 5 * len(area_id)) % 7)
    lost = (to - 1) * min(1.0, max(0, day - CHANGE) / 28) if area_id == drifting else 0.0
    return 40.0 * wave * (1 + lost)


def change(root: Path, site: Site, **planted_in: object) -> BeforeAfterFigure:
    entry = {"at": f"{FIRST + timedelta(days=CHANGE)}T07:00:00+00:00", "text": "rope", "area": "queue"}
    (root / "log.jsonl").write_text(json.dumps(entry) + "\n", encoding="utf-8")
    given = {"first": FIRST, "n_days": N_DAYS, "camera_of": CAMERAS.__getitem__, "people": people, **planted_in}
    with planted(site, **given) as warehouse:  # type: ignore[arg-type]
        return before_after(warehouse, 1)


def site(root: Path) -> Site:
    return site_of(root, cameras=("cam", "cam-2", "cam-3", "cam-4"))


def test_the_areas_own_camera_that_loses_people_is_a_doubt_that_names_both_causes(tmp_path: Path) -> None:
    found = change(tmp_path, site(tmp_path))
    (doubt,) = found.doubts
    assert "cam loses people beside its neighbours since 2026-1" in reason_text(doubt)
    assert reason_text(doubt).endswith("fewer people there, or fewer detected")
    assert not found.is_credible
    assert found.outcome != "works"


def test_a_camera_of_an_area_compared_with_is_a_caution(tmp_path: Path) -> None:
    found = change(tmp_path, site(tmp_path), people=lambda a, d: people(a, d, drifting="back"))
    assert found.doubts == ()
    assert any("cam-4 loses people" in reason_text(c) for c in found.cautions)


def test_cameras_without_drift_are_no_doubt(tmp_path: Path) -> None:
    found = change(tmp_path, site(tmp_path), people=lambda a, d: people(a, d, to=1.0))
    assert found.doubts == ()


def watched(root: Path, made: Site, drifting: str = "queue") -> dict[str, tuple[str | None, str | None]]:
    reference = FIRST, FIRST + timedelta(days=83)
    since = FIRST + timedelta(days=87), FIRST + timedelta(days=87 + 41)
    given = {"first": FIRST, "n_days": N_DAYS, "people": lambda a, d: people(a, d, drifting=drifting)}
    cameras = {c.camera_id for c in made.cameras}
    of = {a: c if c in cameras else "cam" for a, c in CAMERAS.items()}
    with planted(made, **given, camera_of=of.__getitem__) as warehouse:  # type: ignore[arg-type]
        found = watch(FloorHours(warehouse, floor=made.floors[0]), reference, since)
    return {c.camera_id: (c.verdict, None if c.reason is None else reason_text(c.reason)) for c in found}


def test_one_camera_has_no_neighbour_and_says_so(tmp_path: Path) -> None:
    ((verdict, why),) = watched(tmp_path, site_of(tmp_path)).values()
    assert verdict is None
    assert why == "not watched: no other camera is on its floor, so there is no neighbour to compare it with"


def test_two_cameras_cannot_tell_which_and_name_each_other(tmp_path: Path) -> None:
    found = watched(tmp_path, site_of(tmp_path, cameras=("cam-2", "cam")), drifting="door")
    assert {v for v, _ in found.values()} == {"loses", "gains"}
    assert "beside cam-2, its only neighbour, since" in str(found["cam"][1])


def test_weeks_of_an_event_of_the_calendar_are_not_watched(tmp_path: Path) -> None:
    last = FIRST + timedelta(days=N_DAYS)
    summer = Event("school holidays", FIRST + timedelta(days=84), last)
    made = replace(site(tmp_path), calendar=Calendar(events=(summer,)))
    assert {v for v, _ in watched(tmp_path, made).values()} == {None}


HALVES = [
    ("2026-12-27", "2026-01-05", ("2026-04-06", "2026-06-29")),
    ("2027-01-10", "2026-01-05", ("2026-10-12", "2027-01-04")),
    ("2026-12-27", "2026-08-05", ("2026-08-10", "2026-11-02")),
    ("2026-10-25", "2026-08-05", None),
]


@pytest.mark.parametrize(("until", "stored", "spans"), HALVES)
def test_the_watch_begins_with_a_half_year_or_after_twelve_weeks(
    until: str, stored: str, spans: tuple[str, str] | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    last = date.fromisoformat(until)
    extent = Extent(date.fromisoformat(stored), last)
    monkeypatch.setattr("vsd_analytics.figures.camera_watch.stored_extent", lambda site, near: extent)
    found = watch_days(site(tmp_path), last)
    if spans is None:
        assert found is None
    else:
        reference, since = (date.fromisoformat(day) for day in spans)
        assert found == ((reference, since - timedelta(days=1)), (since, last))
