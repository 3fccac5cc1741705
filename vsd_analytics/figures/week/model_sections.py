"""Sections of the report beyond the week and its map: spots, weeks, readings, logged changes, causes, outlook."""
# ruff: noqa: RUF009  (`_f` only wraps dataclasses.field)

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime
from typing import Literal

from vsd_analytics.answer import Design, Outcome, Reason, State
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_estimate import described as _f
from vsd_analytics.figures.week.model_estimate import optional as _o

SpotKind = Literal["tested", "busiest"]
UsualPosition = Literal["below", "within", "above"]
TargetPosition = Literal["below", "near", "above"]
Sureness = Literal["high", "medium", "low"]


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualHours:
    """When a spot has most of its violations."""

    weekday: int | None = _o("Weekday that stands out, 0 Monday to 6 Sunday; None: none does.")
    first_hour: int = _f("First local hour of the part of the day with most.")
    last_hour: int = _f("Last local hour of it, inclusive.")
    share: float = _f("Share of the spot's violations in that part of the day, all days.", "share")


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What decides how sure a spot is."""

    sureness: Sureness = _f("high: all three hold; medium: one is missed; low: two are, or the camera was down.")
    recorded_share: float | None = _o("Open hours recorded by the cameras that see it.", "share", "M1")
    days_present: int = _f("Days of the week with a violation there.", "days")
    days_open: int = _f("Days of the week with open hours.", "days", default=7)
    error_m: float | None = _o("Position error of the camera that sees most of it; None: unknown.", "m")
    camera_id: str | None = _o("The camera that counts most of it.")
    camera_name: str | None = _o("Its display name; free text.")
    lost_h: float = _f("Open hours of its usual hours that this camera did not record.", "h", default=0.0)
    is_camera_down: bool = _f("True: it missed so many of them that nothing can be said of the spot.", default=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpotCard:
    """One numbered spot."""

    number: int = _f("As on the map, 1 first.")
    name: str = _f("Area, or where it is; free text.")
    at: tuple[float, float] | None = _o(
        "Middle of its cell with the most, floor metres; None when it has no place on a map."
    )
    area_id: str | None = _o("Area it lies in; None for none.")
    violation_rate: Estimate | None = _o(
        "Violations per open hour of that area, and its change.", "per open hour", "M0"
    )
    ratio: Estimate | None = _o("Tested spots: violations over those expected at the floor's rate.", "ratio", "M20")
    excess_min_per_week: float | None = _o(
        "Tested spots: time too close above what crowding explains.", "person-minutes a week", "M20"
    )
    here: Estimate | None = _o(
        "Tested spots: violations at the spot itself per open hour, this week and the week before.",
        "per open hour", "M0",
    )  # fmt: skip
    is_new: bool | None = _o("Tested spots: it did not stand out a week earlier; None: not known.")
    since: date | None = _o("Tested spots: last day of the first window from which on it stood out.")
    is_since_first: bool = _f("True: that window is the first looked at, so it may be older.", default=False)
    usual: UsualHours | None = _o("When; None where too few violations have a time.")
    evidence: Evidence | None = _o("How sure; None where nothing is known.")
    ask: str = _f("What to ask about the room there.", default="")
    question: str = _f("The same, with the hours it is about; empty where nothing is to be asked.", default="")


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedSpot:
    """A hotspot of an earlier window that a logged change made untestable until enough days have passed."""

    name: str = _f("Its area, or where it lies; free text.")
    area_id: str | None = _o("Identifier of its area; None on the rest of the floor.")
    changed_on: date | None = _o("Local day of the last change of the log in or near it.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Spots:
    """The numbered spots of the map."""

    kind: SpotKind = _f(
        "tested: more time too close than crowding explains (M20); busiest: areas with most violations."
    )
    reason: Reason | None = _o("Why they are not tested ones; None when they are.")
    first: date | None = _o("First day of the test's window.")
    last: date | None = _o("Last day of it.")
    cards: tuple[SpotCard, ...] = _f("At most three.", metric="M20", default=())
    n_more: int = _f("Tested spots without a card: all are in the planner.", metric="M20", default=0)
    watching: tuple[WatchedSpot, ...] = _f(
        "Hotspots in or near which something was changed, with too few days since for a test.",
        metric="M20",
        default=(),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrendWeek:
    """One week of the trend; without figures it is a gap, over which no line is drawn."""

    iso: str = _f("ISO week.")
    number: int = _f("Its number in the year.")
    monday: date = _f("First day.")
    violation_rate: Estimate | None = _o("Violations per recorded open hour.", "per open hour", "M0")
    close: Estimate | None = _o("Share of person-time too close.", "share", "M6")
    encounter_rate: Estimate | None = _o("Violations per person-hour.", "per person-hour", "M7")
    missing: tuple[str, ...] = _f(
        "Names of cameras that recorded too little of it to compare it with this week; free text.", default=()
    )
    coverage: float | None = _o("Recorded over open camera-hours.", "share", "M1")
    reason: Reason | None = _o("Why it is a gap.")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrendMark:
    """A change of the site's log, to be marked on the trend."""

    label: str = _f("Letter on the drawing, A first.")
    at: datetime = _f("Instant in the site's zone.")
    text: str = _f("Free text.")
    area_name: str | None = _o("Area it concerns; None for the whole site.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Usual:
    """Where a week like the weeks before would lie (`vsd_analytics.stats.usual`)."""

    lo: float = _f("Lower end.")
    hi: float = _f("Upper end.")
    n_weeks: int = _f("Weeks before that it was made from.", "weeks")
    position: UsualPosition = _f("Where this week's figure lies.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """What a floor wants to stay below, and where this week lies."""

    value: float = _f("The target.")
    position: TargetPosition | None = _o("Where this week's interval lies; None without one.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Trend:
    """The last weeks, oldest first, each over all its own recorded hours, of the cameras that recorded this week."""

    weeks: tuple[TrendWeek, ...] = _f("At most ten, up to this one.", metric="M28", default=())
    marks: tuple[TrendMark, ...] = _f("Logged changes in these weeks.", default=())
    usual_violation_rate: Usual | None = _o(
        "Usual range of how often, from up to eleven weeks before; None with fewer than four.", "per open hour", "M28"
    )
    usual_close: Usual | None = _o("The same of the share of time too close.", "share", "M28")
    target_violation_rate: Target | None = _o(
        "The target of the floor, `target_per_open_h` of vsd.toml.", "per open hour"
    )
    holidays: tuple[Reason, ...] = _f(
        "Public holidays of this week on which the site was open, in words; with one there is no usual range.",
        default=(),
    )
    left_out: tuple[str, ...] = _f(
        "Names of cameras that recorded nothing this week, so that no week counts them; free text.", default=()
    )
    state: State = _f("ok: enough weeks to call it a trend.", default="ok")
    reason: Reason | None = _o("In words, why not.")
    encounter_rate_reason: Reason | None = _o("Why there is no rate per person-hour.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """The headline numbers by one reading."""

    violation_rate: Estimate = _f("Violations per recorded open hour.", "per open hour", "M9")
    encounter_rate: Estimate = _f("Violations per person-hour.", "per person-hour", "M9")


@dataclass(frozen=True, slots=True, kw_only=True)
class AreaReading:
    """An area by the second reading."""

    area_id: str | None = _f("Area; None for the rest of the floor.")
    violation_rate: Estimate = _f("Violations between groups per recorded open hour.", "per open hour", "M9")


@dataclass(frozen=True, slots=True, kw_only=True)
class Readings:
    """Violations of all people, and those between groups of people who walk or stand together."""

    all: Reading | None = _o("All violations, over the cameras that take part.", metric="M9")
    between: Reading | None = _o("Only those between groups, over the same cameras.", metric="M9")
    between_share: float | None = _o("Share of violations that are between groups.", "share", "M9")
    between_lo: float | None = _o("Lower end of its interval.", "share", "M9")
    between_hi: float | None = _o("Upper end of its interval.", "share", "M9")
    areas: tuple[AreaReading, ...] = _f("Areas whose cameras all take part.", metric="M9", default=())
    left_out: tuple[str, ...] = _f("Names of cameras that take no part; free text.", default=())
    precision_lo: float | None = _o(
        "Share of time called within groups that is so, in the poorest of the scenes checked.", "share"
    )
    recall_lo: float | None = _o("Share of time within groups that is found, likewise.", "share")
    state: State = _f("Whether the second reading can be given.", default="ok")
    reason: Reason | None = _o("In words, why not.")


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivingArea:
    """An area that clearly has more people since a logged change."""

    area_name: str = _f("Free text.")
    change: float = _f("Relative change of people there, beside areas that were left alone.", "share", "M27")
    change_lo: float | None = _o("Lower end of its range.", "share", "M27")
    change_hi: float | None = _o("Upper end of its range.", "share", "M27")


@dataclass(frozen=True, slots=True, kw_only=True)
class Foreseen:
    """When a logged change that is not clear yet will be, by the plan from the weeks before it (`vsd plan`)."""

    change: float = _f("Effect that is looked for: that of the plan made for the area, else -0.3.", "share", "M27")
    power: float = _f("Chance of a clear verdict by `clear_by`, or within `weeks_max`.", "share", "M27")
    weeks: int | None = _o("Whole weeks after the change until then; None: more than `weeks_max`, or never.", "weeks")
    weeks_max: int = _f("Whole weeks that a change is watched.", "weeks")
    clear_by: date | None = _o("Last day of these weeks.")
    n_areas: int = _f("Areas that it is compared with.", default=0)
    left_out: tuple[Reason, ...] = _f("Why other areas are not compared with.", default=())
    reason: Reason | None = _o("Why no week will tell.")


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedChange:
    """A logged change, and what may be said of it: one verdict, and one effect, on the time too close in its area."""

    number: int = _f("Its place in the log, from 1.")
    at: datetime = _f("Instant in the site's zone.")
    text: str = _f("Free text.")
    area_name: str | None = _o("Area looked at; free text. None: the whole site.")
    outcome: Outcome = _f(
        "What may be said: works only beside areas that were left alone, by the running verdict, where the rest of "
        "the floor did not take up half of the fall, after eight weeks, and where the last two hold half of it; "
        "moved: the rest took it up, and an area of it clearly rose; fell: a fall beside these areas, and `not_yet` "
        "says why it is not said to work; doubtful: a fall that something else may have made; "
        "about_same: its whole range lies near no change; alone: no area was left alone to compare with.",
        default="too_early",
    )
    running: Estimate | None = _o(
        "The effect: the change of person-time in violation over all weeks watched, beside the comparison areas, with "
        "an interval and a verdict that hold however often they are read.",
        "per open hour", "M27",
    )  # fmt: skip
    n_watched: int | None = _o("Weeks since the change that `running` has read.", "weeks", "M27")
    usual_min: float | None = _o(
        "Person-minutes too close in the area in a week before the change.", "person-minutes a week", "M27"
    )
    avoided_min: float | None = _o(
        "Fewer of them a week since the change, by `running`; below 0 where there are more.",
        "person-minutes a week", "M27",
    )  # fmt: skip
    people: Estimate | None = _o("Change of people in the area.", metric="M27")
    receivers: tuple[ReceivingArea, ...] = _f("Areas that clearly have more people since, most first.", default=())
    moved_elsewhere: float | None = _o(
        "Share of the area's fall that the two places took up that have most more, beside the areas left alone.",
        "share",
        "M27",
    )
    net: Estimate | None = _o(
        "Change of person-time in violation per open hour on the whole floor, by itself.", "per open hour", "M27",
    )  # fmt: skip
    compared_with: tuple[str, ...] = _f("Names of the comparison areas; free text.", default=())
    not_yet: Reason | None = _o("In words, why a fall is not said to work.")
    foreseen: Foreseen | None = _o("When it will be clear; None where nothing more is to come.")
    reason: Reason | None = _o("Why nothing can be said yet.")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedChangeEffect(JudgedChange):
    """What a logged change did to its area, with the figures behind it (M27)."""

    area_name: str = _f("Area looked at; free text.")
    design: Design = _f("Beside areas that were left alone, or the area by itself.")
    is_credible: bool = _f("False: something speaks against the comparison, see `doubts`.")
    n_weeks: int | None = _o("Whole weeks on either side.", "weeks")
    before: tuple[date, date] | None = _o("First and last day of the weeks before.")
    after: tuple[date, date] | None = _o("First and last day of the weeks after.")
    effect: Estimate | None = _o(
        "Change of violations per person-hour, beside the comparison areas where there are any.",
        "per person-hour", "M27",
    )  # fmt: skip
    violation_rate: Estimate | None = _o(
        "The same of violations per open hour; None where the area is looked at by itself.", "per open hour", "M27"
    )
    burden: Estimate | None = _o(
        "Change of person-time in violation per open hour, beside the comparison areas.", "per open hour", "M27",
    )  # fmt: skip
    close: Estimate | None = _o(
        "Change of the share of person-time in violation, beside the comparison areas.", "share", "M27"
    )
    through_people: float | None = _o(
        "Part of `burden` that fewer or more people make; the change moved them.", "share", "M27"
    )
    through_closeness: float | None = _o(
        "Part of `burden` that another share of time too close makes; both parts add up to it.", "share", "M27",
    )  # fmt: skip
    e_value: float | None = _o("Evidence of `running` against no change; clear from 20 on.", metric="M27")
    contribution: float | None = _o("Part of the area in `net`.", "share", "M27")
    cautions: tuple[Reason, ...] = _f("What the data could not rule out.", default=())
    doubts: tuple[Reason, ...] = _f("What speaks against the comparison.", default=())
    assumptions: tuple[Reason, ...] = _f("What must hold for the change to be the logged change's.", default=())
    state: State = _f("Whether a change can be given.", default="ok")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedChangeResult(JudgedChange):
    """One logged change, also of the whole site, and until when it is watched."""

    area_id: str | None = _o("Area it concerns; None for the whole site.")
    watched_until: date | None = _o("Last day it is watched; None: it is decided, or cannot be.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Causes:
    """What moved the time that pairs spend close, from the week before to this one (M23)."""

    close: float | None = _o("Change of the time pairs spend closer than the distance.", "share", "M23")
    people: float | None = _o("Change that more or fewer people made by themselves.", "share", "M23")
    layout: float | None = _o("Change that the use of the floor made by itself.", "share", "M23")
    behaviour: float | None = _o("Change left over: queueing, walking together.", "share", "M23")
    behaviour_lo: float | None = _o("Lower end of its interval.", "share", "M23")
    behaviour_hi: float | None = _o("Upper end of its interval.", "share", "M23")
    people_part: float | None = _o("Part of `close` that people make; the parts add up.", "share", "M23")
    layout_part: float | None = _o("Part that the use of the floor makes.", "share", "M23")
    behaviour_part: float | None = _o("Part left over.", "share", "M23")
    people_moved_by: tuple[int, ...] = _f(
        "Numbers of the logged changes that moved people out of their area in these two weeks: the part of people is "
        "theirs, and no rival to them.",
        metric="M23", default=(),
    )  # fmt: skip
    state: State = _f("Whether it can be given.", default="ok")
    reason: Reason | None = _o("In words, why not.")


@dataclass(frozen=True, slots=True, kw_only=True)
class FalseAlarmShare:
    """How often shuffled weeks of the floor got a clear verdict."""

    share: float = _f("Clear verdicts over verdicts on weeks in which nothing changed on average.", "share")
    lo: float = _f("Lower end of its interval.", "share")
    hi: float = _f("Upper end of its interval.", "share")


@dataclass(frozen=True, slots=True, kw_only=True)
class SelfCheck:
    """How often the verdicts on the floor are false alarms, as its own weeks tell."""

    n_weeks: int = _f("Weeks it comes from.", "weeks")
    both: FalseAlarmShare | None = _o("Of both verdicts on the floor.")
    violation_rate: FalseAlarmShare | None = _o("Of verdicts on how often.", metric="M0")
    encounter_rate: FalseAlarmShare | None = _o("Of verdicts on how risky.", metric="M7")
    verdicts_a_year: int = _f("Verdicts on the floor in 52 weekly reports.", "verdicts", default=0)
    false_a_year: float | None = _o("False ones to expect among them.", "verdicts")
    false_a_year_lo: float | None = _o("Lower end of its interval.", "verdicts")
    false_a_year_hi: float | None = _o("Upper end of its interval.", "verdicts")
    state: State = _f("Whether it can be given.", default="ok")
    reason: Reason | None = _o("In words, why not.")


@dataclass(frozen=True, slots=True, kw_only=True)
class OutlookHour:
    """One open hour of the next week."""

    day: date = _f("Local date.")
    hour: int = _f("Local hour, 0 to 23.")
    value: float = _f("Expected violations per open hour.", "per open hour", "M25")
    lo: float | None = _o("Lower end of its range.", "per open hour", "M25")
    hi: float | None = _o("Upper end of its range.", "per open hour", "M25")


@dataclass(frozen=True, slots=True, kw_only=True)
class OutlookScore:
    """How good last week's forecast was, beside repeating the week before."""

    error: float = _f("Sum of absolute errors over what happened.", "share", "M25")
    error_naive: float = _f("The same of the hours of the week before.", "share", "M25")
    hit_rate: float | None = _o("Share of hours inside the range.", "share", "M25")
    n_hours: int = _f("Hours scored.", "hours")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlook:
    """The next week."""

    iso: str = _f("ISO week forecast.")
    number: int = _f("Its number in the year.")
    monday: date = _f("Its first day.")
    mean: float | None = _o("Mean of the hours forecast.", "per open hour", "M25")
    highest: tuple[OutlookHour, ...] = _f("The three highest hours, highest first.", metric="M25", default=())
    range_share: float | None = _o("Share of hours the ranges are to hold.", "share")
    n_weeks: int = _f("Recorded weeks it comes from.", "weeks", default=0)
    score: OutlookScore | None = _o("Of the forecast for the week just over; None without one.")
    state: State = _f("Whether a forecast can be given.", default="ok")
    reason: Reason | None = _o("In words, why not.")


@dataclass(frozen=True, slots=True, kw_only=True)
class UnusualHour:
    """One hour far from usual."""

    day: date = _f("Local date.")
    hour: int = _f("Local hour, 0 to 23.")
    violations: int | None = _o("Counted; None if held back.", "violations", "M24")
    usual: float = _f("Expected in so many recorded hours.", "violations", "M24")
    lo: float = _f("Lower end of the usual range.", "violations", "M24")
    hi: float = _f("Upper end of the usual range.", "violations", "M24")


@dataclass(frozen=True, slots=True, kw_only=True)
class UnusualHours:
    """The hours of the week far from usual."""

    rows: tuple[UnusualHour, ...] = _f("At most five, least likely first.", metric="M24", default=())
    n_unusual: int = _f("How many there are.", "hours", "M24", default=0)
    n_tested: int = _f("Hours that were recorded and have a usual count.", "hours", default=0)
    state: State = _f("Whether any hour could be judged.", default="ok")
    reason: Reason | None = _o("In words, why not.")

    @property
    def first(self) -> UnusualHour | None:
        """Return the least likely hour whose count may be printed; None where there is none."""
        return next((r for r in self.rows if r.violations is not None), None)
