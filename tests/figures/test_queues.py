"""Queues through store, facts and marts: against planted people who wait, leave, are lost, or walk back."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from figures.answer_cells import Cells, only_row
from warehouse.small_projects import DAY, HOUR, T0, Frame, Person, beats, make_site, open_days, put

from vsd_analytics.answer import Answer, Value, check_sums, value_of
from vsd_analytics.cli.queue import LAYOUTS
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.people_present import Presence
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.queue_forecast import queue_forecast
from vsd_analytics.figures.queues import NO_END, queues
from vsd_analytics.render.text import remarks, text
from vsd_analytics.site.model import Area, Camera, Site

FIRST = date(2026, 11, 9)
QUEUE = Area("queue", "Queue", "ground", ((0, 0), (4, 0), (4, 4), (0, 4)), is_queue=True, served_in="till")
TILL = Area("till", "Till", "ground", ((4, 0), (6, 0), (6, 4), (4, 4)))
SERVICE_S = 10


def with_queue(root: Path, **changes: object) -> Site:
    """Return a site with one queue; nothing is hidden, as most worlds have fewer than five people."""
    return replace(make_site(root, mask_below=0), areas=(replace(QUEUE, **changes), TILL))  # type: ignore[arg-type]


def customer(
    start_ms: int, wait_s: int, track: str, *, leaves: bool = False, cut_after_s: int | None = None, back: bool = False
) -> list[Person]:
    """Return somebody who comes from the left, waits, and is served or leaves, at 1 Hz; `back`: through the queue."""
    rows = []
    for s in range(-3, wait_s + SERVICE_S + 3):
        x = -1000 if s < 0 else 2000
        if s >= wait_s:
            x = -1000 if leaves or s >= wait_s + SERVICE_S else 5000
        is_lost = cut_after_s is not None and s >= cut_after_s
        rows.append(Person(start_ms + s * 1000, f"{track}-2" if is_lost else track, x, 2000))
    if back:
        at = start_ms + (wait_s + SERVICE_S) * 1000
        rows = [r for r in rows if r.ts < at]
        rows += [Person(at + s * 1000, track, 2000 if s < 3 else -1000, 2000) for s in range(6)]
    return rows


def queue_of(site: Site, n_days: int = 1) -> tuple[Cells, Answer]:
    """Return the queue over the days, and its hours."""
    last = FIRST + timedelta(days=n_days - 1)
    with open_days(site, FIRST.isoformat(), last.isoformat()) as warehouse:
        found, by_hour = queues(Period(FloorHours(warehouse, floor=site.floors[0]), FIRST, last))
    check_sums([found, by_hour])
    return only_row(found), by_hour


def test_people_waiting_and_waiting_times_equal_the_planted_ones(tmp_path: Path) -> None:
    site = with_queue(tmp_path)
    waits = list(range(11, 51))
    rows = [r for k, w in enumerate(waits) for r in customer(T0 + k * 80_000, w, f"t{k}", leaves=k % 4 == 0)]
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    found, by_hour = queue_of(site)
    assert found["people_waiting"].value == pytest.approx(sum(waits) / 3600)
    assert found["people_waiting_p90"].value is not None
    assert found.numbers("n_entered", "n_served", "n_left", "n_cut") == (40, 30, 10, 0)
    assert found["left_share"].value == pytest.approx(0.25)
    served = [w for k, w in enumerate(waits) if k % 4]
    assert found["wait_median_s"].value == np.sort(served)[14]
    assert found["little_ratio"].value == pytest.approx(1.0, abs=0.01)
    assert [row["local_hour"] for row in by_hour.rows] == list(range(24)), "an open hour without records says so"
    assert [h["local_hour"] for h in by_hour.rows if value_of(h, "people_waiting").value is not None] == [8]
    assert by_hour.value("n_entered", local_hour=8).value == 40


def test_who_walks_back_through_the_queue_does_not_wait(tmp_path: Path) -> None:
    site = with_queue(tmp_path)
    rows = [r for k in range(40) for r in customer(T0 + k * 80_000, 30, f"t{k}", back=True)]
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    assert queue_of(site)[0].numbers("n_back", "n_entered", "n_left") == (40, 40, 0)


def test_a_week_of_cut_tracks_holds_the_planted_wait_and_the_naive_one_does_not(tmp_path: Path) -> None:
    site = replace(with_queue(tmp_path), opening=(((480, 540),),) * 7)
    rng = np.random.default_rng(1)
    rows, waits, left, whole = [], [], [], []
    for d in range(7):
        for k in range(45):
            until, patience = rng.gamma(3, 14), rng.exponential(90)
            wait, cut = max(1, round(min(until, patience))), max(1, round(rng.exponential(50)))
            rows += customer(
                T0 + d * DAY + k * 79_000, wait, f"{d}-{k}", leaves=patience < until,
                cut_after_s=cut if cut < wait else None,
            )  # fmt: skip
            waits.append(wait)
            left.append(patience < until)
            whole.append(cut >= wait and not left[-1])
        rows += beats(T0 + d * DAY, T0 + d * DAY + HOUR)
    put(site, rows)
    found, _ = queue_of(site, n_days=7)
    median, share, n_cut = found["wait_median_s"], found["left_share"], found["n_cut"].value
    assert n_cut is not None
    assert n_cut > 0.35 * len(waits)
    served = np.array(waits)[~np.array(left)]
    assert median.lo is not None
    assert median.hi is not None
    assert median.lo <= np.median(served) <= median.hi
    assert np.median(np.array(waits)[whole]) < 0.9 * np.median(served)
    assert share.lo is not None
    assert share.hi is not None
    assert share.lo <= np.mean(left) <= share.hi
    assert found.row["means_agree"] is True


def two_cameras(root: Path) -> Site:
    """Return a site whose cameras see one half of the queue each."""
    views = (
        ((-5.0, -5.0), (2.0, -5.0), (2.0, 10.0), (-5.0, 10.0)),
        ((2.0, -5.0), (9.0, -5.0), (9.0, 10.0), (2.0, 10.0)),
    )
    cameras = [Camera(c, c, "ground", hz=1.0, view=v) for c, v in zip(("cam", "cam-2"), views, strict=True)]
    return replace(make_site(root, cameras=cameras), areas=(QUEUE, TILL))


def standing(camera: str, x: int, since_ms: int, until_ms: int, *, offset_ms: int = 0) -> Iterable[Person]:
    return [Person(t + offset_ms, camera, x, 1000, camera) for t in range(since_ms, until_ms, 1000)]


def test_people_of_two_cameras_add_up_at_each_instant(tmp_path: Path) -> None:
    """One stands for 30 minutes, the other for 15 of them, seen by a camera whose frames come half a second later."""
    site = two_cameras(tmp_path)
    records = [
        *standing("cam", 1000, T0, T0 + HOUR // 2),
        *standing("cam-2", 3000, T0, T0 + HOUR // 4, offset_ms=500),
        *beats(T0, T0 + HOUR),
        *(Frame(t + 500, "cam-2") for t in range(T0, T0 + HOUR, 1000)),
    ]
    put(site, records)
    with open_days(site) as warehouse:
        present = Presence(Period(FloorHours(warehouse, floor=site.floors[0]), FIRST, FIRST), QUEUE)
        rows = warehouse.rows(
            "select n_people, sum(recorded_ms)::bigint as recorded_ms from area_counts group by 1 order by 1"
        )
    assert {r["n_people"]: r["recorded_ms"] for r in rows} == {0: 1_800_000, 1: 899_500, 2: 900_000}
    assert present.mean().value == pytest.approx(0.75, rel=1e-3)
    assert present.quantile(0.9).value == 2


def test_time_without_one_of_the_cameras_counts_as_not_recorded(tmp_path: Path) -> None:
    """The second camera stops after half an hour, and is dead on the next day: the other one's people are too few."""
    site = two_cameras(tmp_path)
    records = [
        *standing("cam", 1000, T0, T0 + HOUR),
        *standing("cam-2", 3000, T0, T0 + HOUR // 2),
        *standing("cam", 1000, T0 + DAY, T0 + DAY + HOUR),
    ]
    put(site, records)
    with open_days(site, "2026-11-09", "2026-11-10") as warehouse:
        data = FloorHours(warehouse, floor=site.floors[0])
        first, second = (Presence(Period(data, day, day), QUEUE) for day in (FIRST, FIRST + timedelta(days=1)))
    assert first.mean().value == pytest.approx(2.0)
    assert first.seconds.sum() == pytest.approx(1800, abs=1)
    assert second.mean().value is None
    assert (8 in first.unrecorded_hours, 8 in second.unrecorded_hours) == (False, True)
    assert second.silent_cameras == ("cam-2",)


def test_hours_missed_on_some_days_count_as_on_others_and_hours_never_recorded_have_no_interval(
    tmp_path: Path,
) -> None:
    """Open from 8 to 10: one person waits until 9, then three; the second hour is missed on three of six days."""
    cameras = (Camera("cam", "Cam", "ground", hz=0.1),)
    site = replace(with_queue(tmp_path), opening=(((480, 600),),) * 7, cameras=cameras)
    rows: list[Person | Frame] = []
    for d in range(6):
        start = T0 + d * DAY
        crowd = [f"{d}-{k}" for k in range(3)]
        for hour in range(1 if d % 2 else 2):
            here = crowd if hour else crowd[:1]
            for t in range(start + hour * HOUR, start + (hour + 1) * HOUR, 10_000):
                rows += [Person(t, track, 1000 * (k + 1), 2000) for k, track in enumerate(here)]
    put(site, rows)
    people = queue_of(site, n_days=6)[0]["people_waiting"]
    assert people.value == pytest.approx(2.0, rel=0.01), "a plain mean would be 15 / 9"
    assert people.lo is not None
    with open_days(site, "2026-11-09", "2026-11-14") as warehouse:
        data = FloorHours(warehouse, floor=site.floors[0])
        odd = Presence(Period(data, FIRST + timedelta(days=1), FIRST + timedelta(days=1)), QUEUE).mean()
    assert odd.value == pytest.approx(1.0, rel=0.01), "of the hour that is known"
    assert (odd.lo, odd.reason and odd.reason.code) == (None, "present.hours")


def test_a_queue_without_an_end_has_people_and_no_waiting_times(tmp_path: Path) -> None:
    site = with_queue(tmp_path, served_in=None)
    put(site, [*customer(T0, 30, "a"), *beats(T0, T0 + HOUR)])
    found, _ = queue_of(site)
    assert found["people_waiting"].value == pytest.approx(30 / 3600)
    for column in ("wait_median_s", "left_share", "n_entered", "n_back", "stay_mean_s"):
        assert found[column] == Value.missing(NO_END, "not_measurable"), column


def test_the_forecast_names_the_hours_above_the_limit_and_knows_none_without_four_weeks(tmp_path: Path) -> None:
    """Open from 8 to 10 on Mondays: one person waits until 9, then four, give or take one, for six weeks."""
    cameras = (Camera("cam", "Cam", "ground", hz=0.1),)
    opening = (((480, 600),), *((),) * 6)
    site = replace(with_queue(tmp_path, queue_limit=3.0), opening=opening, cameras=cameras)
    rows = [
        Person(t, f"{w}-{k}", 1000 * k, 2000)
        for w in range(6)
        for hour, n in ((0, 1), (1, 4 + w % 3 - 1))
        for k in range(n)
        for t in range(T0 + w * 7 * DAY + hour * HOUR, T0 + w * 7 * DAY + (hour + 1) * HOUR, 10_000)
    ]
    put(site, rows)
    monday = FIRST + timedelta(weeks=5)
    with open_days(site, FIRST.isoformat(), (monday + timedelta(days=6)).isoformat()) as warehouse:
        data = FloorHours(warehouse, floor=site.floors[0])
        hours, score = queue_forecast(data, monday)
        early, no_score = queue_forecast(data, FIRST + timedelta(weeks=2))
    quiet, busy = (value_of(row, "people_waiting") for row in hours.rows)
    assert (quiet.value, busy.value) == (pytest.approx(1.0, rel=0.1), pytest.approx(4.0, rel=0.2))
    assert busy.lo is not None
    assert busy.hi is not None
    assert busy.lo < 4 < busy.hi
    assert [row["chance"] for row in hours.rows] == [None, "likely" if busy.lo > 3 else "expected"]
    assert only_row(score)["off_share"].value is not None
    printed = "\n".join(text(hours, LAYOUTS["queue_forecast"]))
    assert re.search(r"^Queue +2026-12-21 +09:00 .* 3 +(likely|expected)$", printed, re.MULTILINE)
    assert re.search(r"^09:00 +[\d.]+ \(", printed, re.MULTILINE), "hours down, days across"
    assert [(row["chance"], value_of(row, "people_waiting").state) for row in early.rows] == [
        (None, "not_enough_data")
    ] * 2, "hours without a forecast say so"
    assert remarks(early, LAYOUTS["queue_forecast"]) == ["Queue: a forecast needs 4 recorded weeks, has 3"]
    assert (text(early, LAYOUTS["queue_forecast"]), only_row(no_score)["off_share"].value) == ([], None)
