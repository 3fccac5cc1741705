"""The planner hour by hour: what its squares hold, for readers and for the operator, and how a page replays a day."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from planner import planted_shop as planted
from planner.written_address import written_address
from privacy.squares_solver import few, known
from report import ingested_worlds as worlds

from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.squares import ClassSteps, SquareClasses, SquareTimes, square_classes
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData, planner_pages
from vsd_analytics.planner.replay import HIDDEN_COUNT, NOT_RECORDED, SHOWN, Replay
from vsd_analytics.site.model import Site

ROME = ZoneInfo("Europe/Rome")
MANY, FEW = (1.2, 4.9), (7.2, 4.9)
"""Somebody always stands at each: ten people an hour take turns at the first, three at the second."""
LOST = (worlds.rome(2, 9), worlds.rome(2, 10))
Open = Callable[..., Any]


def frames(monday: Any, *, has_gap: bool) -> Iterator[dict[str, Any]]:
    lost = [(LOST[0].astimezone(UTC), LOST[1].astimezone(UTC))] if has_gap else []
    for frame in worlds.messages(
        worlds.steady({worlds.AISLE: 20, worlds.DOOR: 20}), monday=monday, hours=(9, 11), lost=lost
    ):
        at = datetime.fromisoformat(frame["ts"])
        hour = at.astimezone(ROME).hour
        frame["persons"] += [
            worlds.person(f"many-{hour}-{at.minute // 6}", *MANY),
            worlds.person(f"few-{hour}-{at.minute // 20}", *FEW),
        ]
        yield frame


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """A week with an hour that was not recorded, and three weeks before it."""
    config = worlds.toml(opening='{ mon-sun = "09:00-11:00" }')
    weeks = [worlds.MONDAY - timedelta(weeks=k) for k in (3, 2, 1, 0)]
    streams = [frames(monday, has_gap=monday == worlds.MONDAY) for monday in weeks]
    return worlds.world(tmp_path_factory.mktemp("replay") / "crowd", config, *streams)


@pytest.fixture(scope="module")
def readers(crowd: Site) -> PlannerData:
    return planner_pages(crowd, worlds.MONDAY)[0]


@pytest.fixture(scope="module")
def operators(crowd: Site) -> PlannerData:
    return planner_pages(planted.with_settings(crowd, mask_below=0), worlds.MONDAY)[0]


def at(found: Replay, place: tuple[float, float]) -> int:
    x, y = (int(v // 2) for v in place)
    return (y - found.grid.y0) * found.grid.n_x + x - found.grid.x0


def replay_of(data: PlannerData) -> Replay:
    assert data.replay is not None
    return data.replay


def test_readers_see_a_class_where_five_people_stood_and_nothing_where_three_did(
    readers: PlannerData, operators: PlannerData
) -> None:
    shown, exact = replay_of(readers), replay_of(operators)
    recorded = shown.state == SHOWN
    assert recorded.sum() == 13
    assert set(shown.now[0, at(shown, MANY), recorded]) == {5}
    assert not shown.now[:, at(shown, FEW)].any()
    assert (exact.now[0, at(exact, MANY), recorded] == 600).all(), "tenths of person-minutes"
    assert (exact.now[0, at(exact, FEW), recorded] >= 600).all()


def test_an_hour_that_was_not_recorded_has_no_squares(readers: PlannerData, operators: PlannerData) -> None:
    for data in (readers, operators):
        found = replay_of(data)
        [lost] = np.flatnonzero(found.state % HIDDEN_COUNT == NOT_RECORDED)
        assert (data.week.panel.weekday[lost], data.week.panel.hour[lost]) == (2, 9)
        assert not found.now[:, :, lost].any()
        assert found.typical[0, at(found, MANY), lost] > 0, "the weeks before have it"


def test_typical_is_the_middle_of_the_weeks_before(readers: PlannerData) -> None:
    found = replay_of(readers)
    assert (found.n_weeks == 3).all()
    assert set(found.typical[0, at(found, MANY)]) == {5}
    assert not found.typical[:, at(found, FEW)].any()


def test_the_page_of_readers_has_the_classes_and_no_number(readers: PlannerData) -> None:
    found, packed = replay_of(readers), planted.PackedStream(render_planner(readers), "replay-data")
    n_hours, n_squares = len(found.state), found.now.shape[1]
    assert packed.many(n_hours) == found.state.tolist()
    assert packed.many(n_hours) == found.n_weeks.tolist()
    for of in (found.now, found.typical):
        rows = packed.one()
        hour, square = np.divmod(np.cumsum(packed.many(rows)), n_squares)
        again = np.zeros_like(of)
        again[0, square, hour], again[1, square, hour] = packed.many(rows), packed.many(rows)
        assert (again == of).all()
        assert of[0].max() <= 5
        assert of[1].max() <= 2


def test_the_solver_works_out_no_time_of_few_people_from_the_page(
    crowd: Site, readers: PlannerData, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It reads the classes of the page beside the exact sums of its hours and square metres, and of areas."""
    asked: list[tuple[SquareTimes, Any, Any]] = []

    def classes(times: SquareTimes, steps: ClassSteps, mask: Mask, *, given: Any, counted: Any) -> SquareClasses:
        asked.append((times, steps, counted))
        return square_classes(times, steps, mask, given=given, counted=counted)

    monkeypatch.setattr("vsd_analytics.planner.replay.square_classes", classes)
    [data] = planner_pages(crowd, worlds.MONDAY)
    (times, steps, counted), found = asked[0], replay_of(data)
    in_min = replace(times, time_ms=times.time_ms / 60_000, close_ms=times.close_ms / 60_000)
    steps_min = ClassSteps(*(tuple(v / 60_000 for v in of) for of in (steps.time_ms, steps.close_ms)))
    mask = Mask(5)
    assert few(times, mask)[at(found, FEW)].sum() == 13
    told = SquareClasses(time=found.now[0], close=found.now[1])
    assert known(in_min, told, steps_min, mask, counted=counted) == []


def test_a_week_without_squares_offers_no_hours(readers: PlannerData) -> None:
    assert 'value="hour"' in render_planner(readers)
    assert 'value="hour"' not in render_planner(replace(readers, replay=None))


@pytest.fixture(scope="module")
def page_files(readers: PlannerData, operators: PlannerData, tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("replay-pages")
    # an hour of few people, and one whose square is new
    found = replay_of(readers)
    state, typical = found.state.copy(), found.typical.copy()
    state[1] = 2 + HIDDEN_COUNT
    typical[0, at(found, MANY), 4] = 3
    made = {"exact": operators, "masked": replace(readers, replay=replace(found, state=state, typical=typical))}
    for name, data in made.items():
        (folder / f"{name}.html").write_text(render_planner(data), encoding="utf-8")
    return folder


@pytest.fixture
def opened(tab: Open, page_files: Path) -> Open:
    def page(name: str, address: str = "", **options: Any) -> Any:
        shown = tab((page_files / f"{name}.html").as_uri() + address, **options)
        shown.wait_for_function("document.body.dataset.ready")
        return shown

    return page


HOUR = "#show=hour&days=0010000&from=10&to=11"
DRAWN = "[...document.querySelector('#replayed').children].map(e => e.getAttribute('d'))"


def chosen(page: Any) -> str:
    return str(page.get_attribute("[data-slot][aria-pressed=true]", "aria-label"))


@pytest.mark.browser
@pytest.mark.parametrize(("scheme", "width"), [("light", 320), ("dark", 390), ("light", 1280), ("dark", 1280)])
def test_every_state_is_accessible_quiet_and_fits(opened: Open, axe: Open, scheme: str, width: int) -> None:
    page = opened("masked", HOUR, color_scheme=scheme, viewport={"width": width, "height": 900}, bypass_csp=True)
    for of in ("", "&as=typical", "&as=difference"):
        page.evaluate("at => { location.hash = at; }", HOUR + of)
        page.wait_for_function("at => (document.body.dataset.as || '') === at", arg=of.partition("=")[2] or "now")
        assert axe(page) == [], of
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0, of
    assert [u for u in page.seen if not u.startswith("data:")] == [page.seen[0]]
    assert page.errors == []


@pytest.mark.browser
def test_the_table_is_a_scrubber_for_keys_and_pointers(opened: Open) -> None:
    page = opened("masked")
    page.check("[name=show][value=hour]")
    page.click("[data-slot='4']")
    assert chosen(page) == "Wednesday, 09:00: no number", "one camera did not record it"
    page.keyboard.press("ArrowDown")
    assert chosen(page).startswith("Wednesday, 10:00: 40")
    assert page.evaluate("document.activeElement.dataset.slot") == "5"
    assert page.evaluate(DRAWN)[4].startswith("M"), "the fifth class"
    page.keyboard.press("ArrowLeft")
    assert chosen(page).startswith("Tuesday, 10:00")
    assert "show=hour" in written_address(page)
    assert "days=0100000" in written_address(page)
    assert page.locator("[data-slot][tabindex='0']").count() == 1
    page.check("[name=show][value=week]")
    assert page.is_hidden("#replay")
    assert "days" not in written_address(page)
    assert page.errors == []


@pytest.mark.browser
def test_play_goes_through_the_day_and_ends_with_it(opened: Open) -> None:
    page = opened("masked", "#show=hour&days=0000100&from=9&to=10")
    page.clock.install()
    page.click("#replay-play")
    assert page.text_content("#replay-play") == "Pause"
    assert page.get_attribute("#out", "aria-live") == "off"
    page.clock.run_for(3100)
    assert chosen(page).startswith("Friday, 10:00")
    page.clock.run_for(3100)
    assert page.text_content("#replay-play") == "Play the day"
    assert chosen(page).startswith("Friday, 10:00")
    assert page.is_disabled("#replay-next")
    page.click("#replay-back")
    assert chosen(page).startswith("Friday, 09:00")


@pytest.mark.browser
def test_an_hour_without_squares_says_why_and_what_is_not_known_is_not_the_same(opened: Open) -> None:
    page = opened("masked", "#show=hour&days=1000000&from=10&to=11")
    assert "Too few people" in page.text_content("#replay-now")
    assert page.evaluate(DRAWN)[12] != "", "dotted"
    assert not any(page.evaluate(DRAWN)[:11])
    page.click("[data-slot='4']")
    assert "Not all cameras" in page.text_content("#replay-now")
    assert page.evaluate(DRAWN)[11] != "", "hatched"
    page.click("[data-slot='5']")
    page.check("[name=as][value=difference]")
    assert page.text_content("#replay-now").endswith("Typical: the middle of 3 weeks before with this hour.")


@pytest.mark.browser
def test_numbers_are_the_operators(opened: Open) -> None:
    assert "60" in opened("exact", HOUR).locator("#numbers text").all_text_contents()
    assert opened("masked", HOUR).locator("#numbers").count() == 0


@pytest.mark.browser
def test_paper_and_drawings_show_the_chosen_hour(opened: Open) -> None:
    page = opened("masked", HOUR)
    page.emulate_media(media="print")
    assert page.is_visible("#replay-now")
    assert page.is_hidden("#replay-hours")
    page.emulate_media(media="screen")
    with page.expect_download() as download:
        page.click("#save-svg")
    drawing = Path(download.value.path()).read_text(encoding="utf-8")
    assert 'id="map-5"' in drawing
    assert "Hour by hour" in drawing
    assert "This hour" in drawing
