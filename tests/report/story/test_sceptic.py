"""What the pages say is true: a small part of the battery of `prove_sceptic`, and that its judges would see a fault."""

from __future__ import annotations

import sys
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "figures"))
sys.path.insert(0, str(Path(__file__).parents[2] / "stats"))
sys.path.insert(0, str(Path(__file__).parent))

from change_worlds import OFFICE, SHOP
from prove_sceptic import PARTS, Findings
from report import model_classes as m
from sceptic_judges import JUDGES, NO_CLAIM, SPOKEN, UNJUDGED, claims_nothing, judge_of
from sceptic_worlds import TALES, Tale, Truth, of, sites_of, weeks_of

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording.catalogue import catalogue

pytestmark = pytest.mark.simulation

SEED = 20261123
BATTERY = {
    "a redesign that clears an area: office": (5,),
    "a camera dead for a week, its area rises": (0,),
    "a closed week": (1,),
    "a quiet site": (1,),
}
"""Tales and which of their weeks are read."""


@pytest.fixture(scope="module")
def battery(tmp_path_factory: pytest.TempPathFactory) -> Findings:
    found = Findings()
    for tale in TALES:
        if tale.name in BATTERY:
            short = replace(tale, weeks=BATTERY[tale.name])
            for truth, report in weeks_of(short, sites_of(tale, 1, SEED), 0, tmp_path_factory.mktemp("tale")):
                found.read(report, truth)
    assert found.n_weeks == sum(map(len, BATTERY.values()))
    return found


def week_of(tale: Tale, folder: Path) -> tuple[Truth, WeekReport]:
    return next(weeks_of(tale, sites_of(tale, 1, SEED), 0, folder))


def read(report: WeekReport, truth: Truth) -> set[str]:
    """Return the keys of a page's sentences that claim too much."""
    found = Findings()
    found.read(replace(report, story=None), truth)
    return {said.key for said, _ in [*found.others.wrong, *found.worked.wrong]}


def test_nothing_is_laid_to_a_change_that_did_not_do_it_and_the_real_one_is_named(battery: Findings) -> None:
    assert [(said.key, said.sentence) for said, _ in battery.worked.wrong] == []
    assert battery.worked.claims > 0


def test_other_sentences_claim_no_more_than_ranges_may_miss(battery: Findings) -> None:
    others = battery.others
    assert others.claims > 100
    wrong = [(said.key, said.sentence) for said, _ in others.wrong]
    assert len(wrong) <= 0.05 * others.claims, wrong


def test_every_sentence_of_these_pages_is_judged(battery: Findings) -> None:
    assert dict(battery.unjudged) == {}
    assert dict(battery.bare) == {}


def test_every_sentence_of_the_catalogue_has_a_judge_or_a_reason_for_none() -> None:
    begins = {begin for keys in PARTS.values() for begin in keys} - {"next."}
    unknown = [
        key
        for key in catalogue()
        if key.startswith(tuple(begins))
        and judge_of(key) is None
        and not claims_nothing(key)
        and not any(fnmatchcase(key, name) for name in UNJUDGED)
    ]
    assert unknown == []


def test_every_judge_is_of_a_sentence_that_exists() -> None:
    named = [name for name in (*JUDGES, *NO_CLAIM, *UNJUDGED) if not any(fnmatchcase(name, s) for s in SPOKEN)]
    assert [name for name in named if not any(fnmatchcase(key, name) for key in catalogue())] == []


def test_a_false_fall_is_seen_in_headline_lead_areas_and_titles(tmp_path: Path) -> None:
    tale = Tale(name="nothing", world=of(SHOP), weeks=(1,))
    truth, report = week_of(tale, tmp_path)
    fall = {"change": -0.3, "change_lo": -0.4, "change_hi": -0.2, "verdict": "clear_fall"}
    violation_rate = replace(report.level.violation_rate, **fall)
    rows = tuple(
        replace(a, violation_rate=replace(a.violation_rate, **fall)) if a is report.areas[0] else a
        for a in report.areas
    )
    spoilt = replace(report, level=replace(report.level, violation_rate=violation_rate), areas=rows)
    wrong = read(spoilt, truth)
    assert {"lead.clear", "area.clear_fall", "area.range", "things.fell", "titles.changed_one"} <= wrong
    assert not any(key.startswith("headline.") for key in wrong), "a week within its usual range is no news"
    assert spoilt.trend is not None
    below = replace(spoilt, trend=replace(spoilt.trend, usual_violation_rate=None))
    assert any(key.startswith("headline.") for key in read(below, truth))
    assert "area.clear_fall" not in read(report, truth)


def test_a_false_success_is_seen_wherever_it_is_said(tmp_path: Path) -> None:
    tale = Tale(name="an entry", world=of(OFFICE), entries=(3,), weeks=(2,))
    truth, report = week_of(tale, tmp_path)
    (change,) = report.change_effects
    assert change.running is not None
    running = replace(change.running, change=-0.4, change_lo=-0.5, change_hi=-0.3, verdict="clear_fall")
    net = m.Estimate(value=None, change=-0.2, change_lo=-0.3, change_hi=-0.1, verdict="clear_fall")
    made = replace(
        change,
        running=running,
        outcome="works",
        net=net,
        e_value=400.0,
        is_credible=True,
        doubts=(),
        design="beside",
        moved_elsewhere=0.0,
    )
    line = replace(report.logged_changes[0], outcome="works", running=running, usual_min=50.0, avoided_min=20.0)
    wrong = read(replace(report, change_effects=(made,), logged_changes=(line,)), truth)
    assert {
        "things.works",
        "came_of.works",
        "came_of.story_works",
        "change_effects.running.clear_fall",
    } <= wrong


def test_a_silent_camera_that_no_word_names_is_seen(tmp_path: Path) -> None:
    tale = next(t for t in TALES if t.name == "a camera dead for a week, its area rises")
    truth, report = week_of(replace(tale, weeks=(0,)), tmp_path)
    cameras = tuple(replace(c, is_silent=False) for c in report.coverage.cameras)
    hidden = replace(report, coverage=replace(report.coverage, cameras=cameras))
    wrong = read(hidden, truth)
    assert {"headline.names_missing", "lead.names_missing"} <= wrong
    assert not {"headline.names_missing", "lead.names_missing"} & read(report, truth)
    zero = replace(report.areas[-2], violation_rate=m.Estimate(value=0.0))
    assert zero.area_id in ("place-0", "place-1")
    assert "area.level" in read(replace(report, areas=(*report.areas[:-2], zero, report.areas[-1])), truth)
