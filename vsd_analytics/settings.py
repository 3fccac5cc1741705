"""Every default of the product, a line each: name, type, value, unit, range, help.

`vsd.toml`, the command line, `docs/settings.md`, the JSON Schema of `vsd.toml`, the reports' settings id and the SQL
relation `params` all read the fields of `Settings`; no threshold is anywhere else.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, Literal, TypeAlias, TypedDict, TypeVar, get_args, get_origin, get_type_hints

FLOOR_CELL_M: Final = 0.25
"""Side of a floor cell in stored facts. Facts, areas and maps of every age must nest in it, so it is not a setting."""

OWNER_CELL_M: Final = 0.5
"""Side of the cells that decide which of several overlapping cameras counts. Not a setting, as `FLOOR_CELL_M`."""

FORMER: Final[Mapping[str, float]] = {"cell_m": FLOOR_CELL_M, "owner_cell_m": OWNER_CELL_M}
"""Keys of `[rule]` that were settings with one legal value: the value they may still have."""

Value: TypeAlias = "float | int | str | bool | tuple[float, ...] | tuple[str, ...]"
Reader: TypeAlias = Literal["facts", "sql"]

T = TypeVar("T")


class IntervalRules(TypedDict):
    """The settings that every interval follows, as arguments of the functions of `vsd_analytics.stats`."""

    confidence: float
    min_days: int


@dataclass(frozen=True, slots=True)
class Setting:
    """What is known of a setting besides its value.

    Attributes:
        name: Key in `vsd.toml`; the unit is its suffix.
        section: Table of `vsd.toml` it belongs to.
        default: Value used when `vsd.toml` does not give one.
        unit: Unit in words, empty for shares and counts.
        minimum: Smallest allowed value (inclusive); None for non-numbers.
        maximum: Largest allowed value (inclusive); None for non-numbers.
        help: One sentence for the manual.
        choices: The words it may be, of a setting that is a word.
        is_fact: True when stored facts depend on it, so that a change makes them stale.
        is_in_sql: True when it is a column of the relation `params`.
    """

    name: str
    section: str
    default: Value
    unit: str
    minimum: float | None
    maximum: float | None
    help: str
    choices: tuple[str, ...]
    is_fact: bool
    is_in_sql: bool


def _setting(
    section: str, default: T, unit: str, minimum: float | None, maximum: float | None, help: str, *read_by: Reader
) -> T:
    """Return the field of a setting; `read_by` says whether stored facts depend on it, and whether SQL reads it."""
    about = {"section": section, "unit": unit, "minimum": minimum, "maximum": maximum, "help": help}
    about |= {"is_fact": "facts" in read_by, "is_in_sql": "sql" in read_by}
    return field(default=default, metadata=about)


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The values in force: the defaults below with a site's overrides.

    A field is one setting: section of `vsd.toml`, default, unit, smallest and largest value, meaning, who reads it.
    """

    # one setting a line: the table is read across
    # fmt: off
    distance_m: float = _setting("site", 2.0, "metres", 0.1, 10.0, "Two people closer than this are in violation (strictly closer).", "facts", "sql")
    distance_unit: Literal["m", "ft"] = _setting("rule", "m", "", None, None, "Unit in which reports write distances: m or ft; settings stay in metres.")
    pair_max_m: float = _setting("rule", 2.5, "metres", 0.1, 20.0, "Pairs farther apart than this are left out.", "facts", "sql")
    episode_gap_s: float = _setting("rule", 3.0, "seconds", 0.0, 600.0, "Violation records of one pair at most this far apart are one episode; never less than 2.5 frame intervals.", "facts", "sql")
    episode_min_s: float = _setting("rule", 3.0, "seconds", 0.0, 600.0, "Episodes at least this long count as a violation.", "sql")
    coverage_gap_s: float = _setting("rule", 600.0, "seconds", 1.0, 3600.0, "Without a heartbeat, a silence longer than this counts as not recorded.", "facts", "sql")
    full_hour_share: float = _setting("rule", 0.92, "", 0.5, 1.0, "An hour recorded at least this much is full.", "sql")
    partial_hour_share: float = _setting("rule", 0.5, "", 0.0, 1.0, "An hour recorded at least this much is partial and enters rates; below it is low-data.", "sql")
    outage_min_s: float = _setting("rule", 600.0, "seconds", 60.0, 86400.0, "An outage is at least this much opening time without data from a camera.", "sql")
    gathering_people: int = _setting("rule", 3, "people", 2, 1000, "A gathering is a cluster of at least this many people, each closer than distance_m to the next.", "facts", "sql")
    gathering_last_s: float = _setting("rule", 10.0, "seconds", 0.0, 3600.0, "A gathering lasts at least this long.", "facts", "sql")
    gathering_link_s: float = _setting("rule", 5.0, "seconds", 0.0, 600.0, "A cluster carries a gathering on that was last seen at most this long ago; never less than 2.5 frame intervals.", "facts", "sql")
    visit_gap_s: float = _setting("rule", 5.0, "seconds", 0.0, 600.0, "Who leaves an area and is back within this is still on the same visit; never less than 2.5 frame intervals.", "facts", "sql")
    join_views: bool = _setting("rule", False, "", None, None, "Visits, waits and flow follow people from camera to camera of a floor, where both cameras see them at the same place.")
    min_coverage: float = _setting("report", 0.6, "", 0.0, 1.0, "Below this share of open hours recorded a week is not compared or ranked.")
    min_days: int = _setting("report", 5, "days", 2, 7, "Intervals need at least this many recorded days.")
    min_exposure_h: float = _setting("report", 20.0, "person-hours", 0.0, 1e6, "Rates per person-hour need at least this much exposure.")
    confidence: float = _setting("report", 0.95, "", 0.5, 0.999, "Confidence level of every interval.")
    about_same_share: float = _setting("report", 0.15, "", 0.01, 0.5, "A change is called about the same when its whole interval lies within 1 -+ this share.")
    material_share: float = _setting("report", 0.05, "", 0.0, 1.0, "A place gets a card, a headline or the week's question when at least this share of the floor's time too close is spent in it.")
    show_context: bool = _setting("report", False, "", None, None, "Reports show what else happened, the series of vsd context add, and figures made with them.")
    show_lines: bool = _setting("report", False, "", None, None, "The weekly page has the section of counting lines and doors.")
    mask_below: int = _setting("report", 5, "", 0, 1000, "Counts from 1 to just under this are hidden in what leaves the operator's hands (small-count suppression).")
    heat_steps: tuple[float, ...] = _setting("report", (0.5, 1.0, 2.0, 4.0, 8.0), "violations per m2 per open hour", 0.0, 1e6, "Lower ends of the five colour bands of every map.")
    hour_steps: tuple[float, ...] = _setting("report", (0.0, 50.0, 100.0, 150.0, 200.0), "violations per hour", 0.0, 1e6, "Lower ends of the five colour bands of the timetable.")
    smoothing_m: float = _setting("report", 0.5, "metres", 0.05, 5.0, "Standard deviation of the smoothing of maps: about how well cameras know a position.")
    hotspot_days: int = _setting("analysis", 28, "days", 7, 366, "Hotspots are searched in this many days up to the last one asked for.")
    hotspot_min_days: int = _setting("analysis", 14, "days", 2, 366, "Hotspots need at least this many recorded days, of the floor and of each place.")
    hotspot_min_violations: int = _setting("analysis", 300, "", 1, 1e9, "Hotspots need at least this many violations on the floor.")
    hotspot_min_ratio: float = _setting("analysis", 1.25, "", 1.0, 100.0, "A hotspot has at least this many times the time in violation that its crowd explains; smoothing makes high ratios lower.")
    hotspot_false_share: float = _setting("analysis", 0.05, "", 1e-6, 0.5, "Of the cells called hot, at most this share is expected to be so by chance (false discovery rate).")
    sustained_s: float = _setting("analysis", 30.0, "seconds", 0.0, 86400.0, "Violations at least this long are sustained: their share is a figure (M10).")
    long_visit_s: float = _setting("analysis", 120.0, "seconds", 1.0, 86400.0, "A visit of an area that lasts longer is a long one, where the area does not set its own limit.")
    contact_s: float = _setting("analysis", 900.0, "seconds", 1.0, 86400.0, "A pair whose episodes within 24 hours sum to this is a close contact (M12).")
    unusual_false_share: float = _setting("analysis", 0.05, "", 1e-6, 0.5, "Of the hours called unusual, at most this share is expected to be so by chance (false discovery rate).")
    unusual_min_change: float = _setting("analysis", 0.5, "", 0.0, 100.0, "An unusual hour differs by at least this share of what is usual.")
    unusual_min_violations: float = _setting("analysis", 5.0, "violations", 0.0, 1e6, "An unusual hour differs by at least this many violations from what is usual.")
    forecast_share: float = _setting("analysis", 0.8, "", 0.5, 0.99, "Share of hours that the range of a forecast is to hold.")
    change_min_days: int = _setting("analysis", 7, "days", 2, 366, "Before and after a logged change need at least this many pairs of days.")
    change_min_violations: int = _setting("analysis", 30, "", 1, 1e6, "Before and after a logged change need at least this many violations each.")
    change_apart_m: float = _setting("analysis", 5.0, "metres", 0.0, 1000.0, "Areas nearer to the changed one than this are no comparison: people may only have moved there.")
    together_life_s: float = _setting("analysis", 20.0, "seconds", 0.0, 86400.0, "Groups are inferred where half of person-time is in track ids that live at least this long, or where ids are not cut.")
    together_cut_share: float = _setting("analysis", 0.12, "", 0.0, 1.0, "Track ids that live shorter are taken as short visits if at most this share of them end where another one begins right then.")
    free_way_m: tuple[float, ...] = _setting("analysis", (1.2, 1.5), "metres", 0.3, 20.0, "Clear widths of accessible ways (EN 17210): vsd whatif says which ways fall under them.")
    washout_days: int = _setting("analysis", 3, "days", 0, 28, "Days left out on both sides of a logged change before the two periods are compared: while it is built, and while people get used to it.")
    earliest_year: int = _setting("ingest", 1990, "year", 1970, 2100, "Records before this year are quarantined.")
    future_max_s: float = _setting("ingest", 86400.0, "seconds", 0.0, 366 * 86400.0, "Records of files later than the clock by more than this are quarantined.")
    live_late_max_s: float = _setting("ingest", 86400.0, "seconds", 1.0, 366 * 86400.0, "Live messages older than this are quarantined.")
    live_ahead_max_s: float = _setting("ingest", 300.0, "seconds", 0.0, 86400.0, "Live messages further ahead of the clock than this are quarantined.")
    quarantine_day_max: int = _setting("ingest", 5_000_000, "records", 1, 1e9, "Once a broker's quarantine has taken this many records in a UTC day, nothing more is acknowledged until the next day.")
    watch_settle_s: float = _setting("ingest", 5.0, "seconds", 0.0, 3600.0, "A file in a watched folder is read once it has not changed for this long.")
    watch_scan_s: float = _setting("ingest", 2.0, "seconds", 0.1, 3600.0, "A watched folder is listed this often.")
    coordinate_max_m: float = _setting("ingest", 10000.0, "metres", 1.0, 1e6, "Floor positions farther from the origin than this are quarantined.", "facts", "sql")
    line_max_bytes: int = _setting("ingest", 1_000_000, "bytes", 1000, 1e9, "Lines longer than this are quarantined unread.")
    cell_max_bytes: int = _setting("ingest", 10_000, "bytes", 100, 1e6, "Cells of Parquet files longer than this are quarantined unread.")
    sequence_frames_max: int = _setting("ingest", 2_500_000, "frames", 1, 1e9, "Highest frame number believed in MOTChallenge files: a day at 25 frames a second has 2,160,000.")
    unreadable_max: int = _setting("ingest", 250_000, "", 1, 1e12, "A source with more records than this that cannot be read is read no further; 1 in 100 of a day of 30 cameras at 10 Hz.")
    records_free: int = _setting("ingest", 3_000_000, "", 1, 1e12, "A source may have this many records whatever its size.")
    records_per_byte_max: float = _setting("ingest", 3.0, "records per byte", 0.001, 1e6, "Beyond records_free, a source may have this many records per byte on disk; heartbeats packed by bz2 have 1.4.")
    records_max: int = _setting("ingest", 1_000_000_000, "", 1, 1e12, "A source with more records than this is read no further; a day of 30 cameras at 10 Hz with five people in view has 415 million.")
    unpack_free_mb: float = _setting("ingest", 4.0, "megabytes", 0.001, 1e6, "A source may unpack to this much whatever its size.")
    unpack_ratio_max: float = _setting("ingest", 200.0, "", 1.0, 1e6, "Beyond unpack_free_mb, a source may unpack to this many times its size; bz2 packs heartbeats 140-fold.")
    unpack_max_gb: float = _setting("ingest", 100.0, "gigabytes", 0.001, 1e6, "A source that unpacks to more than this is read no further; a day of 30 cameras at 10 Hz with five people in view has 10.")
    page_max_mb: float = _setting("ingest", 64.0, "megabytes", 0.01, 2000.0, "A Parquet file with a larger page, unpacked, is read no further; writers make pages of about 1 MB.")
    persons_max: int = _setting("ingest", 1000, "", 1, 1e6, "Frames with more persons are quarantined (too-many). The most crowded public recordings of tracked people (MOT20) have about 250; 2,400 in one frame made the database fail.")
    pairs_max: int = _setting("ingest", 100_000, "", 1, 1e9, "Frames with more pairs sent by the engine are quarantined (too-many). It is all pairs, near and far, of 447 persons.")
    ballast_mb: float = _setting("ingest", 64.0, "megabytes", 0.0, 10000.0, "Room reserved in store/.ballast, given up when a full disk stops a fold; made once the store is larger and the disk has ten times as much free; 0 = none.")
    lateness_s: float = _setting("alarms", 10.0, "seconds", 0.0, 3600.0, "Alarms wait this long for records that are late or out of order; later ones are stored and count for no alarm.")
    update_s: float = _setting("alarms", 60.0, "seconds", 1.0, 86400.0, "An open alarm is sent again this often, and at once when its group is larger than ever before.")
    same_place_m: float = _setting("alarms", 3.0, "metres", 0.1, 1000.0, "Without an area, an alarm within this distance of one that ended is at the same place for the cool-down.")
    together_m: float = _setting("rule", 1.25, "metres", 0.1, 10.0, "Two people who walk together are at most this far apart in at least half of their close records; who stand together, on average.", "facts", "sql")
    together_share: float = _setting("rule", 0.6, "", 0.0, 1.0, "Two people who walk together are close in at least this share of the records that have either of them.", "sql")
    together_walk_m: float = _setting("rule", 2.0, "metres", 0.0, 100.0, "Two people who walk together have walked at least this far while close.", "sql")
    together_min_s: float = _setting("rule", 2.0, "seconds", 0.0, 3600.0, "Two people who walk together are close for at least this long in all.", "sql")
    together_min_records: int = _setting("rule", 3, "records", 1, 1000, "Two people who walk together are close in at least this many records.", "sql")
    people: Literal["all", "visitors", "staff"] = _setting("staff", "all", "", None, None, "Whom the figures count: everybody, or only visitors or only staff as the rules of this section tell them apart.", "facts", "sql")
    staff_in_area_s: float = _setting("staff", 600.0, "seconds", 1.0, 86400.0, "Staff is who is in staff areas at least this long in a site day, and for staff_in_area_share of the time in view.", "sql")
    staff_in_area_share: float = _setting("staff", 0.2, "", 0.0, 1.0, "Staff is who is in staff areas for at least this share of the time in view, and for staff_in_area_s.", "sql")
    staff_in_view_s: float = _setting("staff", 18000.0, "seconds", 1.0, 90000.0, "Staff is who is in view at least this long in a site day.", "sql")
    staff_closed_s: float = _setting("staff", 1800.0, "seconds", 1.0, 90000.0, "Staff is who is in view at least this long outside opening hours in a site day.", "sql")
    staff_classes: tuple[str, ...] = _setting("staff", (), "", None, None, "Classes and tags of engines that mean staff, such as \"staff\" or \"employee\"; a track that has one in most of its records is staff.")
    pseudonyms: bool = _setting("privacy", True, "", None, None, "Replace the engine's track ids by keyed hashes; false only for published research recordings.")
    retention_days: int = _setting("privacy", 30, "days", 1, 36500, "Days for which raw records are meant to be stored; printed on the report; vsd purge --older-than retention deletes older ones.")
    # fmt: on

    @property
    def values(self) -> dict[str, Value]:
        """Return the value of each setting by name, in the order of the table."""
        return {s.name: getattr(self, s.name) for s in SETTINGS}

    @property
    def for_intervals(self) -> IntervalRules:
        """Return the confidence level of every interval and the recorded days it needs."""
        return {"confidence": self.confidence, "min_days": self.min_days}

    def with_values(self, overrides: Mapping[str, Any]) -> Settings:
        """Return a copy with `overrides` applied; names must be in the table."""
        unknown = set(overrides) - set(BY_NAME)
        if unknown:
            raise KeyError(f"no such setting: {', '.join(sorted(unknown))}")
        return replace(self, **overrides)

    def non_default(self) -> dict[str, Value]:
        """Return the settings that differ from the table."""
        return {name: value for name, value in self.values.items() if value != BY_NAME[name].default}

    def settings_id(self) -> str:
        """Return a short stable id of all values: 8 hexadecimal digits of their BLAKE2 hash."""
        return hashlib.blake2b(json.dumps(self.values, sort_keys=True).encode(), digest_size=4).hexdigest()


DEFAULTS: Final = Settings()
"""The settings of a site that overrides none."""


_TYPES: Final = get_type_hints(Settings)

SETTINGS: Final = tuple(
    Setting(
        f.name,
        default=getattr(DEFAULTS, f.name),
        choices=get_args(_TYPES[f.name]) if get_origin(_TYPES[f.name]) is Literal else (),
        **f.metadata,
    )
    for f in fields(Settings)
)
"""What is known of each setting, in the order of the fields."""

BY_NAME: Final[Mapping[str, Setting]] = {s.name: s for s in SETTINGS}
