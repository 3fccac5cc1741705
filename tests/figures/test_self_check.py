"""A site's own weeks, shuffled, show how often its verdicts are false alarms."""

from __future__ import annotations

import json
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from planted_changes import planted, site_of
from report.ingested_worlds import DOOR, QUEUE, messages, report, toml, world

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.self_check import FloorSelfCheck, self_check
from vsd_analytics.report.pages.json_and_csv import from_json, to_json
from vsd_analytics.site.model import Site

FIRST = date(2026, 8, 31)  # a Monday


def checked(root: Path, *, weeks: int = 12, **options: Any) -> FloorSelfCheck:
    with planted(site_of(root), first=FIRST, n_days=7 * weeks, **options) as warehouse:
        data = FloorHours(warehouse, floor=warehouse.site.floors[0])
        return self_check(data, until=FIRST + timedelta(days=7 * weeks - 1))


def test_twelve_weeks_in_which_nothing_changes_seldom_raise_a_false_alarm(tmp_path: Path) -> None:
    found = checked(tmp_path)
    assert (found.state, found.reason, found.n_weeks) == ("ok", None, 12)
    assert found.weeks == (FIRST, FIRST + timedelta(days=83))
    assert found.violation_rate is not None
    assert found.encounter_rate is not None
    assert found.both is not None
    assert found.both.value == (found.violation_rate.value + found.encounter_rate.value) / 2 <= 0.1
    assert found.both.lo <= found.both.value <= found.both.hi
    assert found.verdicts_a_year == 104
    assert found.false_a_year is not None
    assert found.false_a_year[0] == 104 * found.both.value


def test_nine_weeks_are_too_few(tmp_path: Path) -> None:
    found = checked(tmp_path, weeks=9)
    assert (found.state, found.both, found.false_a_year) == ("not_enough_data", None, None)
    assert found.reason is not None
    assert (found.reason.code, found.reason.values["has"]) == ("selfcheck.weeks", 9)


def test_a_week_that_is_recorded_too_little_to_be_compared_does_not_count(tmp_path: Path) -> None:
    assert checked(tmp_path, recorded=lambda camera, day: 0.0 if 21 <= day < 26 else 1.0).n_weeks == 11


def test_a_change_for_good_is_no_false_alarm_of_the_site(tmp_path: Path) -> None:
    """Weeks before and after it are mixed: the steps between them widen the intervals of all."""
    found = checked(tmp_path, rate=lambda area_id, day: 0.5 if day >= 42 else 1.0)
    assert found.both is not None
    assert found.both.value <= 0.15


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Twelve weeks of an open hour a day, in which nothing changes."""
    rng = np.random.default_rng(3)
    weeks = []
    for k in range(12):
        n = rng.poisson((30, 20), (7, 2))
        weeks.append(
            messages(
                lambda day, hour, n=n: {QUEUE: n[day, 0], DOOR: n[day, 1]},  # type: ignore[misc]
                monday=FIRST + timedelta(days=7 * k),
                hours=(9, 10),
            )
        )
    config = toml(opening='{ mon-sun = "09:00-10:00" }', more="[report]\nmin_exposure_h = 1.0")
    return world(tmp_path_factory.mktemp("twelve"), config, *weeks)


def vsd(site: Site, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    capsys.readouterr()
    code = run(cli, ["-C", str(site.root), "--now", "2026-11-24T12:00:00Z", "--quiet", "selfcheck", *arguments])
    return code, capsys.readouterr().out


def test_the_command_says_how_many_false_alarms_a_year_to_expect(
    shop: Site, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out = vsd(shop, capsys, "--json")
    found = json.loads(out)
    assert (code, found["first"], found["last"]) == (0, str(FIRST), str(FIRST + timedelta(days=83)))
    rows = {row["judged"]: row for row in found["answers"]["self_check"]["rows"]}
    assert [(row["n_weeks"], row["verdicts_a_year"]) for row in rows.values()] == [(12, 52), (12, 52), (12, 104)]
    share = rows["both"]["false_alarm_share"]["value"]
    assert share <= 0.1
    assert rows["both"]["false_a_year"]["value"] == pytest.approx(104 * share, abs=0.01)
    code, out = vsd(shop, capsys)
    assert code == 0
    assert next(line for line in out.splitlines() if line.startswith("both")).split()[1] == f"{share:.0%}"


def test_the_json_file_of_a_week_has_the_self_check_of_the_weeks_up_to_it(shop: Site) -> None:
    made = report(shop, FIRST + timedelta(days=77))
    assert made.selfcheck is not None
    assert (made.selfcheck.state, made.selfcheck.n_weeks, made.selfcheck.verdicts_a_year) == ("ok", 12, 104)
    assert made.selfcheck.both is not None
    assert made.selfcheck.false_a_year == 104 * made.selfcheck.both.share
    written = json.loads(to_json(made))["selfcheck"]
    assert written["both"]["share"] == pytest.approx(made.selfcheck.both.share)
    assert (written["n_weeks"], written["reason"]) == (12, None)
    read = from_json(to_json(made)).selfcheck
    assert read is not None
    assert read.verdicts_a_year == 104
    early = report(shop, FIRST + timedelta(days=14)).selfcheck
    assert early is not None
    assert (early.state, early.n_weeks, early.both) == ("not_enough_data", 3, None)
    assert early.reason is not None
    assert early.reason.code == "selfcheck.weeks"


def test_the_command_says_what_is_missing_after_a_few_weeks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stream = messages(lambda day, hour: {QUEUE: 20}, monday=FIRST, hours=(9, 10))
    site = world(tmp_path, toml(opening='{ mon-sun = "09:00-10:00" }'), stream)
    code, out = vsd(site, capsys)
    assert code == 1
    assert out.splitlines()[-1] == "needs at least 10 whole weeks that are recorded well enough, has 1"
    code, out = vsd(site, capsys, "--json")
    answer = json.loads(out)["answers"]["self_check"]
    assert (code, answer["rows"], answer["state"]) == (1, [], "not_enough_data")
