"""Planted gatherings, contacts and silences: each reported once, when it is due, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from alarm_worlds import (
    CONTACT,
    GATHERING,
    SILENCE,
    WEEKDAYS,
    at,
    frame,
    make_site,
    quiet,
    row,
    run,
    stand,
    tables_of,
    told,
    walk,
)
from simulate.small_scenes import START_MS, merge

from vsd_analytics.live.alarms import AlarmEngine
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import AlarmRule, Area, Calibration, Camera


def seconds(*values: int) -> set[int]:
    return {START_MS + v * 1000 for v in values}


def without(messages: list, *lost_s: int, people: tuple[str, ...] | None = None) -> list:
    """Return messages without those of the given seconds, or without these people in them."""
    instants = {m["ts"] for m in (frame("cam-1", START_MS + s * 1000, []) for s in lost_s)}
    if people is None:
        return [m for m in messages if m["ts"] not in instants]
    return [
        m if m["ts"] not in instants else {**m, "persons": [p for p in m["persons"] if p["id"] not in people]}
        for m in messages
    ]


# --- gatherings ---


def test_four_people_for_61_s_are_one_start_and_one_end() -> None:
    events = run(make_site(GATHERING), merge(stand(row(4), 61), quiet(100)))
    assert told(events) == [("start", 60), ("end", 61)]
    start, end = (e.as_dict(make_site().zone) for e in events)
    assert start == {
        "alarm": events[0].alarm,
        "rule": "crowd",
        "kind": "gathering",
        "event": "start",
        "at": "2026-11-09T08:01:00.000+00:00",
        "since": "2026-11-09T08:00:00.000+00:00",
        "lasted_s": 60.0,
        "site": "shop",
        "area": "queue",
        "camera": "cam-1",
        "floor": "ground",
        "x_m": 4.5,
        "y_m": 3.0,
        "n_people": 4,
        "n_people_max": 4,
        "nearest_m": 1.0,
    }
    assert end == {**start, "event": "end", "at": "2026-11-09T08:01:01.000+00:00", "lasted_s": 61.0}


def test_four_people_for_59_s_are_none() -> None:
    assert run(make_site(GATHERING), merge(stand(row(4), 59), quiet(100))) == []


def test_three_people_are_no_gathering_of_four() -> None:
    assert run(make_site(GATHERING), merge(stand(row(3), 200), quiet(300))) == []


def test_people_exactly_at_the_distance_are_not_close() -> None:
    assert run(make_site(GATHERING), stand(row(4, x=0.5, apart=2.0), 100)) == []
    assert told(run(make_site(GATHERING), stand(row(4, x=0.5, apart=1.999), 100))) == [("start", 60)]


def test_a_gathering_outside_the_area_is_none_of_its_rule() -> None:
    outside = merge(stand(row(4, x=20.0), 100), quiet(120))
    assert run(make_site(GATHERING), outside) == []
    assert told(run(make_site(replace(GATHERING, area_id=None)), outside)) == [("start", 60), ("end", 100)]


def test_an_area_on_another_floor_does_not_count() -> None:
    upstairs = replace(make_site(GATHERING), areas=(Area("queue", "Q", "upper", ((0, 0), (9, 0), (9, 9), (0, 9))),))
    assert run(upstairs, merge(stand(row(4), 100), quiet(120))) == []


def test_who_joins_is_reported_at_once_and_who_passes_by_again_is_not() -> None:
    passing = walk([((2.0, 0.0), (2.0, 8.0))], 8, start_s=70, first_id=9)
    again = walk([((2.0, 0.0), (2.0, 8.0))], 8, start_s=90, first_id=10)
    events = run(make_site(GATHERING), merge(stand(row(4), 110), passing, again, quiet(120)))
    assert told(events) == [("start", 60), ("update", 72), ("end", 110)]
    assert [(e.n_people, e.n_people_max) for e in events] == [(4, 4), (5, 5), (4, 5)]
    assert len({e.alarm for e in events}) == 1


def test_an_open_alarm_is_reported_again_every_minute() -> None:
    events = run(make_site(GATHERING), merge(stand(row(4), 250), quiet(300)))
    assert told(events) == [("start", 60), ("update", 120), ("update", 180), ("update", 240), ("end", 250)]


@pytest.mark.parametrize("people", [None, ("1",), ("1", "2", "3", "4")])
def test_a_frame_or_track_lost_for_a_moment_breaks_nothing(people: tuple[str, ...] | None) -> None:
    messages = without(stand(row(4), 61), 20, 21, 40, people=people)
    assert told(run(make_site(GATHERING), merge(messages, quiet(19), quiet(58, start_s=42)))) == [
        ("start", 60),
        ("end", 61),
    ]


def test_a_gap_longer_than_that_of_an_episode_begins_anew() -> None:
    still = without(stand(row(4), 75), 20, 21)
    assert told(run(make_site(GATHERING), merge(still, quiet(100)))) == [("start", 60), ("end", 75)]
    broken = without(stand(row(4), 75), 20, 21, 22)
    assert run(make_site(GATHERING), merge(broken, quiet(100))) == []


def test_slow_engines_may_miss_one_frame_too() -> None:
    frames = [m for i, m in enumerate(stand(row(4), 70, interval_s=5.0)) if i != 6]
    assert told(run(make_site(GATHERING), merge(frames, quiet(60, start_s=75, interval_s=5.0)))) == [
        ("start", 60),
        ("end", 70),
    ]


def test_people_may_change_as_long_as_two_stay() -> None:
    shifts = [stand(row(4), 20, start_s=k * 20, first_id=1 + 2 * k) for k in range(4)]
    assert told(run(make_site(GATHERING), merge(*[s[:-1] for s in shifts], quiet(100)))) == [("start", 60), ("end", 79)]
    strangers = [stand(row(4), 19, start_s=k * 20, first_id=1 + 4 * k) for k in range(4)]
    assert run(make_site(GATHERING), merge(*strangers, quiet(100))) == []


def test_two_gatherings_at_once_are_two_alarms_also_when_they_part_and_meet() -> None:
    both = merge(stand(row(4), 80), stand(row(4, y=8.0), 80, first_id=11), quiet(100))
    events = run(make_site(GATHERING), both)
    assert told(events) == [("start", 60)] * 2 + [("end", 80)] * 2
    assert len({e.alarm for e in events}) == 2
    # eight in a row; the link in the middle breaks for a second: still one alarm
    chain = stand(row(8, x=1.0), 80)
    apart = [(x + (1.5 if k > 3 else 0.0), y) for k, (x, y) in enumerate(row(8, x=1.0))]
    chain[30] = stand(apart, 30)[30]
    assert told(run(make_site(GATHERING), merge(chain, quiet(100)))) == [("start", 60), ("end", 80)]


def test_there_is_no_alarm_when_the_site_is_closed() -> None:
    night = make_site(GATHERING, opening=(((600, 1260),),) * 7)
    assert run(night, merge(stand(row(4), 100), quiet(120))) == []
    assert run(make_site(GATHERING, closed=frozenset({at(0).date()})), stand(row(4), 100)) == []
    always = make_site(replace(GATHERING, is_open_only=False), opening=(((600, 1260),),) * 7)
    assert told(run(always, merge(stand(row(4), 100), quiet(120)))) == [("start", 60), ("end", 100)]


def test_a_gathering_ends_when_the_site_closes() -> None:
    events = run(make_site(GATHERING, opening=(((0, 495),),) * 7), merge(stand(row(4), 1000), quiet(1100)))
    assert told(events)[-1] == ("end", 899)


def test_the_same_place_stays_quiet_after_an_end_and_a_long_one_is_reported_after_that() -> None:
    rule = replace(GATHERING, cooldown_s=100.0)
    again = merge(stand(row(4), 70), stand(row(4), 60, start_s=90, first_id=11), quiet(300))
    assert told(run(make_site(rule), again)) == [("start", 60), ("end", 70)]
    longer = merge(stand(row(4), 70), stand(row(4), 120, start_s=90, first_id=11), quiet(300))
    assert told(run(make_site(rule), longer)) == [("start", 60), ("end", 70), ("start", 170), ("end", 210)]


def test_without_an_area_the_cool_down_is_of_the_place() -> None:
    rule = replace(GATHERING, area_id=None)
    near = merge(stand(row(4), 70), stand(row(4, y=5.0), 70, start_s=90, first_id=11), quiet(300))
    assert [e.event for e in run(make_site(rule), near)] == ["start", "end"]
    far = merge(stand(row(4), 70), stand(row(4, y=9.0), 70, start_s=90, first_id=11), quiet(300))
    assert [e.event for e in run(make_site(rule), far)] == ["start", "end", "start", "end"]


def test_a_rule_may_be_about_some_cameras_only() -> None:
    world = merge(stand(row(4), 70), quiet(100))
    assert run(make_site(replace(GATHERING, camera_ids=("cam-2",))), world) == []
    assert told(run(make_site(replace(GATHERING, camera_ids=("cam-1",))), world)) == [("start", 60), ("end", 70)]


def test_pixels_are_placed_by_the_calibration_in_force() -> None:
    h = ((0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 1.0))
    far = ((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 1.0))
    messages = merge(stand(row(4), 70), quiet(100))
    for message in messages:
        message["persons"] = [
            {"id": p["id"], "u_px": p["x_m"] * 100, "v_px": p["y_m"] * 100} for p in message["persons"]
        ]
    one = Camera("cam-1", "One", "ground", calibrations=(Calibration(h, None, "a"),))
    assert told(run(make_site(GATHERING, cameras=(one,)), messages)) == [("start", 60), ("end", 70)]
    moved = replace(one, calibrations=(*one.calibrations, Calibration(far, at(50), "b")))
    assert run(make_site(GATHERING, cameras=(moved,)), messages) == []
    assert run(make_site(GATHERING, cameras=(replace(one, calibrations=()),)), messages) == []


def test_of_two_cameras_that_see_a_place_one_tells() -> None:
    left, right = (
        ((0.0, 0.0), (6.0, 0.0), (6.0, 10.0), (0.0, 10.0)),
        ((2.0, 0.0), (12.0, 0.0), (12.0, 10.0), (2.0, 10.0)),
    )
    cameras = (Camera("cam-1", "One", "ground", view=left), Camera("cam-2", "Two", "ground", view=right))
    one = stand(row(4, x=2.2, apart=0.5), 70)
    two = [{**m, "camera": "cam-2"} for m in one]
    events = run(make_site(GATHERING, cameras=cameras), merge(one, two, quiet(100), quiet(100, camera="cam-2")))
    assert [(e.camera, e.event) for e in events] == [("cam-1", "start"), ("cam-1", "end")]


def test_engines_that_send_pairs_only_have_gatherings_of_their_graph() -> None:
    links = [{"a": str(k), "b": str(k + 1), "distance_m": 1.2} for k in range(3)]
    messages = [frame("cam-1", START_MS + s * 1000, [], pairs=links if s <= 70 else []) for s in range(90)]
    events = run(make_site(replace(GATHERING, area_id=None)), messages)
    assert told(events) == [("start", 60), ("end", 70)]
    assert (events[0].n_people, events[0].x_mm, events[0].nearest_mm) == (4, None, 1200)
    assert run(make_site(GATHERING), messages) == []  # nobody knows whether they are in the area
    for message in messages:  # exactly at the distance is not closer
        message["pairs"] = [{**link, "distance_m": 2.0} for link in message["pairs"]]
    assert run(make_site(replace(GATHERING, area_id=None)), messages) == []


def test_pairs_the_engine_sent_win_over_positions() -> None:
    messages = [{**m, "pairs": []} for m in stand(row(4), 100)]
    assert run(make_site(GATHERING), messages) == []


def test_people_without_track_ids_belong_to_a_gathering_and_do_not_make_one() -> None:
    nameless = stand(row(4), 70)
    for message in nameless:
        message["persons"] = [{k: v for k, v in p.items() if k != "id"} for p in message["persons"]]
    engine = AlarmEngine(make_site(GATHERING))
    assert engine.feed(tables_of(make_site(), merge(nameless, quiet(100)))) + engine.close() == []
    assert engine.n_untracked == 71 * 4
    half = merge(stand(row(2), 70), nameless, quiet(100))
    for message in half:
        message["persons"] = [p for p in message["persons"] if "id" in p or p["x_m"] > 4.5]
    assert told(run(make_site(GATHERING), half)) == [("start", 60), ("end", 70)]


def test_a_crowd_has_the_pairs_of_a_table_of_all_distances() -> None:
    from vsd_analytics.live import situations

    xy = np.random.default_rng(1).integers(0, 20_000, (300, 2)).astype(float)
    xy[::50] = np.nan
    tree = situations.close_pairs(xy, distance_mm=2000)
    d = xy[:, None] - xy[None]
    square = (d * d).sum(axis=2)
    assert [(a, b) for a, b, _ in tree] == [(a, b) for a, b in np.argwhere(square < 4e6).tolist() if a < b]


# --- contacts ---


def test_a_couple_that_walks_together_is_no_contact() -> None:
    ways = [((0.0, 3.0), (30.0, 3.0)), ((0.0, 3.8), (30.0, 3.8))]
    assert run(make_site(CONTACT), merge(walk(ways, 40), quiet(60))) == []
    then = merge(walk(ways, 40), stand([b for _, b in ways], 100, start_s=41), quiet(200))
    assert run(make_site(CONTACT), then) == []


@pytest.mark.parametrize(("apart_m", "end_s"), [(1.5, 200), (1.0, 149)])
def test_strangers_who_stop_beside_each_other_are_until_they_stand_in_company(apart_m: float, end_s: int) -> None:
    """In the window of two minutes in which one of them came they do not; 30 s of the next one tell."""
    there = stand([(5.0, 5.0)], 220)
    comes = walk([((20.0, 5.0), (5.0 + apart_m, 5.0))], 14, start_s=20, first_id=2)
    stays = stand([(5.0 + apart_m, 5.0)], 165, start_s=35, first_id=2)
    events = [e for e in run(make_site(CONTACT), merge(there, comes, stays, quiet(240))) if e.event != "update"]
    assert told(events) == [("start", 64), ("end", end_s)]
    place = (events[0].x_mm, events[0].y_mm, events[0].n_people, events[1].nearest_mm)
    assert place == (5000 + 500 * apart_m, 5000, 2, 1000 * apart_m)


def test_a_contact_of_any_two_does_not_ask_who_is_together() -> None:
    any_two = replace(CONTACT, is_between_groups=False)
    two = stand([(5.0, 5.0), (5.8, 5.0)], 300)
    assert run(make_site(CONTACT), merge(two, quiet(360))) == []
    events = [e for e in run(make_site(any_two), merge(two, quiet(360))) if e.event != "update"]
    assert told(events) == [("start", 30), ("end", 300)]


def test_strangers_who_pass_are_not() -> None:
    ways = [((0.0, 3.0), (30.0, 3.0)), ((30.0, 3.8), (0.0, 3.8))]
    assert run(make_site(CONTACT), merge(walk(ways, 30), quiet(60))) == []


def test_contacts_of_engines_that_send_pairs_only() -> None:
    link = [{"a": "1", "b": "2", "distance_m": 1.2}]
    messages = [frame("cam-1", START_MS + s * 1000, [], pairs=link if s <= 40 else []) for s in range(60)]
    assert told(run(make_site(CONTACT), messages)) == [("start", 30), ("end", 40)]


# --- silences ---

BUSY = make_site(SILENCE)


def test_a_silent_camera_is_reported_and_its_return_is_the_end() -> None:
    world = [*quiet(30), *quiet(100, start_s=200), *quiet(300, camera="cam-2")]
    events = run(BUSY, world)
    assert told(events) == [("start", 90), ("update", 150), ("end", 200)]
    assert {(e.camera, e.n_people, e.x_mm, e.since_ms) for e in events} == {("cam-1", None, None, START_MS + 30_000)}


def test_a_camera_is_silent_by_the_time_of_the_others_before_it_returns() -> None:
    engine = AlarmEngine(BUSY)
    engine.feed(tables_of(BUSY, quiet(30) + quiet(30, camera="cam-2")))
    assert told(engine.feed(tables_of(BUSY, quiet(68, start_s=31, camera="cam-2")))) == []
    assert told(engine.feed(tables_of(BUSY, quiet(5, start_s=100, camera="cam-2")))) == [("start", 90)]
    assert len(engine.open_alarms) == 1


def test_when_all_are_silent_the_clock_tells() -> None:
    engine = AlarmEngine(BUSY)
    engine.feed(tables_of(BUSY, quiet(30) + quiet(20, camera="cam-2")), now=at(32))
    assert told(engine.tick(at(95))) == []
    # a stream is judged from when it was last heard: 32 s by the clock
    assert told(engine.tick(at(110))) == [("start", 80), ("start", 90)]


def test_our_own_absence_is_no_silence() -> None:
    engine = AlarmEngine(BUSY)
    engine.feed(tables_of(BUSY, quiet(30) + quiet(30, camera="cam-2")))
    engine.resume(at(1000))
    assert engine.tick(at(1005)) == []
    assert engine.feed(tables_of(BUSY, quiet(30, start_s=31)), now=at(1010)) == []
    assert told(engine.tick(at(1071))) == [("start", 90)]  # camera 2, never heard since


def test_a_camera_with_its_clock_ahead_makes_no_other_silent() -> None:
    engine = AlarmEngine(BUSY)
    for s in range(0, 200, 2):
        assert engine.feed(tables_of(BUSY, quiet(1, start_s=s)), now=at(s + 1)) == []
        assert engine.feed(tables_of(BUSY, quiet(1, start_s=s + 280, camera="cam-2")), now=at(s + 1)) == []
    assert engine.n_late == 0


def test_a_gap_shorter_than_the_rule_is_none() -> None:
    assert run(BUSY, [*quiet(30), *quiet(100, start_s=89), *quiet(189, camera="cam-2")]) == []


def test_a_silence_of_exactly_the_time_is_one_and_its_end_is_no_update() -> None:
    world = [*quiet(30), *quiet(100, start_s=90), *quiet(189, camera="cam-2")]
    assert told(run(BUSY, world)) == [("start", 90), ("end", 90)]
    world = [*quiet(30), *quiet(100, start_s=150), *quiet(300, camera="cam-2")]
    assert told(run(BUSY, world)) == [("start", 90), ("end", 150)]


def test_a_silence_too_short_before_the_closing_begins_again_at_the_opening() -> None:
    site = make_site(SILENCE, opening=WEEKDAYS)
    closing, opening = 13 * 3600, 24 * 3600
    world = [*quiet(closing - 30, interval_s=30.0), *quiet(opening + 100, camera="cam-2", interval_s=30.0)]
    events = run(site, world)
    assert told(events) == [("start", opening + 60)]
    assert events[0].since_ms == START_MS + opening * 1000


def test_a_silence_counts_from_the_opening_and_ends_with_the_closing() -> None:
    site = make_site(SILENCE, opening=(((495, 510),),) * 7)  # 8:15 to 8:30
    events = run(site, [*quiet(5), *quiet(3 * 3600, camera="cam-2", interval_s=10.0)])
    assert [e for e in told(events) if e[0] != "update"] == [("start", 960), ("end", 1800)]
    assert events[0].since_ms == START_MS + 900_000
    always = make_site(replace(SILENCE, is_open_only=False), opening=site.opening)
    assert told(run(always, [*quiet(5), *quiet(600, camera="cam-2")]))[0] == ("start", 65)


def test_cameras_are_silent_at_night_and_at_the_weekend_without_a_word() -> None:
    site = make_site(SILENCE, opening=WEEKDAYS)
    friday, monday = 4 * 86400 + 13 * 3600 - 1, 7 * 86400
    both = [m for c in ("cam-1", "cam-2") for s in (friday - 60, monday) for m in quiet(60, start_s=s, camera=c)]
    assert run(site, both) == []


def test_a_camera_never_heard_is_silent_from_the_start_of_watching() -> None:
    engine = AlarmEngine(BUSY, start=at(0))
    assert told(engine.feed(tables_of(BUSY, quiet(100))) + engine.close()) == [("start", 60)]
    assert run(BUSY, quiet(100)) == []


def test_a_camera_that_comes_and_goes_is_reported_once_in_a_cool_down() -> None:
    world = [*quiet(600, camera="cam-2")] + [m for s in (0, 100, 200, 300) for m in quiet(5, start_s=s)]
    assert told(run(make_site(replace(SILENCE, cooldown_s=1000.0)), world)) == [("start", 65), ("end", 100)]


def test_the_end_of_what_is_known_leaves_a_silence_open() -> None:
    assert told(run(make_site(SILENCE), quiet(30), until_s=100)) == [("start", 90)]
    assert run(make_site(SILENCE), quiet(30), until_s=90) == []


def test_ids_tell_sites_rules_cameras_and_beginnings_apart() -> None:
    world = merge(stand(row(4), 70), stand(row(4), 70, start_s=500, first_id=11), quiet(800))
    ids = {e.alarm for e in run(make_site(GATHERING), world)}
    other = {e.alarm for e in run(make_site(replace(GATHERING, alarm_id="other")), world)}
    moved = {e.alarm for e in run(replace(make_site(GATHERING), site_id="elsewhere"), world)}
    assert len(ids) == len(other) == len(moved) == 2
    assert len(ids | other | moved) == 6


def test_memory_does_not_grow_with_the_day() -> None:
    site = make_site(GATHERING, CONTACT, SILENCE, AlarmRule("any", "gathering", for_s=1, n_people=2, cooldown_s=60.0))
    engine = AlarmEngine(site)
    kept = []
    for k in range(40):
        pairs = merge(
            *(stand(row(2, y=float(j)), 3, start_s=k * 100 + 4 * j, first_id=100 * k + 2 * j) for j in range(20))
        )
        engine.feed(tables_of(site, merge(pairs, quiet(99, start_s=k * 100))))
        kept.append(engine.n_in_memory)
    assert max(kept[20:]) <= max(kept[:20]) * 1.1


def test_settings_of_alarms_are_used() -> None:
    changed = Settings().with_values({"pseudonyms": False, "update_s": 20.0, "distance_m": 0.9})
    assert run(make_site(GATHERING, settings=changed), stand(row(4), 100)) == []
    changed = changed.with_values({"distance_m": 2.0})
    assert told(run(make_site(GATHERING, settings=changed), stand(row(4), 100))) == [
        ("start", 60),
        ("update", 80),
        ("update", 100),
    ]
