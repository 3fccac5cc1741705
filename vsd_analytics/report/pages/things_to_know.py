"""At most three things to know about a week, made by rule: what worked, what to watch, what not to trust."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from vsd_analytics.figures.change_outcome import WORKS_WEEKS
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_recording import CameraRecord
from vsd_analytics.figures.week.model_sections import LoggedChangeEffect
from vsd_analytics.figures.week.results import AreaRow
from vsd_analytics.report.model.week import Thing, WeekReport
from vsd_analytics.report.pages.change_story import came_of, story
from vsd_analytics.report.pages.no_data import nothing
from vsd_analytics.report.pages.spoken import week_before
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

FALLS: Final = ("works", "fell", "moved")
"""Outcomes of a change after which its area has clearly less time too close."""
NEWS_WEEKS: Final = 2
"""For so many weeks the page explains the result of a change; then a shorter line does."""
KNOWN_WEEKS: Final = 3
"""What was so in so many of the weeks before is no news."""


def weakest_camera(report: WeekReport) -> CameraRecord | None:
    """Return the camera that recorded least, if that is less than a full share of its open hours."""
    known = [c for c in report.coverage.cameras if c.share is not None]
    weakest = min(known, key=lambda c: c.share or 0.0, default=None)
    return weakest if weakest and (weakest.share or 0.0) < report.rules.full_hour_share else None


def things(report: WeekReport) -> tuple[Thing, ...]:
    """Return what worked, what to watch and what not to trust, each with the anchor of its proof."""
    if report.state == "no_data":
        texts = nothing(report)
        return (Thing(kind="distrust", title=texts.title, text=texts.text, target="data"),)
    recorded = say("things.recorded", share=fmt.percent(report.coverage.share))
    if report.is_so_far:
        title = say("things.not_over_title")
        return (Thing(kind="distrust", title=title, text=say("things.not_over"), target="when"),)
    if report.state == "too_incomplete":
        return (Thing(kind="distrust", title=recorded, text=say("things.too_incomplete"), target="data"),)
    if report.state == "normal" and report.level.violation_rate.value is not None:
        doubts = () if _is_chance_all(report) else (_distrust(report),)
        return _worked(report), _watch(report), *doubts
    part = "_part" if report.silent_cameras else ""
    worked = Thing(kind="worked", title=recorded, text=say(f"things.enough{part}"), target="data")
    if report.level.violation_rate.value is None:
        is_few = report.level.violation_rate.state != "not_measurable"
        return (replace(worked, text=say(f"things.few{part}" if is_few else "things.no_means")), _distrust(report))
    return (worked, _distrust(report)) if report.state == "empty" else (worked, _watch(report), _distrust(report))


def _change_that_fell(change: LoggedChangeEffect) -> Thing:
    """Return the thing to know of a change whose area fell: it works, it moved, or nobody can tell whether it did."""
    n = change.n_watched or 0
    text = say("things.since", plural=n, weeks=n, at=fmt.date_short(change.at.date()), story=story(change))
    key = {"works": "things.works", "moved": "things.moved"}.get(change.outcome, "things.less")
    return Thing(kind="worked", title=say(key, area=change.area_name), text=text, target="changed")


def _is_news(change: LoggedChangeEffect, report: WeekReport) -> bool:
    """Tell whether the result of a change is new to a reader of every week's page."""
    first = WORKS_WEEKS if change.outcome == "works" else 1
    return report.agenda is None or (change.n_watched or 0) < first + NEWS_WEEKS


def _results(report: WeekReport, *, is_new: bool) -> list[Thing]:
    """Return the results of changes after which there is clearly less time too close, the latest first."""
    changes = (c for c in reversed(report.change_effects) if _is_news(c, report) == is_new and _is_material(c, report))
    return [_change_that_fell(c) for c in changes if c.outcome in FALLS]


def _is_material(change: LoggedChangeEffect, report: WeekReport) -> bool:
    """Tell whether a change moved a material share of the floor's time too close, or its area still holds one."""
    row = next((a for a in report.areas if a.name == change.area_name), None)
    return abs(change.contribution or 0.0) >= report.rules.material_share or (row is not None and row.is_material)


def _worked(report: WeekReport) -> Thing:
    since = week_before(report)
    new = _results(report, is_new=True)
    if new:
        return new[0]
    if not report.areas:
        return _worked_at_all(report, since)
    falls = [a for a in report.areas if a.violation_rate.verdict == "clear_fall" and a.is_material]
    if falls:
        best = min(falls, key=lambda a: a.violation_rate.change or 0.0)
        latest = next((c for c in reversed(report.change_effects) if c.area_name == best.name), None)
        if latest is not None and latest.outcome not in FALLS:
            return _fell_since(best, latest, report)
        title = say("things.fell", area=best.name)
        return Thing(kind="worked", title=title, text=_against(best.violation_rate, since), target="changed")
    old = _results(report, is_new=False)
    if old:
        return old[0]
    doubtful = [c for c in report.change_effects if c.outcome == "doubtful" and _is_material(c, report)]
    if doubtful:
        change = doubtful[-1]
        text = say("things.none_fell_doubtful", area=change.area_name, at=fmt.date_short(change.at.date()))
        return Thing(kind="worked", title=say("things.none_fell"), text=text, target="changed")
    if any(c.running is not None and c.running.verdict == "clear_fall" for c in report.change_effects):
        text = say("things.none_fell_small")
        return Thing(kind="worked", title=say("things.none_fell"), text=text, target="changed")
    unseen = {a.area_id: a.name for a in report.areas if a.area_id and a.recorded_share == 0}
    lost = next((unseen[e.area_id] for e in reversed(report.log) if e.kind == "logged" and e.area_id in unseen), None)
    if lost is not None:
        text = say("things.none_fell_unseen", area=lost)
        return Thing(kind="worked", title=say("things.none_fell"), text=text, target="changed")
    is_logged = any(line.kind == "logged" for line in report.log)
    is_quiet = report.agenda is not None and not is_logged and not report.change_effects
    text = say("things.none_fell_quiet") if is_quiet else say("things.none_fell_text", since=since)
    return Thing(kind="worked", title=say("things.none_fell"), text=text, target="changed")


def _fell_since(area: AreaRow, change: LoggedChangeEffect, report: WeekReport) -> Thing:
    """Return what is known of an area that fell since last week, after a change that is not shown to have done it."""
    since = _against(area.violation_rate, week_before(report))
    outcome = came_of(change, day=report.week.sunday)
    text = f"{since} {say('things.of_change', at=fmt.date_short(change.at.date()), said=outcome)}"
    return Thing(kind="worked", title=say("things.fell_since", area=area.name), text=text, target="changed")


def _worked_at_all(report: WeekReport, since: str) -> Thing:
    """Say the same of a floor without areas."""
    violation_rate = report.level.violation_rate
    if violation_rate.verdict == "clear_fall" and violation_rate.change is not None:
        return Thing(
            kind="worked", title=say("things.floor_fell"), text=_against(violation_rate, since), target="changed"
        )
    text = say("things.nothing_fell_text", since=since, verdict=terms.verdict_words(violation_rate).lower())
    return Thing(kind="worked", title=say("things.nothing_fell"), text=text, target="changed")


def _watch(report: WeekReport) -> Thing:
    rises = [a for a in report.areas if a.violation_rate.verdict == "clear_rise" and a.is_material]
    if rises and report.state == "normal":
        top = max(rises, key=lambda a: a.violation_rate.change or 0.0)
        text = _against(top.violation_rate, week_before(report))
        return Thing(kind="watch", title=say("things.rose", area=top.name), text=text, target="changed")
    spot = report.busiest_spot
    if (
        spot is not None
        and not report.silent_cameras
        and (weeks := _weeks_busiest(report)) >= KNOWN_WEEKS
        and report.state == "normal"
    ):
        hour = _unusual_hour(report)
        if hour is not None:
            return hour
        text = say("things.busiest_again", share=fmt.percent(spot.share), weeks=weeks, of=_weeks_known(report))
        return Thing(kind="watch", title=say("things.busiest_still", area=spot.name), text=text, target="where")
    if spot is not None:
        row = next((a for a in report.areas if a.area_id == spot.area_id), None)
        key = "things.busiest_share" if spot.floor_share is None else "things.busiest_floor"
        key, name = ("things.busiest_share_recorded", "recorded") if report.silent_cameras else (key, "spot")
        text = terms.sentence(say(key, share=fmt.percent(spot.share), floor=fmt.percent(spot.floor_share)))
        own = _own_change(row) if report.state == "normal" else ""
        title = say(f"things.busiest_{name}", area=spot.name)
        return Thing(kind="watch", title=title, text=f"{text}{own}", target="where")
    busiest = report.busiest_hour
    if busiest is not None:
        title = say("things.busiest_hour", at=terms.moment(busiest.start))
        return Thing(kind="watch", title=title, text=say("things.busiest_hour_text"), target="when")
    return Thing(kind="watch", title=say("things.unranked"), text=say("things.unranked_text"), target="when")


def _weeks_known(report: WeekReport) -> int:
    return 0 if report.agenda is None else len(report.agenda.busiest_before)


def _weeks_busiest(report: WeekReport) -> int:
    """Return in how many of the eight weeks before the busiest area was the same."""
    spot = report.busiest_spot
    return 0 if spot is None or report.agenda is None else report.agenda.busiest_before.count(spot.area_id or "")


def _unusual_hour(report: WeekReport) -> Thing | None:
    """Return the hour farthest above its usual count; None without one, or where it is too small to print."""
    rows = report.unusual.rows if report.unusual is not None else ()
    row = next((r for r in rows if r.violations is not None and r.violations > r.hi), None)
    if row is None:
        return None
    hour = f"{fmt.weekday(row.day)} {fmt.hour_label(row.hour)}"
    text = say("things.unusual_text", n=fmt.count(row.violations), usual=fmt.number(row.usual))
    return Thing(kind="watch", title=say("things.unusual", hour=hour), text=text, target="when")


def _against(violation_rate: Estimate, since: str) -> str:
    change, likely = fmt.fewer_more(violation_rate.change), fmt.likely_change(violation_rate)
    return terms.sentence(say("things.against", change=change, since=since, likely=likely))


def _own_change(row: AreaRow | None) -> str:
    if (
        row is None
        or row.violation_rate.change is None
        or row.violation_rate.verdict not in ("about_same", "cannot_tell")
    ):
        return ""
    if round(row.violation_rate.change * 100) == 0:
        return say("things.own_same") if row.violation_rate.verdict == "about_same" else ""
    key = "things.own_up" if row.violation_rate.change > 0 else "things.own_down"
    return say(key, percent=fmt.percent(abs(row.violation_rate.change)))


def _leans_on(area: AreaRow, camera: CameraRecord, report: WeekReport) -> bool:
    """Tell whether what a camera missed leaves an area incomplete."""
    is_thin = area.recorded_share is None or area.recorded_share < report.rules.full_hour_share
    return is_thin and camera.camera_id in area.cameras


def _distrust(report: WeekReport) -> Thing:
    left_out = [c for c in report.coverage.cameras if c.not_counted is not None]
    if left_out and report.level.violation_rate.value is not None:
        title = say("things.not_counted", plural=len(left_out), cameras=_named(left_out))
        return _doubt(title, terms.sentence(reason_text(left_out[0].not_counted)), "data")
    if report.level.violation_rate.state == "not_measurable":
        return _doubt(
            say("things.no_violation_rate"), terms.sentence(reason_text(report.level.violation_rate.reason)), "about"
        )
    apart = [c for c in report.coverage.cameras if c.not_compared is not None]
    if apart and report.state == "normal":
        title = say("things.not_compared", plural=len(apart), cameras=_named(apart))
        text = say("things.not_compared_text", reason=terms.sentence(reason_text(apart[0].not_compared)))
        return _doubt(title, text, "changed")
    moved = [c for c in report.coverage.cameras if c.moved is not None]
    if moved and report.state == "normal":
        title = say("things.moved_camera", plural=len(moved), cameras=_named(moved))
        return _doubt(title, terms.sentence(reason_text(moved[0].moved)), "data")
    camera = weakest_camera(report)
    is_reported = (
        report.state != "normal" and len(report.coverage.cameras) == 1
    )  # the first thing says what it recorded
    if camera is not None and not is_reported:
        return _weak(camera, report)
    if report.coverage.is_inferred:
        return _doubt(say("things.inferred"), say("things.inferred_text"), "data")
    if report.level.encounter_rate.state == "not_measurable":
        text = terms.sentence(reason_text(report.level.encounter_rate.reason) or say("lead.no_positions"))
        return _doubt(say("things.no_risk"), text, "about")
    return _doubt(say("things.chance"), say("things.chance_text"), "about")


def _is_chance_all(report: WeekReport) -> bool:
    """Tell whether chance is all there is to doubt, and earlier pages said so: no news (`about` still has it)."""
    is_known = report.agenda is not None and report.trend is not None and len(report.trend.weeks) > KNOWN_WEEKS
    return is_known and _distrust(report).title == say("things.chance")


def _weak(camera: CameraRecord, report: WeekReport) -> Thing:
    areas = [a for a in report.areas if a.area_id is not None and _leans_on(a, camera, report)][:2]
    is_clear = any(a.violation_rate.verdict in ("clear_fall", "clear_rise") for a in areas)
    key = "things.weak_areas_clear" if is_clear else "things.weak_areas"
    text = say(key, areas=terms.joined(a.name for a in areas)) if areas else say("things.weak_camera_text")
    title = say("things.weak_camera", camera=terms.camera_name(camera.name), share=fmt.percent(camera.share))
    return _doubt(title, text, "data")


def _doubt(title: str, text: str, target: str) -> Thing:
    return Thing(kind="distrust", title=title, text=text, target=target)


def _named(cameras: Sequence[CameraRecord]) -> str:
    return terms.joined(terms.camera_name(c.name) for c in cameras)
