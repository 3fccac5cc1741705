"""Results of a week, one frozen dataclass per section: raw numbers, no sentences of a page."""
# ruff: noqa: RUF009  (`_f` only wraps dataclasses.field)

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Any, Literal, Self

from vsd_analytics.answer import Reason, State, Verdict
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_estimate import described as _f
from vsd_analytics.figures.week.model_estimate import optional as _o

WeekState = Literal["normal", "no_data", "too_incomplete", "first_week", "empty", "settings_changed"]
HourState = Literal["full", "partial", "low_data", "no_data", "closed", "not_over"]
LogKind = Literal["logged", "detected"]
DistanceUnit = Literal["m", "ft"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One entry of `figures`, keyed by catalogue id."""

    unit: Reason = _f("Unit in words; empty for lists.")
    value: float | None = _o("The figure; None with a `state` when missing.")
    rows: tuple[Mapping[str, Any], ...] | None = _o("The rows of a figure that is a list.")
    denominator: float | None = _o("What the figure was divided by.")
    lo: float | None = _o("Lower end of its interval.")
    hi: float | None = _o("Upper end of its interval.")
    verdict: Verdict | None = _o("Verdict on its change, if it is compared.")
    state: State = _f("Whether the figure can be given.", default="ok")
    reason: Reason | None = _o("In words, why not.")
    note: Reason | None = _o("What a reader must know beside it.")


@dataclass(frozen=True, slots=True, kw_only=True)
class CloseInDays:
    """Person-time of a day, or of days put together as one has too few violations to print."""

    first: date = _f("First local day.")
    last: date = _f("Last local day; mostly the first.")
    close_h: float = _f("Person-hours closer than the legal distance to somebody.", "h", "M6")
    person_h: tuple[float, ...] = _f("Person-hours in each class of crowding.", "h", "M3")


@dataclass(frozen=True, slots=True, kw_only=True)
class CloseInClasses:
    """Time too close in a class of crowding, or in classes put together as one has too few violations to print."""

    first: int = _f("First class, 0 for the emptiest.")
    last: int = _f("Last class; mostly the first.")
    close_h: float = _f("Person-hours closer than the legal distance to somebody, all days.", "h", "M6")


@dataclass(frozen=True, slots=True, kw_only=True)
class CloseByCrowding:
    """Time too close by how crowded it was, for a fair comparison of sites (`vsd site build`)."""

    edges: tuple[float, ...] = _f(
        "Where the second and later classes of crowding begin: others in view of a person, mean of a camera's hour.",
        "people per 100 m2", default=(),
    )  # fmt: skip
    days: tuple[CloseInDays, ...] = _f("Days with recorded hours, in order.", default=())
    classes: tuple[CloseInClasses, ...] = _f("Classes with person-time, in order.", default=())
    state: State = _f("Whether it can be given.", default="ok")
    reason: Reason | None = _o("In words, why not.")


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteRef:
    """The site and its floors."""

    site_id: str = _f("Identifier.")
    name: str = _f("Display name; free text.")
    floor_id: str = _f("Floor of this report.")
    floor_name: str = _f("Its display name; free text.")
    floors: tuple[str, ...] = _f("Ids of all floors of the site.", default=())


@dataclass(frozen=True, slots=True, kw_only=True)
class WeekRef:
    """An ISO week of the site's calendar, or other days in a row."""

    iso: str = _f("ISO name, such as 2026-W46; of other days 2026-11-09--2026-11-10.")
    year: int = _f("ISO year of the first day.")
    number: int = _f("ISO week number of the first day.")
    monday: date = _f("First local day.")
    sunday: date = _f("Last local day.")
    zone: str = _f("IANA time zone of all local times.")
    is_week: bool = _f("False for other days than one ISO week.", default=True)

    @property
    def days(self) -> int:
        """Return how many local days it has."""
        return (self.sunday - self.monday).days + 1

    @classmethod
    def of_days(cls, first: date, last: date, *, zone: str) -> Self:
        """Return days in a row that are reported as no week, whatever they are."""
        year, number, _ = first.isocalendar()
        iso = f"{first}" if first == last else f"{first}--{last}"
        return cls(iso=iso, year=year, number=number, monday=first, sunday=last, zone=zone, is_week=False)

    @classmethod
    def of(cls, monday: date, *, zone: str) -> Self:
        """Return the week from a Monday on."""
        year, number, _ = monday.isocalendar()
        iso, sunday = f"{monday:%G-W%V}", monday + timedelta(days=6)
        return cls(iso=iso, year=year, number=number, monday=monday, sunday=sunday, zone=zone)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """The settings that the words of the page depend on; same names as in the settings table."""

    distance_m: float = _f("Two people strictly closer than this are in violation.", "m")
    distance_unit: DistanceUnit = _f("Unit in which the page writes distances.", default="m")
    episode_min_s: float = _f("For at least this long.", "s", default=3.0)
    confidence: float = _f("Confidence level of every interval.", "share", default=0.95)
    mask_below: int = _f("Counts from 1 to just under this are shown as fewer than it.", default=5)
    min_coverage: float = _f(
        "Below this share of open hours recorded nothing is compared or ranked.", "share", default=0.6
    )
    full_hour_share: float = _f("An hour recorded at least this much is full.", "share", default=0.92)
    partial_hour_share: float = _f("An hour recorded less than this is low-data.", "share", default=0.5)
    heat_steps: tuple[float, ...] = _f(
        "Lower ends of the map's bands.", "violations per m2 per open hour", default=(0.5, 1.0, 2.0, 4.0, 8.0)
    )
    hour_steps: tuple[float, ...] = _f(
        "Lower ends of the timetable's bands.", "violations per hour", default=(0.0, 50.0, 100.0, 150.0, 200.0)
    )
    smoothing_m: float = _f("Standard deviation of the map's smoothing.", "m", default=0.5)
    retention_days: int = _f("Days raw records are meant to be kept.", "days", default=30)
    outage_min_s: float = _f("An outage is at least this much opening time without data.", "s", default=600.0)
    contact_s: float = _f("Two people this long too close within 24 hours are a close contact.", "s", default=900.0)
    show_lines: bool = _f("The page has the section of counting lines and doors.", default=False)
    material_share: float = _f("A place with less of the floor's time too close makes no news.", "share", default=0.05)


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """What made the page, so that anyone can make it again."""

    version: str = _f("Version of vsd-analytics.")
    engines: tuple[str, ...] = _f("Engines and versions that sent the records; hostile text.")
    settings_id: str = _f("Hash of all settings in force.")
    settings_non_default: tuple[tuple[str, str], ...] = _f(
        "Name and value of the settings that differ from the table.", default=()
    )
    inputs_digest: str = _f("Hash of the facts the page was made from.", default="")
    language: str = _f("Language of its sentences, as ISO 639-1 has it.", default="en")
    is_made_up: bool = _f("True for `vsd demo`: the page says so.", default=False)
    notes: tuple[str, ...] = _f("What does not compare: purged hours that were computed by other rules.", default=())


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """The first figures of the page."""

    violation_rate: Estimate = _f("How often: violations per recorded open hour.", "per open hour", "M0")
    encounter_rate: Estimate = _f("How risky: violations per person-hour.", "per person-hour", "M7")
    close_time_share: Estimate | None = _o("Share of person-time closer than the distance to somebody.", "share", "M6")
    people: Estimate = _f(
        "People: person-hours seen per recorded open hour, and its change.", "person-hours per open hour", "M3"
    )
    exposure_h: float | None = _o("Person-hours seen in the hours that enter rates.", "person-hours", "M3")
    violations: int | None = _o(
        "Violations counted in the hours that enter rates; None if masked or unknown.", "violations", "M8"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BusiestSpot:
    """The area with the most violations per square metre, of those with a material share of all."""

    area_id: str | None = _f("Area, or None for the rest of the floor.")
    name: str = _f("Its display name; free text.")
    share: float = _f("Its rate over the sum of all areas' rates.", "share", "M15")
    floor_share: float | None = _o("Share of the floor that cameras see.", "share")


@dataclass(frozen=True, slots=True, kw_only=True)
class BusiestHour:
    """The full hour with the most violations."""

    start: datetime = _f("Local start.", metric="M14")
    violations: float | None = _f("Violations in that hour.", "violations", "M14")
    is_masked: bool = _f("True: fewer than `mask_below`, do not show the number.", default=False)
    ratio_to_mean: float | None = _o("Over the mean of the week's full hours.", "ratio", "M14")


@dataclass(frozen=True, slots=True, kw_only=True)
class AreaRow:
    """One area of the floor."""

    area_id: str | None = _f("Identifier; None for the rest of the floor.")
    name: str = _f("Display name; free text.")
    counted: int | None = _o(
        "Violations counted in the hours that enter rates; None if masked or unknown.", "violations", "M15"
    )
    is_masked: bool = _f("True: 1 to `mask_below`-1 were counted; no figure of this area is shown.", default=False)
    is_held_back: bool = _f("True: its figures are held back, as they would tell a masked one.", default=False)
    violation_rate: Estimate = _f("Violations per recorded open hour, and its change.", "per open hour", "M0")
    encounter_rate: Estimate | None = _o("Violations per person-hour spent in the area.", "per person-hour", "M7")
    close_time_share: Estimate | None = _o(
        "Share of the person-time spent in the area that is closer than the distance to somebody, and its change.",
        "share",
        "M6",
    )
    exposure_h: float | None = _o("Person-hours seen in the area.", "person-hours", "M15")
    share: float | None = _o("Its rate over the sum of all areas' rates.", "share", "M15")
    difference: float | None = _o(
        "What it adds to the floor's change over the hours compared; areas and the rest add up to it.",
        "per open hour",
        "M15",
    )
    recorded_share: float | None = _o(
        "Open hours recorded by its cameras, each weighted by how much of the area it counts.", "share", "M1"
    )
    cameras: tuple[str, ...] = _f(
        "Ids of the cameras that count at least 1 % of the area, the largest part first.", default=()
    )
    is_material: bool = _f(
        "It holds `material_share` of the floor's time too close, in this week or the one compared with: only then it "
        "makes a headline, a thing to know or the week's question.",
        default=True,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class HourCell:
    """One local hour of the week."""

    day: date = _f("Local date.")
    hour: int = _f("Local hour, 0 to 23.")
    fold: int = _f("1 for the second of two equal local hours (clocks set back).", default=0)
    start: datetime = _f("Start with offset.")
    state: HourState = _f(
        "full: for `full_hour_share` of the hour or more; partial: for `partial_hour_share`; low_data: for less, "
        "in no rate or ranking; no_data: not recorded; closed; not_over: still to come."
    )
    violations: int | None = _o(
        "Violations of the hour, also of low-data hours, which M8 leaves out; None if masked, no data, closed or not "
        "over.",
        "violations",
        "M0",
    )
    is_masked: bool = _f("True: 1 to `mask_below`-1 were counted.", default=False)
    is_held_back: bool = _f("True: its count is held back, as it would tell a masked one.", default=False)
    scaled: float | None = _o("Low-data hours: counted over recorded share, rough.", "violations")
    close_time_share: float | None = _o(
        "Share of the hour's person-time closer than the distance to somebody, where the hour enters rates and its "
        "count is given; one hour has no interval.",
        "share",
        "M6",
    )
    share: float | None = _o("Camera-hours recorded over open camera-hours.", "share", "M1")
    cameras_down: int = _f("Cameras that recorded less than half of it: the true figure is higher.", default=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DayMean:
    """Mean of a day's full hours."""

    day: date = _f("Local date.")
    value: float | None = _o(
        "Mean violations per full hour, masked ones taken as `mask_below` / 2; None without a full hour.",
        "violations per hour",
    )
    hours: int = _f("Full hours in it.", default=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class HourMean:
    """Mean of a local hour's full cells over the week."""

    hour: int = _f("Local hour, 0 to 23.")
    value: float | None = _o(
        "Mean violations per full hour, masked ones taken as `mask_below` / 2; None without a full hour.",
        "violations per hour",
    )
    hours: int = _f("Full hours in it.", default=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Timetable:
    """The timetable."""

    cells: tuple[HourCell, ...] = _f(
        "All local hours of the week in order (167 to 169 of them), or only the open ones."
    )
    day_means: tuple[DayMean, ...] = _f("Monday to Sunday.", default=())
    hour_means: tuple[HourMean, ...] = _f("By local hour.", default=())
    busiest_day: date | None = _o(
        "The day with more violations than every other in the full hours that both have; None: none has."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LogLine:
    """One line of the site's change log, or a change that was detected."""

    at: datetime = _f("Instant in the site's zone.")
    text: str = _f("Free text.")
    kind: LogKind = _f("Written by a person, or detected.", default="logged")
    area_id: str | None = _o("Area it concerns; None for the whole floor.")
    area_name: str | None = _o("Its display name.")
    moved_after: float | None = _o(
        "Share of the area's change over the week that came after the entry, 0 to 1.", "share"
    )
    floor_share: float | None = _o("Part of the floor's change that lies in the area.", "share", "M0")
    rest_verdict: Verdict | None = _o("Verdict on how often on the floor without the area.")


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingsChange:
    """A setting or calibration that changed inside the comparison window, so that nothing is compared."""

    name: str = _f("Setting, such as distance_m; or calibration, cameras, engine, rules (of purged hours).")
    before: str = _f("Value before, with unit.")
    after: str = _f("Value after, with unit.")
    at: datetime | None = _o("Instant of the change in the site's zone; None: somewhere between the two weeks.")
    violation_rate_before: Estimate | None = _o("How often, in this week before the change.", "per open hour", "M0")
    violation_rate_after: Estimate | None = _o("How often, in this week from the change on.", "per open hour", "M0")
    command: str | None = _o("What recomputes the week with one setting.")
