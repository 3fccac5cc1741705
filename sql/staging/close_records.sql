-- name: staging/close_records
-- One row per violation record of a pair with track ids, with the run it belongs to: a run has no gap longer than gap_ms.
-- grain: camera_id, track_a, track_b, ts_ms
-- reads: pairs, camera_days
-- params: distance_mm, parting_mm, episode_gap_ms, gap_half_intervals
-- columns:
--   hour         UTC hour number
--   camera_id
--   track_a      the lesser track id
--   track_b      the greater track id
--   ts_ms        milliseconds since 1970, UTC
--   started_ms   first record of its run in this hour
--   weight_ms    time that the frame represents
--   interval_ms  frame interval of the camera's day
--   gap_ms       episode_gap_s, at least 2.5 frame intervals
--   x_a_mm       place of track_a, floor millimetres, null when unknown
--   y_a_mm       likewise
--   x_b_mm       place of track_b
--   y_b_mm       likewise
--   distance_mm  less than distance_m
--   is_owned     false where another camera counts it, because it sees the midpoint better
--   follows      the run has a record before this one
--   is_followed  the run has a record after this one
--   near_from_ms  since when the pair has not parted: a stretch with no gap longer than gap_ms; at most gap_ms before the hour
--   near_to_ms   until when; at most gap_ms after the hour
--   next_ms      the pair's next record, whether of this run or not
--   next_x_a_mm  place of track_a in that
--   next_y_a_mm  likewise
--   next_x_b_mm  place of track_b
--   next_y_b_mm  likewise
-- steps:
--   near         2.5 frame intervals: one lost frame does not cut a run, whatever the frame rate; the lesser track id comes first,
--                with its place
--   stretches    a pair parts only 0.3 m beyond distance_m: nearer, an error of a place looks like parting and meeting again
--   neighboured  the next record is read beyond the run, because same_pairs interpolates towards it
-- assumes: both persons carry track ids; pairs without ids are in no run
with near as (
    select
        p.hour,
        p.camera_id,
        p.ts_ms,
        p.weight_ms,
        d.interval_ms,
        greatest(s.episode_gap_ms, cast(floor(s.gap_half_intervals * d.interval_ms / 2) as bigint)) as gap_ms,
        p.distance_mm,
        p.is_owned,
        least(p.track_a, p.track_b) as track_a,
        greatest(p.track_a, p.track_b) as track_b,
        case when p.track_a <= p.track_b then p.x_a_mm else p.x_b_mm end as x_a_mm,
        case when p.track_a <= p.track_b then p.y_a_mm else p.y_b_mm end as y_a_mm,
        case when p.track_a <= p.track_b then p.x_b_mm else p.x_a_mm end as x_b_mm,
        case when p.track_a <= p.track_b then p.y_b_mm else p.y_a_mm end as y_b_mm
    from pairs as p
    cross join params as s
    inner join camera_days as d on p.camera_id = d.camera_id and cast(floor(p.ts_ms / 86400000) as bigint) = d.utc_day
    where p.distance_mm < s.distance_mm + s.parting_mm and p.track_a is not null and p.track_b is not null
),

begun as (
    select
        hour,
        camera_id,
        track_a,
        track_b,
        ts_ms,
        weight_ms,
        interval_ms,
        gap_ms,
        x_a_mm,
        y_a_mm,
        x_b_mm,
        y_b_mm,
        distance_mm,
        is_owned,
        case
            when ts_ms - lag(ts_ms) over (partition by camera_id, track_a, track_b order by ts_ms) <= gap_ms then 0 else 1
        end as is_begun
    from near
),

stretches as (
    select
        hour,
        camera_id,
        track_a,
        track_b,
        ts_ms,
        weight_ms,
        interval_ms,
        gap_ms,
        x_a_mm,
        y_a_mm,
        x_b_mm,
        y_b_mm,
        distance_mm,
        is_owned,
        sum(is_begun) over (
            partition by camera_id, track_a, track_b order by ts_ms rows between unbounded preceding and current row
        ) as stretch
    from begun
),

close as (
    select
        n.hour,
        n.camera_id,
        n.track_a,
        n.track_b,
        n.ts_ms,
        n.weight_ms,
        n.interval_ms,
        n.gap_ms,
        n.x_a_mm,
        n.y_a_mm,
        n.x_b_mm,
        n.y_b_mm,
        n.distance_mm,
        n.is_owned,
        greatest(n.from_ms, 3600000 * n.hour - n.gap_ms) as near_from_ms,
        least(n.to_ms, 3600000 * (n.hour + 1) + n.gap_ms) as near_to_ms
    from (
        select
            hour,
            camera_id,
            track_a,
            track_b,
            ts_ms,
            weight_ms,
            interval_ms,
            gap_ms,
            x_a_mm,
            y_a_mm,
            x_b_mm,
            y_b_mm,
            distance_mm,
            is_owned,
            min(ts_ms) over (partition by camera_id, track_a, track_b, stretch) as from_ms,
            max(ts_ms) over (partition by camera_id, track_a, track_b, stretch) as to_ms
        from stretches
    ) as n
    cross join params as s
    where n.distance_mm < s.distance_mm
),

neighboured as (
    select
        hour,
        camera_id,
        track_a,
        track_b,
        ts_ms,
        weight_ms,
        interval_ms,
        gap_ms,
        x_a_mm,
        y_a_mm,
        x_b_mm,
        y_b_mm,
        distance_mm,
        is_owned,
        near_from_ms,
        near_to_ms,
        ts_ms - lag(ts_ms) over (partition by camera_id, track_a, track_b order by ts_ms) <= gap_ms as follows,
        lag(hour) over (partition by camera_id, track_a, track_b order by ts_ms) as hour_before,
        lead(ts_ms) over (partition by camera_id, track_a, track_b order by ts_ms) as next_ms,
        lead(x_a_mm) over (partition by camera_id, track_a, track_b order by ts_ms) as next_x_a_mm,
        lead(y_a_mm) over (partition by camera_id, track_a, track_b order by ts_ms) as next_y_a_mm,
        lead(x_b_mm) over (partition by camera_id, track_a, track_b order by ts_ms) as next_x_b_mm,
        lead(y_b_mm) over (partition by camera_id, track_a, track_b order by ts_ms) as next_y_b_mm
    from close
)

select
    hour,
    camera_id,
    track_a,
    track_b,
    ts_ms,
    max(case when follows and hour_before = hour then null else ts_ms end) over (
        partition by camera_id, track_a, track_b order by ts_ms rows between unbounded preceding and current row
    ) as started_ms,
    weight_ms,
    interval_ms,
    gap_ms,
    x_a_mm,
    y_a_mm,
    x_b_mm,
    y_b_mm,
    distance_mm,
    is_owned,
    coalesce(follows, false) as follows,
    coalesce(next_ms - ts_ms <= gap_ms, false) as is_followed,
    near_from_ms,
    near_to_ms,
    next_ms,
    next_x_a_mm,
    next_y_a_mm,
    next_x_b_mm,
    next_y_b_mm
from neighboured
