"""JSON files of made-up weeks for the index: the report's own fixtures, moved to other weeks, sites and floors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any

from report import model_classes as m
from report import sample_weeks as weeks

from vsd_analytics.report.model import week as page_model
from vsd_analytics.report.pages.json_and_csv import to_json

LAST = date(2026, 11, 9)
ADDRESS = ("riverside", "Riverside Store", "ground", "Ground floor")


def report(
    state: Callable[[], page_model.WeekReport] = weeks.normal,
    *,
    back: int = 0,
    address: tuple[str, str, str, str] = ADDRESS,
    value: float | None = None,
    change: float | None = None,
    half: float = 0.04,
    share: float | None = None,
    is_busy: bool = True,
) -> page_model.WeekReport:
    """Return a week of a floor, so many weeks before the last, with a level and a change of its own."""
    made = state()
    monday = LAST - timedelta(weeks=back)
    iso = monday.isocalendar()
    site_id, name, floor_id, floor_name = address
    level, coverage = made.level, made.coverage
    if value is not None:
        level = replace(level, violation_rate=weeks.estimate(value, change, half))
    if share is not None:
        coverage = replace(coverage, share=share)
    return replace(
        made,
        site=m.SiteRef(
            site_id=site_id,
            name=name,
            floor_id=floor_id,
            floor_name=floor_name,
            floors=tuple(dict.fromkeys(("ground", floor_id))),
        ),
        week=replace(
            made.week,
            iso=f"{iso.year}-W{iso.week:02d}",
            year=iso.year,
            number=iso.week,
            monday=monday,
            sunday=monday + timedelta(days=6),
        ),
        generated_at=datetime(2026, 11, 16, 6, tzinfo=weeks.ROME) - timedelta(weeks=back),
        level=level,
        coverage=coverage,
        busiest_spot=made.busiest_spot if is_busy else None,
        log=made.log if back == 0 and state is weeks.normal and change is not None and change < -0.1 else (),
    )


def write(
    folder: Path, made: page_model.WeekReport, *, stem: str | None = None, page: bool = True, **more: Any
) -> Path:
    """Write a JSON file, and an empty page beside it, into the reports of a project; return its path."""
    reports = folder / "reports"
    reports.mkdir(parents=True, exist_ok=True)
    stem = stem or made.week.iso
    if page:
        (reports / f"{stem}.html").write_text("<!doctype html><title>a week</title>", encoding="utf-8")
    for end, data in more.items():
        (reports / f"{stem}.{end}").write_bytes(data)
    path = reports / f"{stem}.json"
    path.write_bytes(to_json(made))
    return path


GROUND, FIRST = ADDRESS, ("riverside", "Riverside Store", "first", "First floor")
CANTEEN = ("harbour", "Harbour Office", "canteen", "Canteen")
HALL = ("central", "Central Station", "east-hall", "East hall")


def company(root: Path) -> list[Path]:
    """Write three projects: two floors of a shop, a canteen with bad weeks, a hall without change."""
    shop, office, station = (root / name for name in ("riverside", "harbour", "central"))
    for back in range(10):
        now = back == 0
        ground = report(
            back=back, address=GROUND, value=121.3 if now else 141 - back % 3 * 4, change=-0.14 if now else 0.01
        )
        write(shop, ground, stem=f"{ground.week.iso}-ground", pdf=b"%PDF-1.7")
        first = report(back=back, address=FIRST, value=65 + back % 4, change=0.01, half=0.07)
        write(shop, first, stem=f"{first.week.iso}-first")
        if back != 6:
            state = {3: weeks.too_incomplete, 4: weeks.no_data}.get(back, weeks.normal)
            value = None if state is not weeks.normal else 115 - 4 * back
            write(office, report(state, back=back, address=CANTEEN, value=value, change=0.2 if back == 2 else 0.02))
        write(station, report(back=back, address=HALL, value=229 - back, change=0.005))
    (shop / "reports" / "2026-W46-ground-planner.html").write_text("<!doctype html>", encoding="utf-8")
    return [shop, office, station]
