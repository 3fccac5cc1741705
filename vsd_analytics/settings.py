"""Every default of the product in one frozen table: name, value, unit, range, help.

`vsd.toml`, the command line, `docs/settings.md`, the reports' settings id and the SQL relation `params` all read
this table; no threshold is anywhere else.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting.

    Attributes:
        name: Key in `vsd.toml`; the unit is its suffix.
        section: Table of `vsd.toml` it belongs to.
        default: Value used when `vsd.toml` does not give one.
        unit: Unit in words, empty for shares and counts.
        minimum: Smallest allowed value (inclusive); None for non-numbers.
        maximum: Largest allowed value (inclusive); None for non-numbers.
        help: One sentence for the manual.
        is_fact: True when stored facts depend on it, so that a change makes them stale.
    """

    name: str
    section: str
    default: Any
    unit: str
    minimum: float | None
    maximum: float | None
    help: str
    is_fact: bool = False


# one setting a line: the table is read across
# fmt: off
SETTINGS: tuple[Setting, ...] = (
    Setting("distance_m", "site", 2.0, "metres", 0.1, 10.0, "Two people closer than this are in violation (strictly closer).", True),
    Setting("distance_unit", "rule", "m", "", None, None, "Unit in which reports write distances: m or ft; settings stay in metres."),
    Setting("pair_max_m", "rule", 2.5, "metres", 0.1, 20.0, "Pairs farther apart than this are not stored.", True),
    Setting("episode_gap_s", "rule", 3.0, "seconds", 0.0, 600.0, "Violation records of one pair at most this far apart are one episode; never less than 2.5 frame intervals.", True),
    Setting("episode_min_s", "rule", 3.0, "seconds", 0.0, 600.0, "Episodes at least this long count as a violation."),
    Setting("coverage_gap_s", "rule", 600.0, "seconds", 1.0, 3600.0, "Without a heartbeat, a silence longer than this counts as not recorded.", True),
    Setting("cell_m", "rule", 0.25, "metres", 0.25, 0.25, "Side of a floor cell in stored facts.", True),
    Setting("owner_cell_m", "rule", 0.5, "metres", 0.5, 0.5, "Side of the cells that decide which of several overlapping cameras counts.", True),
    Setting("full_hour_share", "rule", 0.92, "", 0.5, 1.0, "An hour recorded at least this much is full."),
    Setting("partial_hour_share", "rule", 0.5, "", 0.0, 1.0, "An hour recorded at least this much is partial and enters rates; below it is low-data."),
    Setting("min_coverage", "report", 0.6, "", 0.0, 1.0, "Below this share of open hours recorded a week is not compared or ranked."),
    Setting("min_days", "report", 5, "days", 2, 7, "Intervals need at least this many recorded days."),
    Setting("min_exposure_h", "report", 20.0, "person-hours", 0.0, 1e6, "Rates per person-hour need at least this much exposure."),
    Setting("confidence", "report", 0.95, "", 0.5, 0.999, "Confidence level of every interval."),
    Setting("about_same_share", "report", 0.15, "", 0.01, 0.5, "A change is called about the same when its whole interval lies within 1 -+ this share."),
    Setting("mask_below", "report", 5, "", 0, 1000, "Counts from 1 to just under this are hidden in what leaves the operator's hands (small-count suppression)."),
    Setting("heat_steps", "report", (0.5, 1.0, 2.0, 4.0, 8.0), "violations per m2 per open hour", 0.0, 1e6, "Lower ends of the five colour bands of every map."),
    Setting("hour_steps", "report", (0.0, 50.0, 100.0, 150.0, 200.0), "violations per hour", 0.0, 1e6, "Lower ends of the five colour bands of the timetable."),
    Setting("smoothing_m", "report", 0.5, "metres", 0.05, 5.0, "Standard deviation of the smoothing of maps: about how well cameras know a position."),
    Setting("hotspot_days", "analysis", 28, "days", 7, 366, "Hotspots are searched in this many days up to the last one asked for."),
    Setting("hotspot_min_days", "analysis", 14, "days", 2, 366, "Hotspots need at least this many recorded days, of the floor and of each place."),
    Setting("hotspot_min_violations", "analysis", 300, "", 1, 1e9, "Hotspots need at least this many violations on the floor."),
    Setting("hotspot_min_ratio", "analysis", 1.25, "", 1.0, 100.0, "A hotspot has at least this many times the floor's violations per person-hour; smoothing makes high ratios lower."),
    Setting("hotspot_false_share", "analysis", 0.05, "", 1e-6, 0.5, "Of the cells called hot, at most this share is expected to be so by chance (false discovery rate)."),
    Setting("together_life_s", "analysis", 20.0, "seconds", 0.0, 86400.0, "Groups are inferred where half of person-time is in track ids that live at least this long, or where ids are not cut."),
    Setting("together_cut_share", "analysis", 0.12, "", 0.0, 1.0, "Track ids that live shorter are taken as short visits if at most this share of them end where another one begins right then."),
    Setting("washout_days", "analysis", 3, "days", 0, 28, "Days left out on both sides of a logged change before the two periods are compared: while it is built, and while people get used to it."),
    Setting("earliest_year", "ingest", 1990, "year", 1970, 2100, "Records before this year are quarantined."),
    Setting("future_max_s", "ingest", 86400.0, "seconds", 0.0, 366 * 86400.0, "Records of files later than the clock by more than this are quarantined."),
    Setting("live_late_max_s", "ingest", 86400.0, "seconds", 1.0, 366 * 86400.0, "Live messages older than this are quarantined."),
    Setting("live_ahead_max_s", "ingest", 300.0, "seconds", 0.0, 86400.0, "Live messages further ahead of the clock than this are quarantined."),
    Setting("quarantine_day_max", "ingest", 5_000_000, "records", 1, 1e9, "Once a broker's quarantine has taken this many records in a UTC day, nothing more is acknowledged until the next day."),
    Setting("watch_settle_s", "ingest", 5.0, "seconds", 0.0, 3600.0, "A file in a watched folder is read once it has not changed for this long."),
    Setting("watch_scan_s", "ingest", 2.0, "seconds", 0.1, 3600.0, "A watched folder is listed this often."),
    Setting("coordinate_max_m", "ingest", 10000.0, "metres", 1.0, 1e6, "Floor positions farther from the origin than this are quarantined."),
    Setting("line_max_bytes", "ingest", 1_000_000, "bytes", 1000, 1e9, "Lines longer than this are quarantined unread."),
    Setting("cell_max_bytes", "ingest", 10_000, "bytes", 100, 1e6, "Cells of Parquet files longer than this are quarantined unread."),
    Setting("sequence_frames_max", "ingest", 2_500_000, "frames", 1, 1e9, "Highest frame number believed in MOTChallenge files: a day at 25 frames a second has 2,160,000."),
    Setting("unreadable_max", "ingest", 250_000, "", 1, 1e12, "A source with more records than this that cannot be read is read no further; 1 in 100 of a day of 30 cameras at 10 Hz."),
    Setting("records_free", "ingest", 3_000_000, "", 1, 1e12, "A source may have this many records whatever its size."),
    Setting("records_per_byte_max", "ingest", 3.0, "records per byte", 0.001, 1e6, "Beyond records_free, a source may have this many records per byte on disk; heartbeats packed by bz2 have 1.4."),
    Setting("records_max", "ingest", 1_000_000_000, "", 1, 1e12, "A source with more records than this is read no further; a day of 30 cameras at 10 Hz with five people in view has 415 million."),
    Setting("unpack_free_mb", "ingest", 4.0, "megabytes", 0.001, 1e6, "A source may unpack to this much whatever its size."),
    Setting("unpack_ratio_max", "ingest", 200.0, "", 1.0, 1e6, "Beyond unpack_free_mb, a source may unpack to this many times its size; bz2 packs heartbeats 140-fold."),
    Setting("unpack_max_gb", "ingest", 100.0, "gigabytes", 0.001, 1e6, "A source that unpacks to more than this is read no further; a day of 30 cameras at 10 Hz with five people in view has 10."),
    Setting("page_max_mb", "ingest", 64.0, "megabytes", 0.01, 2000.0, "A Parquet file with a larger page, unpacked, is read no further; writers make pages of about 1 MB."),
    Setting("persons_max", "ingest", 1000, "", 1, 1e6, "Frames with more persons are quarantined (too-many). The most crowded public recordings of tracked people (MOT20) have about 250; 2,400 in one frame made the database fail."),
    Setting("pairs_max", "ingest", 100_000, "", 1, 1e9, "Frames with more pairs sent by the engine are quarantined (too-many). It is all pairs, near and far, of 447 persons."),
    Setting("ballast_mb", "ingest", 64.0, "megabytes", 0.0, 10000.0, "Room reserved in store/.ballast, given up when a full disk stops a fold; made once the store is larger and the disk has ten times as much free; 0 = none."),
    Setting("lateness_s", "alarms", 10.0, "seconds", 0.0, 3600.0, "Alarms wait this long for records that are late or out of order; later ones are stored and count for no alarm."),
    Setting("update_s", "alarms", 60.0, "seconds", 1.0, 86400.0, "An open alarm is sent again this often, and at once when its group is larger than ever before."),
    Setting("same_place_m", "alarms", 3.0, "metres", 0.1, 1000.0, "Without an area, an alarm within this distance of one that ended is at the same place for the cool-down."),
    Setting("together_m", "rule", 1.25, "metres", 0.1, 10.0, "Two people who move together are at most this far apart in at least half of their close records.", True),
    Setting("together_share", "rule", 0.6, "", 0.0, 1.0, "Two people who move together are close in at least this share of the records that have either of them."),
    Setting("together_walk_m", "rule", 2.0, "metres", 0.0, 100.0, "Two people who move together have walked at least this far while close; people who only stand near each other are not taken as a group."),
    Setting("pseudonyms", "privacy", True, "", None, None, "Replace the engine's track ids by keyed hashes; false only for published research recordings."),
    Setting("retention_days", "privacy", 30, "days", 1, 36500, "Days for which raw records are meant to be stored; printed on the report; vsd purge --older-than retention deletes older ones."),
)
# fmt: on

CHOICES: Mapping[str, tuple[str, ...]] = {"distance_unit": ("m", "ft")}
"""What a setting that is a word may be."""

BY_NAME: Mapping[str, Setting] = {s.name: s for s in SETTINGS}


@dataclass(frozen=True, slots=True)
class Settings:
    """The values in force: the table's defaults with a site's overrides.

    Attributes:
        values: One value per name of `SETTINGS`.
    """

    values: Mapping[str, Any] = field(default_factory=lambda: {s.name: s.default for s in SETTINGS})

    def __getattr__(self, name: str) -> Any:
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(name) from None

    def with_values(self, overrides: Mapping[str, Any]) -> Settings:
        """Return a copy with `overrides` applied; names must be in the table."""
        unknown = set(overrides) - set(BY_NAME)
        if unknown:
            raise KeyError(f"no such setting: {', '.join(sorted(unknown))}")
        return Settings({**self.values, **overrides})

    def non_default(self) -> dict[str, Any]:
        """Return the settings that differ from the table."""
        return {s.name: self.values[s.name] for s in SETTINGS if self.values[s.name] != s.default}

    def settings_id(self) -> str:
        """Return a short stable id of all values: 8 hexadecimal digits of their BLAKE2 hash."""
        text = json.dumps({s.name: self.values[s.name] for s in SETTINGS}, sort_keys=True)
        return hashlib.blake2b(text.encode(), digest_size=4).hexdigest()
