"""Three things to know and one question, made by rule from the figures (report brief, 4.1 and 4.3)."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from vsd_analytics.report import format as fmt
from vsd_analytics.report import words
from vsd_analytics.report.model import AreaRow, CameraRecord, Thing, WeekReport
from vsd_analytics.report.nothing import nothing

# Words in an area's name -> the question to ask about it.
_QUESTIONS: Final = (
    (
        ("queue", "checkout", "till", "counter", "desk"),
        "Could people at {area} wait in a longer or a second line, above all {when}?",
    ),
    (
        ("entrance", "door", "exit", "lobby", "foyer"),
        "Could {area} be kept free of things that make people stop, above all {when}?",
    ),
    (("aisle", "corridor", "passage"), "Could people pass through {area} in one direction only, above all {when}?"),
    (("",), "Could people at {area} spread out more, above all {when}?"),
)


def weakest_camera(report: WeekReport) -> CameraRecord | None:
    """Return the camera that recorded least, if that is less than a full share of its open hours."""
    known = [c for c in report.coverage.cameras if c.share is not None]
    weakest = min(known, key=lambda c: c.share or 0.0, default=None)
    return weakest if weakest and (weakest.share or 0.0) < report.rules.full_hour_share else None


def things(report: WeekReport) -> tuple[Thing, ...]:
    """Return what worked, what to watch and what not to trust, each with the anchor of its proof."""
    if report.state == "no_data":
        told = nothing(report)
        return (Thing(kind="distrust", title=told.title, text=told.text, target="data"),)
    if report.state == "too_incomplete":
        title = f"Cameras recorded {fmt.percent(report.coverage.share)} of open hours"
        text = "The recorded hours may be unlike the others. Do not read a level, a ranking or a trend from this page."
        return (Thing(kind="distrust", title=title, text=text, target="data"),)
    if report.state == "normal" and report.level.often.value is not None:
        return _worked(report), _watch(report), _distrust(report)
    worked = Thing(
        kind="worked",
        title=f"Cameras recorded {fmt.percent(report.coverage.share)} of open hours",
        text="That is enough to know the level of this week.",
        target="data",
    )
    if report.level.often.value is None:
        return (replace(worked, text="What is missing is not hours but the means to count."), _distrust(report))
    return (worked, _distrust(report)) if report.state == "empty" else (worked, _watch(report), _distrust(report))


def _worked(report: WeekReport) -> Thing:
    since_week = f"week {report.previous.number}" if report.previous else "last week"
    for line in report.log:
        if line.since is not None and line.since.verdict == "clear_fall" and line.area_name:
            at = f"{fmt.weekday(line.at.date())} {fmt.clock(line.at)}"
            return Thing(
                kind="worked",
                title=f"The change at {line.area_name} seems to have worked",
                text=f"Since {at}, violations there are {fmt.fewer_more(line.since.change)} than in the same hours of "
                f"{since_week} ({fmt.likely_change(line.since)}).",
                target="changed",
            )
    if not report.areas:
        return _worked_at_all(report, since_week)
    falls = [a for a in report.areas if a.often.verdict == "clear_fall"]
    if falls:
        best = min(falls, key=lambda a: a.often.change or 0.0)
        return Thing(
            kind="worked",
            title=f"{best.name} clearly fell",
            text=_against(best, since_week),
            target="changed",
        )
    return Thing(
        kind="worked",
        title="No area clearly fell",
        text=f"Nothing changed at the site shows in the figures yet, compared with {since_week}.",
        target="changed",
    )


def _worked_at_all(report: WeekReport, since_week: str) -> Thing:
    """Say the same of a floor without areas."""
    often = report.level.often
    if often.verdict == "clear_fall" and often.change is not None:
        text = f"{fmt.fewer_more(often.change).capitalize()} than in {since_week} ({fmt.likely_change(often)})."
        return Thing(kind="worked", title="The whole floor clearly fell", text=text, target="changed")
    text = f"The floor as a whole, compared with {since_week}: {words.verdict_words(often).lower()}."
    return Thing(kind="worked", title="Nothing clearly fell", text=text, target="changed")


def _watch(report: WeekReport) -> Thing:
    since_week = f"week {report.previous.number}" if report.previous else "last week"
    rises = [a for a in report.areas if a.often.verdict == "clear_rise"]
    if rises and report.state == "normal":
        top = max(rises, key=lambda a: a.often.change or 0.0)
        return Thing(
            kind="watch",
            title=f"{top.name} clearly rose",
            text=_against(top, since_week),
            target="changed",
        )
    spot = report.busiest_spot
    if spot is not None:
        row = next((a for a in report.areas if a.area_id == spot.area_id), None)
        size = f", on {fmt.percent(spot.floor_share)} of the floor" if spot.floor_share is not None else ""
        own = _own_change(row) if report.state == "normal" else ""
        return Thing(
            kind="watch",
            title=f"{spot.name} is the busiest spot",
            text=f"{fmt.percent(spot.share)} of all violations{size}.{own}",
            target="where",
        )
    busiest = report.busiest_hour
    if busiest is not None:
        at = f"{fmt.weekday(busiest.start.date())} {fmt.clock(busiest.start)}"
        return Thing(kind="watch", title=f"{at} is the busiest hour", text="See the timetable.", target="when")
    return Thing(kind="watch", title="Nothing is ranked this week", text="No hour was recorded in full.", target="when")


def _against(row: AreaRow, since_week: str) -> str:
    return f"{fmt.fewer_more(row.often.change).capitalize()} than in {since_week} ({fmt.likely_change(row.often)})."


def _own_change(row: AreaRow | None) -> str:
    if row is None or row.often.change is None or row.often.verdict != "no_clear_change":
        return ""
    points = fmt.fewer_more(row.often.change)
    if points == "about the same":
        return " Its own figure is about the same as last week."
    way, by = ("up", "more") if row.often.change > 0 else ("down", "fewer")
    return f" Its own figure is {way} {points.removesuffix(' ' + by)}, which could be normal variation."


def _leans_on(area: AreaRow, camera: CameraRecord, report: WeekReport) -> bool:
    """Tell whether what a camera missed leaves an area incomplete."""
    is_thin = area.recorded_share is None or area.recorded_share < report.rules.full_hour_share
    return is_thin and camera.camera_id in area.cameras


def _distrust(report: WeekReport) -> Thing:
    left_out = [c for c in report.coverage.cameras if c.not_counted is not None]
    if left_out and report.level.often.value is not None:
        camera_names = words.joined(words.camera_name(c.name) for c in left_out)
        return Thing(
            kind="distrust",
            title=f"{camera_names} {'is' if len(left_out) == 1 else 'are'} not counted",
            text=words.sentence(left_out[0].not_counted or ""),
            target="data",
        )
    if report.level.often.state == "not_measurable":
        return Thing(
            kind="distrust",
            title="How often cannot be said",
            text=words.sentence(report.level.often.reason or ""),
            target="about",
        )
    apart = [c for c in report.coverage.cameras if c.not_compared is not None]
    if apart and report.state == "normal":
        camera_names = words.joined(words.camera_name(c.name) for c in apart)
        return Thing(
            kind="distrust",
            title=f"{camera_names} {'is' if len(apart) == 1 else 'are'} not compared",
            text=f"{words.sentence(apart[0].not_compared or '')} Changes are those of what the other cameras count.",
            target="changed",
        )
    camera = weakest_camera(report)
    if camera is not None:
        areas = [a for a in report.areas if a.area_id is not None and _leans_on(a, camera, report)][:2]
        names = words.joined(a.name for a in areas)
        if not areas:
            seen = ""
        elif any(a.often.verdict in ("clear_fall", "clear_rise") for a in areas):
            seen = f" It sees {names}: the change there stands on the hours recorded in both weeks only."
        else:
            seen = f" It sees {names}: do not read a trend there."
        return Thing(
            kind="distrust",
            title=f"{words.camera_name(camera.name)} recorded {fmt.percent(camera.share)} of its open hours",
            text=f"What it alone sees is hard to compare this week.{seen}",
            target="data",
        )
    if report.coverage.is_inferred:
        return Thing(
            kind="distrust",
            title="Recorded hours are inferred",
            text="The engine sends no sign of life when nobody is in view, so quiet hours and lost hours look alike.",
            target="data",
        )
    if report.level.risky.state == "not_measurable":
        return Thing(
            kind="distrust",
            title="How risky cannot be said",
            text=words.sentence(report.level.risky.reason or "the engine sends no positions"),
            target="about",
        )
    return Thing(
        kind="distrust",
        title="Likely ranges cover chance only",
        text="A camera that was moved or badly calibrated shifts every figure and is not in them.",
        target="about",
    )


def question(report: WeekReport) -> str:
    """Return the one question for the next meeting: about the room, never about people."""
    distance = fmt.metres(report.rules.distance_m)
    if report.state == "no_data":
        return nothing(report).question
    if report.level.often.state == "not_measurable":
        return "What would it take to have violations counted here?"
    if report.state == "empty":
        return f"When was the {distance} distance last checked against a tape measure?"
    camera = weakest_camera(report)
    spot = report.busiest_spot
    row = next((a for a in report.areas if spot is not None and a.area_id == spot.area_id), None)
    owns_spot = row is not None and camera is not None and row.cameras == (camera.camera_id,)
    if report.state == "too_incomplete" and (camera is None or (camera.share or 0.0) > report.coverage.share - 0.1):
        return "What would keep the cameras recording all week?"
    if camera is not None and (report.state == "too_incomplete" or owns_spot):
        return f"What would keep {words.camera_name(camera.name)} recording all week?"
    rises = [a for a in report.areas if a.often.verdict == "clear_rise" and a.area_id is not None]
    if rises and report.state == "normal":
        top = max(rises, key=lambda a: a.often.change or 0.0)
        return f"What changed at {top.name} that brings people closer together there?"
    busiest = report.busiest_hour
    when = f"on {fmt.weekday(busiest.start.date())} around {fmt.clock(busiest.start)}" if busiest else "at busy hours"
    if spot is None:
        return f"Could people come at other times than {when}?"
    if spot.area_id is None:
        return f"What is it on the rest of the floor that brings people together {when}?"
    name = spot.name.casefold()
    template = next(q for keys, q in _QUESTIONS if any(k in name for k in keys))
    return template.format(area=spot.name, when=when)
