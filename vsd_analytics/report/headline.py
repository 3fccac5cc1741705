"""The words of the page, made by rule from the figures: headline, lead, three things to know, one question.

The headline reads the two verdicts, never a point estimate alone. `SENTENCES` is the whole 4 x 5 table of verdicts
(how often x how risky); abnormal weeks have their own sentence each. "After" is allowed, "because" is not.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from vsd_analytics.analysis.floor_days import NO_FLOOR, NO_IDS
from vsd_analytics.report import format as fmt
from vsd_analytics.report import words
from vsd_analytics.report.model import AreaRow, LogLine, Span, Story, WeekReport
from vsd_analytics.report.nothing import nothing
from vsd_analytics.report.things import question, things

MAX_WORDS: Final = 15
_SAME: Final = "Violations about the same as last week"

# (how often, how risky) -> sentence. {moved} is "fell by about a seventh", {people} is ", with 15% more people" or "".
SENTENCES: Final[dict[tuple[str, str], str]] = {
    ("clear_fall", "clear_fall"): "Violations {moved}",
    ("clear_fall", "clear_rise"): "Violations {moved}, but rose per person-hour",
    ("clear_fall", "no_clear_change"): "Violations {moved}{people}: no clear change per person-hour",
    ("clear_fall", "too_little_data"): "Violations {moved}",
    ("clear_fall", "not_measurable"): "Violations {moved}",
    ("clear_rise", "clear_fall"): "Violations {moved}{people}, but fell per person-hour",
    ("clear_rise", "clear_rise"): "Violations {moved}, and per person-hour too",
    ("clear_rise", "no_clear_change"): "Violations {moved}{people}: no clear change per person-hour",
    ("clear_rise", "too_little_data"): "Violations {moved}",
    ("clear_rise", "not_measurable"): "Violations {moved}",
    ("no_clear_change", "clear_fall"): f"{_SAME}, but fewer per person-hour",
    ("no_clear_change", "clear_rise"): f"{_SAME}, but more per person-hour",
    ("no_clear_change", "no_clear_change"): _SAME,
    ("no_clear_change", "too_little_data"): _SAME,
    ("no_clear_change", "not_measurable"): _SAME,
    ("too_little_data", "clear_fall"): "Fewer violations per person-hour; too little data on how often",
    ("too_little_data", "clear_rise"): "More violations per person-hour; too little data on how often",
    ("too_little_data", "no_clear_change"): "Too little data to say whether violations changed",
    ("too_little_data", "too_little_data"): "Too little data to say whether violations changed",
    ("too_little_data", "not_measurable"): "Too little data to say whether violations changed",
}


def finish(report: WeekReport) -> WeekReport:
    """Return the report with its story filled in."""
    return report if report.story is not None else replace(report, story=tell(report))


def tell(report: WeekReport) -> Story:
    """Make the words of the page.

    Args:
        report: The figures; `report.story` is not read.

    Returns:
        Headline with the name of its rule, lead, at most three things to know, one question, notes.
    """
    rule, headline = _headline(report)
    lead, notes = _lead(report)
    return Story(
        headline=headline,
        rule=rule,
        lead=tuple(lead),
        things=things(report),
        question=question(report),
        notes=tuple(notes),
    )


def risk_key(report: WeekReport) -> str:
    """Return the second key of `SENTENCES`: the verdict on how risky, or not_measurable."""
    risky = report.level.risky
    if risky.state == "not_measurable":
        return "not_measurable"
    return risky.verdict or "too_little_data"


def often_key(report: WeekReport) -> str:
    """Return the first key of `SENTENCES`: the verdict on how often."""
    return report.level.often.verdict or "too_little_data"


def _headline(report: WeekReport) -> tuple[str, str]:
    week, often = report.week, report.level.often
    match report.state:
        case "no_data":
            told = nothing(report)
            return told.rule, told.headline
        case "too_incomplete":
            return "too_incomplete", f"Week {week.number} is too incomplete to compare"
        case "empty":
            return "empty", f"No violations were recorded in week {week.number}"
        case _ if often.state == "not_measurable":
            return "not_measurable", "Violations cannot be counted on this floor"
        case _ if often.value is None:
            return "few", f"Very few violations in week {week.number}"
        case "first_week":
            return "first_week", f"{fmt.number(often.value)} violations per open hour in the first week"
        case "settings_changed":
            return "settings_changed", _settings_headline(report)
        case _:
            pass
    keys = often_key(report), risk_key(report)
    rule = "/".join(k.removeprefix("clear_") for k in keys)
    people = words.with_people(report.level.people.change, report.level.people.verdict)
    said = f", {people}" if people and "about as many" not in people else ""
    moved = words.moved(often.change) if often.change is not None else "changed"
    text = SENTENCES[keys].format(moved=moved, people=said)
    if words.n_words(text) > MAX_WORDS:
        text = SENTENCES[keys].format(moved=moved, people="")
    entry = change_to_name(report)
    if entry is not None:
        for words_after in _after(entry):
            longer = f"{text} after {words_after}"
            if words.n_words(longer) <= MAX_WORDS and ":" not in text:
                return f"{rule}/after", longer
    return rule, text


def _settings_headline(report: WeekReport) -> str:
    change = report.settings_change
    since = f"since week {report.previous.number}" if report.previous else "since last week"
    when = since
    if change is not None and change.at is not None:
        when = f"on {fmt.weekday(change.at.date())}"
    match change.name if change is not None else "":
        case "distance_m":
            return f"A new distance limit was set {when}"
        case "calibration":
            return f"A camera was calibrated anew {when}"
        case "engine":
            return f"The engine changed {when}"
        case "rules":
            return "The two weeks were computed by different rules, so nothing is compared"
        case _:
            return f"A setting changed {when}, so nothing is compared"


def change_to_name(report: WeekReport) -> LogLine | None:
    """Return the log entry the headline may name with "after", or None.

    It lies in an area whose own verdict is the headline's, was logged by a person, and most of that area's change came
    after it.
    """
    verdict = report.level.often.verdict
    if report.state != "normal" or verdict not in ("clear_fall", "clear_rise"):
        return None
    moved_areas = {a.area_id for a in report.areas if a.often.verdict == verdict and a.area_id is not None}
    entries = [
        line
        for line in report.log
        if line.kind == "logged"
        and line.area_id in moved_areas
        and line.moved_after is not None
        and line.moved_after > 0.5
    ]
    return max(entries, key=lambda e: (e.moved_after or 0.0, e.at), default=None)


def _after(entry: LogLine) -> list[str]:
    text = entry.text.strip().rstrip(".")
    quoted = [f"\u201c{text}\u201d"] if 0 < words.n_words(text) <= 6 and len(text) <= 48 else []
    return [*quoted, f"the change at {entry.area_name or entry.area_id}"]


def _lead(report: WeekReport) -> tuple[list[Span], list[str]]:
    coverage, rules = report.coverage, report.rules
    distance, pause = fmt.metres(rules.distance_m), fmt.seconds(rules.episode_min_s)
    often = report.level.often
    match report.state:
        case "no_data":
            told = nothing(report)
            return [Span(text=told.lead)], list(told.notes)
        case "too_incomplete":
            text = (
                f"Cameras recorded {fmt.percent(coverage.share)} of open hours. We show what was seen but give no "
                f"change and no ranking below {fmt.percent(rules.min_coverage)}."
            )
            return [Span(text=text)], _missing_notes(report)
        case "empty":
            seen = ""
            if coverage.seen_h is not None:
                seen = f" and saw people in {fmt.number(coverage.seen_h)} of {fmt.number(coverage.open_h)} open hours"
            text = (
                f"Cameras recorded {fmt.number(coverage.recorded_h)} of {fmt.number(coverage.scheduled_h)} camera-hours"
                f"{seen}. No two people stood closer than {distance} for {pause} or more."
            )
            return [Span(text=text)], [f"If this surprises you, ask whether the {distance} distance was calibrated."]
        case _ if often.value is None:
            return _unknown_lead(report)
        case "first_week":
            level = fmt.likely_level(often)
            tail = (f" ({level})" if level else "") + ". There is no earlier week to compare with. "
            tail += "Use this week to learn where and when, not whether it is getting better."
            opening = Span(text=f"People came closer than {distance} to each other ")
            return [opening, _times(report), Span(text=tail)], ["Comparisons start next week."]
        case "settings_changed":
            return _settings_lead(report)
        case _:
            return _normal_lead(report), []


def _unknown_lead(report: WeekReport) -> tuple[list[Span], list[str]]:
    """Say why how often is not given, and what is known all the same."""
    often, level, coverage = report.level.often, report.level, report.coverage
    parts = [
        often.reason or "There is too little data",
        f"cameras recorded {fmt.percent(coverage.share)} of open hours",
    ]
    if level.people.value is not None:
        parts.append(f"on average {fmt.number(level.people.value)} people were in view")
    mend = "Let the engine send an id for each person it follows, and the next report counts violations."
    notes = [mend] if often.reason == NO_IDS else []
    if often.reason == NO_FLOOR:
        notes = ["Calibrate its cameras (vsd calibrate), and the next report counts violations in this week too."]
    return [Span(text=" ".join(words.sentence(p) for p in parts))], notes


def _times(report: WeekReport) -> Span:
    return Span(text=f"{fmt.number(report.level.often.value)} times in an average open hour", is_strong=True)


def _normal_lead(report: WeekReport) -> list[Span]:
    level, often = report.level, report.level.often
    spans = [Span(text=f"People came closer than {fmt.metres(report.rules.distance_m)} to each other "), _times(report)]
    since = f"week {report.previous.number}" if report.previous else "last week"
    likely = fmt.likely_change(often)
    match often.verdict:
        case "clear_fall" | "clear_rise":
            spans.append(Span(text=f", {fmt.fewer_more(often.change)} than in {since} ({likely}). "))
        case "no_clear_change":
            spans.append(Span(text=f": no clear change since {since}" + (f" ({likely}). " if likely else ". ")))
        case _:
            spans.append(Span(text=f". There is too little data to compare it with {since}. "))
    spans += _risk_spans(report)
    clear = [a for a in report.areas if a.often.verdict in ("clear_fall", "clear_rise")]
    same_way = [a for a in clear if a.often.verdict == often.verdict and a.area_id is not None]
    same_way.sort(key=lambda a: -abs(a.often.change or 0.0))
    if same_way and len(clear) <= 3:
        noun = "fall" if often.verdict == "clear_fall" else "rise"
        where = words.joined(_with_change(a) for a in same_way)
        are = f"{noun}s are" if len(same_way) > 1 else f"{noun} is"
        spans.append(Span(text=f"The clear {are} at {where}. "))
    spot = report.busiest_spot
    if spot is not None and spot.area_id is not None and spot.area_id not in {a.area_id for a in same_way}:
        spans.append(Span(text=f"{spot.name} is the place to look at."))
    if level.people.value is None and level.risky.state == "ok":
        return spans
    return [*spans[:-1], replace(spans[-1], text=spans[-1].text.rstrip())]


def _with_change(area: AreaRow) -> str:
    return area.name if area.often.change is None else f"{area.name} ({fmt.fewer_more(area.often.change)})"


def _risk_spans(report: WeekReport) -> list[Span]:
    risky, people = report.level.risky, report.level.people
    said = words.with_people(people.change, people.verdict)
    with_people = f", {said}" if said else ""
    if risky.state == "not_measurable":
        return [Span(text=f"How risky is not measurable: {risky.reason or 'the engine sends no positions'}. ")]
    if risky.state == "not_enough_data" or risky.value is None:
        return [Span(text=f"There is too little data to say how risky: {risky.reason or 'few people were seen'}. ")]
    spans = [Span(text="Per person-hour there were "), Span(text=fmt.number(risky.value), is_strong=True)]
    match risky.verdict:
        case "clear_fall" | "clear_rise":
            tail = f", {fmt.fewer_more(risky.change)} ({fmt.likely_change(risky)}){with_people}. "
        case "no_clear_change":
            tail = f": no clear change{with_people}. "
        case _:
            tail = f"{with_people}. "
    return [*spans, Span(text=tail)]


def _settings_lead(report: WeekReport) -> tuple[list[Span], list[str]]:
    change = report.settings_change
    if change is None:
        return [Span(text="A setting changed, so the change column is blank.")], []
    when = f" on {fmt.date_long(change.at.date())}, {fmt.clock(change.at)}" if change.at is not None else ""
    if change.name == "calibration":
        text = f"A camera got a new calibration{when}, so positions and distances are measured anew. "
    elif change.name == "rules":
        text = "Hours whose records were purged keep the figures of their time, made by other rules than today's. "
    else:
        what = {"distance_m": "The distance limit", "engine": "The engine"}.get(
            change.name, f"The setting {change.name}"
        )
        text = f"{what} changed from {change.before} to {change.after}{when}. "
    text += "Figures before and after cannot be compared, so the change column is blank."
    notes = [f"To compare, run the week again with one setting: {change.command}"] if change.command else []
    return [Span(text=text)], notes


def _missing_notes(report: WeekReport) -> list[str]:
    longest = sorted(report.coverage.outages, key=lambda o: -o.open_h * len(o.camera_ids))[:2]
    names = {c.camera_id: c.name for c in report.coverage.cameras}
    lines = []
    for outage in sorted(longest, key=lambda o: o.start):
        who = ", " + words.joined(words.camera_name(names.get(c, c)) for c in outage.camera_ids)
        if len(outage.camera_ids) == len(names):
            who = ", all cameras" if len(names) > 1 else ""
        lines.append(f"{fmt.instant_short(outage.start)} to {fmt.instant_short(outage.end)}{who}")
    return [f"Missing: {'; '.join(lines)}."] if lines else []
