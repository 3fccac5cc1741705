"""Staff apart from visitors: who is called staff, and facts of visitors are those of a shop without staff."""

from __future__ import annotations

import os
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from unittest.mock import patch

import pytest
from warehouse.prove_staff import FIGURES, figures, judged, named
from warehouse.small_projects import T0, Frame, Pair, Person, beats, fact_files, make_site
from warehouse.small_projects import put as put_records
from warehouse.staffed_shop import MONDAY, Records, Shop, put, records_of, site_of

from vsd_analytics.api.days import Days
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError
from vsd_analytics.retention.purge import Terms, purge_older
from vsd_analytics.site.model import Area, Site
from vsd_analytics.warehouse.build import build, build_plan
from vsd_analytics.warehouse.warehouse import Warehouse

DAY = MONDAY.date()
SMALL = Shop(n_visitors=40, cuts_per_h=0.0)


@pytest.fixture(scope="module")
def records() -> Records:
    return records_of(SMALL)


@pytest.fixture(scope="module")
def shop(records: Records, tmp_path_factory: pytest.TempPathFactory) -> Site:
    site = site_of(tmp_path_factory.mktemp("staffed") / "shop")
    put(site, records)
    return site


def test_without_cut_tracks_figures_of_visitors_are_those_of_a_shop_without_staff(
    shop: Site, records: Records, tmp_path: Path
) -> None:
    found = judged(records, named(shop, 1))
    assert (found["precision"], found["recall"]) == (1, 1)
    truth, those = site_of(tmp_path / "truth"), site_of(tmp_path / "those")
    put(truth, records, only=~records.is_staff)
    put(those, records, only=records.is_staff)
    every, visitors = figures(shop, 1), figures(shop.with_settings(people="visitors"), 1)
    assert visitors == figures(truth, 1)
    assert figures(shop.with_settings(people="staff"), 1) == figures(those, 1)
    assert all(every[name] != visitors[name] for name in FIGURES)


def test_days_in_python_count_whom_they_are_asked_for(shop: Site) -> None:
    day = Days(shop, DAY, DAY, name="Monday")
    every, visitors, staff = (
        day.at(people=people).hours.total("exposure_s") for people in ("all", "visitors", "staff")
    )
    assert every == pytest.approx(visitors + staff)
    assert min(visitors, staff) > 0


def test_of_people_with_cut_tracks_hardly_a_visitor_is_called_staff(tmp_path: Path) -> None:
    of = records_of(Shop(seed=3, cuts_per_h=4.0))
    site = site_of(tmp_path / "shop")
    put(site, of)
    found = judged(of, named(site, 1))
    assert found["precision"] >= 0.95
    assert 0.25 <= found["recall"] < 1, "the limit that docs/methods/staff.md names"


@pytest.mark.parametrize(("tagged", "is_known"), [(0.6, True), (0.4, False)])
def test_whom_the_engine_calls_staff_in_most_records_is_staff(
    records: Records, tmp_path: Path, tagged: float, is_known: bool
) -> None:
    never = dict.fromkeys(("staff_in_area_s", "staff_in_view_s", "staff_closed_s"), 86400.0)
    site = site_of(tmp_path / "shop", staff_classes=("staff",), **never)
    put(site, records, tagged=tagged)
    staff = named(site, 1)
    assert {*staff.values()} == ({"tag"} if is_known else set())
    found = judged(records, staff)
    assert (found["precision"], found["recall"]) == ((1, 1) if is_known else (0, 0))
    assert named(site.with_settings(staff_classes=()), 1) == {}, "without classes no tag is read"


def test_tags_change_nothing_but_who_is_staff(records: Records, tmp_path: Path) -> None:
    plain, tagged = (site_of(tmp_path / name) for name in ("plain", "tagged"))
    put(plain, records)
    put(tagged, records, tagged=1.0)
    asked = replace(tagged, settings=tagged.settings.with_values({"staff_classes": ("staff",)}))
    assert figures(plain, 1) == figures(tagged, 1) == figures(asked, 1)
    assert {p.split("/")[0] for p in fact_files(asked)} - {p.split("/")[0] for p in fact_files(plain)} <= {"staff_tags"}


def test_nothing_changes_while_nobody_asks(records: Records, tmp_path: Path) -> None:
    plain, drawn = site_of(tmp_path / "plain"), site_of(tmp_path / "drawn", staff_in_view_s=60.0)
    for site in (plain, drawn):
        put(site, records)
        build(site)
    assert fact_files(plain) == fact_files(drawn)
    assert not (plain.root / "facts" / "beside").exists()


def test_facts_of_visitors_are_fresh_until_somebody_else_is_staff(records: Records, tmp_path: Path) -> None:
    site = site_of(tmp_path / "shop", people="visitors")
    put(site, records)
    assert build(site).n_built > 0
    assert build(site).n_built == 0
    assert not build_plan(site).stale
    other = replace(site, settings=site.settings.with_values({"staff_in_area_share": 0.1}))
    assert build(other).n_built == 0, "the same people are staff"
    cleaner = replace(site, settings=site.settings.with_values({"staff_closed_s": 80_000.0}))
    again = build(cleaner)
    assert 0 < again.n_built < 6, "only hours with the cleaner, and those beside them"
    assert set(again.reasons) == {"staff changed"}


def test_a_purge_seals_the_facts_of_visitors(records: Records, tmp_path: Path) -> None:
    site = site_of(tmp_path / "shop", people="visitors")
    put(site, records)
    before = figures(site, 1)
    assert figures(site.with_settings(people="all"), 1) != before
    terms = Terms(now=datetime(2027, 1, 1, tzinfo=UTC), is_forced=True)
    purge_older(site, before=DAY + timedelta(days=1), terms=terms)
    assert figures(site, 1) == before


def test_hours_asked_for_alone_are_judged_by_the_whole_site_day(records: Records, tmp_path: Path) -> None:
    whole, part = (site_of(tmp_path / name, people="visitors") for name in ("whole", "part"))
    for site in (whole, part):
        put(site, records)
    build(whole)
    with Warehouse(part, DAY, DAY) as one, Warehouse(whole, DAY, DAY + timedelta(days=1)) as two:
        query = "select hour_start_ms, exposure_s, n_violations from hours where local_date = '2026-11-09'"
        assert one.rows(query) == two.rows(query)


def scene(root: Path, **settings: object) -> Site:
    """Return a site whose engine sends pairs of one camera: a and b are behind the counter for a minute."""
    area = Area("counter", "Counter", "ground", ((-1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (-1.0, 1.0)), is_staff=True)
    site = replace(make_site(root, staff_in_area_s=30.0, **settings), areas=(area,))
    where = {"a": 0, "b": 1_500, "c": 3_000, "d": 4_500, None: 6_000}
    seen: list[Person | Pair | Frame] = [*beats(T0, T0 + 60_000)]
    for ts in range(T0, T0 + 60_000, 1000):
        seen += [Person(ts, track, x, 0) for track, x in where.items()]
        if ts >= T0 + 30_000:
            seen += [Pair(ts, a, b, 1_500) for a, b in ("ab", "bc", "cd")]
    put_records(site, seen)
    return site


@pytest.mark.parametrize("is_fast", ["0", "1"])
@pytest.mark.parametrize(
    ("people", "tracks", "pairs"),
    [
        ("all", {"a", "b", "c", "d", None}, {"ab", "bc", "cd", "d-"}),
        ("visitors", {"c", "d", None}, {"cd", "d-"}),
        ("staff", {"a", "b"}, {"ab"}),
    ],
)
def test_a_pair_counts_where_both_are_counted_and_who_has_no_id_is_no_staff(
    tmp_path: Path, people: str, tracks: set[str | None], pairs: set[str], is_fast: str
) -> None:
    with patch.dict(os.environ, VSD_ACCELERATED=is_fast):
        site = scene(tmp_path / "shop", people=people)
        with Warehouse(site, DAY, DAY, uses_days=False) as warehouse:
            found = {row["track_id"] for row in warehouse.rows("select distinct track_id from located")}
            near = warehouse.rows(
                "select distinct coalesce(track_a, '-') as a, coalesce(track_b, '-') as b from pairs where is_owned"
            )
            hours = warehouse.rows("select recorded_s, person_records from hours where recorded_s > 0")
    assert found == tracks
    assert {"".join(sorted((row["a"], row["b"]), key=lambda t: (t == "-", t))) for row in near} == pairs
    assert hours == [{"recorded_s": 60, "person_records": 60 * len(tracks)}]


def test_without_track_ids_nobody_is_staff(tmp_path: Path) -> None:
    site = scene(tmp_path / "shop", people="visitors")
    nobody = replace(site, root=tmp_path / "nobody")
    put_records(nobody, [*beats(T0, T0 + 60_000), *(Person(ts, None, 0, 0) for ts in range(T0, T0 + 60_000, 1000))])
    with Warehouse(nobody, DAY, DAY) as warehouse:
        assert warehouse.rows("select sum(person_records) as n from hours") == [{"n": 60}]


def test_vsd_toml_and_environment_say_whom_figures_count(tmp_path: Path) -> None:
    text = """
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
[[floor]]
id = "ground"
name = "Ground"
[[camera]]
id = "cam"
name = "Cam"
[[area]]
id = "counter"
name = "Counter"
polygon = [[0, 0], [1, 0], [1, 1]]
staff = true
[staff]
people = "visitors"
staff_in_view_s = 7200
"""
    (tmp_path / "vsd.toml").write_text(text, encoding="utf-8")
    site = load_site(tmp_path)
    assert (site.settings.people, site.settings.staff_in_view_s) == ("visitors", 7200)
    assert [a.is_staff for a in site.areas] == [True]
    asked = load_site(tmp_path, environ={"VSD_PEOPLE": "all"})
    assert (asked.settings.people, asked.with_own_settings().settings.people) == ("all", "visitors")
    (tmp_path / "vsd.toml").write_text(text.replace('"visitors"', '"guests"'), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_site(tmp_path)
    assert "people" in caught.value.problems[0].what
