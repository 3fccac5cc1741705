"""Who moves together, against networkx and a plain recount; what must not change it; what cannot tell."""

from __future__ import annotations

import json
import random
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import UTC, date, datetime
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from stats.group_scenes import components
from warehouse.small_projects import DAY, HOUR, T0, Frame, Pair, Person, beats, make_site, open_days, put

from vsd_analytics.cli import main
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.groups import PURGED, between_groups, groups
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.retention import purge, sealing
from vsd_analytics.site.model import Area, Camera, Site
from vsd_analytics.store.duck import connect
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording.reasons import reason_text

Call = tuple[date, str, frozenset[str]]
TWO = [Camera("cam", "Cam", "ground", hz=1.0), Camera("side", "Side", "ground", hz=1.0)]


def walkers(seed: int, *, n_parties: int = 14, start: int = T0, hours: float = 1.0) -> list[Person]:
    """Return parties of one to three that cross a hall at 1 Hz in about a minute, side by side with some wavering."""
    rng = np.random.default_rng(seed)
    rows, track = [], 0
    for _ in range(n_parties):
        begin, n = start + int(rng.integers(0, int(hours * 3600))) * 1000, int(rng.integers(20, 70))
        at, way = rng.uniform(0, 12_000, 2), rng.normal(0, 700, 2) * (rng.random() < 0.8)
        for k in range(int(rng.integers(1, 4))):
            track += 1
            apart = np.array([k * rng.uniform(600, 1500), rng.normal(0, 200)])
            late, early = rng.integers(0, 6, 2)
            for s in range(late, n - early):
                x, y = at + way * s + apart + rng.normal(0, 120, 2)
                rows.append(Person(begin + s * 1000, f"t{track}", round(x), round(y)))
    return rows


def recount(rows: Sequence[Person], *, weight_ms: int = 1000) -> tuple[dict, set[frozenset[str]]]:
    """Return every pair ever closer than 2 m with what the rule asks of it, and the groups; from the rule in words."""
    frames, lives = defaultdict(list), defaultdict(int)
    for r in rows:
        frames[r.ts].append(r)
        lives[r.track] += 1
    close = defaultdict(list)
    for _, seen in sorted(frames.items()):
        for a, b in combinations(sorted(seen, key=lambda r: str(r.track)), 2):
            d = int(np.hypot(a.x - b.x, a.y - b.y))
            if d < 2000:
                close[a.track, b.track].append((d, (a.x + b.x) / 2, (a.y + b.y) / 2))
    pairs = {}
    for (a, b), seen in close.items():
        d, x, y = map(np.array, zip(*seen, strict=True))
        walked = np.hypot(x[-1] - x[0], y[-1] - y[0])
        share = len(d) / (lives[a] + lives[b] - len(d))
        nearer_half = np.sort(d)[(len(d) - 1) // 2]  # the median, of an even number the lower one
        is_long = len(d) * weight_ms >= 2000 and len(d) >= 3
        together = is_long and nearer_half <= 1250 and share >= 0.6 and walked >= 2000
        pairs[a, b] = (len(d), round(share, 9), round(walked / 1000, 6), bool(together))
    return pairs, set(components(pair for pair, told in pairs.items() if told[3]))


def called(warehouse: Warehouse) -> set[Call]:
    return {(g.day, g.camera_id, frozenset(g.tracks)) for g in groups(warehouse).groups if not g.is_standing}


def pairs_of(warehouse: Warehouse) -> dict:
    rows = warehouse.rows("select * from pair_days")
    return {
        (r["track_a"], r["track_b"]): (
            r["n_records"],
            round(r["life_share"], 9),
            round(r["walked_m"], 6),
            r["moves_together"],
        )
        for r in rows
    }


@pytest.mark.parametrize("seed", range(6))
def test_pairs_and_groups_equal_a_plain_recount(tmp_path: Path, seed: int) -> None:
    rows = walkers(seed)
    site = make_site(tmp_path)
    put(site, [*rows, *beats(T0, T0 + HOUR)])
    pairs, expected = recount(rows)
    assert expected
    with open_days(site) as warehouse:
        assert pairs_of(warehouse) == pairs
        assert {tracks for _, _, tracks in called(warehouse)} == expected


def labelled(tracks: Iterable[tuple[str, str]], edges: Iterable[tuple[str, str, str]]) -> list[tuple]:
    """Return the rows of the mart `track_groups` of graphs: camera (the graph's name) and track, camera and pair."""
    con = connect(threads=1)
    con.register("tracks", pd.DataFrame(tracks, columns=["camera_id", "track_id"]))
    con.register("edges", pd.DataFrame(edges, columns=["camera_id", "track_a", "track_b"]))
    con.execute("create table track_days as select camera_id, track_id, 0 as site_day from tracks")
    con.execute("create table pair_days as select *, 0 as site_day, true as moves_together from edges")
    return con.execute(relations("marts")["track_groups"].sql).fetchall()


def test_groups_are_the_connected_components_of_a_thousand_random_graphs() -> None:
    random.seed(0)
    edges, expected = [], {}
    for graph in range(1000):
        n = random.randint(2, 30)
        names = [f"{random.random():.6f}" for _ in range(n)]
        mine = [tuple(sorted(random.sample(names, 2))) for _ in range(random.randint(0, 2 * n))]
        expected[str(graph)] = (set(names), set(components(mine)))
        edges += [(str(graph), a, b) for a, b in dict.fromkeys(mine)]
    found = labelled([(g, t) for g, (tracks, _) in expected.items() for t in tracks], edges)
    assert len(found) == sum(len(tracks) for tracks, _ in expected.values())
    made = defaultdict(lambda: defaultdict(set))
    for graph, _, track, group, n_members in found:
        if group is not None:
            made[graph][group].add(track)
        assert (group is None) == (n_members == 1)
    for graph, (_, groups_of) in expected.items():
        assert {frozenset(members) for members in made[graph].values()} == groups_of
        assert all(group == min(members) for group, members in made[graph].items())


def test_a_chain_of_a_thousand_is_one_group() -> None:
    names = [f"{k * 7919 % 1000:04d}" for k in range(1000)]
    found = labelled([("cam", n) for n in names], [("cam", *sorted(pair)) for pair in pairwise(names)])
    assert {(group, n) for *_, group, n in found} == {("0000", 1000)}


# --- what must not change it ---


@pytest.fixture
def rows() -> list[Person]:
    """Return parties of two hours, some of whom walk over the hour between."""
    late = walkers(3, n_parties=8, start=T0 + HOUR - 30_000, hours=0.01)
    return [*walkers(1, hours=2.0), *(replace(r, track=f"late {r.track}") for r in late)]


def answer(site: Site, days: tuple[str, str] = ("2026-11-09", "2026-11-09")) -> set[Call]:
    with open_days(site, *days) as warehouse:
        return called(warehouse)


def test_the_hour_does_not_cut_groups(tmp_path: Path, rows: list[Person]) -> None:
    """The same walks half an hour later, when no hour ends within them, are the same groups."""
    (tmp_path / "here").mkdir()
    here, there = make_site(tmp_path / "here"), make_site(tmp_path / "there")
    put(here, rows)
    put(there, [replace(r, ts=r.ts + 1_800_000) for r in rows])
    whole = recount(rows)[1]
    assert any(m.startswith("late") for members in whole for m in members)
    assert {m for _, _, m in answer(here)} == {m for _, _, m in answer(there)} == whole


def test_order_of_delivery_and_delivery_twice_change_nothing(tmp_path: Path, rows: list[Person]) -> None:
    site = make_site(tmp_path)
    shuffled = random.Random(5).sample(rows, len(rows))
    put(site, shuffled[: len(rows) // 3])
    put(site, shuffled)
    put(site, rows[::2])
    assert {m for _, _, m in answer(site)} == recount(rows)[1]


def test_which_of_two_is_a_does_not_matter(tmp_path: Path) -> None:
    """Pairs as an engine sends them, in either order, with persons beside."""
    made = []
    for name, swap in (("ab", False), ("ba", True)):
        site = make_site(tmp_path / name)
        records: list[Person | Pair | Frame] = []
        for s in range(20):
            a, b = (s * 500, 0), (s * 500, 900)
            records += [Person(T0 + s * 1000, "a", *a), Person(T0 + s * 1000, "b", *b)]
            told = ("b", "a", (*b, *a)) if swap and s % 2 else ("a", "b", (*a, *b))
            records.append(Pair(T0 + s * 1000, told[0], told[1], 900, xy=told[2]))
        put(site, records)
        made.append(answer(site))
    assert made[0] == made[1] == {(date(2026, 11, 9), "cam", frozenset("ab"))}


def test_a_longer_range_holds_the_groups_of_its_days(tmp_path: Path) -> None:
    """Site days are whole however the range is cut, those across local midnight too."""
    site = make_site(tmp_path)
    for k, start in enumerate((T0, T0 + 15 * HOUR + 3_540_000, T0 + DAY)):  # the second walk crosses midnight
        put(site, [replace(r, track=f"{k} {r.track}") for r in walkers(k, n_parties=6, start=start, hours=0.02)])
    week = answer(site, ("2026-11-08", "2026-11-12"))
    single = [answer(site, (d, d)) for d in ("2026-11-08", "2026-11-09", "2026-11-10", "2026-11-11")]
    assert week == set().union(*single)
    assert sum(map(len, single)) == len(week)
    assert {day for day, _, _ in week} == {date(2026, 11, 9), date(2026, 11, 10)}


def test_a_violation_after_midnight_is_judged_by_its_whole_site_day(tmp_path: Path) -> None:
    """Two who walked together in the early morning stand close 20 hours later, in the same site day."""
    morning, night = T0 - 3 * HOUR, T0 + 16 * HOUR + 1_800_000
    site = make_site(tmp_path)
    rows = [Person(morning + s * 1000, t, s * 500, y) for s in range(60) for t, y in (("a", 0), ("b", 900))]
    put(site, [*rows, *(Person(night + s * 1000, t, 29_500, y) for s in range(9) for t, y in (("a", 0), ("b", 900)))])
    for days in (("2026-11-09", "2026-11-10"), ("2026-11-10", "2026-11-10")):
        with open_days(site, *days) as warehouse:
            told = warehouse.rows("select is_together from violations where local_date = date '2026-11-10'")
        assert told == [{"is_together": True}]


def test_ids_used_again_on_the_next_site_day_are_other_people(tmp_path: Path) -> None:
    site = make_site(tmp_path, pseudonyms=False)
    first = [Person(T0 + s * 1000, t, s * 500, y) for s in range(30) for t, y in (("1", 0), ("2", 900))]
    other = [Person(T0 + DAY + s * 1000, t, s * 500, y) for s in range(30) for t, y in (("1", 0), ("2", 9000))]
    put(site, first + other)
    assert answer(site, ("2026-11-09", "2026-11-10")) == {(date(2026, 11, 9), "cam", frozenset("12"))}


def test_cameras_do_not_mix(tmp_path: Path) -> None:
    site = make_site(tmp_path, cameras=TWO)
    beside = [(s, k, *who) for s in range(30) for k, who in enumerate((("a", "cam"), ("b", "side")))]
    put(site, [Person(T0 + s * 1000, track, s * 500, 900 * k, camera) for s, k, track, camera in beside])
    assert answer(site) == set()


# --- two readings ---


def two_groups_that_meet() -> list[Person]:
    """Return two pairs that walk past each other for 8 s within 2 m, and then stand apart."""
    rows = []
    for s in range(40):
        for track, y in (("a", 0), ("b", 800), ("c", 2500), ("d", 3300)):
            away = max(0, s - 8) * 400 * (1 if track in "cd" else 0)
            rows.append(Person(T0 + s * 1000, track, s * 600, y + away))
    return rows


def test_both_readings_are_there_and_add_up(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [*two_groups_that_meet(), *beats(T0, T0 + HOUR)])
    with open_days(site) as warehouse:
        told = {(r["track_a"], r["track_b"]): r["is_together"] for r in warehouse.rows("select * from violations")}
        found = groups(warehouse)
        period = Period(FloorHours(warehouse, floor=site.floors[0]), warehouse.first, warehouse.last)
        left = between_groups(period, {"cam"})
    assert told == {("a", "b"): True, ("c", "d"): True, ("b", "c"): False}
    assert (found.between.n, found.between.of, found.n_by_size) == (1, 3, {2: 2})
    assert (left.n.sum(), period.whole.n.sum()) == (1.0, 3.0)
    reading = found.readings[0]
    assert (reading.violation_rate.n_events, reading.violation_rate_between.n_events) == (3.0, 1.0)
    assert reading.violation_rate.exposure_h == reading.violation_rate_between.exposure_h > 0
    assert found.people_share == 1.0
    assert found.time_share == pytest.approx(80 / 89)


# --- what cannot tell says why ---


def test_ids_that_are_cut_are_not_applicable(tmp_path: Path) -> None:
    rows = [
        Person(T0 + s * 1000, f"{party} {k} {s // 10}", s * 1000, party * 5000 + k * 800)
        for party in range(15)
        for k in (0, 1)
        for s in range(40)
    ]
    site = make_site(tmp_path)
    put(site, rows)
    with open_days(site) as warehouse:
        found = groups(warehouse)
    assert found.state == "not_measurable"
    assert reason_text(found.reason).startswith("group filter not applicable")
    assert (found.people_share, found.time_share, found.between.value, found.readings) == (None, None, None, ())
    assert found.left_out.keys() == {"cam"}


@pytest.mark.parametrize(
    ("records", "state", "words"),
    [
        ([Pair(T0 + s * 1000, "a", "b", 900) for s in range(30)], "not_measurable", "no positions"),
        ([Person(T0 + s * 1000, None, 500 * k, 0) for s in range(9) for k in (0, 1)], "not_measurable", "no track ids"),
        ([Person(T0 + s * 1000, "a", u=5.0, v=5.0) for s in range(9)], "not_measurable", "no calibration"),
        (
            [
                r
                for s in range(30)
                for r in (Person(T0 + s * 1000, "a"), Person(T0 + s * 1000, "b"), Pair(T0 + s * 1000, "a", "b", 900))
            ],
            "not_measurable",
            "no positions",
        ),
        ([Person(T0 + DAY * 3, "a", 0, 0)], "not_enough_data", "nothing or too little was recorded"),
        ([Person(T0 + s * 1000, "a", s, 0) for s in range(5)], "not_enough_data", "1 ends"),
    ],
    ids=[
        "pairs only",
        "no ids",
        "pixels without calibration",
        "distances without places",
        "nothing",
        "one short track",
    ],
)
def test_what_cannot_tell_says_why(tmp_path: Path, records: list, state: str, words: str) -> None:
    site = make_site(tmp_path)
    put(site, records)
    with open_days(site) as warehouse:
        found = groups(warehouse)
    assert (found.state, found.between.value, found.people_share, found.n_by_size) == (state, None, None, {})
    assert words in reason_text(found.reason)


def test_hours_purged_before_tracks_were_counted_are_not_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their sealed facts know violations, but not who moved together: neither reading of them is shown."""
    site = make_site(tmp_path)
    put(site, two_groups_that_meet())
    before = {n: r for n, r in relations("facts").items() if n not in ("track_lives", "track_pairs")}
    monkeypatch.setattr(sealing, "relations", lambda _layer: before)
    terms = purge.Terms(now=datetime(2026, 12, 1, tzinfo=UTC), is_forced=True)
    assert purge.purge_older(site, before=date(2026, 11, 11), terms=terms).n_sealed
    with open_days(site) as warehouse:
        told = warehouse.rows("select is_together from violations")
        found = groups(warehouse)
    assert told == [{"is_together": None}] * 3
    assert (found.state, found.reason, found.between.value) == ("not_measurable", PURGED, None)


def test_a_camera_that_cannot_tell_is_left_out_and_named(tmp_path: Path) -> None:
    site = make_site(tmp_path, cameras=TWO)
    bare = [Person(T0 + s * 1000, None, 500 * k, 0, "side") for s in range(9) for k in (0, 1)]
    put(site, [*two_groups_that_meet(), *bare])
    with open_days(site) as warehouse:
        found = groups(warehouse)
        one = groups(warehouse, camera_id="side")
        with pytest.raises(UsageError, match="the site has no camera"):
            groups(warehouse, camera_id="nope")
    assert (found.state, found.n_by_size, dict(found.left_out).keys()) == ("ok", {2: 2}, {"side"})
    assert (one.state, one.groups) == ("not_measurable", ())


# --- the command ---


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    return int(stopped.value.code or 0), capsys.readouterr().out


def test_the_command_prints_both_readings_and_names_tracks_in_json_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "vsd.toml").write_text(
        '[site]\nid = "shop"\nname = "Shop"\ntimezone = "UTC"\n'
        '[rule]\npartial_hour_share = 0.0\n[[floor]]\nid = "ground"\nname = "Ground"\n'
        '[[camera]]\nid = "cam"\nname = "Cam"\nfloor = "ground"\nhz = 1.0\n'
    )
    put(make_site(tmp_path), [replace(r, track=f"track-{r.track}") for r in two_groups_that_meet()])
    code, text = run(["-C", str(tmp_path), "groups"], capsys)
    assert (code, "track-" in text) == (0, False)
    together = text.splitlines()[2:4]
    assert together[1].split()[0] == "2", "two groups"
    assert "F1 of pairs" in text
    code, text = run(["-C", str(tmp_path), "groups", "--json", "--camera", "cam"], capsys)
    told = json.loads(text)
    assert code == 0
    assert [g["tracks"] for g in told["groups"]] == [["track-a", "track-b"], ["track-c", "track-d"]]
    assert {(g["date"], g["camera_id"]) for g in told["groups"]} == {("2026-11-09", "cam")}
    [together] = told["answers"]["together"]["rows"]
    assert together["between_share"]["value"] == pytest.approx(1 / 3, rel=1e-5)
    assert (together["between_share"]["lo"], together["n_violations"]["value"]) == (None, 3)
    between = next(r for r in told["answers"]["readings"]["rows"] if r["reading"] == "between_groups")
    assert between["violation_rate"]["lo"] is None
    assert between["violation_rate"]["reason"]
    assert [(r["n_people"], r["n_groups"]["value"]) for r in told["answers"]["groups_by_size"]["rows"]] == [(2, 2)]


def test_the_command_exits_with_1_when_it_cannot_tell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "vsd.toml").write_text(
        '[site]\nid = "shop"\nname = "Shop"\ntimezone = "UTC"\n'
        '[rule]\npartial_hour_share = 0.0\n[[floor]]\nid = "ground"\nname = "Ground"\n'
        '[[camera]]\nid = "cam"\nname = "Cam"\nfloor = "ground"\nhz = 1.0\n'
    )
    put(make_site(tmp_path), [Pair(T0 + s * 1000, "a", "b", 900) for s in range(30)])
    code, text = run(["-C", str(tmp_path), "groups"], capsys)
    assert (code, "the engine sends no positions" in text) == (1, True)
    code, text = run(["-C", str(tmp_path), "groups", "--json"], capsys)
    [together] = json.loads(text)["answers"]["together"]["rows"]
    assert (code, together["people_share"]["state"], together["people_share"]["value"]) == (1, "not_measurable", None)
    assert run(["-C", str(tmp_path), "groups", "--camera", "=nope"], capsys)[0] == 2


# --- people who stand ---


def standing(places: dict[str, tuple[int, int]], first_s: int, last_s: int) -> list[Person]:
    """Return people who stand, one record a second."""
    return [Person(T0 + s * 1000, track, x, y) for s in range(first_s, last_s) for track, (x, y) in places.items()]


def test_company_that_stands_is_within_a_group_while_it_lasts(tmp_path: Path) -> None:
    """Two talk, then one goes over to a third; a fourth stands two steps away."""
    site = make_site(tmp_path)
    first = standing({"a": (0, 0), "b": (1000, 0), "c": (9000, 0), "d": (9000, 1800)}, 0, 240)
    then = standing({"a": (0, 0), "b": (8000, 0), "c": (9000, 0), "d": (9000, 1800)}, 240, 480)
    put(site, [*first, *then, *beats(T0, T0 + HOUR)])
    with open_days(site) as warehouse:
        found = groups(warehouse)
        told = warehouse.rows("select track_a, track_b, is_together from violations order by all")
        [hours] = warehouse.rows("select violation_s, between_s from company_hours")
    assert [g.is_standing for g in found.groups] == [True, True]
    assert {(g.tracks, (g.end - g.start).total_seconds()) for g in found.groups} == {
        (("a", "b"), 240.0),
        (("b", "c"), 240.0),
    }
    together = {(row["track_a"], row["track_b"]): row["is_together"] for row in told}
    assert together == {("a", "b"): True, ("b", "c"): True, ("c", "d"): False}
    # a and b, then b and c; c and d are close all the time, and c has a stranger beside whom it talks to
    assert hours == {"violation_s": 480 + 480 + 3 * 240, "between_s": 240 + 240 + 480}


def test_in_a_queue_nobody_knows_who_is_together(tmp_path: Path) -> None:
    ring = ((-1.0, -1.0), (3.0, -1.0), (3.0, 3.0), (-1.0, 3.0))
    site = replace(make_site(tmp_path), areas=(Area("tills", "Tills", "ground", ring, is_queue=True),))
    put(site, [*standing({"a": (0, 0), "b": (1000, 0)}, 0, 240), *beats(T0, T0 + HOUR)])
    with open_days(site) as warehouse:
        assert [row["is_together"] for row in warehouse.rows("select is_together from violations")] == [None]
        between = groups(warehouse).between
    assert (between.value, between.state, between.n) == (None, "not_measurable", 0)
    assert between.reason is not None
    assert between.reason.code == "groups.unknown"


def test_frames_too_rare_to_tell_say_so(tmp_path: Path) -> None:
    site = make_site(tmp_path, cameras=[Camera("cam", "Cam", "ground")])
    put(site, [r for r in standing({"a": (0, 0), "b": (1000, 0)}, 0, 3600) if (r.ts - T0) % 60_000 == 0])
    with open_days(site) as warehouse:
        found = groups(warehouse)
    assert (found.state, found.reason and found.reason.code) == ("not_measurable", "groups.rare_frames")
