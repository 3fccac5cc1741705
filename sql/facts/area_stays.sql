-- name: facts/area_stays
-- One row per stay of a track in an area of vsd.toml that asks for visits, within one UTC hour; `visits` stitches them over hours.
-- grain: camera_id, track_id, area_id, started_ms
-- reads: located, visit_cells, cameras, camera_days
-- params: cell_mm, visit_gap_ms, gap_half_intervals
-- columns:
--   hour            UTC hour number
--   camera_id
--   track_id        pseudonym of the engine's track number, of one site day
--   area_id         area of vsd.toml; the first of the file where two overlap
--   started_ms      first record inside, milliseconds since 1970, UTC
--   ended_ms        last record inside
--   interval_ms     frame interval of the camera's day
--   gap_ms          who is away for no longer is still the same visit: visit_gap_s, at least 2.5 frame intervals
--   n_records       records inside
--   before_ms       the track's last record outside, at most gap_ms before it came in; null where it begins inside, or in an earlier hour
--   after_ms        the track's next record outside, at most gap_ms after it went out; null where it ends inside, or in a later hour
--   owned_ms        person-milliseconds inside that this camera counts
--   is_entry_owned  this camera counts the place of the first record
--   is_exit_owned   this camera counts the place of the last record
-- steps:
--   placed       records with a place, and the area it lies in, if any
--   neighboured  the records before and after of a track, wherever they lie, show whether somebody was seen to come and to go
--   inside       only records inside, so that the gap is the time away from the area
-- assumes: a record without floor position says nothing; of two records of a track in one frame, the first by member comes first
with placed as (
    select
        l.camera_id,
        l.track_id,
        l.ts_ms,
        l.member,
        l.weight_ms,
        l.is_owned,
        v.area_id
    from located as l
    cross join params as s
    inner join cameras as c on l.camera_id = c.camera_id
    left join visit_cells as v
        on
            c.floor_id = v.floor_id
            and cast(floor(l.x_mm / s.cell_mm) as integer) = v.cx
            and cast(floor(l.y_mm / s.cell_mm) as integer) = v.cy
            and l.ts_ms >= v.from_ms
            and l.ts_ms < v.to_ms
    where l.track_id is not null and l.x_mm is not null
),

visitors as (
    select distinct
        camera_id,
        track_id
    from placed
    where area_id is not null
),

neighboured as (
    select
        p.camera_id,
        p.track_id,
        p.ts_ms,
        p.member,
        p.weight_ms,
        p.is_owned,
        p.area_id,
        d.interval_ms,
        greatest(s.visit_gap_ms, cast(floor(s.gap_half_intervals * d.interval_ms / 2) as bigint)) as gap_ms,
        lag(p.ts_ms) over track as before_ms,
        lead(p.ts_ms) over track as after_ms
    from placed as p
    cross join params as s
    inner join visitors as v on p.camera_id = v.camera_id and p.track_id = v.track_id
    inner join camera_days as d on p.camera_id = d.camera_id and cast(floor(p.ts_ms / 86400000) as bigint) = d.utc_day
    window track as (partition by p.camera_id, p.track_id order by p.ts_ms, p.member)
),

inside as (
    select
        camera_id,
        track_id,
        area_id,
        cast(floor(ts_ms / 3600000) as bigint) as hour,
        ts_ms,
        member,
        weight_ms,
        is_owned,
        interval_ms,
        gap_ms,
        case when ts_ms - before_ms <= gap_ms then before_ms end as before_ms,
        case when after_ms - ts_ms <= gap_ms then after_ms end as after_ms,
        coalesce(ts_ms - (lag(ts_ms) over stay) <= gap_ms, false) as follows,
        coalesce((lead(ts_ms) over stay) - ts_ms <= gap_ms, false) as is_followed,
        cast(floor((lag(ts_ms) over stay) / 3600000) as bigint) as hour_before
    from neighboured
    where area_id is not null
    window stay as (partition by camera_id, track_id, area_id order by ts_ms, member)
),

stays as (
    select
        camera_id,
        track_id,
        area_id,
        hour,
        ts_ms,
        member,
        weight_ms,
        is_owned,
        interval_ms,
        gap_ms,
        case when not follows then before_ms end as before_ms,
        case when not is_followed then after_ms end as after_ms,
        max(case when follows and hour_before = hour then null else ts_ms end) over (
            partition by camera_id, track_id, area_id order by ts_ms, member rows between unbounded preceding and current row
        ) as started_ms
    from inside
)

select
    hour,
    camera_id,
    track_id,
    area_id,
    started_ms,
    max(ts_ms) as ended_ms,
    max(interval_ms) as interval_ms,
    max(gap_ms) as gap_ms,
    count(*) as n_records,
    min(before_ms) as before_ms,
    max(after_ms) as after_ms,
    cast(sum(case when is_owned then weight_ms else 0 end) as bigint) as owned_ms,
    min_by(is_owned, ts_ms) as is_entry_owned,
    max_by(is_owned, ts_ms) as is_exit_owned
from stays
group by hour, camera_id, track_id, area_id, started_ms
order by hour, camera_id, track_id, area_id, started_ms
