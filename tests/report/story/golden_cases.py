"""The words of every branch as text, in golden/: `python tests/report/story/golden_cases.py` writes them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import datetime
from itertools import product
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[2]))

from report import model_classes as m
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.answer import Reason
from vsd_analytics.figures.floor_days import NO_FLOOR, NO_IDS
from vsd_analytics.report.model import week as page_model
from vsd_analytics.report.pages.story import story_of
from vsd_analytics.wording.reasons import read_reason

FOLDER = Path(__file__).parent / "golden"
OFTEN = ("clear_fall", "clear_rise", "about_same", "cannot_tell", "too_little_data")
CLOSE = (*OFTEN, "not_measurable")
"""The verdicts that a headline is made of: how often, share of time too close."""
CHANGE = {"clear_fall": -0.14, "clear_rise": 0.12, "about_same": 0.02, "cannot_tell": 0.02}


def made(verdict: str, value: float) -> m.Estimate:
    """Return a figure with a verdict."""
    if verdict == "not_measurable":
        return m.Estimate(value=None, state="not_measurable", reason=read_reason("the engine sends no positions"))
    if verdict == "too_little_data":
        return m.Estimate(value=value, verdict="too_little_data", reason=read_reason("3 days"))
    change = CHANGE[verdict]
    reach = 0.3 if verdict == "cannot_tell" else 0.03
    ends = {"change_lo": change - reach, "change_hi": change + reach}
    return m.Estimate(value=value, previous=value / (1 + change), change=change, verdict=verdict, **ends)  # type: ignore[arg-type]


def pair(violation_rate: str, close: str) -> page_model.WeekReport:
    """Return a week with two verdicts, more people, and no log."""
    report = weeks.normal()
    people = m.Estimate(value=300.0, change=0.15, change_lo=0.1, change_hi=0.2, verdict="clear_rise")
    level = replace(
        report.level, violation_rate=made(violation_rate, 121.0), close_time_share=made(close, 0.41), people=people
    )
    return replace(report, level=level, log=())


def beside_usual(violation_rate: str, position: str) -> page_model.WeekReport:
    """Return a week with a verdict on how often that lies somewhere beside the weeks before."""
    report = pair(violation_rate, "cannot_tell")
    usual = m.Usual(lo=130.0, hi=150.0, n_weeks=8, position=position)  # type: ignore[arg-type]
    return replace(report, trend=replace(sections.trend(report), usual_violation_rate=usual))


def silent(n: int, report: page_model.WeekReport | None = None) -> page_model.WeekReport:
    """Return a week of which so many cameras recorded nothing; None = a normal week of four."""
    report = report or pair("cannot_tell", "cannot_tell")
    cameras = tuple(
        replace(c, is_silent=True, share=0.0, recorded_h=0.0) if i < n else c
        for i, c in enumerate(report.coverage.cameras)
    )
    return replace(report, coverage=replace(report.coverage, cameras=cameras))


def unusual_hour() -> page_model.WeekReport:
    """Return a week with one hour far from usual."""
    report = pair("cannot_tell", "about_same")
    row = m.UnusualHour(day=weeks.MONDAY, hour=10, violations=283, usual=72.0, lo=31.0, hi=121.0)
    return replace(report, unusual=m.UnusualHours(rows=(row,), n_unusual=1, n_tested=84))


def changed(name: str, before: str = "the old", after: str = "the new") -> page_model.WeekReport:
    """Return a week in which something was set between the two weeks."""
    report = weeks.settings_changed()
    return replace(report, settings_change=m.SettingsChange(name=name, before=before, after=after))


def quoted() -> page_model.WeekReport:
    """Return a week with a log entry short enough for the headline."""
    report = weeks.normal()
    return replace(report, log=(replace(report.log[1], text="Display moved."),))


def no_areas() -> page_model.WeekReport:
    """Return a week of a floor without areas."""
    return replace(weeks.normal(), areas=(), busiest_spot=None, log=())


def rises() -> page_model.WeekReport:
    """Return a week in which one area clearly rose."""
    report = pair("clear_rise", "cannot_tell")
    rows = (replace(report.areas[0], violation_rate=weeks.estimate(43.6, 0.2, 0.09)), *report.areas[1:])
    return replace(report, areas=rows)


def uncounted(reason: Reason) -> page_model.WeekReport:
    """Return a week in which violations cannot be counted."""
    report = sections.not_measurable()
    why = replace(report.level.violation_rate, reason=reason)
    return replace(report, level=replace(report.level, violation_rate=why))


def stopped(*last: datetime | None) -> page_model.WeekReport:
    """Return a week without data whose cameras sent their last record at these instants."""
    report = weeks.no_data()
    cameras = tuple(replace(c, last_record=t) for c, t in zip(report.coverage.cameras, last, strict=True))
    return replace(report, coverage=replace(report.coverage, cameras=cameras))


def closed() -> page_model.WeekReport:
    """Return a week in which the site never opened."""
    report = weeks.no_data()
    return replace(report, coverage=replace(report.coverage, scheduled_h=0.0, open_h=0.0, outages=()))


def no_camera() -> page_model.WeekReport:
    """Return a floor nobody looks at."""
    report = weeks.no_data()
    return replace(report, coverage=replace(report.coverage, cameras=(), scheduled_h=0.0, outages=()))


def recalibrated_one() -> page_model.WeekReport:
    """Return a week in which one of four cameras was calibrated anew and is left out of the comparison."""
    report = weeks.normal()
    first, *rest = report.coverage.cameras
    apart = replace(first, not_compared=read_reason("it was recalibrated on Wed 11 Nov, 09:00"))
    return replace(report, coverage=replace(report.coverage, cameras=(apart, *rest)))


def after_a_gap(*, is_usual: bool) -> page_model.WeekReport:
    """Return a week after one that was closed, of a site with a longer history."""
    report = weeks.first_week()
    weekly = sections.trend(weeks.normal())
    usual = m.Usual(lo=110.0, hi=150.0, n_weeks=8, position="within") if is_usual else None
    return replace(report, trend=replace(weekly, usual_violation_rate=usual))


def inferred() -> page_model.WeekReport:
    """Return a complete week of an engine that sends no heartbeat."""
    report = weeks.normal()
    full = tuple(replace(c, share=1.0) for c in report.coverage.cameras)
    return replace(report, coverage=replace(report.coverage, cameras=full, is_inferred=True))


_AT = datetime(2026, 11, 8, 17, 59, tzinfo=weeks.ROME)
CASES: Mapping[str, Callable[[], page_model.WeekReport]] = {
    **{f"{o}-{r}": (lambda o=o, r=r: pair(o, r)) for o, r in product(OFTEN, CLOSE)},  # type: ignore[misc]
    **{
        f"usual-{o}-{p}": (lambda o=o, p=p: beside_usual(o, p))  # type: ignore[misc]
        for o, p in product(OFTEN, ("below", "within", "above"))
    },
    "one-camera-silent": lambda: silent(1),
    "three-cameras-silent": lambda: silent(3),
    "one-camera-silent-first-week": lambda: silent(1, weeks.first_week()),
    "unusual-hour": unusual_hour,
    "normal": weeks.normal,
    "after-quoted": quoted,
    "no-areas": no_areas,
    "an-area-rose": rises,
    "tested-spots": sections.with_tested_spots,
    "spot-question": sections.complete,
    "six-feet": lambda: replace(
        weeks.normal(), rules=replace(weeks.normal().rules, distance_m=1.8288, distance_unit="ft")
    ),
    "one-camera-recalibrated": recalibrated_one,
    "inferred": inferred,
    "exposure-unknown": weeks.exposure_unknown,
    "very-few": sections.very_few,
    "no-ids": lambda: uncounted(NO_IDS),
    "no-floor": lambda: uncounted(NO_FLOOR),
    "empty": weeks.empty,
    "too-incomplete": weeks.too_incomplete,
    "not-over": weeks.not_over,
    "first-week": weeks.first_week,
    "after-a-gap": lambda: after_a_gap(is_usual=False),
    "after-a-gap-usual": lambda: after_a_gap(is_usual=True),
    "no-data-all-at-once": weeks.no_data,
    "no-data-one-by-one": lambda: stopped(datetime(2026, 11, 6, 9, tzinfo=weeks.ROME), _AT, _AT, _AT),
    "no-data-never": lambda: stopped(None, None, None, None),
    "no-data-closed-hours": lambda: stopped(*[datetime(2026, 11, 10, 3, tzinfo=weeks.ROME)] * 4),
    "closed": closed,
    "no-camera": no_camera,
    "distance-changed": weeks.settings_changed,
    "recalibrated": sections.recalibrated,
    "cameras-changed": sections.cameras_changed,
    "engine-changed": lambda: changed("engine", "demo 1.2", "demo 2.0"),
    "rules-changed": lambda: changed("rules"),
    "setting-changed": lambda: changed("episode_min_s", "3", "5"),
}


def text_of(report: page_model.WeekReport) -> str:
    """Return the words of a week as plain text: rule, headline, lead, notes, things, question."""
    story = story_of(report)
    lines = [f"[{story.rule}]", story.headline, "", "".join(s.text for s in story.lead)]
    lines += [f"! {n}" for n in story.notes]
    lines += ["", *(f"- {t.title}. {t.text} ({t.target})" for t in story.things), "", story.question]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write every fragment, and remove those of cases that are gone."""
    for path in FOLDER.glob("*.txt"):
        if path.stem not in CASES:
            path.unlink()
    for name, case in CASES.items():
        (FOLDER / f"{name}.txt").write_text(text_of(case()), encoding="utf-8")


if __name__ == "__main__":
    main()
