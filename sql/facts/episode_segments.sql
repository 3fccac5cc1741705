-- name: facts/episode_segments
-- One row per run of violation records of one pair of one camera within one UTC hour; `camera_episodes` stitches them over hours.
-- grain: camera_id, track_a, track_b, started_ms
-- reads: close_records, instants, located
-- params: distance_mm, gap_half_intervals, next_half_intervals
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
--   before_ms        how long before started_ms they came closer than distance_m; null when the frame before does not show it
--   after_ms         how long after ended_ms they parted; null when the frame after does not show it
--   near_from_ms     since when the pair has not parted (close_records)
--   near_to_ms       until when
--   n_owned          violation records that this camera counts, because it owns their midpoint
--   owned_from_ms    first of these
--   owned_to_ms      last of these
--   n_owned_located  those of n_owned with floor positions
--   owned_x2_mm      sum of x_a + x_b over these
--   owned_y2_mm      sum of y_a + y_b over these
-- steps:
--   segments   sums of x_a + x_b stay whole numbers, so that stitched segments give exactly the midpoint of an episode that was never
--              cut
--   frames     frames of the camera, with or without the pair: only a frame in which both stand farther apart shows when they parted
--   ends       both ends are computed alike, with time running outwards from the run
--   around     a frame beside the end may be two frame intervals off (4 halves), so that one lost frame does not hide the crossing; the
--              frame beyond two and a half
--   middles    people turn while they pass, so a straight line between two frames dates the crossing wrongly; a cubic through both
--              places with the speeds at both follows the turn, and its middle is all the next steps need
--   halves     the cubic is replaced by two straight halves, because the crossing of a straight line has a closed form
--   squares    c < 0 as the line starts inside distance_m, and a > 0 as it leaves it: exactly one root is positive
--   crossings  share = (sqrt(b^2 - a c) - b) / a is that root; no row for an end whose frames do not show it, so its time is null
-- assumes: over a step of at most two frame intervals people walk straight to the middle of a cubic, then on; episodes need track ids
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
        min(near_from_ms) as near_from_ms,
        max(near_to_ms) as near_to_ms,
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
        lag(ts_ms, 2) over (partition by camera_id order by ts_ms) as before_last_ms,
        lag(ts_ms) over (partition by camera_id order by ts_ms) as last_ms,
        lead(ts_ms) over (partition by camera_id order by ts_ms) as next_ms,
        lead(ts_ms, 2) over (partition by camera_id order by ts_ms) as after_next_ms
    from instants
),

-- both ends of a run
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

-- the frames around an end, counted outwards, and how far off they may be: 1 beside it, where they are apart, 2 beyond that, -1 behind it
around as (
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
        n.number,
        n.n_half_intervals,
        case
            when n.number = 2 and e.is_start then f.before_last_ms
            when n.number = 2 then f.after_next_ms
            when n.number = 1 and e.is_start or n.number = -1 and not e.is_start then f.last_ms
            else f.next_ms
        end as frame_ms
    from ends as e
    inner join frames as f on e.camera_id = f.camera_id and e.ts_ms = f.ts_ms
    cross join (
        select
            1 as number,
            params.next_half_intervals as n_half_intervals
        from params
        union all
        select
            2 as number,
            params.gap_half_intervals as n_half_intervals
        from params
        union all
        select
            -1 as number,
            params.next_half_intervals as n_half_intervals
        from params
    ) as n
),

-- where b stands seen from a: at the end itself, and in these frames
places as (
    select
        e.camera_id,
        e.track_a,
        e.track_b,
        e.started_ms,
        e.is_start,
        e.number,
        cast(abs(e.frame_ms - e.ts_ms) as integer) as away_ms,
        e.x_mm as end_x_mm,
        e.y_mm as end_y_mm,
        a.x_mm - b.x_mm as x_mm,
        a.y_mm - b.y_mm as y_mm
    from around as e
    inner join located as a on e.camera_id = a.camera_id and e.frame_ms = a.ts_ms and e.track_a = a.track_id
    inner join located as b on e.camera_id = b.camera_id and e.frame_ms = b.ts_ms and e.track_b = b.track_id
    where 2 * abs(e.frame_ms - e.ts_ms) <= e.n_half_intervals * e.interval_ms
),

steps as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        is_start,
        cast(min(away_ms) filter (where number = 1) as double) as step_ms,
        cast(min(away_ms) filter (where number = 2) as double) as beyond_ms,
        cast(min(away_ms) filter (where number = -1) as double) as behind_ms,
        cast(min(end_x_mm) as double) as x_mm,
        cast(min(end_y_mm) as double) as y_mm,
        cast(min(x_mm) filter (where number = 1) as double) as beside_x_mm,
        cast(min(y_mm) filter (where number = 1) as double) as beside_y_mm,
        cast(min(x_mm) filter (where number = 2) as double) as beyond_x_mm,
        cast(min(y_mm) filter (where number = 2) as double) as beyond_y_mm,
        cast(min(x_mm) filter (where number = -1) as double) as behind_x_mm,
        cast(min(y_mm) filter (where number = -1) as double) as behind_y_mm
    from places
    group by camera_id, track_a, track_b, started_ms, is_start
),

-- the cubic from place r to r' with the speeds v and v' is half way at (r + r') / 2 + step * (v - v') / 8; v is the speed from the frame
-- behind to the one beside, v' from the end to the frame beyond, and either is that of the step itself where nothing else is known
middles as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        is_start,
        step_ms,
        x_mm,
        y_mm,
        beside_x_mm,
        beside_y_mm,
        (x_mm + beside_x_mm) / 2
        + step_ms / 8 * coalesce((beside_x_mm - behind_x_mm) / (behind_ms + step_ms), (beside_x_mm - x_mm) / step_ms)
        - step_ms / 8 * coalesce((beyond_x_mm - x_mm) / beyond_ms, (beside_x_mm - x_mm) / step_ms) as middle_x_mm,
        (y_mm + beside_y_mm) / 2
        + step_ms / 8 * coalesce((beside_y_mm - behind_y_mm) / (behind_ms + step_ms), (beside_y_mm - y_mm) / step_ms)
        - step_ms / 8 * coalesce((beyond_y_mm - y_mm) / beyond_ms, (beside_y_mm - y_mm) / step_ms) as middle_y_mm
    from steps
    cross join params
    where
        x_mm * x_mm + y_mm * y_mm < params.distance_mm * params.distance_mm
        and beside_x_mm * beside_x_mm + beside_y_mm * beside_y_mm >= params.distance_mm * params.distance_mm
),

-- the half of the step in which the distance is crossed: when it begins, from where, and how far that place moves
halves as (
    select
        m.camera_id,
        m.track_a,
        m.track_b,
        m.started_ms,
        m.is_start,
        m.step_ms / 2 as half_ms,
        m.middle_x_mm * m.middle_x_mm + m.middle_y_mm * m.middle_y_mm < s.distance_mm * s.distance_mm as is_second,
        m.x_mm,
        m.y_mm,
        m.middle_x_mm,
        m.middle_y_mm,
        m.beside_x_mm,
        m.beside_y_mm,
        s.distance_mm
    from middles as m
    cross join params as s
),

moved as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        is_start,
        half_ms,
        case when is_second then half_ms else 0 end as from_ms,
        case when is_second then middle_x_mm else x_mm end as x_mm,
        case when is_second then middle_y_mm else y_mm end as y_mm,
        case when is_second then beside_x_mm - middle_x_mm else middle_x_mm - x_mm end as dx_mm,
        case when is_second then beside_y_mm - middle_y_mm else middle_y_mm - y_mm end as dy_mm,
        distance_mm
    from halves
),

-- |place + share * move| = distance is a square equation of the share: a * share^2 + 2 * b * share + c = 0 with c < 0
squares as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        is_start,
        from_ms,
        half_ms,
        dx_mm * dx_mm + dy_mm * dy_mm as a,
        x_mm * dx_mm + y_mm * dy_mm as b,
        x_mm * x_mm + y_mm * y_mm - distance_mm * distance_mm as c
    from moved
),

crossings as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        cast(round(min(from_ms + half_ms * (sqrt(b * b - a * c) - b) / a) filter (where is_start)) as bigint) as before_ms,
        cast(round(min(from_ms + half_ms * (sqrt(b * b - a * c) - b) / a) filter (where not is_start)) as bigint) as after_ms
    from squares
    group by camera_id, track_a, track_b, started_ms
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
    c.before_ms,
    c.after_ms,
    g.near_from_ms,
    g.near_to_ms,
    g.n_owned,
    g.owned_from_ms,
    g.owned_to_ms,
    g.n_owned_located,
    g.owned_x2_mm,
    g.owned_y2_mm
from segments as g
left join crossings as c
    on
        g.camera_id = c.camera_id
        and g.track_a = c.track_a
        and g.track_b = c.track_b
        and g.started_ms = c.started_ms
order by g.hour, g.camera_id, g.track_a, g.track_b, g.started_ms
