"""The fact `camera_days`, one file for each UTC day, and the units of the hours, whose inputs follow from its rows."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.site.model import Site
from vsd_analytics.store.seals import DAY_FACT
from vsd_analytics.warehouse.dimensions import params
from vsd_analytics.warehouse.fact_days import slices
from vsd_analytics.warehouse.fact_weeks import FactWeeks
from vsd_analytics.warehouse.factfiles import damaged_facts, fact_bytes
from vsd_analytics.warehouse.input_fingerprint import FactInputs, InputHashes, SiteInputs, fact_inputs, text_hash
from vsd_analytics.warehouse.lookback import NearParts, Spans, lookback_ms, noted_spans, spans_of
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.staff import NOBODY, StaffHours
from vsd_analytics.warehouse.units import PartIndex, Unit, day_unit, days_around, fact_path, hour_unit


@dataclass(frozen=True, slots=True)
class KnownDay:
    """The fact of one UTC day.

    Attributes:
        unit: Its unit.
        rows: Its rows.
        digest: Hash of the rows.
        cameras: Cameras with records.
        lookback_ms: How far beyond an hour of the day its facts read records.
        spans: Of parts of the day that share an hour and a table. The first day of a week's file has those of all its
            days.
    """

    unit: Unit
    rows: pa.Table
    digest: str
    cameras: frozenset[str]
    lookback_ms: int
    spans: Spans


def hourly_inputs(site: Site) -> FactInputs:
    """Return what the hourly facts together depend on: hashes of SQL and settings, and which other inputs they read."""
    return fact_inputs(site, [r.name for r in relations("facts").values() if r.unit == "hour"])


def day_units(index: PartIndex, hours: Iterable[int], *, site: Site) -> list[Unit]:
    """Return the units of the UTC days of some hours and of their neighbours; days without parts have none."""
    days = sorted({d for h in hours for d in days_around(h)})
    current, depends_on = SiteInputs(site).of_day(), fact_inputs(site, [DAY_FACT])
    units = (day_unit(index, day, current=current, depends_on=depends_on) for day in days)
    return [u for u in units if any(u.parts.values())]


def day_path(site: Site, unit: Unit) -> Path:
    """Return the path of the fact of a UTC day."""
    return fact_path(site.root / "facts", DAY_FACT, site.site_id, unit, is_day=True)


def weeks_of_days(site: Site) -> FactWeeks:
    """Return the week files of the fact."""
    return FactWeeks(site.root / "facts", DAY_FACT, site.site_id)


def joined_days(
    site: Site, units: Iterable[Unit], *, first_day: int | None, last_day: int | None, without: Collection[int]
) -> dict[int, Path]:
    """Join the files of weeks that are over; return the file with the rows of each day. See `FactWeeks.join`."""
    weeks = weeks_of_days(site)
    own = weeks.joined_paths({unit.number: day_path(site, unit) for unit in units})
    return weeks.join(own, first_day=first_day, last_day=last_day, without=without)


def day_bytes(unit: Unit, rows: pa.Table) -> bytes:
    """Return the bytes of its file."""
    return fact_bytes(rows, inputs=unit.inputs, noted=noted_spans(unit.parts))


def read_days(site: Site, units: Iterable[Unit]) -> dict[int, KnownDay]:
    """Return the fact of UTC days whose files are there, by UTC day number.

    Raises:
        StoreError: E302, a file is damaged.
    """
    settings = params(site)
    units_of = {unit.number: unit for unit in units}
    days_in: dict[Path, list[int]] = defaultdict(list)
    own_paths = {day: day_path(site, unit) for day, unit in units_of.items()}
    for day, path in weeks_of_days(site).joined_paths(own_paths).items():
        days_in[path].append(day)
    known_days = {}
    for path, days in days_in.items():
        try:
            # a report opens many of these small files, and bytes are opened faster than a path
            data = path.read_bytes()
            with pq.ParquetFile(pa.BufferReader(data), pre_buffer=False) as file:
                rows, spans = file.read(use_threads=False), spans_of(file.metadata.metadata)
        except (pa.ArrowException, OSError) as error:
            raise damaged_facts(error) from None
        for day, own in slices(rows, "utc_day", days):
            known = own.to_pylist()
            cameras = frozenset(row["camera_id"] for row in known)
            of_day = KnownDay(units_of[day], own, text_hash(known), cameras, lookback_ms(settings, known), spans)
            known_days[day], spans = of_day, {}
    return {day: known_days[day] for day in units_of}


def hour_units(
    site: Site, index: PartIndex, hours: Iterable[int], days: Mapping[int, KnownDay], staff: StaffHours = NOBODY
) -> list[Unit]:
    """Return the units of hours, given the days they and their neighbours lie in, and who is staff."""
    times, inputs = SiteInputs(site), hourly_inputs(site)
    near = NearParts(index, {digest: span for day in days.values() for digest, span in day.spans.items()})
    units = []
    for hour in hours:
        around = [days[d] for d in days_around(hour) if d in days]
        parts = near(hour, max((day.lookback_ms for day in around), default=0))
        units.append(
            hour_unit(index, hour, near=parts, current=_current(hour, around, times, staff), depends_on=inputs)
        )
    return units


def _current(hour: int, around: Sequence[KnownDay], times: SiteInputs, staff: StaffHours) -> InputHashes:
    """Return the hashes of an hour's inputs besides records, SQL and settings, given the days around it."""
    present = frozenset[str]().union(*(day.cameras for day in around))
    intervals = text_hash([day.digest for day in around])
    return {**times.of_hour(hour, present=present), "frame interval": intervals, "staff": staff.digest(hour)}
