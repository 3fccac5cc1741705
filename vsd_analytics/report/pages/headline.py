"""The words of the page, made by rule from the figures: headline, lead, three things to know, one question.

The headline reads the two verdicts and the usual range, never a point estimate alone. In the catalogue `headline.pair`
is the whole 5 x 6 table of verdicts (how often x share of time too close), and `headline.usual` says where how often
lies beside the weeks before; abnormal weeks have their own sentence each. "After" is allowed, "because" is not.

A week within its usual range has no news for the headline, also where it clearly differs from last week: one of twenty
such pairs of weeks differs by chance, and the lead gives the change with its range.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from vsd_analytics.figures.floor_days import NO_FLOOR, NO_IDS
from vsd_analytics.figures.week.model_recording import CameraRecord
from vsd_analytics.figures.week.results import AreaRow, LogLine
from vsd_analytics.report.model.week import Span, WeekReport
from vsd_analytics.report.pages.no_data import nothing
from vsd_analytics.report.pages.spoken import week_before
from vsd_analytics.report.pages.things_to_know import things
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import has, say
from vsd_analytics.wording.reasons import reason_text

MAX_WORDS: Final = 15
OWN_SHARE: Final = 0.8
"""A change of the floor is an area's own when at least this part of it lies there."""
CLEAR: Final = ("clear_fall", "clear_rise")


def close_key(report: WeekReport) -> str:
    """Return the second key of the table: the verdict on the share of time too close, or not_measurable.

    A clear change that leaves the share within its usual range is no news for a headline: the lead says it.
    """
    close = report.level.close_time_share
    if close is None or close.state == "not_measurable":
        return "not_measurable"
    usual = report.trend.usual_close if report.trend is not None else None
    if close.verdict in CLEAR and usual is not None and usual.position == "within":
        return "cannot_tell"
    return close.verdict or "too_little_data"


def violation_rate_key(report: WeekReport) -> str:
    """Return the first key of the table: the verdict on how often."""
    return report.level.violation_rate.verdict or "too_little_data"


def headline(report: WeekReport) -> tuple[str, str]:
    """Return the name of the rule that a week comes under, and the headline it gives."""
    if report.state == "no_data":  # nothing was recorded anywhere, so no camera is named
        texts = nothing(report)
        return texts.rule, texts.headline
    cameras = report.silent_cameras
    abnormal = _abnormal_headline(report)
    if abnormal is None:
        return _compared_headline(report, cameras)
    rule, text = abnormal
    if cameras:
        named = _cameras(report, cameras)
        key = "headline.little" if report.is_little_recorded else "headline.silent"
        text = say(key, plural=len(cameras), headline=text, cameras=named)
    return rule, text


def _abnormal_headline(report: WeekReport) -> tuple[str, str] | None:
    """Return the rule and headline of a week that is compared with nothing; None for a normal one."""
    week, violation_rate = report.week, report.level.violation_rate
    match report.state:
        case "too_incomplete" if report.is_so_far:
            return "not_over", say("headline.not_over", week=week.number)
        case "too_incomplete":
            return "too_incomplete", say("headline.too_incomplete", week=week.number)
        case "empty":
            return "empty", say("headline.empty", week=week.number)
        case _ if violation_rate.state == "not_measurable":
            return "not_measurable", say("headline.not_measurable")
        case _ if violation_rate.value is None:
            return "few", say("headline.few", week=week.number)
        case "first_week":
            return _headline_without_week_before(report)
        case "settings_changed":
            return "settings_changed", _settings_headline(report)
        case _:
            return None


def _headline_without_week_before(report: WeekReport) -> tuple[str, str]:
    """Return the rule and headline of a first week, or of one after a week that was closed or has no data."""
    rate = fmt.number(report.level.violation_rate.value)
    usual = report.trend.usual_violation_rate if report.trend is not None else None
    if not report.has_history:
        return "first_week", say("headline.first_week", rate=rate)
    if usual is None:
        return "no_week_before", say("headline.no_week_before", rate=rate)
    return f"no_week_before/{usual.position}", say(f"headline.usual.too_little_data.{usual.position}")


def _compared_headline(report: WeekReport, cameras: Sequence[CameraRecord]) -> tuple[str, str]:
    """Return the rule and headline of a normal week, in which these cameras recorded nothing."""
    violation_rate = report.level.violation_rate
    keys = violation_rate_key(report), close_key(report)
    rule = "/".join(k.removeprefix("clear_") for k in keys)
    moved = terms.moved(violation_rate.change) if violation_rate.change is not None else say("headline.changed")
    plain = say(f"headline.pair.{keys[0]}.{keys[1]}", moved=moved)
    usual = report.trend.usual_violation_rate if report.trend is not None else None
    entry = change_to_name(report)
    choices: list[tuple[str, str]] = []
    if entry is not None:
        choices += [("/after", say("headline.after", headline=plain, entry=tail)) for tail in _after(entry)]
    if usual is not None and keys[1] not in CLEAR:
        is_usual = usual.position == "within" and keys[0] in CLEAR
        beside = say(f"headline.usual.{'cannot_tell' if is_usual else keys[0]}.{usual.position}", moved=moved)
        if not is_usual:
            choices += [("/where", say("headline.where", headline=beside, part=tail)) for tail in _where(report)]
        choices.append((f"/{usual.position}", beside))
    choices += [("/where", say("headline.where", headline=plain, part=tail)) for tail in _where(report)]
    choices.append(("", plain))
    if cameras:
        choices = [
            (name, say("headline.without", headline=text, cameras=_cameras(report, cameras)))
            for name, text in choices
            if name not in ("/where", "/after")
        ]
    name, text = next((c for c in choices if terms.n_words(c[1]) <= MAX_WORDS), choices[-1])
    return rule + name, text


def _cameras(report: WeekReport, cameras: Sequence[CameraRecord]) -> str:
    if len(cameras) > 2:
        return say("headline.some_cameras", n=len(cameras), all=len(report.coverage.cameras))
    named = terms.joined(terms.camera_name(c.name) for c in cameras)
    return f"{named[:1].lower()}{named[1:]}"


def _where(report: WeekReport) -> list[str]:
    """Return where most of the floor's change lies, in words: the area that adds most to it, if it adds a third."""
    violation_rate = report.level.violation_rate
    if (
        violation_rate.verdict not in ("clear_fall", "clear_rise")
        or violation_rate.previous is None
        or not violation_rate.change
    ):
        return []
    whole = violation_rate.previous * violation_rate.change
    material = [a for a in report.areas if a.area_id is not None and a.is_material]
    parts = [(a.difference / whole, a.name) for a in material if a.difference is not None]
    share, name = max(parts, default=(0.0, ""))
    part = terms.part(share)
    return [] if part is None else [say("headline.part_at", part=part, area=name)]


def _settings_headline(report: WeekReport) -> str:
    change = report.settings_change
    when = say("headline.since", week=week_before(report))
    if change is not None and change.at is not None:
        when = say("headline.on_day", day=fmt.weekday(change.at.date()))
    key = f"headline.setting_{change.name if change is not None else 'other'}"
    return say(key if has(key) else "headline.setting_other", when=when)


def change_to_name(report: WeekReport) -> LogLine | None:
    """Return the log entry the headline may name with "after", or None.

    It lies in an area whose own verdict is the headline's and was logged by a person; most of that area's change came
    after it; and the change is that area's: it holds at least 80 % of the floor's, and the rest of the floor has not
    clearly moved the same way.
    """
    verdict = report.level.violation_rate.verdict
    if report.state != "normal" or verdict not in ("clear_fall", "clear_rise"):
        return None
    moved_areas = {
        a.area_id
        for a in report.areas
        if a.violation_rate.verdict == verdict and a.area_id is not None and a.is_material
    }
    entries = [
        line
        for line in report.log
        if line.kind == "logged"
        and line.area_id in moved_areas
        and line.moved_after is not None
        and line.moved_after > 0.5
        and line.floor_share is not None
        and line.floor_share >= OWN_SHARE
        and line.rest_verdict not in (verdict, None)
    ]
    return max(entries, key=lambda e: (e.moved_after or 0.0, e.at), default=None)


def _after(entry: LogLine) -> list[str]:
    text = entry.text.strip().rstrip(".")
    quoted = [say("format.quoted", text=text)] if 0 < terms.n_words(text) <= 6 and len(text) <= 48 else []
    return [*quoted, say("headline.after_area", area=entry.area_name or entry.area_id)]


def lead(report: WeekReport) -> tuple[list[Span], list[str]]:
    """Return the lead and notes of any week: a camera that recorded nothing, and whom the figures leave out."""
    spans, notes = _lead_of_all(report)
    cameras = report.silent_cameras
    if cameras and report.state != "no_data":
        named = terms.joined(terms.camera_name(c.name) for c in cameras)
        key = "lead.camera_little" if report.is_little_recorded else "lead.camera_silent"
        missing = say(key, plural=len(cameras), cameras=named)
        spans = [*_trimmed(spans), Span(text=f" {missing}")]
    counted = dict(report.provenance.settings_non_default).get("people")
    whom = {"visitors": "lead.only_visitors", "staff": "lead.only_staff"}.get(counted or "")
    return _trimmed(spans), [*notes, *([say(whom)] if whom else [])]


def _lead_of_all(report: WeekReport) -> tuple[list[Span], list[str]]:
    """Return the lead and notes as if all cameras had recorded."""
    coverage, rules = report.coverage, report.rules
    distance, pause = fmt.distance(rules.distance_m, rules.distance_unit), fmt.seconds(rules.episode_min_s)
    violation_rate = report.level.violation_rate
    match report.state:
        case "no_data":
            texts = nothing(report)
            return [Span(text=texts.lead)], list(texts.notes)
        case "too_incomplete":
            share, limit = fmt.percent(coverage.share), fmt.percent(rules.min_coverage)
            until = "" if coverage.not_over_from is None else fmt.instant_short(coverage.not_over_from)
            key = "lead.not_over" if report.is_so_far else "lead.too_incomplete"
            return [Span(text=say(key, share=share, limit=limit, until=until))], _missing_notes(report)
        case "empty":
            seen = ""
            if coverage.seen_h is not None:
                seen = say("lead.empty_seen", seen=fmt.number(coverage.seen_h), open=fmt.number(coverage.open_h))
            text = say(
                "lead.empty",
                recorded=fmt.number(coverage.recorded_h),
                scheduled=fmt.number(coverage.scheduled_h),
                seen=seen,
                distance=distance,
                time=pause,
            )
            return [Span(text=text)], [say("lead.empty_note", distance=distance)]
        case _ if violation_rate.value is None:
            return _unknown_lead(report)
        case "first_week":
            level, rule = fmt.likely_level(violation_rate), "no_week_before" if report.has_history else "first_week"
            tail = say(f"lead.{rule}", level=say("lead.in_brackets", text=level) if level else "")
            spans = [_people_came(report), _times(report), Span(text=tail), *_usual(report), *_close_spans(report)]
            return spans, [say(f"lead.{rule}_note")]
        case "settings_changed":
            return _settings_lead(report)
        case _:
            return _normal_lead(report), []


def _unknown_lead(report: WeekReport) -> tuple[list[Span], list[str]]:
    """Say why how often is not given, and what is known all the same."""
    violation_rate, level, coverage = report.level.violation_rate, report.level, report.coverage
    parts = [
        reason_text(violation_rate.reason) or say("lead.little_data"),
        say("lead.recorded", share=fmt.percent(coverage.share)),
    ]
    if level.people.value is not None:
        parts.append(say("lead.in_view", people=fmt.number(level.people.value)))
    code = "" if violation_rate.reason is None else violation_rate.reason.code
    notes = {NO_IDS.code: [say("lead.fix_ids")], NO_FLOOR.code: [say("lead.fix_floor")]}.get(code, [])
    return [Span(text=" ".join(terms.sentence(p) for p in parts))], notes


def _people_came(report: WeekReport) -> Span:
    rules = report.rules
    return Span(text=say("lead.people_came", distance=fmt.distance(rules.distance_m, rules.distance_unit)))


def _times(report: WeekReport) -> Span:
    return Span(text=say("lead.times", rate=fmt.number(report.level.violation_rate.value)), is_strong=True)


def _normal_lead(report: WeekReport) -> list[Span]:
    violation_rate = report.level.violation_rate
    spans = [_people_came(report), _times(report)]
    since, likely = week_before(report), fmt.likely_change(violation_rate)
    match violation_rate.verdict:
        case "clear_fall" | "clear_rise":
            spans.append(
                Span(text=say("lead.clear", change=fmt.fewer_more(violation_rate.change), since=since, likely=likely))
            )
        case "about_same" | "cannot_tell":
            in_brackets = say("lead.in_brackets", text=likely) if likely else ""
            spans.append(Span(text=say("lead.not_clear", since=since, likely=in_brackets)))
        case _:
            spans.append(Span(text=say("lead.unknown", since=since)))
    spans += [*_usual(report), *_close_spans(report)]
    clear = [a for a in report.areas if a.violation_rate.verdict in CLEAR]
    same_way = [a for a in clear if a.violation_rate.verdict == violation_rate.verdict and a.area_id is not None]
    same_way = [a for a in same_way if a.is_material]
    same_way.sort(key=lambda a: -abs(a.violation_rate.change or 0.0))
    if same_way and len(clear) <= 3:
        areas = terms.joined(_with_change(a) for a in same_way)
        spans.append(Span(text=say(f"lead.{violation_rate.verdict}_at", plural=len(same_way), areas=areas)))
    return spans + _unusual_hour(report)


def _usual(report: WeekReport) -> list[Span]:
    trend = report.trend
    if trend is not None and trend.holidays:
        days = "; ".join(reason_text(day) for day in trend.holidays)
        return [Span(text=say("lead.holiday", days=terms.capital(days)))]
    usual = trend.usual_violation_rate if trend is not None else None
    if usual is None:
        return []
    return [Span(text=say("lead.usual", low=fmt.number(usual.lo), high=fmt.number(usual.hi)))]


def _trimmed(spans: Sequence[Span]) -> list[Span]:
    return [*spans[:-1], replace(spans[-1], text=spans[-1].text.rstrip())]


def _unusual_hour(report: WeekReport) -> list[Span]:
    """Name the least likely hour of the week; nothing where every hour was as usual, or a thing to know names it."""
    row = None if report.unusual is None else report.unusual.first
    if row is None or any(t.target == "when" for t in things(report)):
        return []
    hour = f"{fmt.weekday(row.day)} {fmt.hour_label(row.hour)}"
    return [Span(text=say("lead.unusual", hour=hour, n=fmt.count(row.violations), usual=fmt.number(row.usual)))]


def _with_change(area: AreaRow) -> str:
    if area.violation_rate.change is None:
        return area.name
    return say("lead.area_change", area=area.name, change=fmt.fewer_more(area.violation_rate.change))


def _close_spans(report: WeekReport) -> list[Span]:
    close = report.level.close_time_share
    if close is None or close.state == "not_measurable":
        why = None if close is None else close.reason
        return [Span(text=say("lead.close_unknown", reason=reason_text(why) or say("lead.no_positions")))]
    if close.state == "not_enough_data" or close.value is None:
        return [Span(text=say("lead.close_little", reason=reason_text(close.reason) or say("lead.few_seen")))]
    strong = Span(text=say("lead.close_strong", share=fmt.percent(close.value)), is_strong=True)
    since = week_before(report)
    match close.verdict if report.state == "normal" else None:
        case "clear_fall" | "clear_rise" if close.change is not None:
            likely = fmt.likely_change(close, is_counted=False)
            tail = say("lead.close_clear", change=fmt.less_more(close.change), since=since, likely=likely)
        case "about_same":
            tail = say("lead.close_same", since=since)
        case "cannot_tell":
            tail = say("lead.close_not_clear")
        case _:
            tail = say("lead.close_other")
    return [Span(text=say("lead.close_share")), strong, Span(text=tail)]


def _settings_lead(report: WeekReport) -> tuple[list[Span], list[str]]:
    change = report.settings_change
    if change is None:
        return [Span(text=say("lead.setting_blank"))], []
    when = ""
    if change.at is not None:
        when = say("lead.setting_when", date=fmt.date_long(change.at.date()), clock=fmt.clock(change.at))
    key = f"lead.setting_{change.name}"
    text = say(
        key if has(key) else "lead.setting_other",
        name=change.name,
        before=change.before,
        after=change.after,
        when=when,
    )
    notes = [say("lead.setting_command", command=change.command)] if change.command else []
    return [Span(text=text + say("lead.setting_end"))], notes


def _missing_notes(report: WeekReport) -> list[str]:
    outages = report.coverage.outages
    longest = sorted(outages, key=lambda o: -o.open_h * len(o.camera_ids))[:2]
    names = {c.camera_id: c.name for c in report.coverage.cameras}
    lines = []
    for outage in sorted(longest, key=lambda o: o.start):
        start, end = fmt.instant_short(outage.start), fmt.instant_short(outage.end)
        who = terms.joined(terms.camera_name(names.get(c, c)) for c in outage.camera_ids)
        if len(outage.camera_ids) == len(names):
            who = say("lead.all_cameras") if len(names) > 1 else ""
        lines.append(say("lead.outage_who" if who else "lead.outage", start=start, end=end, who=who))
    n_more = len(outages) - len(longest)
    if n_more:
        return [say("lead.missing_more", plural=n_more, outages="; ".join(lines), n=n_more)]
    return [say("lead.missing", outages="; ".join(lines))] if lines else []
