"""What a weekly report knows: one frozen dataclass per section, raw numbers only.

The page, its JSON file, the CSV files and the notebook are all made from one `WeekReport`. Nothing in it is
formatted: numbers are floats, ints or None, instants are aware datetimes in the site's zone, names are the free text of
`vsd.toml`. A missing number is None and its `state` says why; it is never 0.

Every field carries `help`, and `unit` and `metric` (catalogue id, such as M7) where they apply; `docs` and the
published JSON Schema are made from them.
"""
# ruff: noqa: RUF009  (`_f` only wraps dataclasses.field)

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Final, Literal

from vsd_analytics.answer import Answers
from vsd_analytics.figures.week.model_estimate import described as _f
from vsd_analytics.figures.week.model_estimate import optional as _o
from vsd_analytics.figures.week.model_map import ChangeMaps, FloorMap, Footsteps, MapViews, SpotPicture
from vsd_analytics.figures.week.model_recording import CameraRecord, Coverage
from vsd_analytics.figures.week.model_sections import (
    Causes,
    LoggedChangeEffect,
    LoggedChangeResult,
    Outlook,
    Readings,
    SelfCheck,
    Spots,
    Trend,
    UnusualHours,
)
from vsd_analytics.figures.week.results import (
    AreaRow,
    BusiestHour,
    BusiestSpot,
    CloseByCrowding,
    Figure,
    Level,
    LogLine,
    Provenance,
    Rules,
    SettingsChange,
    SiteRef,
    Timetable,
    WeekRef,
    WeekState,
)
from vsd_analytics.figures.week.stored_records import StoredRecords
from vsd_analytics.report.model.week_agenda import Agenda

# fmt: on

SCHEMA: Final = "vsd.report.week/2"
ThingKind = Literal["worked", "watch", "distrust"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """A run of words; strong ones are set bold."""

    text: str = _f("The words.")
    is_strong: bool = _f("Set bold.", default=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Thing:
    """One of the three things to know."""

    kind: ThingKind = _f("What worked, what to watch, what not to trust.")
    title: str = _f("The finding as a sentence.")
    text: str = _f("Its evidence.")
    target: str = _f("Anchor of the proof on the page: where, when, changed, data.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Story:
    """The words of the page, made by rule from the figures (`headline.story_of`)."""

    headline: str = _f("One sentence, at most 15 words where names allow.")
    rule: str = _f("Name of the rule that made it, such as fall/fall or no_data.")
    lead: tuple[Span, ...] = _f("Two to four sentences.")
    things: tuple[Thing, ...] = _f("At most three.")
    question: str = _f("Exactly one, about the room; empty where other days than a week are reported.")
    question_id: str = _f("Its id, for vsd log answer.", default="")
    notes: tuple[str, ...] = _f("What an abnormal week says in its box.", default=())


@dataclass(frozen=True, slots=True, kw_only=True)
class WeekReport:
    """One floor, one week."""

    schema: str = _f("Schema id of this object.", default=SCHEMA)
    site: SiteRef = _f("The site.")
    week: WeekRef = _f("The week.")
    previous: WeekRef | None = _o("The week compared with; None if there is none.")
    generated_at: datetime = _f("From --now or the data, never the clock; in the site's zone.")
    provenance: Provenance = _f("What made it.")
    rules: Rules = _f("Settings the words depend on.")
    state: WeekState = _f(
        "What may be said; the first true of no_data, too_incomplete, empty, settings_changed, first_week, normal."
    )
    coverage: Coverage = _f("Data recorded.", metric="M1")
    level: Level = _f("How often, how risky, how many people.")
    busiest_spot: BusiestSpot | None = _o("None when nothing is ranked.", metric="M15")
    busiest_hour: BusiestHour | None = _o("None when nothing is ranked or all counts are small.", metric="M14")
    areas: tuple[AreaRow, ...] = _f("Most violations first, the rest of the floor last.", metric="M15", default=())
    when: Timetable = _f("The timetable.", metric="M8")
    maps: tuple[FloorMap, ...] = _f("One plan or floor, or one picture per camera.", metric="M17", default=())
    change_maps: ChangeMaps | None = _o("None when nothing is compared.", metric="M17")
    spot_pictures: tuple[SpotPicture, ...] = _f("What stands around the numbered spots.", default=())
    footsteps: Footsteps | None = _o("None where the engine sends no positions or no track ids.")
    views: MapViews | None = _o("None where what some camera sees is unknown.")
    log: tuple[LogLine, ...] = _f("In order of time.", default=())
    stored: StoredRecords | None = _o("Raw records stored when the report was made.")
    settings_change: SettingsChange | None = _o("Set when `state` is settings_changed.")
    spots: Spots | None = _o("The numbered spots; None when nothing is ranked.", metric="M20")
    readings: Readings | None = _o("All violations, and those between groups.", metric="M9")
    change_effects: tuple[LoggedChangeEffect, ...] = _f("What logged changes did.", metric="M27", default=())
    logged_changes: tuple[LoggedChangeResult, ...] = _f(
        "Every logged change from the first week looked at, and what it avoided.", metric="M27", default=()
    )
    causes: Causes | None = _o("What moved; None when nothing is compared.", metric="M23")
    trend: Trend | None = _o("The last ten weeks.", metric="M28")
    outlook: Outlook | None = _o("The next week.", metric="M25")
    unusual: UnusualHours | None = _o("Hours far from usual.", metric="M24")
    selfcheck: SelfCheck | None = _o("How often the verdicts on the floor are false alarms.")
    close_by_crowding: CloseByCrowding | None = _o(
        "Time too close by crowding and day; None in files of older versions.", metric="M6"
    )
    answers: Answers = field(
        default_factory=Answers,
        metadata={"help": "Tables of figures by name, as they may leave the operator's hands; none in files of 1.x."},
    )
    figures: Mapping[str, Figure] = _f(
        "What no rows of an answer hold, by catalogue id: maps, as M17. In files of 1.x, all figures."
    )
    agenda: Agenda | None = _o("What may be asked, and what earlier weeks asked.")
    story: Story | None = _o("Filled by `headline.story_of`; None until then.")

    @property
    def silent_cameras(self) -> tuple[CameraRecord, ...]:
        """Return the cameras without an hour that counts: the page does not know the floor that only they see."""
        return tuple(c for c in self.coverage.cameras if c.is_silent)

    @property
    def is_so_far(self) -> bool:
        """Tell whether nothing is compared only because the week is not over: its hours so far were recorded."""
        is_recorded = self.coverage.share >= self.rules.min_coverage
        return self.state == "too_incomplete" and self.coverage.not_over_from is not None and is_recorded

    @property
    def is_little_recorded(self) -> bool:
        """Return whether one of the silent cameras recorded minutes, so that "nothing" would be false."""
        return any(c.recorded_h > 0 for c in self.silent_cameras)

    @property
    def has_history(self) -> bool:
        """Tell whether any week before this one has a figure, be it the week before or an earlier one."""
        weeks = () if self.trend is None else self.trend.weeks[:-1]
        return any(w.violation_rate is not None and w.violation_rate.value is not None for w in weeks)

    @property
    def language(self) -> str:
        """Return the language of its sentences."""
        return self.provenance.language
