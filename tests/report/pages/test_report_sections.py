"""Sections beyond the week and its map: weeks, spots, readings, redesigns, causes, outlook, unusual hours."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from types import SimpleNamespace
from typing import Any

import pytest
from report import model_classes as m
from report import sample_sections as sections
from report import sample_weeks as weeks
from shapely import Polygon

from vsd_analytics.answer import Reason
from vsd_analytics.figures.forecast import FloorForecast as FoundOutlook
from vsd_analytics.figures.forecast import HourForecast, SeriesForecast
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.unusual import UnusualWeek
from vsd_analytics.figures.week import change_effects, outlook, trend_weeks
from vsd_analytics.report.draw.trend_chart import NARROW, WIDE, chart, spark
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages import questions
from vsd_analytics.report.pages import sections as page_sections
from vsd_analytics.report.pages.spot_cards import cards
from vsd_analytics.report.pages.week import make_page, render_html
from vsd_analytics.site.calendar import Calendar
from vsd_analytics.site.model import Area, Fixture, Floor
from vsd_analytics.stats.decomposition import Mixing, MixingChange
from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate
from vsd_analytics.stats.forecast import ForecastScore
from vsd_analytics.stats.trend import WeekRates
from vsd_analytics.stats.unusual import Unusual
from vsd_analytics.wording.reasons import reason_text

NIGHT = datetime(2026, 11, 13, 2, tzinfo=sections.ROME)


def seen(page: str) -> str:
    """Return the text of a page."""
    bare = re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", bare))


# ---- weeks ----


@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_weeks_are_never_joined_over_a_gap_and_start_at_zero(width: int) -> None:
    trend = sections.trend(weeks.normal())
    drawing = chart(trend, "violation_rate", width=width, label="weeks")
    assert drawing.count('class="tl"') == 10 - 1 - 2  # nine steps, less the two beside the gap
    assert drawing.count('class="tg"') == 1
    assert drawing.count("<circle") == 9
    assert drawing.count('class="tw"') == 9
    assert len(re.findall(r'class="axt"[^>]*>0<', drawing)) == 1
    assert drawing.count('class="tm"') == 2


def test_a_higher_week_is_drawn_higher_and_by_the_same_scale() -> None:
    trend = sections.trend(weeks.normal())
    drawing = chart(trend, "violation_rate", width=WIDE, label="weeks")
    y = [float(v) for v in re.findall(r'<circle[^>]*cy="([\d.]+)"', drawing)]
    values = [w.violation_rate.value for w in trend.weeks if w.violation_rate is not None]
    zero = float(re.findall(r'class="zero"[^>]*y1="(\d+)"', drawing)[0])
    ratios = [(zero - at) / (value or 1.0) for at, value in zip(y, values, strict=True)]
    assert max(ratios) == pytest.approx(min(ratios), rel=0.01)


def test_a_change_is_marked_where_it_lies_in_its_week() -> None:
    trend = sections.trend(weeks.normal())
    monday = replace(trend.marks[1], at=datetime(2026, 11, 9, 0, 0, tzinfo=weeks.ROME))
    sunday = replace(trend.marks[1], at=datetime(2026, 11, 15, 23, 0, tzinfo=weeks.ROME))

    def x(mark: m.TrendMark) -> int:
        drawing = chart(replace(trend, marks=(mark,)), "violation_rate", width=WIDE, label="weeks")
        return int(re.findall(r'class="tm"[^>]*x1="(\d+)"', drawing)[0])

    dots = [
        int(v) for v in re.findall(r'<circle[^>]*cx="(\d+)"', chart(trend, "violation_rate", width=WIDE, label="weeks"))
    ]
    assert dots[-2] < x(monday) < dots[-1] < x(sunday)


def test_a_whisker_that_would_flatten_all_others_is_cut_with_an_arrow() -> None:
    trend = sections.trend(weeks.normal())
    wild = replace(trend.weeks[0], violation_rate=m.Estimate(value=139.0, lo=20.0, hi=9000.0))
    drawing = chart(replace(trend, weeks=(wild, *trend.weeks[1:])), "violation_rate", width=WIDE, label="weeks")
    assert drawing.count('class="tn" fill="#1b2430"') == 1
    assert "9,000" not in drawing


def test_the_small_line_is_broken_at_the_gap_and_absent_with_two_weeks() -> None:
    trend = sections.trend(weeks.normal())
    assert len(re.findall(r'd="([^"]*)"', spark(trend, "violation_rate"))[0].split("M")) == 3
    assert spark(sections.trend(weeks.normal(), n=2), "violation_rate") == ""
    assert spark(None, "close") == ""


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (100.0, "week 46 is below the usual range"),
        (140.0, "week 46 is in the usual range"),
        (200.0, "week 46 is above the usual range"),
    ],
)
def test_a_week_is_notable_by_the_range_of_the_weeks_before(value: float, said: str) -> None:
    report = weeks.normal()
    level = replace(report.level, violation_rate=m.Estimate(value=value, lo=value - 10, hi=value + 10))
    report = replace(report, level=level)
    assert page_sections.trend_title(replace(report, trend=sections.trend(report)), "violation_rate") == said


def test_before_four_weeks_there_is_no_usual_range() -> None:
    report = weeks.normal()
    assert (
        page_sections.trend_title(replace(report, trend=sections.trend(report, n=4)), "violation_rate")
        == "4 weeks so far"
    )
    page = render_html(replace(report, trend=sections.trend(report, n=4)))
    assert "usual range" not in seen(page)


def test_a_week_with_other_cameras_is_drawn_apart_and_named() -> None:
    report = weeks.normal()
    found = sections.trend(report)
    other = replace(found.weeks[2], missing=("Entrance",))
    page = render_html(replace(report, trend=replace(found, weeks=(*found.weeks[:2], other, *found.weeks[3:]))))
    assert 'stroke-dasharray="2 2"' in page
    assert "Not comparable: Camera “Entrance” recorded too little" in seen(page)
    assert 'stroke-dasharray="2 2"' not in render_html(replace(report, trend=found))


def test_the_first_week_has_no_chart_but_a_table() -> None:
    report = replace(weeks.first_week(), trend=sections.trend(weeks.first_week(), n=1))
    page = render_html(report)
    assert 'class="tr ' not in page
    assert "This is the first week" in page
    assert "Weeks so far" in page


def test_the_last_week_of_the_trend_is_the_headline_and_small_counts_are_held_back() -> None:
    report = weeks.normal()
    monday = weeks.MONDAY - timedelta(weeks=1)

    def rate(n: float) -> RateEstimate:
        return RateEstimate(n / 40, n / 50, n / 30, n, 40.0, 7, 6.0, 0.1, "ok", None, False)

    found = trend_weeks.analysis.FloorTrend(
        floor_id="ground",
        weeks=tuple(
            WeekRates(day, rate(count), rate(count), None, 1.0, "ok", None)
            for day, count in ((monday, 3.0), (weeks.MONDAY, 900.0))
        ),
        marks=(),
        cameras=(),
        left_out=(),
        state="ok",
        reason=None,
        encounter_rate_reason=None,
    )
    made = trend_weeks.trend(_Data(), found, level=report.level)  # type: ignore[arg-type]
    assert made.weeks[1].violation_rate == report.level.violation_rate
    assert made.weeks[0].violation_rate is not None
    assert (made.weeks[0].violation_rate.value, made.weeks[0].violation_rate.lo) == (None, None)
    assert "fewer than 5" in reason_text(made.weeks[0].violation_rate.reason)


class _Settings:
    mask_below = 5
    confidence = 0.95


class _Site:
    settings = _Settings()
    calendar = Calendar()
    closed: frozenset[date] = frozenset()
    zone = weeks.ROME


class _Data:
    """As much of a week's data as the sections ask for."""

    site = _Site()
    mask = Mask(5)
    monday = weeks.MONDAY
    sunday = weeks.MONDAY + timedelta(days=6)
    areas = (Area("a1", "Main entrance", "ground", ((0, 0), (1, 0), (1, 1))),)
    floor = Floor("ground", "Ground floor")

    def hidden_in(self, monday: date) -> SimpleNamespace:
        """Return a week that holds nothing back."""
        return SimpleNamespace(why_floor=None)


# ---- spots ----


def rectangle(x0: float, y0: float, x1: float, y1: float) -> tuple[tuple[float, float], ...]:
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


TILL = Fixture("till", "Till 1", "ground", rectangle(2, -1.5, 3, -0.5), "till")
PILLAR = Fixture("pillar", "Pillar", "ground", rectangle(-2, 0, -1, 1), "wall")
STAND = Fixture("stand", "Stand", "ground", rectangle(-1.5, 0, -0.5, 1), "shelf", is_movable=True)
SHELVES = tuple(Fixture(f"s{k}", f"Shelf {k}", "ground", rectangle(x, 1, x + 0.8, 9)) for k, x in enumerate((0, 3)))


@pytest.mark.parametrize(
    ("name", "shape", "fixtures", "said"),
    [
        ("Hall", rectangle(0, 0, 9, 2), (TILL,), "second line"),
        ("Hall", rectangle(0, 0, 3, 2), (TILL,), "spread out"),
        ("Checkout", rectangle(0, 0, 3, 2), (), "second line"),
        ("Hall", rectangle(0, 0, 3, 2), (PILLAR, STAND), "“Stand” be moved"),
        ("Hall", rectangle(0, -3, 4, 0.5), SHELVES, "one direction"),
        ("Hall", rectangle(0, 0, 4, 9), SHELVES, "spread out"),
        ("Front door", rectangle(0, 0, 3, 2), (PILLAR,), "free of things that make people stop"),
        ("Aisle 4", rectangle(0, 0, 3, 2), (), "one direction"),
    ],
)
def test_what_is_asked_follows_shape_fixtures_and_name(
    name: str, shape: Any, fixtures: tuple[Fixture, ...], said: str
) -> None:
    asked = questions.remedies(name, Polygon(shape), area=None, fixtures=fixtures)[0].text
    assert said in asked
    assert asked.endswith("?")


def test_a_site_may_ask_its_own_question() -> None:
    area = Area("hall", "Hall", "ground", rectangle(0, 0, 3, 2), ask="Could the bench go?")
    made = questions.remedies("Hall", Polygon(area.polygon), area=area, fixtures=(STAND,))
    assert made[0].text == "Could the bench go?"


def test_a_place_in_doubt_is_checked_before_anything_costly_is_proposed() -> None:
    made = questions.remedies("Aisle 4", Polygon(rectangle(0, 0, 3, 2)), area=None, fixtures=(STAND,), is_unsure=True)
    assert [r.key for r in made] == ["check", "spread", "fewer"]
    assert made[0].text.startswith("Are people really this close together at Aisle 4?")


def test_a_card_says_how_sure_with_dots_a_word_and_the_reason() -> None:
    made = cards(sections.complete())
    assert made is not None
    assert [sum(c.dots) for c in made.cards] == [3, 2, 1]
    assert [c.sure for c in made.cards] == ["High.", "Medium.", "Low."]
    assert made.cards[0].reason == "Seen on 7 of 7 open days, 96% of hours recorded, positions accurate to 0.31 m."
    assert made.cards[1].reason == "Seen on 1 of 7 open days, 96% of hours recorded, position error not known."
    assert made.cards[2].reason == "Camera “Aisles” missed 10 hours of its usual hours."
    assert made.cards[0].when == "Half of them from 11:00 to 18:00, most on Saturday"
    assert (made.cards[1].change, made.cards[1].direction) == ("43% fewer than in week 45", "good")


def test_tested_spots_say_so_and_busiest_ones_say_why_they_are_not() -> None:
    tested, busiest = cards(sections.with_tested_spots()), cards(sections.complete())
    assert tested is not None
    assert busiest is not None
    assert tested.title == "The two spots riskier than their crowd explains"
    assert [c.change for c in tested.cards] == [
        "Stands out since week 43 or longer",
        "New this week",
    ]
    assert busiest.title == "The three busiest spots"
    assert "fewer than 300 violations" in busiest.sub
    assert "ranked by how much time could be saved" in render_html(sections.with_tested_spots())


def test_a_place_that_is_watched_after_a_change_is_named_below_the_cards() -> None:
    report = sections.with_tested_spots()
    assert report.spots is not None
    watching = (m.WatchedSpot(name="Door", area_id="door", changed_on=date(2026, 11, 9)),)
    said = "Door: changed on Mon 9 Nov; watching since."
    assert said not in render_html(report)
    assert said in render_html(replace(report, spots=replace(report.spots, watching=watching)))


# ---- what happened at the site ----


def test_the_site_log_is_there_once_and_names_the_letters_of_the_charts() -> None:
    report = sections.complete()
    report = replace(report, log=(*report.log, m.LogLine(at=NIGHT, kind="detected", text="Camera off")))
    page = make_page(report)
    assert page.log_section == "trend"
    assert [r.label for r in page.log if r.label] == ["A", "B"]
    assert [r.about for r in page.log if r.text == "Camera off."] == ["Found in the data, not logged."]
    texts = [r.text for r in page.log]
    assert len(texts) == len(set(texts)), "what is marked and logged stands once"
    assert render_html(report).count(">Logged at the site<") == 1


def test_without_charts_the_log_is_part_of_what_changed() -> None:
    report = weeks.normal()
    page = make_page(report)
    assert page.log_section == "changed"
    assert [(r.label, r.text) for r in page.log] == [("", line.text) for line in report.log]
    section = render_html(report).split('id="changed"')[1].split("</section>")[0]
    assert "Logged at the site" in section


# ---- readings ----


def test_both_readings_are_side_by_side_with_their_accuracy() -> None:
    page = make_page(sections.complete())
    assert page.tiles[0].also == "Without people together: 98"
    assert "81% (likely between 78% and 84%) remain" in page.readings_note
    assert page.between == {"a0": pytest.approx(37.6), None: pytest.approx(16.2)}
    assert "Of these between groups" in seen(render_html(sections.complete()))


def test_a_camera_that_takes_no_part_is_named_beside_the_figure_it_is_missing_from() -> None:
    assert (
        make_page(sections.with_tested_spots()).tiles[0].also
        == "Without people together: 98 of 101 (without Camera “Aisles”)"
    )


def test_where_there_is_no_second_reading_the_page_says_why() -> None:
    page = make_page(sections.refused())
    assert page.tiles[0].also == ""
    assert page.readings_note == (
        "Violations between groups cannot be counted: track ids are cut: 38% end where another begins."
    )
    assert "Of these between groups" not in seen(render_html(sections.refused()))


# ---- what changed ----


def mixing(**more: Any) -> MixingChange:
    period = Mixing(1.0, 1.0, 0.1, 0.1, 1.0, 0.9, 1.1, 7, "ok", None)
    behaviour = ChangeEstimate(1.1, 0.9, 1.3, 1.0, 1.1, 90, 99, 9.0, 9.0, 7, 6.0, 0.1, "cannot_tell", "ok", None, False)
    said: dict[str, Any] = {"close": 0.8, "crowding": 0.7, "layout": 1.04, "behaviour": behaviour}
    said |= {"crowding_share": None, "layout_share": None, "behaviour_share": None, "state": "ok", "reason": None}
    return MixingChange(period, period, **(said | more))


def test_causes_are_factors_of_the_whole_change() -> None:
    found = change_effects.causes(mixing(close=0.7 * 1.04 * 1.1))
    parts = (found.people or 0) + 1, (found.layout or 0) + 1, (found.behaviour or 0) + 1
    assert parts[0] * parts[1] * parts[2] == pytest.approx((found.close or 0) + 1)


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ((-0.3, 0.01, 0.0), "People spent 31% less time closer than 2 m. The largest part: fewer people came."),
        (
            (0.02, 0.3, 0.0),
            "People spent 31% more time closer than 2 m. The largest part: people gathered in fewer places.",
        ),
        (
            (0.0, 0.0, -0.2),
            "People spent 31% less time closer than 2 m. "
            "The largest part: people kept farther apart in the same places.",
        ),
    ],
)
def test_the_largest_part_that_moved_the_same_way_is_named(parts: tuple[float, float, float], said: str) -> None:
    close = 0.31 if "more time" in said else -0.31
    people, layout, behaviour = parts
    causes = m.Causes(close=close, people=people, layout=layout, behaviour=behaviour)
    report = weeks.normal()
    way = "clear_rise" if close > 0 else "clear_fall"
    level = replace(report.level, violation_rate=replace(report.level.violation_rate, verdict=way))
    table = page_sections.causes(replace(report, causes=causes, level=level))
    assert table is not None
    assert table.sentence == said


def test_no_part_of_a_change_is_named_that_is_not_clear() -> None:
    report = weeks.normal()
    level = replace(
        report.level,
        violation_rate=replace(report.level.violation_rate, verdict="cannot_tell"),
        close_time_share=None,
    )
    causes = m.Causes(close=-0.31, people=-0.3, layout=0.01, behaviour=0.0)
    table = page_sections.causes(replace(report, causes=causes, level=level))
    assert table is not None
    assert (table.rows, table.sentence) == ((), "")
    (note,) = table.notes
    assert note.startswith("Whether people spent more or less time closer than 2 m")


def test_what_hardly_moved_is_not_explained() -> None:
    causes = m.Causes(close=-0.01, people=-0.02, layout=0.01, behaviour=0.0)
    table = page_sections.causes(replace(weeks.normal(), causes=causes))
    assert table is not None
    assert table.sentence.endswith("No single part changed much.")


RUNNING = m.Estimate(value=None, change=-0.31, change_lo=-0.42, change_hi=-0.18, verdict="clear_fall")
NET = m.Estimate(value=None, change=-0.04, change_lo=-0.2, change_hi=0.1, verdict="cannot_tell")


def with_effect(report: WeekReport, **more: object) -> WeekReport:
    """Return a report whose first logged change has an effect."""
    first, *rest = report.change_effects
    return replace(report, change_effects=(replace(first, running=RUNNING, net=NET, **more), *rest))


def test_a_redesign_is_reported_with_its_one_effect_its_people_and_what_must_hold() -> None:
    table = page_sections.change_effects(with_effect(sections.complete()))
    assert table is not None
    head, effect, floor = table.rows
    assert (head.is_head, head.name, head.bar) == (True, "Fourth till opened.", "")
    assert (effect.name, effect.words, effect.detail) == (
        "In its area, all weeks so far",
        "Clear fall, −31%",
        "likely −42% to −18%",
    )
    assert (floor.name, floor.words, floor.detail) == (
        "Whole floor, from whatever cause",
        "−4%",
        "likely −20% to +10%",
    )
    assert head.note.startswith(
        "Checkout queue, Wed 7 Oct. Compared with End of aisle 2 and Pharmacy counter, 4 weeks before and after. "
        "People there: 4% more."
    )
    assert "Reasons for doubt: another entry" in head.note
    (assumed,) = table.notes
    assert "its area and the comparison areas would have moved alike" in assumed


def test_a_change_without_an_effect_has_no_bars() -> None:
    assert page_sections.change_effects(sections.complete()) is None


def test_encounters_per_person_hour_of_a_redesign_are_not_judged_on_the_page() -> None:
    """They rise where people stand about less, so a good change would be a clear rise beside a clear fall."""
    rise = m.Estimate(value=None, change=0.58, change_lo=0.19, change_hi=1.09, verdict="clear_rise")
    table = page_sections.change_effects(with_effect(sections.complete(), effect=rise))
    assert table is not None
    assert "rise" not in " ".join(row.words for row in table.rows)


# ---- outlook and unusual hours ----


def test_the_three_highest_hours_are_forecast_and_scored_beside_the_naive_forecast() -> None:
    monday = date(2026, 11, 16)
    rows = tuple(
        HourForecast(monday + timedelta(days=d), d, 10 + d, 1.0, value, 1.0, 9.0, 6)
        for d, value in enumerate((3.0, 8.0, None, 5.0, 4.0))
    )
    score = ForecastScore(0.2, 0.8, 0.75, 0.8, 0.3, 1.1, 60, "ok", None)
    series = SeriesForecast("violations", "open hour", rows, 0.8, 1.0, 6, score, "ok", None)
    found = FoundOutlook("2026-W47", monday, "2026-W46", "ground", (), (), (), series, series, series)
    made = outlook.outlook(found)
    assert [h.value for h in made.highest] == [8.0, 5.0, 4.0]
    assert made.mean == pytest.approx(5.0)
    assert made.score == m.OutlookScore(error=0.2, error_naive=0.3, hit_rate=0.75, n_hours=60)
    listed = page_sections.outlook(replace(weeks.normal(), outlook=made))
    assert listed is not None
    assert listed.title == "Tuesday 11:00 is likely to be the busiest hour of week 47"
    assert "was off by 20%; repeating the week before, by 30%" in " ".join(listed.notes)


def test_an_hour_the_timetable_holds_back_is_held_back_among_the_unusual_ones() -> None:
    when = weeks.normal().when
    small = next(c for c in when.cells if c.is_masked)
    shown = next(c for c in when.cells if c.violations)
    rows = tuple(
        Unusual(c.day, c.day.weekday(), c.hour, 3, 1.0, 50.0, 30.0, 70.0, 0.1, 0.01, 6) for c in (small, shown)
    )
    made = outlook.unusual(UnusualWeek("2026-W46", None, "violations", rows, 2, 80, "ok", None), when=when)
    assert [r.violations for r in made.rows] == [None, 3]


def test_what_is_refused_is_said_in_a_line_and_not_in_a_section() -> None:
    page = render_html(sections.refused())
    text = seen(page)
    assert 'id="next"' not in page
    assert "Week 47 cannot be forecast yet: a forecast needs 4 recorded weeks, has 2." in text
    assert "Unusual hours cannot be found yet: a usual value needs 4 earlier recorded weeks, has 1." in text
    assert (
        "The change cannot be split into people, room and behaviour: needs at least 20 person-hours, has 4.2." in text
    )
    assert "A trend needs three recorded weeks; a forecast and unusual hours need four." in text


def test_what_only_needs_more_weeks_is_said_once() -> None:
    report = sections.refused()
    assert report.outlook is not None
    assert report.unusual is not None
    report = replace(
        report,
        outlook=replace(report.outlook, reason=Reason("forecast.weeks", least=4, has=2)),
        unusual=replace(report.unusual, reason=Reason("unusual.weeks", least=4, has=1)),
    )
    text = seen(render_html(report))
    assert "A trend needs three recorded weeks; a forecast and unusual hours need four." in text
    assert "cannot be forecast yet" not in text
    assert "Unusual hours cannot be found yet" not in text


# ---- units ----


@pytest.mark.parametrize("name", ["complete", "with_tested_spots", "empty", "first_week", "settings_changed"])
def test_a_site_in_feet_reads_feet_everywhere(name: str) -> None:
    report = {**weeks.ALL, **sections.MORE}[name]()
    rules = replace(report.rules, distance_m=1.8288, distance_unit="ft")
    change = report.settings_change and replace(report.settings_change, before="5 ft", after="6 ft")
    maps = tuple(replace(x, scale_bar_m=3.048) for x in report.maps)
    log = tuple(replace(line, text="Moved.") for line in report.log)
    report = replace(report, rules=rules, settings_change=change, maps=maps, log=log, change_effects=(), story=None)
    if report.trend is not None:
        report = replace(report, trend=replace(report.trend, marks=()))
    page = render_html(report)
    assert re.search(r"6[ \u00a0]ft", page)
    assert re.findall(r"\d[ \u00a0]m\b", seen(page)) == []
    assert re.findall(r"(?<![\w.])2[ \u00a0]m\b", page) == []


def test_every_instant_of_the_sections_is_local() -> None:
    found = sections.trend(weeks.normal())
    for mark in found.marks:
        utc = replace(mark, at=mark.at.astimezone(UTC))
        assert utc.at == mark.at


def test_further_figures_are_reported_by_the_catalogue_and_refused_with_their_reason() -> None:
    rows = {r.name: r for r in make_page(sections.complete()).further_figures}
    assert rows["How long violations last: median"].value == "12"
    assert rows["How long violations last: 30 s or longer"].likely == "29% and 36%"
    assert rows["Of the time too close, nearest person at 0 m to 0.5 m"].value == "4%"
    assert rows["Of the time in company, 8+ people close together"].value == "5%"
    assert rows["Share of time too close if the limit were 1.8 m"].value == "46%"
    by_error = "The same at 2 m if all distances were too long or too short by what the calibrations state"
    assert (rows[by_error].value, rows[by_error].likely) == ("38% and 47%", "–")
    refused = rows["Gatherings: three or more people who stay together"]
    assert (refused.value, refused.reason) == ("", "The engine sends no track ids.")
