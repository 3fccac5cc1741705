"""What each sentence of a page claims, and whether a planted truth allows it: for the proof of the pages' words.

`JUDGES` says it by the key of the catalogue; `*` stands for any part of a key. A judge returns True where the truth
allows the claim, False where the sentence claims more, None where this one claims nothing. `NO_CLAIM` lists the keys
that never claim anything, with the reason. A key in neither is listed by the proof: nobody judged it.

Keys that are not in the catalogue (`area.clear_fall`, `SPOKEN`) name what a page says by a verdict's word or a range
alone. `UNJUDGED` lists what these worlds cannot judge: tested hotspots need positions, flow needs tracks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any, Final

import numpy as np
from sceptic_worlds import CAMERAS, FIRST, N_AREAS, Truth, camera_of

from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import LoggedChangeEffect, LoggedChangeResult, Usual
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording import format as fmt

SAME: Final = 0.15
"""What "about the same" allows."""
CLOSE_TO_NOTHING: Final = 0.005
"""A planted change below this is none."""
FLOOR: Final = range(N_AREAS)


@dataclass(frozen=True, eq=False, kw_only=True)
class Said:
    """A sentence of a page, or the part of one that has its own key.

    Attributes:
        place: Part of the page: headline, lead, things, ...
        key: Of the catalogue, or of a verdict's word.
        sentence: The whole sentence.
        report: The page it is on.
        values: What fills the named places of the key.
        estimate: The figure whose verdict or range it says.
        change: The logged change it is about.
        line: Its line in the ledger.
        area: Area it is about, by number; None = the floor.
        keys: All keys of the sentence.
    """

    place: str
    key: str
    sentence: str
    report: WeekReport
    values: Mapping[str, Any] = field(default_factory=dict)
    estimate: Estimate | None = None
    change: LoggedChangeEffect | None = None
    line: LoggedChangeResult | None = None
    area: int | None = None
    keys: frozenset[str] = frozenset()

    @property
    def areas(self) -> list[int]:
        """Return the areas that the sentence names, by number; those of its key's places first."""
        for text in (" ".join(str(v) for v in self.values.values()), self.sentence):
            if found := [k for k in FLOOR if f"Place-{k}" in text]:
                return found
        return []


Judge = Callable[[Said, Truth], bool | None]


# what a verdict or range claims ---------------------------------------------------------------------------------------


def allows(verdict: str, ratio: float | None) -> bool | None:
    """Tell whether a true ratio allows a verdict; None where the verdict claims nothing, or nothing is true of it."""
    if ratio is None:
        return None
    return {
        "clear_fall": ratio < 1 - CLOSE_TO_NOTHING,
        "clear_rise": ratio > 1 + CLOSE_TO_NOTHING,
        "about_same": abs(ratio - 1) <= SAME,
    }.get(verdict)


def covers(estimate: Estimate | None, *ratios: float | None) -> bool | None:
    """Tell whether the range of a change reaches what is true, or anything between two ways to put it."""
    known = [r - 1 for r in ratios if r is not None]
    if estimate is None or estimate.change_lo is None or estimate.change_hi is None or not known:
        return None
    return estimate.change_lo <= max(known) and estimate.change_hi >= min(known)


def both(*found: bool | None) -> bool | None:
    """Tell whether all claims hold; None where none is one."""
    known = [f for f in found if f is not None]
    return all(known) if known else None


def of_area(verdict: str) -> Judge:
    """Judge a verdict on the areas that are named."""
    return lambda said, truth: both(*(allows(verdict, truth.ratio([k])) for k in said.areas))


def pair(said: Said, truth: Truth) -> bool | None:
    """Judge a headline by its two verdicts; a share of time too close changes as violations do in these worlds."""
    violation_rate, close = said.key.split(".")[-2:]
    ratio = truth.ratio(FLOOR)
    return both(allows(violation_rate, ratio), allows(close, ratio) if close.startswith("clear") else None)


def position(where: str, usual: Usual | None, truth: Truth) -> bool | None:
    """Judge where a week is said to lie beside the weeks before, which must have been counted alike."""
    if usual is None:
        return None
    first = 0 if truth.tale.engine_since is None or truth.week < truth.start // 7 else truth.start // 7
    if usual.n_weeks > truth.week - first:
        return False
    seen = [k for k in FLOOR if truth.counted(k) is not None]
    before = [
        mean
        for week in range(max(first, truth.week - 11), truth.week)
        if (mean := _mean(truth, seen, week)) is not None
    ]
    now, then = _mean(truth, seen, truth.week), float(np.mean(before)) if before else None
    if now is None or then is None:
        return None
    if where == "within":
        return 1 - abs(now / then - 1) > 0.5 and usual.lo <= now <= usual.hi
    return now < then * (1 - CLOSE_TO_NOTHING) if where == "below" else now > then * (1 + CLOSE_TO_NOTHING)


def _mean(truth: Truth, areas: list[int], week: int) -> float | None:
    """Return the planted rate of some areas in a week; None where any of them was not recorded."""
    e, total = truth.drawn.expected[truth.site], 0.0
    for k in areas:
        days = [d for d in truth.days(week) if truth.is_recorded(k, d)]
        if not days:
            return None
        total += float(e[k, days].mean())
    return total


def usual_violation_rate(said: Said, truth: Truth) -> bool | None:
    trend = said.report.trend
    where = said.key.rsplit(".", 1)[-1].removeprefix("trend_")
    return position(where, trend.usual_violation_rate if trend else None, truth)


def beside_usual(said: Said, truth: Truth) -> bool | None:
    violation_rate = said.key.split(".")[-2]
    return both(allows(violation_rate, truth.ratio(FLOOR)), usual_violation_rate(said, truth))


def usual_range(said: Said, truth: Truth) -> bool | None:
    trend = said.report.trend
    if trend is None or trend.usual_violation_rate is None:
        return None
    return position("within", trend.usual_violation_rate, truth)


# what was measured ----------------------------------------------------------------------------------------------------


def rate(k: int, truth: Truth) -> float | None:
    """Return the violations counted in an area per recorded hour."""
    hours = sum(truth.is_recorded(k, d) for d in truth.days())
    n = truth.counted(k)
    return None if n is None or not hours else n / hours


def measured(truth: Truth) -> float:
    """Return what how often must be: rates of all areas, added."""
    return sum(rate(k, truth) or 0.0 for k in FLOOR)


def same_rate(said: Said, truth: Truth) -> bool | None:
    return str(said.values["rate"]) == fmt.number(measured(truth))


def same_share_of_time(said: Said, truth: Truth) -> bool | None:
    days = [(k, d) for k in FLOOR for d in truth.days() if truth.is_recorded(k, d)]
    close = sum(truth.drawn.violation_h[truth.site, k, d] for k, d in days)
    seen = sum(truth.drawn.exposure_h[truth.site, k, d] for k, d in days)
    return _share(said.values["share"]) is None or abs(_share(said.values["share"]) - close / seen) < 0.0101


def same_recorded(said: Said, truth: Truth) -> bool | None:
    cameras = [c for c in range(len(CAMERAS)) if CAMERAS[c] in said.sentence] or list(range(len(CAMERAS)))
    due = [(c, d) for c in cameras for d in truth.days() if truth.is_open(d)]
    share = sum(not truth.tale.down(c, d - truth.start) for c, d in due) / len(due)
    text = _share(said.values["share"])
    return text is None or abs(text - share) < 0.0101


def _share(text: object) -> float | None:
    """Return a share that was printed; None for "under 1%" and "over 99%"."""
    digits = str(text).removesuffix("%")
    return float(digits) / 100 if digits.isdigit() else None


def busiest(said: Said, truth: Truth) -> bool | None:
    """Judge that an area has more than any other, also than one that nobody recorded."""
    spot = said.areas[0] if said.areas else None
    if spot is None:
        return None
    hours = sum(truth.is_open(d) for d in truth.days())
    rates = {k: rate(k, truth) for k in FLOOR}
    own = rates[spot] or 0.0
    seen = max(r for r in rates.values() if r is not None) <= own + 1e-9
    unseen = max((truth.happened(k) / hours for k in FLOOR if rates[k] is None), default=0.0)
    return seen and unseen <= own


def busiest_recorded(said: Said, truth: Truth) -> bool | None:
    rates = [rate(k, truth) for k in FLOOR]
    return bool(said.areas) and max(r for r in rates if r is not None) <= (rates[said.areas[0]] or 0.0) + 1e-9


def share_of_violations(said: Said, truth: Truth) -> bool | None:
    spot = next(
        (a for a in said.report.areas if said.report.busiest_spot and a.area_id == said.report.busiest_spot.area_id),
        None,
    )
    share = _share(said.values["share"])
    if spot is None or share is None:
        return None
    return abs(share - (rate(int(spot.name.rsplit("-", 1)[1]), truth) or 0.0) / measured(truth)) < 0.0101


def busiest_day(said: Said, truth: Truth) -> bool | None:
    """Judge the hour or day with most violations: each day has one open hour."""
    found = said.report.busiest_hour
    if found is None:
        return None
    full = [d for d in truth.days() if all(truth.is_recorded(k, d) for k in FLOOR)]
    count = truth.drawn.n[truth.site].sum(axis=0)
    day = (found.start.date() - FIRST).days
    return day in full and count[day] >= max(count[full])


def unusual(said: Said, truth: Truth) -> bool | None:
    """Judge that an hour was unusual: only something planted makes it so."""
    seen = [k for k in FLOOR if truth.counted(k) is not None]
    before = [m for w in range(max(0, truth.week - 8), truth.week) if (m := _mean(truth, seen, w)) is not None]
    now = _mean(truth, seen, truth.week)
    return bool(before) and now is not None and abs(now / float(np.mean(before)) - 1) > 0.1


# what is known --------------------------------------------------------------------------------------------------------


def is_silent(said: Said, truth: Truth) -> bool | None:
    """Judge that the named cameras recorded nothing, and that no other did so."""
    silent = truth.silent()
    named = [c for c in CAMERAS if c in said.sentence]
    return named == silent or (len(silent) > 2 and f"{len(silent)} of {len(CAMERAS)}" in said.sentence)


def names_missing(said: Said, truth: Truth) -> bool | None:
    """Judge that a headline or lead says which part of the floor is missing, in a week with any record."""
    silent = truth.silent()
    if not silent or len(silent) == len(CAMERAS):
        return None
    return bool(
        {"headline.without", "headline.silent", "headline.little", "lead.camera_silent", "lead.camera_little"}
        & said.keys
    )


def all_seen(said: Said, truth: Truth) -> bool | None:
    return not truth.silent()


def is_first(said: Said, truth: Truth) -> bool | None:
    """Judge that there is no earlier week."""
    return not any(truth.counted(0, w) is not None for w in range(truth.week))


def not_before(said: Said, truth: Truth) -> bool | None:
    """Judge that nothing was recorded in the week before."""
    return truth.week == 0 or all(truth.counted(k, truth.week - 1) is None for k in FLOOR)


def level_range(said: Said, truth: Truth) -> bool | None:
    violation_rate = said.report.level.violation_rate
    if violation_rate.lo is None or violation_rate.hi is None:
        return None
    return violation_rate.lo <= truth.level(FLOOR) <= violation_rate.hi


def few(said: Said, truth: Truth) -> bool | None:
    return measured(truth) < 5


def empty(said: Said, truth: Truth) -> bool | None:
    return measured(truth) == 0


def closed(said: Said, truth: Truth) -> bool | None:
    return not any(truth.is_open(d) for d in truth.days())


def no_data(said: Said, truth: Truth) -> bool | None:
    return len(truth.silent()) == len(CAMERAS)


def incomplete(said: Said, truth: Truth) -> bool | None:
    return sum(truth.counted(k) is None for k in FLOOR) > 0.4 * N_AREAS


def other_engine(said: Said, truth: Truth) -> bool | None:
    return truth.tale.engine_since is not None and 7 * truth.week <= truth.start < 7 * truth.week + 7


def not_compared(said: Said, truth: Truth) -> bool | None:
    cameras = [c for c in range(len(CAMERAS)) if CAMERAS[c] in said.sentence]
    return all(truth.counted(k, truth.week - 1) is None for k in FLOOR if camera_of(k) in cameras)


def nothing_shows(said: Said, truth: Truth) -> bool | None:
    """Judge that something was logged, and that the same page shows no clear fall since."""
    falls = [c for c in said.report.change_effects if c.running is not None and c.running.verdict == "clear_fall"]
    return bool(truth.tale.entries) and not falls


def small_fall(said: Said, truth: Truth) -> bool | None:
    """Judge that some area of the log fell beside the others."""
    falls = [c for c in said.report.change_effects if c.running is not None and c.running.verdict == "clear_fall"]
    true = [beside_others(int(c.area_name.rsplit("-", 1)[1]), truth) for c in falls]
    return any(allows("clear_fall", ratio) for ratio in true)


def nothing_logged(said: Said, truth: Truth) -> bool | None:
    return not truth.tale.entries or truth.week > truth.start // 7 + 1


def logged_unseen(said: Said, truth: Truth) -> bool | None:
    """Judge that the log names the areas, and that nothing was recorded there."""
    return all(k in truth.tale.entries and truth.counted(k) is None for k in said.areas)


def never(said: Said, truth: Truth) -> bool | None:
    """Judge what no world has: every such sentence claims too much."""
    return False


# changes of the log ---------------------------------------------------------------------------------------------------


def entry(said: Said) -> int | None:
    """Return the area of the log's entry that a sentence is about."""
    name = said.line.area_name if said.line is not None else said.change.area_name if said.change is not None else ""
    if name:
        return int(name.rsplit("-", 1)[1])
    return said.areas[0] if said.areas else None


def beside_others(k: int, truth: Truth) -> float | None:
    """Return the planted change of an area since the entry, beside all others."""
    e = truth.drawn.expected[truth.site]
    since, before = e[:, truth.start : 7 * truth.week + 7].mean(axis=1), e[:, : truth.start]
    if not before.size or not since.size:
        return None
    before = before.mean(axis=1)
    others = [j for j in FLOOR if j != k]
    return float(since[k] / before[k] / (since[others].sum() / before[others].sum()))


def works(said: Said, truth: Truth) -> bool | None:
    """Judge that a change works: something was done there, it fell, and did not go elsewhere."""
    k = entry(said)
    world = truth.tale.world
    return k == 0 and world.effect < 1 and not world.spill[1]


def moved(said: Said, truth: Truth) -> bool | None:
    world = truth.tale.world
    return entry(said) == 0 and world.effect < 1 and world.spill[1] > 0 and world.spill[0] >= 0.5


def since(verdict: str) -> Judge:
    """Judge what became of an area since an entry, whoever did it."""

    def judge(said: Said, truth: Truth) -> bool | None:
        k = entry(said)
        return None if k is None else allows(verdict, beside_others(k, truth))

    return judge


def since_range(said: Said, truth: Truth) -> bool | None:
    """Judge the range of an area since an entry."""
    k, change = entry(said), said.change
    if k is None or change is None:
        return None
    return covers(change.running, beside_others(k, truth), truth.effect(k))


def on_floor(said: Said, truth: Truth) -> bool | None:
    """Judge what is said of the whole floor since an entry."""
    way, net = said.key.removeprefix("logged_changes.floor_"), said.change.net if said.change is not None else None
    verdict = {"less": "clear_fall", "more": "clear_rise"}.get(way, "cannot_tell")
    true = truth.effect(None)
    return both(allows(verdict, true), covers(net, true))


def both_of(*judges: Judge) -> Judge:
    return lambda said, truth: both(*(judge(said, truth) for judge in judges))


def by_word(said: Said, truth: Truth) -> bool | None:
    """Judge the word of a verdict on an area or the floor."""
    return allows(said.key.rsplit(".", 1)[1], truth.ratio(FLOOR if said.area is None else [said.area]))


def by_range(said: Said, truth: Truth) -> bool | None:
    """Judge the range of a change of an area or the floor."""
    return covers(said.estimate, truth.ratio(FLOOR if said.area is None else [said.area]))


def lead_range(said: Said, truth: Truth) -> bool | None:
    return covers(said.report.level.violation_rate, truth.ratio(FLOOR))


def lead_clear(said: Said, truth: Truth) -> bool | None:
    return both(allows(said.report.level.violation_rate.verdict or "", truth.ratio(FLOOR)), lead_range(said, truth))


def lead_close(said: Said, truth: Truth) -> bool | None:
    close = said.report.level.close_time_share
    if close is None:
        return None
    return both(allows(close.verdict or "", truth.ratio(FLOOR)), covers(close, truth.ratio(FLOOR)))


def against(said: Said, truth: Truth) -> bool | None:
    """Judge a change with its range, of the area in the title of the same thing to know."""
    if said.area is None:
        return lead_range(said, truth)
    row = next(a for a in said.report.areas if a.area_id == f"place-{said.area}")
    return covers(row.violation_rate, truth.ratio([said.area]))


def shown_level(said: Said, truth: Truth) -> bool | None:
    """Judge the figure of an area: what was counted in recorded hours, and none where nothing was recorded."""
    assert said.area is not None
    assert said.estimate is not None
    true = rate(said.area, truth)
    if true is None:
        return said.estimate.value is None and said.estimate.change is None
    return said.estimate.value is None or abs(said.estimate.value - true) < 1e-6


def part_at(said: Said, truth: Truth) -> bool | None:
    """Judge that a part of the floor's change lies in an area; its name stands for the least share it may have."""
    least = {"all": 0.95, "most": 0.6, "half": 0.45, "a third": 1 / 3}[str(said.values["part"])]
    return truth.share_of_change(said.areas[0]) >= least - 0.15


def redesign_word(said: Said, truth: Truth) -> bool | None:
    """Judge a verdict in the section on logged changes."""
    kind, verdict = said.key.split(".")[1:]
    k = entry(said)
    if k is None:
        return None
    return allows(verdict, truth.effect(None) if kind == "net" else beside_others(k, truth))


def redesign_range(said: Said, truth: Truth) -> bool | None:
    k = entry(said)
    if k is None:
        return None
    if said.key.endswith("net.range"):
        return covers(said.estimate, truth.effect(None))
    return covers(said.estimate, beside_others(k, truth), truth.effect(k))


JUDGES: Final[Mapping[str, Judge]] = {
    "headline.names_missing": names_missing,
    "lead.names_missing": names_missing,
    "headline.pair.*": pair,
    "headline.usual.*": beside_usual,
    "headline.part_at": part_at,
    "headline.after": works,
    "headline.without": is_silent,
    "headline.silent": is_silent,
    "headline.little": is_silent,
    "headline.too_incomplete": incomplete,
    "headline.empty": empty,
    "headline.few": few,
    "headline.not_measurable": never,
    "headline.first_week": both_of(is_first, same_rate),
    "headline.no_week_before": both_of(not_before, same_rate),
    "headline.setting_engine": other_engine,
    "headline.setting_*": never,
    "lead.too_incomplete": same_recorded,
    "lead.empty": empty,
    "lead.times": same_rate,
    "lead.first_week": both_of(is_first, level_range),
    "lead.no_week_before": both_of(not_before, level_range),
    "lead.first_week_note": is_first,
    "lead.clear": lead_clear,
    "lead.not_clear": lead_range,
    "lead.clear_fall_at": of_area("clear_fall"),
    "lead.clear_rise_at": of_area("clear_rise"),
    "lead.usual": usual_range,
    "lead.unusual": unusual,
    "lead.camera_silent": is_silent,
    "lead.camera_little": is_silent,
    "lead.close_strong": same_share_of_time,
    "lead.close_clear": lead_close,
    "lead.close_same": lead_close,
    "lead.setting_engine": other_engine,
    "lead.setting_end": other_engine,
    "lead.setting_*": never,
    "lead.recorded": same_recorded,
    "nothing.closed*": closed,
    "nothing.no_camera*": never,
    "nothing.no_data*": no_data,
    "nothing.cause_*": no_data,
    "things.recorded": same_recorded,
    "things.enough": all_seen,
    "things.few*": few,
    "things.works": works,
    "things.moved*": moved,
    "things.less": since("clear_fall"),
    "things.fell_since": of_area("clear_fall"),
    "things.fell": of_area("clear_fall"),
    "things.rose": of_area("clear_rise"),
    "things.floor_fell": lead_clear,
    "things.against": against,
    "things.none_fell_text": nothing_shows,
    "things.none_fell_doubtful": since("clear_fall"),
    "things.none_fell_quiet": nothing_logged,
    "things.none_fell_unseen": logged_unseen,
    "things.none_fell_small": small_fall,
    "things.busiest_recorded": busiest_recorded,
    "things.busiest_spot": busiest,
    "things.busiest_still": busiest,
    "things.busiest_share*": share_of_violations,
    "things.busiest_floor": share_of_violations,
    "things.busiest_again": share_of_violations,
    "things.busiest_hour": busiest_day,
    "things.unusual*": unusual,
    "things.not_compared*": not_compared,
    "things.weak_camera": same_recorded,
    "things.not_counted": never,
    "things.no_violation_rate": never,
    "things.no_risk": never,
    "things.inferred*": never,
    "question.rose": of_area("clear_rise"),
    "again.rose": of_area("clear_rise"),
    "tiles.violation_rate.*": by_word,
    "tiles.close.*": by_word,
    "tiles.usual": usual_range,
    "tiles.in_that_hour*": busiest_day,
    "area.level": shown_level,
    "area.range": by_range,
    "area.*": by_word,
    "floor.range": by_range,
    "floor.*": by_word,
    "spots.level": shown_level,
    "spots.change": by_word,
    "titles.where": busiest,
    "titles.where_recorded": busiest_recorded,
    "titles.when_hour": busiest_day,
    "titles.when_day": busiest_day,
    "titles.when_both": busiest_day,
    "titles.changed_one": lambda s, t: both(*(_row_allows(s, t, k) for k in s.areas)),
    "titles.changed": lambda s, t: both(*(_row_allows(s, t, k) for k in s.areas)),
    "titles.changed_many": lambda s, t: both(*(_row_allows(s, t, k) for k in FLOOR)),
    "titles.trend_below": usual_violation_rate,
    "titles.trend_within": usual_violation_rate,
    "titles.trend_above": usual_violation_rate,
    "titles.unusual": unusual,
    "when.unusual_row*": unusual,
    "contributions.title": lead_clear,
    "trend.left_out": is_silent,
    "trend.left_out_little": is_silent,
    "trend.one": is_first,
    "logged_changes.floor_*": on_floor,
    "came_of.works": both_of(works, since_range),
    "came_of.brief_works": both_of(works, since_range),
    "came_of.story_works": both_of(works, since_range),
    "came_of.story_moved": moved,
    "came_of.story_fell": both_of(since("clear_fall"), since_range),
    "came_of.story_doubtful": both_of(since("clear_fall"), since_range),
    "came_of.story_rose": both_of(since("clear_rise"), since_range),
    "came_of.story_about_same": both_of(since("about_same"), since_range),
    "came_of.cannot_tell": since_range,
    "change_effects.*.range": redesign_range,
    "change_effects.*.*": redesign_word,
}  # fmt: skip
WORKED: Final = ("*.works*", "*.moved*", "*.story_works", "*.story_moved", "headline.after")
"""Keys that lay a change to what was done: none of these may claim too much."""

SPOKEN: Final = (
    "headline.names_missing",
    "lead.names_missing",
    "area.*",
    "floor.*",
    "tiles.*",
    "spots.level",
    "change_effects.*",
)
"""Keys of `JUDGES` that are no entry of the catalogue, by how they begin."""

_DEFINITION, _QUESTION, _ASKS = "says what is counted", "asks, and claims nothing", "says that nothing can be said"
NO_CLAIM: Final[Mapping[str, str]] = {
    "headline.where": "joins two parts that are judged",
    "headline.some_cameras": "part of `headline.silent`, which is judged",
    "headline.after_area": "part of `headline.after`, which is judged",
    "headline.since": "names the week before",
    "headline.on_day": "names a day",
    "logged_changes.others": "title of the entries without a result",
    "reason.*": "says why a figure is missing",
    "lead.people_came": _DEFINITION,
    "lead.close_share": _DEFINITION,
    "lead.close_other": _DEFINITION,
    "lead.close_not_clear": _ASKS,
    "lead.in_brackets": "brackets",
    **{f"lead.only_{n}": "says whom the figures count" for n in ("visitors", "staff")},
    "lead.holiday": "names a day of the calendar",
    "titles.trend_holiday": "names a week of the calendar",
    "lead.unknown": _ASKS,
    "lead.little_data": _ASKS,
    "lead.close_little": _ASKS,
    "lead.close_unknown": _ASKS,
    "lead.few_seen": _ASKS,
    "lead.in_view": "a mean of what was seen",
    "lead.area_change": "part of `lead.clear_fall_at`, which is judged",
    "lead.empty_note": "tells what to check",
    "lead.empty_seen": "a count of hours",
    "lead.no_week_before_note": "says when comparisons go on",
    "lead.fix_*": "tells what to do",
    "lead.no_positions": _ASKS,
    "lead.all_cameras": "a list of outages, made from what was recorded",
    "headline.changed": "stands where no size is known",
    "things.title_*": "a heading",
    "things.enough_part": "says of which hours it speaks",
    "logged_changes.title": "a heading",
    "logged_changes.sub": _DEFINITION,
    "spots.busiest_recorded": "names the cards",
    "spots.title": "a heading",
    "spots.two": "a number",
    "spots.three": "a number",
    "spots.ask": "names a line",
    "spots.picture*": "explains a picture",
    "spots.floor_label": "explains a picture",
    "trend.title*": "a heading",
    "trend.read*": "explains a chart",
    "trend.sub_*": _DEFINITION,
    "trend.label_*": "explains a chart",
    "trend.without": "says what is not compared",
    "trend.*": "a table's words",
    "planner.log.running": "names a row that is judged as `change_effect.running`",
    "planner.log.net": "names a row that is judged as `change_effect.net`",
    "planner.log.people": "names a row",
    "planner.log.beside": "says what is compared",
    "planner.log.all_hours": "says what is shown",
    "planner.log.pair": "names a button",
    **{f"planner.log.{n}": "a table's words" for n in ("title", "site", "what", "span", "table", "figure", "likely")},
    "lead.missing": "a list of outages, made from what was recorded",
    "lead.missing_more": "a list of outages, made from what was recorded",
    "lead.outage*": "a list of outages, made from what was recorded",
    "things.too_incomplete": _ASKS,
    "headline.not_over": "a date",
    "lead.not_over": "a count of recorded hours, and a rule",
    "things.not_over*": _ASKS,
    "things.none_fell": "says that no verdict is clear",
    "things.nothing_fell*": "says that no verdict is clear",
    "things.unranked*": _ASKS,
    "things.busiest_hour_text": "points to the timetable",
    "things.own_*": "a point estimate that says it may be chance",
    "things.weak_areas*": "tells what not to read",
    "things.weak_camera_text": "tells what not to read",
    "things.chance*": "tells what ranges do not cover",
    "things.no_means": _ASKS,
    "question.*": _QUESTION,
    "ask.*": _QUESTION,
    "again.*": _QUESTION,
    "titles.changed_none": "says that no verdict is clear",
    "titles.changed_plain": "names the table",
    "titles.changed_floor": "says a verdict that is judged in the table",
    "titles.data*": "a count of recorded hours",
    "titles.trend_few": "a count of weeks",
    "titles.trend_gap": "says that nothing was recorded",
    "titles.where_*": _ASKS,
    "titles.when_*": _ASKS,
    "titles.unusual_none": "says that no hour is far from usual",
    "titles.outlook": "a forecast, judged by its own score",
    "contributions.title_unclear": "says that it may be chance",
    "contributions.others": "names a row",
    "spots.cap_*": _ASKS,
    "spots.when*": "a count of hours",
    "spots.sub_busiest*": "says what the cards are not",
    "spots.busiest": "names the cards",
    "spots.rate_unit": "a unit",
    "spots.reason_*": "a count of days and hours",
    "spots.watching": "says when something changed",
    "spots.high": "how sure a spot is, which needs records",
    "spots.medium": "how sure a spot is, which needs records",
    "spots.low": "how sure a spot is, which needs records",
    "spots.sure": "names a line",
    "tiles.*": "a figure that is judged in the lead, or a count of hours",
    "when.unusual_why": _ASKS,
    "when.unusual_sub": _DEFINITION,
    "trend.too_few": "says what a trend needs",
    "trend.violation_rate": "joins a measure and its title, which is judged",
    "trend.close": "joins a measure and its title, which is judged",
    "next.why": _ASKS,
    "logged_changes.until": "a date",
    "spots.excess_little": "less than a minute, of no consequence",
    "came_of.none": "part of a range that is judged",
    "came_of.took_up*": "who took people up, who do not move in these worlds",
    "came_of.nobody_took_up": "no clear change is claimed",
    "came_of.between": "part of a range that is judged",
    "came_of.same": "part of a range that is judged",
    "came_of.brief": "joins an effect of a story, which is judged",
    "came_of.effect_*": "the effect of a story, which is judged",
    "came_of.minutes_*": "the effect of a story in minutes",
    "came_of.usual": "minutes a week before",
    "came_of.any": "part of a range that is judged",
    "came_of.went_unknown": "no clear change is claimed",
    "foreseen.*": "a plan, whose power tests/stats proves",
    "things.since": "joins weeks and a story, which is judged",
    "things.of_change": "joins a day and a story, which is judged",
    "came_of.early": _ASKS,
    "came_of.nothing": _ASKS,
    "came_of.alone": _ASKS,
    "planner.log.whole_site": _ASKS,
    "planner.log.whole_site_map": _ASKS,
    "planner.log.no_map": _ASKS,
}  # fmt: skip


_CELLS: Final = "tested hotspots need positions; tests/stats/prove_hotspots.py proves them"
_FLOW: Final = "flow needs tracks; tests/stats/prove_flow.py proves how it follows people and checks arrivals"
UNJUDGED: Final[Mapping[str, str]] = {
    **{f"spots.{n}": _CELLS for n in ("tested", "sub_tested", "near", "on_the_rest", "this", "ratio*", "excess")},
    "spots.here": _CELLS,
    **{f"spots.{n}": _CELLS for n in ("more", "new", "since*")},
    "planner.log.elsewhere": "how much the rest of the floor took up has no range; tests/stats proves its bias",
    "planner.log.cautions": "counts the cautions below it",
    **{f"maps.flow_{n}": _FLOW for n in ("in_view", "unknown", "disagrees")},
}  # fmt: skip


def _row_allows(said: Said, truth: Truth, k: int) -> bool | None:
    """Judge the verdict of an area's row that a title counts as clear."""
    row = next((a for a in said.report.areas if a.area_id == f"place-{k}"), None)
    verdict = "" if row is None else row.violation_rate.verdict or ""
    return allows(verdict, truth.ratio([k])) if verdict.startswith("clear") else None


def judge_of(key: str) -> Judge | None:
    """Return the judge of a key; one for the key itself comes before one for many."""
    return JUDGES.get(key) or next((j for name, j in JUDGES.items() if fnmatchcase(key, name)), None)


def claims_nothing(key: str) -> bool:
    """Tell whether a key is known to claim nothing."""
    return any(fnmatchcase(key, name) for name in NO_CLAIM)


def is_about_worked(key: str) -> bool:
    """Tell whether a key lays a change to what was done."""
    return any(fnmatchcase(key, name) for name in WORKED)
