"""What violations of a range are like: how long (M10), how close (M11), close contacts (M12); and tracks (M4, M29)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date
from typing import Any, Final

import numpy as np

from vsd_analytics.answer import Reason, State
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.floor_days import NO_FLOOR, NO_IDS
from vsd_analytics.figures.groups import NOTHING, PURGED
from vsd_analytics.figures.slots import NO_POSITIONS
from vsd_analytics.stats.durations import (
    CloseContacts,
    Distances,
    Durations,
    close_contacts,
    distance_shares,
    durations,
)
from vsd_analytics.warehouse.warehouse import Warehouse

SEED: Final = 1
"""Of the bootstrap, unless another is given: the same days give the same interval."""


@dataclass(frozen=True, slots=True)
class Tracks:
    """Track ids of a range (M4) and how good they are (M29). Tracks are not visitors: one person may have several.

    Attributes:
        n: Track ids, counted once per camera and site day; None when the engine sends none.
        median_life_s: Median from first to last record; None likewise.
        n_records: Person records, the denominator.
        without_id_share: Share of them without a track id; None without records.
        cut_share: Share of ids that end inside the view, where another one begins right then, above what chance gives
            (`stats.groups.track_lives`); None where none ends.
        state, reason: "ok", or why tracks cannot be separated.
    """

    n: int | None
    median_life_s: float | None
    n_records: int
    without_id_share: float | None
    cut_share: float | None
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class EpisodeFigures:
    """What violations are like, and the tracks they were counted by.

    Attributes:
        first, last: First and last local day.
        floor_id: Floor; None = the whole site.
        durations: How long violations that began in opening hours last (M10).
        distances: How close to the nearest person those in violation are, all recorded hours (M11).
        contacts: Pairs with `contact_s` within 24 hours, all recorded hours (M12).
        tracks: Track ids (M4, M29).
    """

    first: date
    last: date
    floor_id: str | None
    durations: Durations
    distances: Distances
    contacts: CloseContacts
    tracks: Tracks


def episode_figures(
    warehouse: Warehouse,
    *,
    floor_id: str | None = None,
    first: date | None = None,
    last: date | None = None,
    seed: int = SEED,
) -> EpisodeFigures:
    """Return how long and how close violations are, close contacts, and the track ids of a range.

    Args:
        warehouse: Its days.
        floor_id: Only cameras of this floor; None = all.
        first: First local day; None = the warehouse's.
        last: Last local day; None = the warehouse's.
        seed: Of the bootstrap of durations.

    Raises:
        UsageError: E101, the site has no such floor.

    Example:
        >>> median = vsd.episode_figures(warehouse).durations.median
        >>> median.lo < median.value < median.hi
        True
    """
    site = warehouse.site
    if floor_id is not None and floor_id not in {f.floor_id for f in site.floors}:
        raise UsageError(f"there is no floor {floor_id!r}", fix=", ".join(f.floor_id for f in site.floors))
    span: dict[str, Any] = {
        "first": first or warehouse.first,
        "last": last or warehouse.last,
        "cameras": [c.camera_id for c in site.cameras if floor_id in (None, c.floor_id)],
    }
    sums = warehouse.rows(_SUMS, span)[0]
    n_violations = None if sums["n_violations"] is None else int(sums["n_violations"])
    return EpisodeFigures(
        first=span["first"],
        last=span["last"],
        floor_id=floor_id,
        durations=_durations(warehouse, span, sums, seed),
        distances=_distances(warehouse, span, sums, n_violations),
        contacts=_contacts(warehouse, span, sums),
        tracks=_tracks(warehouse, span, sums),
    )


def _why(sums: dict[str, Any], *, needs_ids: bool) -> tuple[State, Reason] | None:
    """Return why distances, or with ids violations, cannot be computed; None if they can."""
    if not sums["is_recorded"]:
        return "not_enough_data", NOTHING
    if sums["violation_records"] is None:
        return "not_measurable", NO_FLOOR
    if needs_ids and sums["n_violations"] is None:
        return "not_measurable", NO_IDS
    return None


def _durations(warehouse: Warehouse, span: dict[str, Any], sums: dict[str, Any], seed: int) -> Durations:
    settings = warehouse.site.settings
    rules: dict[str, Any] = {"seed": seed, "sustained_s": settings.sustained_s, **settings.for_intervals}
    if (why := _why(sums, needs_ids=True)) is not None:
        none = durations([], [], None, **rules)
        share = replace(none.long_share, state=why[0], reason=why[1])
        return replace(none, long_share=share, state=why[0], reason=why[1])
    rows = warehouse.table(_DURATIONS, span)
    cut = rows["is_cut"].to_numpy()
    is_known = bool(len(cut)) and rows["is_cut"].null_count == 0
    return durations(
        rows["duration_s"].to_numpy(),
        rows["local_date"].to_numpy().astype("datetime64[D]").astype(np.int64),
        cut.astype(np.bool_) if is_known else None,
        n_days=int(sums["n_days"]),
        **rules,
    )


def _distances(warehouse: Warehouse, span: dict[str, Any], sums: dict[str, Any], n_violations: int | None) -> Distances:
    distance_m = float(warehouse.site.settings.distance_m)
    none = distance_shares([], [], distance_m=distance_m, n_violations=0)
    if (why := _why(sums, needs_ids=False)) is not None:
        return replace(none, state=why[0], reason=why[1])
    rows = warehouse.table(_DISTANCES, span)
    mm, n_pairs = rows["distance_mm"].to_numpy(), rows["n_pairs"].to_numpy()
    if int(n_pairs[mm < round(distance_m * 1000)].sum()) != sums["violation_records"]:
        return replace(none, state="not_measurable", reason=PURGED)
    return distance_shares(mm, rows["nearest_s"].to_numpy(), distance_m=distance_m, n_violations=n_violations)


def _contacts(warehouse: Warehouse, span: dict[str, Any], sums: dict[str, Any]) -> CloseContacts:
    if (why := _why(sums, needs_ids=True)) is not None:
        return CloseContacts(None, 0, None, *why)
    contact_s = warehouse.site.settings.contact_s
    rows = warehouse.table(_EPISODES, {**span, "contact_s": contact_s})
    columns = (rows[name].to_numpy() for name in ("pair", "started_s", "duration_s", "is_long_lived"))
    return close_contacts(*columns, contact_s=contact_s)


def _tracks(warehouse: Warehouse, span: dict[str, Any], sums: dict[str, Any]) -> Tracks:
    if not sums["is_recorded"]:
        return Tracks(None, None, 0, None, None, "not_enough_data", NOTHING)
    row = warehouse.rows(_TRACKS, span)[0]
    n_records = int(row["n_records"])
    if not n_records:
        reason = NO_POSITIONS if sums["person_records"] is None else Reason("nobody.seen")
        state: State = "not_measurable" if sums["person_records"] is None else "not_enough_data"
        return Tracks(None, None, 0, None, None, state, reason)
    if not row["n"]:
        reason = PURGED if row["has_tracks"] else Reason("engine.no_track_ids")
        share = None if row["has_tracks"] else 1.0
        return Tracks(None, None, n_records, share, None, "not_measurable", reason)
    without = max(0, n_records - int(row["n_identified"])) / n_records
    cut = None if row["cut_share"] is None else min(1.0, max(0.0, float(row["cut_share"])))
    return Tracks(int(row["n"]), float(row["median_life_s"]), n_records, without, cut, "ok", None)


_SUMS: Final = """
select
    coalesce(bool_or(recorded_s > 0), false) as is_recorded,
    count(distinct local_date) filter (where recorded_open_s > 0) as n_days,
    sum(person_records)::bigint as person_records,
    sum(violation_records)::bigint as violation_records,
    sum(n_violations)::bigint as n_violations
from camera_hours
where list_contains($cameras::varchar[], camera_id) and local_date between $first and $last
"""
_DURATIONS: Final = """
select
    v.local_date,
    v.duration_s::double as duration_s,
    e.is_cut
from violations as v
inner join episodes as e
    on v.camera_id = e.camera_id and v.track_a = e.track_a and v.track_b = e.track_b and v.started_ms = e.started_ms
where
    v.is_open and list_contains($cameras::varchar[], v.camera_id) and v.local_date between $first and $last
    and e.local_date between $first and $last
order by v.started_ms, v.camera_id, v.track_a, v.track_b
"""
_DISTANCES: Final = """
select
    distance_mm::bigint as distance_mm,
    sum(n_pairs)::bigint as n_pairs,
    sum(nearest_s)::double as nearest_s
from distances
where list_contains($cameras::varchar[], camera_id) and local_date between $first and $last
group by distance_mm
order by distance_mm
"""
_EPISODES: Final = """
with mine as (
    select camera_id, track_a, track_b, started_ms, ended_ms, duration_s
    from episodes
    where is_owned and list_contains($cameras::varchar[], camera_id) and local_date between $first and $last
),

sides as (
    select camera_id, track_a as track_id, started_ms, ended_ms from mine
    union all
    select camera_id, track_b as track_id, started_ms, ended_ms from mine
),

long_lived as (
    select camera_id, track_id
    from sides
    group by camera_id, track_id
    having (max(ended_ms) - min(started_ms)) / 1000 >= $contact_s
)

-- not two joins: DuckDB would join the tracks of a camera with each other first, thirty times the work
select
    dense_rank() over (order by m.camera_id, m.track_a, m.track_b)::bigint as pair,
    m.started_ms / 1000.0::double as started_s,
    m.duration_s::double as duration_s,
    (m.camera_id, m.track_a) in (select (camera_id, track_id) from long_lived)
    and (m.camera_id, m.track_b) in (select (camera_id, track_id) from long_lived) as is_long_lived
from mine as m
order by m.started_ms, m.camera_id, m.track_a, m.track_b
"""
_TRACKS: Final = """
select
    (
        select coalesce(sum(e.person_records + e.n_doubled), 0)::bigint
        from exposure as e
        inner join site_days as s on e.quarter = s.quarter
        where list_contains($cameras::varchar[], e.camera_id) and s.site_day between $first and $last
    ) as n_records,
    count(*) as n,
    coalesce(sum(n_records), 0)::bigint as n_identified,
    median(life_s)::double as median_life_s,
    ((sum(n_goes_on) - sum(n_came_before)) / nullif(sum(n_ends), 0))::double as cut_share,
    (select coalesce(bool_or(has_tracks), false) from camera_days where list_contains($cameras::varchar[], camera_id))
        as has_tracks
from track_days
where list_contains($cameras::varchar[], camera_id) and site_day between $first and $last
"""
