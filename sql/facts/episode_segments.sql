-- name: facts/episode_segments
-- One row per run of violation records of one pair of one camera within one UTC hour; `camera_episodes` stitches them over hours.
-- grain: camera_id, track_a, track_b, started_ms
-- reads: close_records, instants, located
-- params: distance_mm
-- columns:
--   hour             UTC hour number
--   camera_id
--   track_a          the lesser track id
--   track_b          the greater track id
--   started_ms       first violation record, milliseconds since 1970
--   ended_ms         last violation record
--   interval_ms      frame interval
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
--   before_ms        how long before started_ms they came closer than distance_m; null when the frame before does not tell
--   after_ms         how long after ended_ms they parted; null when the frame after does not tell
--   n_owned          violation records that this camera counts, because it owns their midpoint
--   owned_from_ms    first of these
--   owned_to_ms      last of these
--   n_owned_located  those of n_owned with floor positions
--   owned_x2_mm      sum of x_a + x_b over these
--   owned_y2_mm      sum of y_a + y_b over these
-- assumes: from one frame to the next, at most two intervals on, people walk straight on; pairs without ids have no episodes
with segments as (
    select
        hour,
        camera_id,
        track_a,
        track_b,
        started_ms,
        max(ts_ms) as ended_ms,
        max(interval_ms) as interval_ms,
        max(gap_ms) as gap_ms,
        count(*) as n_records,
        count(x_a_mm + x_b_mm) as n_located,
        cast(coalesce(sum(cast(x_a_mm + x_b_mm as bigint)), 0) as bigint) as sum_x2_mm,
        cast(coalesce(sum(cast(y_a_mm + y_b_mm as bigint)), 0) as bigint) as sum_y2_mm,
        min(distance_mm) as min_distance_mm,
        cast(sum(distance_mm) as bigint) as sum_distance_mm,
        count(*) filter (where distance_mm < 500) as n_below_500,
        count(*) filter (where distance_mm < 1000) as n_below_1000,
        count(*) filter (where distance_mm < 1500) as n_below_1500,
        min_by(follows, ts_ms) as open_left,
        max_by(is_followed, ts_ms) as open_right,
        count(*) filter (where is_owned) as n_owned,
        min(ts_ms) filter (where is_owned) as owned_from_ms,
        max(ts_ms) filter (where is_owned) as owned_to_ms,
        count(x_a_mm + x_b_mm) filter (where is_owned) as n_owned_located,
        cast(coalesce(sum(cast(x_a_mm + x_b_mm as bigint)) filter (where is_owned), 0) as bigint) as owned_x2_mm,
        cast(coalesce(sum(cast(y_a_mm + y_b_mm as bigint)) filter (where is_owned), 0) as bigint) as owned_y2_mm
    from close_records
    group by hour, camera_id, track_a, track_b, started_ms
),

frames as (
    select
        camera_id,
        ts_ms,
        lag(ts_ms) over (partition by camera_id order by ts_ms) as before_ms,
        lead(ts_ms) over (partition by camera_id order by ts_ms) as after_ms
    from instants
),

ends as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        true as is_start,
        interval_ms,
        ts_ms,
        x_a_mm - x_b_mm as x_mm,
        y_a_mm - y_b_mm as y_mm
    from close_records
    where not follows
    union all
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        false as is_start,
        interval_ms,
        ts_ms,
        x_a_mm - x_b_mm as x_mm,
        y_a_mm - y_b_mm as y_mm
    from close_records
    where not is_followed
),

beside as (
    select
        e.camera_id,
        e.track_a,
        e.track_b,
        e.started_ms,
        e.is_start,
        e.interval_ms,
        e.ts_ms,
        e.x_mm,
        e.y_mm,
        case when e.is_start then f.before_ms else f.after_ms end as beside_ms
    from ends as e
    inner join frames as f on e.camera_id = f.camera_id and e.ts_ms = f.ts_ms
),

-- from a to b: where b stands seen from a, and how far that place moves to the frame beside
moved as (
    select
        e.camera_id,
        e.track_a,
        e.track_b,
        e.started_ms,
        e.is_start,
        abs(e.beside_ms - e.ts_ms) as step_ms,
        cast(e.x_mm as double) as x_mm,
        cast(e.y_mm as double) as y_mm,
        cast(a.x_mm - b.x_mm - e.x_mm as double) as dx_mm,
        cast(a.y_mm - b.y_mm - e.y_mm as double) as dy_mm
    from beside as e
    inner join located as a on e.camera_id = a.camera_id and e.beside_ms = a.ts_ms and e.track_a = a.track_id
    inner join located as b on e.camera_id = b.camera_id and e.beside_ms = b.ts_ms and e.track_b = b.track_id
    where abs(e.beside_ms - e.ts_ms) <= 2 * e.interval_ms
),

-- |place + share * move| = distance is a square equation of the share: a * share^2 + 2 * b * share + c = 0 with c < 0
squares as (
    select
        m.camera_id,
        m.track_a,
        m.track_b,
        m.started_ms,
        m.is_start,
        m.step_ms,
        m.dx_mm * m.dx_mm + m.dy_mm * m.dy_mm as a,
        m.x_mm * m.dx_mm + m.y_mm * m.dy_mm as b,
        m.x_mm * m.x_mm + m.y_mm * m.y_mm - s.distance_mm * s.distance_mm as c
    from moved as m
    cross join params as s
),

crossings as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        is_start,
        cast(round(min(step_ms * (sqrt(b * b - a * c) - b) / a)) as bigint) as lead_ms
    from squares
    where c < 0 and a + 2 * b + c >= 0
    group by camera_id, track_a, track_b, started_ms, is_start
)

select
    g.hour,
    g.camera_id,
    g.track_a,
    g.track_b,
    g.started_ms,
    g.ended_ms,
    g.interval_ms,
    g.gap_ms,
    g.n_records,
    g.n_located,
    g.sum_x2_mm,
    g.sum_y2_mm,
    g.min_distance_mm,
    g.sum_distance_mm,
    g.n_below_500,
    g.n_below_1000,
    g.n_below_1500,
    g.open_left,
    g.open_right,
    b.lead_ms as before_ms,
    a.lead_ms as after_ms,
    g.n_owned,
    g.owned_from_ms,
    g.owned_to_ms,
    g.n_owned_located,
    g.owned_x2_mm,
    g.owned_y2_mm
from segments as g
left join crossings as b
    on
        b.is_start
        and g.camera_id = b.camera_id
        and g.track_a = b.track_a
        and g.track_b = b.track_b
        and g.started_ms = b.started_ms
left join crossings as a
    on
        not a.is_start
        and g.camera_id = a.camera_id
        and g.track_a = a.track_a
        and g.track_b = a.track_b
        and g.started_ms = a.started_ms
order by g.hour, g.camera_id, g.track_a, g.track_b, g.started_ms
