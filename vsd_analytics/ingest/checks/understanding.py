"""What was understood of a source: a card that a person can check at a glance, with warnings."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from vsd_analytics.errors import InputError, VsdError, Where
from vsd_analytics.ingest.checks.check_case import ROWS_MIN, Case, SourceWarning, floor_bounds_m, picture_px
from vsd_analytics.ingest.checks.check_table import warnings_of
from vsd_analytics.ingest.checks.sample import Extent, Sample, extent
from vsd_analytics.ingest.reading.adapter import Adapter, IngestOptions, Source
from vsd_analytics.ingest.reading.cell_values import full_score
from vsd_analytics.ingest.reading.column_hints import named_like
from vsd_analytics.ingest.reading.columns import TIME_OF_DAY
from vsd_analytics.ingest.reading.table_head import SHOWN_ROWS, TableHead
from vsd_analytics.ingest.reading.units import LENGTHS

_CAMERAS_MAX: Final = 20
_LIMIT: Final = 0.4
"""Confidence from which detectors are usually believed."""
_NUMBERS: Final = ("distance_m", "x", "y", "u", "v")


@dataclass(frozen=True, slots=True)
class ColumnUse:
    """One column that is read.

    Attributes:
        ours: Our name, such as "x_m".
        theirs: The file's name.
        unit: Unit it is converted from; None = it is read as it is.
    """

    ours: str
    theirs: str
    unit: str | None = None


@dataclass(frozen=True, slots=True)
class SourceProfile:
    """What was understood of the first records of one source.

    Attributes:
        format: Adapter that reads it.
        n_records: Records looked at.
        is_whole: Whether these are all records.
        columns: Columns that are read; empty for formats without columns of the user's choice.
        ignored: Columns that are not read.
        missing: Our columns that the file lacks, though figures need them.
        confidence: Column that seems to hold the engine's confidence; None = there is none.
        confidence_limit: A usual limit in the unit of that column; None = it holds neither shares nor percents.
        floor_m: 1st and 99th percentiles of x and y, in metres; None without floor positions.
        floor_bounds_m: Rectangle of the plan or view.
        speed_m_s: Median speed of steps of a second or longer; None = too few.
        pixels: 1st and 99th percentiles of u and v, in pixels; None without.
        picture_px: Width and height of the picture.
        cameras: Records by the name of the camera.
        n_ids: Track ids.
        life_s: Median seconds from the first to the last record of an id.
        interval_s: Median seconds between frames.
        zone: Zone in which times without an offset are read; None = all have one.
        zone_from: Who says so: "--zone", "profile", "clock" (vsd.toml) or "assumed".
        time_format: How times are written, in the words of strptime; None = ISO 8601 or numbers.
        first_ms, last_ms: First and last instant of the sample, UTC milliseconds.
        n_second: Records that would be left out as second sightings.
        n_rejected: Records that cannot be used.
        n_dropped: Records left out on purpose, by reason.
        rows: The first rows: `line`, `theirs` (cells by column) and `ours`.
        profile: The `[[source]]` of vsd.toml that says how it is read; None = none.
        warnings: What looks wrong.
        filtered: Values of the columns that `--where` compares, the most frequent first.
    """

    format: str
    n_records: int
    is_whole: bool
    columns: tuple[ColumnUse, ...] = ()
    ignored: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    confidence: str | None = None
    confidence_limit: float | None = None
    floor_m: Extent | None = None
    floor_bounds_m: Extent | None = None
    speed_m_s: float | None = None
    pixels: Extent | None = None
    picture_px: tuple[int, int] | None = None
    cameras: Mapping[str, int] = field(default_factory=dict)
    n_ids: int = 0
    life_s: float | None = None
    interval_s: float | None = None
    zone: str | None = None
    zone_from: str | None = None
    time_format: str | None = None
    first_ms: int | None = None
    last_ms: int | None = None
    n_second: int = 0
    n_rejected: int = 0
    n_dropped: Mapping[str, int] = field(default_factory=dict)
    rows: Sequence[Mapping[str, Any]] = ()
    profile: str | None = None
    warnings: tuple[SourceWarning, ...] = ()
    filtered: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def sure_warnings(self) -> tuple[SourceWarning, ...]:
        """Return the warnings that are almost surely mistakes."""
        return tuple(d for d in self.warnings if d.is_sure)

    @property
    def shape(self) -> str:
        """Return the same text for files whose columns are read alike."""
        columns = [(c.ours, c.theirs, c.unit) for c in self.columns]
        alike = repr((self.format, columns, self.ignored, self.zone, self.zone_from, self.time_format))
        return hashlib.blake2b(alike.encode("utf-8", "backslashreplace"), digest_size=8).hexdigest()


def refused(source: Source, card: SourceProfile) -> InputError:
    """Return the error of a source that is almost surely understood wrongly: E211."""
    sure = card.sure_warnings
    first = sure[0]
    more = f" ({len(sure) - 1} more: {', '.join(d.code for d in sure[1:])})" if len(sure) > 1 else ""
    return InputError(
        f"{source.file_name} was not stored: {first.what}{more}",
        code="E211",
        where=Where(source.name),
        why=first.why,
        fix=f"{first.fix}; --yes stores it as it is",
    )


def table_head(source: Source, reader: Adapter, options: IngestOptions) -> TableHead | None:
    """Return the columns of a source and what the first rows hold in them; None where the user has no say in them."""
    look = getattr(reader, "head", None)
    if look is None:
        return None
    try:
        head: TableHead | None = look(source, options)
    except VsdError:  # reading the source reports it
        return None
    return head


@np.errstate(over="ignore", invalid="ignore")  # absurd numbers are quarantined later
def understand(case: Case, *, name: str) -> SourceProfile:
    """Return what was understood of a source that the adapter `name` reads."""
    sample, head = case.sample, case.head
    plan = None if head is None else head.plan
    lives = sample.lives_s()
    n_of_camera = sample.camera.counts
    usual_cameras = np.argsort(-n_of_camera, kind="stable")[:_CAMERAS_MAX].tolist()
    zone, zone_from = _zone(case)
    like = [] if head is None else named_like(head.ignored, "confidence")
    full = full_score(head.values.get(like[0], ())) if head is not None and like else None
    return SourceProfile(
        format=name,
        n_records=sample.n,
        is_whole=sample.is_whole,
        columns=() if plan is None else tuple(_use(o, t, plan.units) for o, t in plan.names.items()),
        ignored=() if head is None or plan is None else tuple(n for n in head.ignored if n not in plan.compared),
        missing=("track_id",) if plan is not None and not sample.is_pairs and "track_id" not in plan.theirs else (),
        confidence=like[0] if like else None,
        confidence_limit=_LIMIT * full if full is not None else None,
        floor_m=extent(sample.floor_m),
        floor_bounds_m=floor_bounds_m(case),
        speed_m_s=_speed_m_s(sample),
        pixels=extent(sample.picture_px),
        picture_px=picture_px(case),
        cameras={sample.camera.names[no]: int(n_of_camera[no]) for no in usual_cameras},
        n_ids=int(sample.tracked.is_first.sum()),
        life_s=float(np.median(lives)) if len(lives) else None,
        interval_s=sample.interval_s(),
        zone=zone,
        zone_from=zone_from,
        time_format=None if plan is None else plan.time_format,
        first_ms=int(sample.ts_ms.min()) if sample.n else None,
        last_ms=int(sample.ts_ms.max()) if sample.n else None,
        n_second=sample.n_second,
        n_rejected=sample.n_rejected,
        n_dropped=dict(sample.n_dropped),
        rows=_rows(sample, head),
        profile=case.options.profile,
        warnings=warnings_of(case),
        filtered={} if head is None else {n: [v for v, _ in c.most_common(5)] for n, c in head.filtered.items()},
    )


def _speed_m_s(sample: Sample) -> float | None:
    speeds = sample.walked_m_s if sample.has_floor and not sample.is_pairs else np.array([])
    return float(np.median(speeds)) if len(speeds) >= ROWS_MIN else None


def _use(ours: str, theirs: str, units: Mapping[str, str]) -> ColumnUse:
    unit = units.get(ours, "m") if ours in LENGTHS else None
    return ColumnUse("ts" if ours == TIME_OF_DAY else ours, theirs, unit)


def _zone(case: Case) -> tuple[str | None, str | None]:
    zones = sorted(case.sample.zone.names)
    if not zones:
        return None, None
    if case.options.zone is not None:
        profile = next((p for p in case.site.sources if p.rule_id == case.options.profile), None)
        says_profile = profile is not None and profile.zone == case.options.zone
        return case.options.zone, "profile" if says_profile else "--zone"
    is_stated = all(c.has_clock for c in case.cameras)
    return ", ".join(zones), "clock" if is_stated and case.cameras else "assumed"


def _rows(sample: Sample, head: TableHead | None) -> tuple[Mapping[str, Any], ...]:
    rows = []
    for row in range(min(SHOWN_ROWS, sample.n)):
        numbers = (sample.distance_m[row], *sample.floor_m[row], *sample.picture_px[row])
        ours: dict[str, str | float | None]
        ours = {"camera": sample.camera.at(row), "ts_ms": int(sample.ts_ms[row]), "track": sample.track.at(row)}
        ours |= {name: None if np.isnan(v) else float(v) for name, v in zip(_NUMBERS, numbers, strict=True)}
        line = int(sample.line[row])
        rows.append({"line": line, "theirs": {} if head is None else dict(head.rows.get(line, {})), "ours": ours})
    return tuple(rows)
