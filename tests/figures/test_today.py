"""The card of the day: days beside the same hours of days like them, silent cameras, the hours ahead."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import date, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from planted_hours import MONDAY, of, planted, site_of

from vsd_analytics.answer import Answers, Reason, Value, check_sums, value_of
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.share import earlier
from vsd_analytics.figures.share.days import closed_days
from vsd_analytics.figures.special_days import HOLIDAY
from vsd_analytics.figures.today import Today, today
from vsd_analytics.figures.today_answers import today_answers
from vsd_analytics.live.day_topics import day_figures
from vsd_analytics.report.pages.today import today_words
from vsd_analytics.site.model import Site
from vsd_analytics.stats.usual import usual_range
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.languages import speaking

SATURDAY = MONDAY + timedelta(days=5)
Change = Callable[[pd.DataFrame], None]


def card(
    site: Site, day: date, hour: int, minute: int = 0, *, change: Change | None = None, n_weeks: int = 14
) -> Today:
    monday = day - timedelta(days=day.weekday())
    with planted(site, change, n_weeks=n_weeks, monday=monday) as warehouse:
        at = datetime(day.year, day.month, day.day, hour, minute, tzinfo=site.zone)
        return today(warehouse, at)


def without(day: date, hour: int, camera: str | None = None) -> Change:
    def change(hours: pd.DataFrame) -> None:
        hours.loc[of(hours, day=day, hour=hour, camera=camera), ["recorded_s", "recorded_open_s"]] = 0.0

    return change


def test_days_are_the_counts_of_their_hours_that_are_over(tmp_path: Path) -> None:
    seen: dict[str, float] = {}

    def count(hours: pd.DataFrame) -> None:
        for name, day, last in (("yesterday", SATURDAY - timedelta(days=1), 11), ("so far", SATURDAY, 10)):
            rows = hours[(hours["local_date"].astype(str) == str(day)) & (hours["local_hour"] <= last)]
            seen[name] = rows["n_violations_open"].sum()

    found = card(site_of(tmp_path), SATURDAY, 11, 59, change=count)
    assert found.yesterday is not None
    assert found.so_far is not None
    assert (found.yesterday.violations, found.so_far.violations) == (seen["yesterday"], seen["so far"])
    assert (found.yesterday.is_over, found.so_far.is_over, found.so_far.until_hour) == (True, False, 11)


def test_a_day_is_compared_with_the_same_hours_of_the_same_weekday(tmp_path: Path) -> None:
    totals: list[float] = []

    def count(hours: pd.DataFrame) -> None:
        for week in range(1, 13):
            rows = of(hours, day=SATURDAY - timedelta(weeks=week)) & (hours["local_hour"] < 11)
            totals.append(hours.loc[rows, "n_violations_open"].sum())

    found = card(site_of(tmp_path), SATURDAY, 11, change=count).so_far
    assert found is not None
    assert found.usual == pytest.approx(usual_range(totals[::-1], confidence=0.975))
    assert found.n_days == 12


def test_what_is_recorded_after_the_clock_is_not_read(tmp_path: Path) -> None:
    def later(hours: pd.DataFrame) -> None:
        after = of(hours, day=SATURDAY) & (hours["local_hour"] >= 10)
        hours.loc[after, "n_violations_open"] = 9_999.0

    site = site_of(tmp_path)
    assert card(site, SATURDAY, 10, 30, change=later) == card(site, SATURDAY, 10, 30)


def test_an_hour_without_data_is_not_zero_and_is_not_compared(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    whole, holed = card(site, SATURDAY, 12).so_far, card(site, SATURDAY, 12, change=without(SATURDAY, 10)).so_far
    assert whole is not None
    assert holed is not None
    assert whole.usual is not None
    assert holed.usual is not None
    assert (holed.open_hours, holed.recorded_hours) == (3, 2)
    middle = [(u.lo * u.hi) ** 0.5 for u in (whole.usual, holed.usual)]
    assert middle[1] / middle[0] == pytest.approx(2 / 3, rel=0.12)  # two hours beside two, not beside three
    assert holed.usual.position(holed.violations or 0.0) == "within"


def test_a_day_whose_hours_were_not_recorded_has_no_number(tmp_path: Path) -> None:
    def nothing(hours: pd.DataFrame) -> None:
        hours.loc[of(hours, day=SATURDAY), ["recorded_s", "recorded_open_s"]] = 0.0

    found = card(site_of(tmp_path), SATURDAY, 12, change=nothing)
    assert found.so_far is not None
    assert (found.so_far.violations, found.so_far.usual, found.so_far.state) == (None, None, "not_enough_data")
    assert [h.violations for h in found.hours if h.day == SATURDAY] == [None, None, None]


def test_days_that_lack_one_of_the_hours_are_left_out_and_fewer_than_four_are_too_few(tmp_path: Path) -> None:
    def gone(hours: pd.DataFrame) -> None:
        for week in range(1, 10):
            without(SATURDAY - timedelta(weeks=week), 10)(hours)

    found = card(site_of(tmp_path), SATURDAY, 12, change=gone).so_far
    assert found is not None
    assert (found.n_days, found.usual, found.state) == (3, None, "not_enough_data")
    assert found.reason is not None
    assert found.reason == Reason("today.days", least=4, has=3)


def test_before_the_first_open_hour_is_over_today_has_no_number(tmp_path: Path) -> None:
    found = card(site_of(tmp_path), SATURDAY, 9, 59).so_far
    assert found is not None
    assert (found.until_hour, found.open_hours, found.violations) == (None, 0, None)
    assert found.reason is not None
    assert found.reason.code == "today.not_yet"


def test_a_closed_day_is_none(tmp_path: Path) -> None:
    site = site_of(tmp_path, closed=frozenset({SATURDAY - timedelta(days=1)}))
    found = card(site, SATURDAY, 12)
    assert found.yesterday is None
    assert found.so_far is not None


def test_a_monday_has_sunday_as_yesterday_and_a_sunday_has_monday_as_tomorrow(tmp_path: Path) -> None:
    monday = card(site_of(tmp_path), MONDAY, 12)
    assert monday.yesterday is not None
    assert monday.yesterday.day == MONDAY - timedelta(days=1)
    assert monday.yesterday.n_days == 12
    sunday = card(site_of(tmp_path), MONDAY + timedelta(days=6), 9)
    assert {h.day for h in sunday.ahead} == {MONDAY + timedelta(days=6), MONDAY + timedelta(days=7)}


def test_hours_ahead_are_forecast_and_hours_over_are_not_ahead(tmp_path: Path) -> None:
    found = card(site_of(tmp_path), SATURDAY - timedelta(days=1), 10, 30)
    assert [(h.day.weekday(), h.hour) for h in found.ahead] == [(4, 10), (4, 11), (5, 9), (5, 10), (5, 11)]
    assert [h.people for h in found.ahead] == pytest.approx([9.0] * 5)
    assert [h.usual for h in found.ahead] == pytest.approx([30.0] * 5, rel=0.25)


@pytest.mark.parametrize("days_later", [9, 12, 14])
def test_recorded_weeks_are_counted_from_monday_to_sunday(days_later: int, tmp_path: Path) -> None:
    def two_weeks(hours: pd.DataFrame) -> None:
        days = pd.to_datetime(hours["local_date"]).dt.date
        is_other = (days < MONDAY - timedelta(weeks=1)) | (days >= MONDAY + timedelta(weeks=1))
        hours.loc[is_other, ["recorded_s", "recorded_open_s"]] = 0.0

    found = card(site_of(tmp_path), MONDAY + timedelta(days=days_later), 12, change=two_weeks)
    assert found.forecast_reason == Reason("forecast.weeks", least=4, has=2)
    assert found.unusual.reason == Reason("unusual.weeks", least=4, has=2)


def test_an_hour_with_four_times_the_usual_count_is_unusual(tmp_path: Path) -> None:
    def many(hours: pd.DataFrame) -> None:
        hours.loc[of(hours, day=SATURDAY - timedelta(days=1), hour=10), "n_violations_open"] *= 4

    found = card(site_of(tmp_path), SATURDAY, 11, change=many)
    assert [(r.day, r.hour) for r in found.unusual.rows] == [(SATURDAY - timedelta(days=1), 10)]


def test_a_camera_that_stopped_is_named_with_its_last_hour_and_the_open_hours_since(tmp_path: Path) -> None:
    def stop(hours: pd.DataFrame) -> None:
        rows = of(hours, camera="cam-2") & (
            of(hours, day=SATURDAY) | (of(hours, day=SATURDAY - timedelta(days=1)) & (hours["local_hour"] >= 10))
        )
        hours.loc[rows, ["recorded_s", "recorded_open_s"]] = 0.0

    found = card(site_of(tmp_path), SATURDAY, 11, change=stop)
    [camera] = found.silent
    assert (camera.camera_id, camera.last_day, camera.last_hour) == ("cam-2", SATURDAY - timedelta(days=1), 9)
    assert camera.open_hours == 4  # 10 and 11 on Friday, 9 and 10 on Saturday
    assert found.n_cameras == 2


def test_a_camera_that_sent_in_the_last_hour_or_is_not_due_yet_is_not_silent(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    assert card(site, SATURDAY, 11, change=without(SATURDAY, 9, "cam-2")).silent == ()
    assert card(site, SATURDAY, 10, change=without(SATURDAY, 10, "cam-2")).silent == ()


def test_a_camera_that_began_in_the_running_hour_is_not_silent(tmp_path: Path) -> None:
    def begin(hours: pd.DataFrame) -> None:
        began = of(hours, day=SATURDAY, hour=11, camera="cam-2")
        hours.loc[of(hours, camera="cam-2") & ~began, ["recorded_s", "recorded_open_s"]] = 0.0

    site = site_of(tmp_path)
    assert card(site, SATURDAY, 11, 5, change=begin).silent == ()
    assert [c.camera_id for c in card(site, SATURDAY, 11, change=begin).silent] == ["cam-2"], "11:05 has not come"


def answers(found: Today, site: Site) -> Answers:
    made = today_answers(found, site, inputs="")
    check_sums(made)
    return Answers(made)


def test_answers_have_both_days_and_every_open_hour_and_days_are_the_sums_of_their_hours(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    found = card(site, SATURDAY, 11)
    tables = answers(found, site)
    days, hours = tables["today_days"], tables["today_hours"]
    assert [row["local_date"] for row in days.rows] == [SATURDAY - timedelta(days=1), SATURDAY]
    for level in (found.yesterday, found.so_far):
        assert level is not None
        assert days.value("n_violations", local_date=level.day).value == level.violations
        assert next(days.where(local_date=level.day))["position"] == level.position is not None
    assert len(hours.rows) == len(found.hours)
    to_come = [row for row in hours.rows if not row["is_over"]]
    assert to_come
    for row in to_come:
        assert row["n_violations"] == row["people_seen"] == Value.missing(Reason("today.not_over"))
        assert value_of(row, "people").lo is not None


def test_page_topic_and_answers_of_a_day_give_the_same_numbers(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    found = card(site, SATURDAY, 11)
    tables, topic = answers(found, site), day_figures(found, site, site.floors[0])
    [yesterday, so_far] = tables["today_days"].rows
    with speaking("en"):
        shown = today_words(found, site).days
    for words, row in zip(shown, (yesterday, so_far), strict=True):
        lo, hi = (value_of(row, name).value for name in ("usual_lo", "usual_hi"))
        assert words.value == fmt.count(value_of(row, "n_violations").value)
        assert words.position == row["position"]
        assert f"{fmt.number(lo)} and {fmt.number(hi)}" in words.notes[0]
    assert topic["violations"] == value_of(so_far, "n_violations").value
    for name in ("usual_lo", "usual_hi"):
        assert topic[name] == pytest.approx(value_of(so_far, name).value, abs=0.05)
    assert topic["position"] == so_far["position"]
    last = next(tables["today_hours"].where(local_date=SATURDAY, local_hour=topic["last_hour"]["hour"]))
    n, people = value_of(last, "violations_estimate").value, value_of(last, "people_seen").value
    assert topic["last_hour"]["violations"] == value_of(last, "n_violations").value
    assert topic["last_hour"]["people_in_view"] == pytest.approx(people, abs=0.05)
    assert n is not None
    assert people
    assert topic["last_hour"]["violations_per_person_h"] == pytest.approx(n / people, abs=0.005)


def test_a_sum_of_a_day_that_is_not_that_of_its_hours_is_refused(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    found = card(site, SATURDAY, 11)
    assert found.yesterday is not None
    wrong = replace(found, yesterday=replace(found.yesterday, violations=(found.yesterday.violations or 0) + 1))
    with pytest.raises(ValueError, match="today_days"):
        answers(wrong, site)


def test_a_closed_day_and_an_hour_without_data_have_a_row_that_says_why(tmp_path: Path) -> None:
    site = site_of(tmp_path, closed=frozenset({SATURDAY - timedelta(days=1)}))
    tables = answers(card(site, SATURDAY, 12, change=without(SATURDAY, 10)), site)
    closed, _ = tables["today_days"].rows
    assert closed["is_open"] is False
    assert closed["n_violations"] == Value.missing(Reason("today.closed"))
    n = tables["today_hours"].value("n_violations", local_date=SATURDAY, local_hour=10)
    assert n == Value.missing(Reason("recorded.nothing"))


def one_more(weeks: int, *, hour: int = 9, more: int = 1) -> Change:
    """Put the Fridays on round numbers in one hour, with so many more in the one of some weeks before."""

    def change(hours: pd.DataFrame) -> None:
        for week in range(14):
            friday = of(hours, day=SATURDAY - timedelta(days=1, weeks=week))
            hours.loc[friday, "n_violations_open"] = 0.0
            at = friday & of(hours, hour=hour, camera="cam-1")
            hours.loc[at, "n_violations_open"] = 60.0 + 10 * (week % 3) + (more if week == weeks else 0)

    return change


@pytest.mark.parametrize("week", [0, 1, 7])
def test_a_card_for_readers_is_the_same_whatever_lies_within_the_steps_of_its_days(week: int, tmp_path: Path) -> None:
    """So nobody finds an hour from it that they do not find from the round numbers of days."""
    site = site_of(tmp_path)
    plain, same, other = (
        closed_days(replace(card(site, SATURDAY, 7, change=one_more(week, more=n)), forecast_reason=None), site)
        for n in (0, 3, 20)
    )
    assert plain.yesterday is not None
    assert plain.yesterday.usual is not None
    assert plain == replace(same, unusual=plain.unusual)
    assert plain.yesterday != other.yesterday


def test_a_day_that_a_camera_lacks_in_part_has_no_usual_range_for_readers(tmp_path: Path) -> None:
    """What made up for the camera would be computed from exact hours."""
    site = site_of(tmp_path)
    lost = without(SATURDAY - timedelta(days=1), 10, "cam-2")
    operators = card(site, SATURDAY, 7, change=lost)
    readers = closed_days(operators, site).yesterday
    assert operators.yesterday is not None
    assert readers is not None
    assert operators.yesterday.usual is not None
    assert readers.violations == readers.estimate
    assert (readers.usual, readers.reason) == (None, Reason("today.not_whole"))


def test_a_public_holiday_has_no_usual_range_for_readers_either(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    found = card(site, SATURDAY, 7)
    assert found.yesterday is not None
    why = Reason(HOLIDAY, day=found.yesterday.day, name="a holiday")
    readers = closed_days(replace(found, yesterday=replace(found.yesterday, usual=None, reason=why)), site).yesterday
    assert readers is not None
    assert (readers.usual, readers.reason) == (None, why)


def test_days_that_changed_since_their_week_left_do_not_enter_the_range_of_readers(tmp_path: Path) -> None:
    """Two rough numbers of a day, and a change in between that is known, could tell the count before."""
    site = replace(site_of(tmp_path), root=tmp_path)
    found = card(site, SATURDAY, 7, change=one_more(1))
    assert found.yesterday is not None
    assert found.yesterday.whole_days is not None
    days = dict(found.yesterday.whole_days)
    changed, same = list(days)[:2]
    for day, n in ((changed, days[changed] - 3), (same, days[same])):
        start = datetime(day.year, day.month, day.day, 9, tzinfo=site.zone)
        monday = day - timedelta(days=day.weekday())
        hours = {str(round(start.timestamp() * 1000)): {"cam-1": int(n)}}
        week = earlier.SharedWeek(
            "ground", monday, monday + timedelta(days=6), 0, 9, {}, hours, frozenset(), frozenset()
        )
        earlier.remember(site, [week])
    readers = closed_days(found, site).yesterday
    assert readers is not None
    assert readers.n_days == len(days) - 1


def test_earlier_days_that_a_camera_lacks_in_part_do_not_enter_the_range_of_readers(tmp_path: Path) -> None:
    site = site_of(tmp_path)

    def lost(hours: pd.DataFrame) -> None:
        for week in range(4, 13):
            without(SATURDAY - timedelta(days=1, weeks=week), 10, "cam-2")(hours)

    readers = closed_days(card(site, SATURDAY, 7, change=lost), site).yesterday
    assert readers is not None
    assert readers.reason == Reason("today.whole_days", least=4, has=3)


def test_days_that_differ_by_rounding_alone_are_within_the_range_of_readers(tmp_path: Path) -> None:
    site = site_of(tmp_path)

    def steady(hours: pd.DataFrame) -> None:
        one_more(0, more=6)(hours)
        for week in range(1, 14):
            at = of(hours, day=SATURDAY - timedelta(days=1, weeks=week), hour=9, camera="cam-1")
            hours.loc[at, "n_violations_open"] = 64.0

    readers = closed_days(card(site, SATURDAY, 7, change=steady), site).yesterday
    assert readers is not None
    assert (readers.violations, readers.position) == (70, "within")


def test_a_card_for_readers_expects_no_violations_of_an_hour(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    found = closed_days(card(site, SATURDAY, 7), site)
    assert found.ahead
    assert {(h.violations, h.estimate, h.usual, h.lo, h.hi, h.seen) for h in found.hours} == {(None,) * 6}


def test_an_unknown_floor_is_refused(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), n_weeks=14) as warehouse, pytest.raises(UsageError, match="no floor has the id"):
        today(warehouse, datetime(2026, 11, 14, 12, tzinfo=warehouse.site.zone), floor_id="cellar")


def test_where_days_only_differ_by_chance_one_card_in_twenty_names_a_day(tmp_path: Path) -> None:
    """280 cards of a site whose days differ by a log-normal factor of 15 % and by chance."""
    site = site_of(tmp_path)
    weeks = 54

    def vary(hours: pd.DataFrame) -> None:
        rng = np.random.default_rng(11)
        days = hours["local_date"].astype(str)
        factor = dict(zip(sorted(days.unique()), rng.lognormal(0.0, 0.15, days.nunique()), strict=True))
        busy = np.where(hours["camera_no"] == 0, 20.0, 10.0) * hours["open_s"] / 3600
        hours["n_violations_open"] = rng.poisson(busy * days.map(factor)).astype(float)

    n_cards = n_named = n_unusual = 0
    with planted(site, vary, n_weeks=weeks) as warehouse:
        for k in range(280):
            day = MONDAY + timedelta(days=6 - k)
            found = today(warehouse, datetime(day.year, day.month, day.day, 23, tzinfo=site.zone))
            levels = [d for d in (found.yesterday, found.so_far) if d is not None and d.usual is not None]
            n_cards += len(levels) == 2
            n_unusual += bool(found.unusual.rows)
            n_named += any(d.usual.position(d.violations or 0.0) != "within" for d in levels if d.usual)
    assert n_cards == 280
    assert 1 / 100 < n_named / n_cards < 8 / 100
    assert n_unusual / n_cards <= 8 / 100
