"""The page of alarms: what it says in each situation, in each language, and how it looks to a browser."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import pytest

from vsd_analytics.figures.alarms import Alarm, AlarmDays, alarm_answers, longer_waits
from vsd_analytics.report.pages.alarms import AlarmPage, alarm_html, make_alarm_page
from vsd_analytics.site.instants import day_start_ms
from vsd_analytics.site.model import AlarmRule, Area, Camera, Floor, Site
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import speaking

ROME = ZoneInfo("Europe/Rome")
MONDAY = date(2026, 11, 9)
WEEK = tuple(MONDAY + timedelta(days=k) for k in range(7))
AFTER = datetime(2026, 11, 20, tzinfo=ROME)
QUEUE = AlarmRule("queue-too-full", "gathering", for_s=60.0, area_id="queue", n_people=4)
SILENCE = AlarmRule("camera-dead", "silence", for_s=300.0)
OPENING = (((480, 1260),),) * 7
SQUARE = ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0))
ENGLISH = re.compile(r"\b(the|and|hours?|week|cameras?|since|than|more|people|data|alarms|rings|longest|days?)\b")


def site(*rules: AlarmRule, name: str = "Quayside Market", floors: tuple[str, ...] = ("Ground",)) -> Site:
    return Site(
        "shop",
        name,
        "Europe/Rome",
        Path("/nowhere"),
        floors=tuple(Floor(f"floor-{k}", floor) for k, floor in enumerate(floors)),
        cameras=(Camera("cam-1", "Entrance", "floor-0"), Camera("cam-2", "Aisles", "floor-0")),
        areas=(Area("queue", name if "<" in name else "Checkout queue", "floor-0", SQUARE),),
        opening=OPENING,
        alarms=rules,
    )


def alarm(day: date = MONDAY, hour: int = 12, *, lasted_s: float = 90.0, number: int = 0, **changed: Any) -> Alarm:
    since = datetime(day.year, day.month, day.day, hour, 5, tzinfo=ROME)
    plain = Alarm(
        alarm_id=f"{day}-{hour}-{number}",
        rule_id="queue-too-full",
        kind="gathering",
        floor_id="floor-0",
        camera_id="cam-1",
        area_id="queue",
        since=since,
        started=since + timedelta(seconds=60),
        ended=since + timedelta(seconds=lasted_s),
        lasted_s=lasted_s,
        n_people_max=5,
        nearest_m=0.5,
        x_m=4.5,
        y_m=4.5,
    )
    return replace(plain, **changed)


def silent(day: date = MONDAY, hour: int = 18) -> Alarm:
    people: dict[str, Any] = {"n_people_max": None, "nearest_m": None, "x_m": None, "y_m": None, "area_id": None}
    return alarm(day, hour, lasted_s=3600.0, rule_id="camera-dead", kind="silence", **people)


def recorded(*, without: tuple[int, ...] = (), cameras: tuple[str, ...] = ("cam-1", "cam-2")) -> set[tuple[str, int]]:
    """Return the open hours of the week, but those on Monday that are left out."""
    return {
        (camera, day_start_ms(day, ROME) + hour * 3_600_000)
        for camera in cameras
        for day in WEEK
        for hour in range(8, 21)
        if day != MONDAY or hour not in without
    }


def days(*alarms: Alarm, rules: tuple[AlarmRule, ...] = (QUEUE, SILENCE), **changed: Any) -> AlarmDays:
    waits: Mapping[tuple[str, float], int] = changed.pop("n_waited", {})
    every = {(rule.alarm_id, for_s): 0 for rule, for_s in longer_waits(rules)} | dict(waits)
    given = {"rules": rules, "days": WEEK, "alarms": alarms, "recorded": recorded(), "now": AFTER, "n_waited": every}
    return AlarmDays(**{**given, **changed})


def busy(**changed: Any) -> AlarmDays:
    """40 alarms at the queue, 24 of them at 12:00 and 13:00, and a silence; a wait of 5 minutes is enough."""
    noon = [alarm(WEEK[k % 7], 12 + k % 2, number=k, lasted_s=90.0 + k) for k in range(24)]
    others = [alarm(WEEK[k % 7], (9, 16, 19)[k % 3], number=k) for k in range(16)]
    waits = {("queue-too-full", s): n for s, n in ((120.0, 30), (180.0, 22), (300.0, 21), (600.0, 2))}
    return days(*noon, *others, silent(), **{"n_waited": waits, **changed})


def page(found: AlarmDays, at: Site | None = None) -> AlarmPage:
    here = at or site(*found.rules)
    return make_alarm_page(alarm_answers(found, here), here)


def going_on() -> AlarmDays:
    last = WEEK[-1]
    return days(alarm(last, 20, ended=None, lasted_s=600.0), now=datetime(2026, 11, 15, 20, 30, tzinfo=ROME))


ALL: dict[str, Callable[[], AlarmDays]] = {
    "busy": busy,
    "none": days,
    "no_rules": lambda: days(rules=()),
    "not_recorded": lambda: days(recorded=set()),
    "one": lambda: days(alarm()),
    "gaps": lambda: busy(
        recorded=recorded(without=(17, 18)) - {("cam-2", day_start_ms(WEEK[2], ROME) + 10 * 3_600_000)}
    ),
    "going_on": going_on,
    "no_wait": lambda: busy(n_waited={("queue-too-full", s): 39 for s in (120.0, 180.0, 300.0, 600.0)}),
}


@pytest.mark.parametrize(
    ("name", "headline"),
    [
        ("busy", "41 alarms in week 46, 24 of them at Checkout queue from 12:00 to 14:00"),
        ("none", "No alarm in week 46"),
        ("no_rules", "No alarm rules"),
        ("not_recorded", "No data in week 46: whether there was anything to ring for is not known"),
        ("one", "One alarm in week 46: Checkout queue"),
    ],
)
def test_the_headline_states_the_finding(name: str, headline: str) -> None:
    assert page(ALL[name]()).headline == headline


def test_a_rule_that_rings_too_often_gets_the_least_wait_that_is_enough() -> None:
    [wait] = page(busy()).waits
    assert wait.line == "for_s = 300"
    assert wait.rows[0][1:] == ("40", "5.7")
    assert wait.rows[3] == ("5\u00a0min", "21", "3")
    [wait] = page(ALL["no_wait"]()).waits
    assert wait.line == ""
    assert say("alarms.narrow") in wait.text


def test_a_camera_that_is_silent_too_often_needs_repair_and_no_smaller_area() -> None:
    rules = (SILENCE,)
    many = [silent(day, hour) for day in WEEK for hour in (9, 11, 13, 15)]
    [wait] = page(days(*many, rules=rules, n_waited={("camera-dead", 600.0): 28})).waits
    assert say("alarms.repair") in wait.text
    assert say("alarms.narrow") not in wait.text


def test_a_rule_that_already_waits_long_is_offered_no_longer_wait() -> None:
    slow = replace(QUEUE, for_s=900.0)
    [wait] = page(days(*busy().alarms[:40], rules=(slow,))).waits
    assert (wait.line, len(wait.rows)) == ("", 1)
    assert "10 minutes or more already" in wait.text


def test_few_alarms_are_called_few_enough() -> None:
    shown = page(days(alarm()))
    assert shown.waits == ()
    assert shown.waits_note == say("alarms.none_often", most="3")


def test_hours_that_nobody_recorded_are_hatched_and_not_zero() -> None:
    shown = page(ALL["gaps"]())
    at = {row.label: row.cells for block in shown.blocks for row in block.rows}
    assert (at["17"][0].style, at["17"][0].text) == ("hatch", "")
    assert (at["18"][0].style, at["18"][0].text) == ("hatch", "1")  # of a silent camera
    assert at["10"][2].style == "b0 part"
    assert (at["17"][6].style, at["17"][6].text) == ("b0", "0")
    assert shown.notes[0] == "2 of 91 hours were not recorded: what happened in them is not known."


def test_days_that_were_not_recorded_do_not_lower_the_alarms_a_day() -> None:
    monday_only = {(c, ms) for c, ms in recorded() if ms < day_start_ms(WEEK[1], ROME)}
    [queue, dead] = page(days(*(alarm(number=k) for k in range(4)), recorded=monday_only)).rules
    assert queue[1:4] == ("4", "1", "4")
    assert dead[1:4] == ("0", "7", "0")


def test_alarms_that_began_before_or_go_on_are_mentioned() -> None:
    shown = page(going_on())
    assert "One alarm was still going on at the end." in shown.notes
    assert "Counted until Sun 15 Nov, 20:30: later hours are not over." in shown.notes
    assert shown.longest[0][1] == "10\u00a0min, not over"
    before = alarm(MONDAY - timedelta(days=1), 20)
    assert any("began before the first day" in note for note in page(days(before)).notes)


@pytest.mark.parametrize("people", ["visitors", "staff"])
def test_a_page_says_that_alarms_count_everybody_where_other_figures_do_not(people: str) -> None:
    of_all = site(QUEUE)
    said = "Alarms count everybody, staff and visitors alike, whatever [staff] of vsd.toml says."
    assert said in page(days(alarm(), rules=(QUEUE,)), of_all.with_settings(people=people)).notes
    assert said not in page(days(alarm(), rules=(QUEUE,)), of_all).notes


def test_several_floors_are_named() -> None:
    two = site(QUEUE, floors=("Ground", "First"))
    shown = page(days(alarm(), rules=(QUEUE,)), two)
    assert shown.headline == "One alarm in week 46: Checkout queue (Ground)"
    assert "Alarms of all floors: Ground and First." in shown.notes


def test_the_page_adds_up_to_the_alarms() -> None:
    answers = alarm_answers(busy(), site(QUEUE, SILENCE))
    for name in ("alarm_rules", "alarm_hours"):
        counted = [row["n_alarms"].value or 0 for row in answers[name].rows]  # type: ignore[union-attr]
        assert sum(counted) == len(answers["alarms"].rows) == 41
    assert page(busy()).longest[0][1] == "1\u00a0min\u00a053\u00a0s"
    assert len(page(busy()).longest) == 10


def test_names_are_text_and_the_page_loads_nothing() -> None:
    evil = '<script>alert(1)</script>"{x}'
    html = alarm_html(page(busy(), site(QUEUE, SILENCE, name=evil)))
    assert "<script>" not in html
    assert "default-src 'none'" in html
    assert not re.search(r'(src|href)="(?!data:)', html)


@pytest.mark.parametrize("name", list(ALL))
def test_no_english_word_is_left_in_another_language(name: str) -> None:
    with speaking("it"):
        here = site(*ALL[name]().rules, name="Mercato")
        html = alarm_html(page(ALL[name](), replace(here, areas=(replace(here.areas[0], name="Casse"),))))
    body = re.sub(
        r"<(style|title)>.*?</\1>|<[^>]+>|vsd-analytics|docs/alarms.md|camera-dead",
        " ",
        html[html.index("<body") :],
        flags=re.DOTALL,
    )
    assert not ENGLISH.findall(body)
    assert 'lang="it-IT"' in html


@pytest.mark.browser
@pytest.mark.parametrize("name", list(ALL))
def test_the_page_fits_a_phone_and_is_accessible(
    tab: Callable[..., Any], axe: Callable[..., Any], tmp_path: Path, name: str
) -> None:
    path = tmp_path / f"{name}.html"
    path.write_text(alarm_html(page(ALL[name]())), encoding="utf-8")
    shown = tab(path.as_uri(), bypass_csp=True)
    for scheme, width in (("light", 320), ("dark", 390), ("light", 768), ("dark", 1280)):
        shown.emulate_media(color_scheme=scheme)
        shown.set_viewport_size({"width": width, "height": 700})
        assert shown.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
        assert axe(shown) == [], (scheme, width)
    shown.emulate_media(media="print", color_scheme="light")
    assert axe(shown) == []
