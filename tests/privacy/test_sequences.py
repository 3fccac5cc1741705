"""Nobody who keeps every version of every page works out a small count, or a small change (`sequences`)."""

from __future__ import annotations

import copy
import shutil
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from unittest import mock

import pytest
from privacy import hidden_counts as hidden
from privacy import sequences
from report import ingested_worlds as worlds

from vsd_analytics.errors import ReportError, UsageError
from vsd_analytics.figures.share import earlier
from vsd_analytics.report.pages.story import days_report, week_report
from vsd_analytics.site.model import Site

WEEKS = 3
LATE_SEED = 6  # a world in which a camera lost a day


@pytest.fixture(scope="module")
def whole_life(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, sequences.Versions]:
    """Return a folder with a world and what a reader knows after its weeks, before anything changes."""
    folder = tmp_path_factory.mktemp("life") / "world"
    return folder, sequences.lived(folder, 1, n_weeks=WEEKS, days=())


@pytest.fixture
def versions(whole_life: tuple[Path, sequences.Versions], tmp_path: Path) -> Iterator[sequences.Versions]:
    """Return a copy of what the reader knows; the world's folder is as before after the test."""
    folder, known = whole_life
    shutil.copytree(folder, tmp_path / "kept")
    yield copy.deepcopy(known)
    shutil.rmtree(folder)
    shutil.move(tmp_path / "kept", folder)


@pytest.fixture
def forgetful() -> Iterator[None]:
    """What left before is not remembered, as before version 2.0."""
    with mock.patch.object(earlier, "remember"):
        yield


def test_pages_of_each_week_two_erasures_and_another_distance_tell_no_small_count(
    versions: sequences.Versions,
) -> None:
    sequences.erased(versions, 1, 0, 0, 10, slots=3)
    sequences.erased(versions, 1, 0, 2, 10, slots=7)
    sequences.nearer(versions)
    assert sequences.broken(versions) == []
    assert len(sequences.protected(versions)) > len(hidden.small_counts(versions.worlds[0]))
    assert sequences.worked_out(versions) == {}


def test_a_day_that_arrives_late_tells_no_small_count(tmp_path: Path) -> None:
    versions = sequences.lived(tmp_path, LATE_SEED, n_weeks=2, days=())
    [at, *_] = sorted(versions.worlds[0].lost)
    sequences.late(versions, *at, lambda key: 2 if key[1] == 0 else 20)
    assert sequences.broken(versions) == []
    assert sequences.worked_out(versions) == {}


@pytest.mark.usefixtures("forgetful")
def test_without_memory_of_what_left_before_an_erasure_tells_how_many_it_took(tmp_path: Path) -> None:
    versions = sequences.lived(tmp_path, 1, n_weeks=WEEKS, days=())
    sequences.erased(versions, 1, 0, 0, 10, slots=3)
    assert sequences.broken(versions) == []
    assert any(name.startswith("change to version 1") for name in sequences.worked_out(versions))


def test_pages_of_running_weeks_leave_and_tell_no_small_count(tmp_path: Path) -> None:
    versions = sequences.lived(tmp_path, 1, n_weeks=2, days=(2, 3))
    assert versions.n_running > 0
    assert sequences.broken(versions) == []
    assert sequences.worked_out(versions) == {}


@pytest.mark.parametrize(
    ("by_hour", "lost"),
    [
        # pages tell the time of Monday, and of Tuesday, so an hour of Monday hides none of Wednesday
        ([[10, 0], [10, 10], [10, 0]], None),
        # a camera lost a day: the planner has no hours with small counts, so none stands beside those of one person
        ([[4, 0], [0, 1], [4, 1]], (0, 1, 2)),
    ],
)
def test_the_time_of_one_person_in_an_hour_is_told_by_no_page_of_its_week(
    by_hour: list[list[int]], lost: tuple[int, int, int] | None, tmp_path: Path
) -> None:
    """At the first point are so many violations by day and hour, and one person is alone all the time."""
    n = {key: by_hour[key[2]][key[3] - hidden.HOURS[0]] if key[1] == 0 else 0 for key in hidden.keys_of(0)}
    made = mock.Mock(n=n, lost={lost} if lost else set())
    with mock.patch.object(hidden, "build", return_value=made):
        versions = sequences.lived(tmp_path, 0, n_weeks=1)
    assert versions.n_running > 0
    assert sequences.times_worked_out(versions) == {}


def test_the_page_of_a_running_week_is_the_same_at_every_hour_of_a_day(versions: sequences.Versions) -> None:
    site, monday = versions.worlds[0].site, hidden.monday(0)
    pages = [week_report(site, monday, clock=sequences.instant(0, 3, hour)) for hour in (5, 23)]
    assert pages[0] == pages[1]


def test_a_page_of_days_that_are_no_week_is_refused(versions: sequences.Versions) -> None:
    monday = hidden.monday(0)
    for days in (1, 3, 14):  # a week has its own report
        with pytest.raises(UsageError) as refused:
            days_report(versions.worlds[0].site, monday, monday + (days - 1) * worlds.DAY)
        assert refused.value.code == "E105"


def test_a_week_is_not_shared_again_after_a_small_erasure_and_the_operator_sees_it(
    versions: sequences.Versions,
) -> None:
    world = versions.worlds[0]
    sequences.erased(versions, 1, 0, 0, 10, slots=3)
    with pytest.raises(ReportError) as refused:
        week_report(world.site, hidden.monday(1))
    assert refused.value.code == "E503"
    exact = week_report(world.site.with_settings(mask_below=0), hidden.monday(1))
    assert exact.level.violations == versions.worlds[1].sum(hidden.keys_of(1))


def without_week(site: Site, monday: date) -> None:
    path = site.root / earlier.FILE
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    path.write_text("".join(line for line in lines if f'"{monday:%G-W%V}"' not in line), encoding="utf-8")


def test_a_week_is_shared_of_one_kind_of_people_only(versions: sequences.Versions) -> None:
    site, monday = versions.worlds[0].site, hidden.monday(1)
    visitors = site.with_settings(people="visitors")
    with pytest.raises(ReportError) as refused:
        week_report(visitors, monday)
    assert refused.value.code == "E503"
    assert f"VSD_PEOPLE=all vsd report --week {monday:%G-W%V}" in str(refused.value.fix)
    assert week_report(site, monday).state != "no_data"
    assert week_report(visitors.with_settings(mask_below=0), monday).state != "no_data"


def test_a_week_of_other_people_is_not_compared_with_nor_remembered(versions: sequences.Versions) -> None:
    site, monday = versions.worlds[0].site, hidden.monday(1)
    assert week_report(site, monday).previous is not None
    without_week(site, monday)
    visitors = site.with_settings(people="visitors")
    assert week_report(visitors, monday).previous is None, "the week before was shared of everybody"
    shared = {week.monday: week.people for week in earlier.read(site)}
    assert shared == {hidden.monday(week): "visitors" if week == 1 else "all" for week in range(WEEKS)}


def test_what_is_made_for_the_operator_is_not_remembered_as_shared(versions: sequences.Versions) -> None:
    site = versions.worlds[0].site
    before = (site.root / earlier.FILE).read_bytes()
    sequences.erased(versions, 1, 0, 0, 10, slots=3)
    week_report(site.with_settings(mask_below=0), hidden.monday(1))
    assert (site.root / earlier.FILE).read_bytes() == before


def test_a_page_made_again_from_the_same_records_has_the_same_bytes(versions: sequences.Versions) -> None:
    site = versions.worlds[0].site
    assert week_report(site, hidden.monday(1)) == week_report(site, hidden.monday(1))
