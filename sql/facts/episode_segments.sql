-- name: facts/episode_segments
-- One row per run of violation records of one pair within one UTC hour; the mart `episodes` stitches them over hours.
-- grain: camera_id, track_a, track_b, started_ms
-- reads: pairs, camera_days
-- params: distance_mm, episode_gap_ms
-- columns:
--   hour             UTC hour number
--   camera_id
--   track_a          the lesser track id
--   track_b          the greater track id
--   started_ms       first violation record, milliseconds since 1970
--   ended_ms         last violation record
--   interval_ms      frame interval, added once to an episode's duration
--   gap_ms           records of one pair at most this far apart are one run: episode_gap_s, at least 2.5 frame intervals
--   n_records        violation records
--   n_located        those with floor positions
--   sum_x2_mm        sum of x_a + x_b over located records (midpoint = sum / 2 n_located)
--   sum_y2_mm        sum of y_a + y_b over located records
--   min_distance_mm  closest approach
--   sum_distance_mm  sum of distances over n_records
--   n_below_500      records closer than 0.5 m
--   n_below_1000     records closer than 1.0 m
--   n_below_1500     records closer than 1.5 m
--   open_left        the pair's previous violation record lies within gap_ms, in an earlier hour
--   open_right       the pair's next violation record lies within gap_ms, in a later hour
-- assumes: both persons carry track ids; pairs without ids have no episodes
with close as (
    select
        p.hour,
        p.camera_id,
        least(p.track_a, p.track_b) as track_a,
        greatest(p.track_a, p.track_b) as track_b,
        p.ts_ms,
        d.interval_ms,
        greatest(s.episode_gap_ms, cast(floor(5 * d.interval_ms / 2) as bigint)) as gap_ms,
        cast(p.x_a_mm + p.x_b_mm as bigint) as x2_mm,
        cast(p.y_a_mm + p.y_b_mm as bigint) as y2_mm,
        p.distance_mm
    from pairs as p
    cross join params as s
    inner join camera_days as d on p.camera_id = d.camera_id and cast(floor(p.ts_ms / 86400000) as bigint) = d.utc_day
    where p.distance_mm < s.distance_mm and p.track_a is not null and p.track_b is not null
),

neighboured as (
    select
        hour,
        camera_id,
        track_a,
        track_b,
        ts_ms,
        interval_ms,
        gap_ms,
        x2_mm,
        y2_mm,
        distance_mm,
        ts_ms - lag(ts_ms) over (partition by camera_id, track_a, track_b order by ts_ms) <= gap_ms as follows,
        lead(ts_ms) over (partition by camera_id, track_a, track_b order by ts_ms) - ts_ms <= gap_ms as is_followed
    from close
),

numbered as (
    select
        hour,
        camera_id,
        track_a,
        track_b,
        ts_ms,
        interval_ms,
        gap_ms,
        x2_mm,
        y2_mm,
        distance_mm,
        coalesce(follows, false) as follows,
        coalesce(is_followed, false) as is_followed,
        sum(case when follows then 0 else 1 end) over (
            partition by camera_id, track_a, track_b order by ts_ms rows between unbounded preceding and current row
        ) as run
    from neighboured
)

select
    hour,
    camera_id,
    track_a,
    track_b,
    min(ts_ms) as started_ms,
    max(ts_ms) as ended_ms,
    max(interval_ms) as interval_ms,
    max(gap_ms) as gap_ms,
    count(*) as n_records,
    count(x2_mm) as n_located,
    cast(coalesce(sum(x2_mm), 0) as bigint) as sum_x2_mm,
    cast(coalesce(sum(y2_mm), 0) as bigint) as sum_y2_mm,
    min(distance_mm) as min_distance_mm,
    cast(sum(distance_mm) as bigint) as sum_distance_mm,
    count(*) filter (where distance_mm < 500) as n_below_500,
    count(*) filter (where distance_mm < 1000) as n_below_1000,
    count(*) filter (where distance_mm < 1500) as n_below_1500,
    min_by(follows, ts_ms) as open_left,
    max_by(is_followed, ts_ms) as open_right
from numbered
group by hour, camera_id, track_a, track_b, run
order by hour, camera_id, track_a, track_b, started_ms
