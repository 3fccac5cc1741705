"""`[calendar]` of vsd.toml: public holidays by country and region, events, and what is refused."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st
from site_text import site_text

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, VsdError
from vsd_analytics.site.calendar import Calendar, Event, is_after_clock_change

EVENT = '[[event]]\nname = "Fair"\nfrom = "2026-11-10"\nto = "2026-11-12"\n'


def calendar(folder: Path, text: str) -> Calendar:
    (folder / "vsd.toml").write_text(site_text() + text, encoding="utf-8")
    return load_site(folder).calendar


def the_problem(folder: Path, text: str) -> VsdError:
    with pytest.raises(ConfigError) as caught:
        calendar(folder, text)
    (problem,) = caught.value.problems
    return problem


def test_a_site_without_a_calendar_has_no_special_day(tmp_path: Path) -> None:
    plain = calendar(tmp_path, "")
    assert plain == Calendar()
    assert plain.holiday(date(2026, 12, 25)) is None
    assert plain.event(date(2026, 12, 25)) is None


def test_holidays_are_those_of_the_country_and_its_region(tmp_path: Path) -> None:
    whole = calendar(tmp_path, '[calendar]\ncountry = "DE"\n')
    bavaria = calendar(tmp_path, '[calendar]\ncountry = "DE"\nregion = "BY"\n')
    unity, epiphany = date(2026, 10, 3), date(2026, 1, 6)
    assert whole.holiday(unity) == bavaria.holiday(unity) == "German Unity Day"
    assert (whole.holiday(epiphany), bavaria.holiday(epiphany)) == (None, "Epiphany")


def test_a_country_without_names_in_english_keeps_its_own() -> None:
    assert Calendar("IT", language="it").holiday(date(2026, 12, 8)) == "Immacolata Concezione"
    assert Calendar("IT", language="xx").holiday(date(2026, 12, 8)) == "Immacolata Concezione"


def test_an_event_includes_its_first_and_last_day(tmp_path: Path) -> None:
    fair = Event("Fair", date(2026, 11, 10), date(2026, 11, 12))
    days = [calendar(tmp_path, EVENT).event(date(2026, 11, day)) for day in range(9, 14)]
    assert days == [None, fair, fair, fair, None]


REFUSED = {
    "a country that is none": ('[calendar]\ncountry = "IX"\n', "E124", "no country whose holidays are known"),
    "a region that is none": ('[calendar]\ncountry = "DE"\nregion = "BX"\n', "E124", "is none of DE"),
    "a region without a country": ('[calendar]\nregion = "BY"\n', "E123", "has no country"),
    "an event without a name": (EVENT.replace('name = "Fair"\n', ""), "E123", "has no name"),
    "an event without an end": (EVENT.replace('to = "2026-11-12"\n', ""), "E123", "has no to"),
    "an event that ends first": (EVENT.replace("11-12", "11-09"), "E124", "before it begins"),
    "a day that is none": (EVENT.replace("11-12", "11-31"), "E124", "no date such as"),
    "a key that is none": ('[calendar]\ncountries = "IT"\n', "E122", "knows no key"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_mistake_is_named_with_its_fix(case: str, tmp_path: Path) -> None:
    text, code, words = REFUSED[case]
    problem = the_problem(tmp_path, text)
    assert (problem.code, words in problem.what) == (code, True), problem.what
    assert problem.fix


def test_without_the_library_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "holidays", None)
    problem = the_problem(tmp_path, '[calendar]\ncountry = "IT"\n')
    assert "vsd-analytics[calendar]" in str(problem.fix)


@given(st.dates(date(2022, 1, 1), date(2026, 12, 31)))
def test_the_clocks_changed_in_seven_days_of_a_spring_and_of_an_autumn(day: date) -> None:
    year = [date.fromordinal(n) for n in range(date(day.year, 1, 1).toordinal(), date(day.year + 1, 1, 1).toordinal())]
    after = [d for d in year if is_after_clock_change(ZoneInfo("Europe/Rome"), d)]
    assert len(after) == 14
    assert [after[0].weekday(), after[7].weekday()] == [6, 6]
    assert not any(is_after_clock_change(ZoneInfo("Asia/Tokyo"), d) for d in year)
