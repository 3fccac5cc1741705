-- name: facts/track_pairs
-- One row per pair of tracks and UTC hour in which they were closer than distance_m: records, time, and first and last midpoint.
-- grain: hour, camera_id, track_a, track_b
-- reads: pairs, standing_tracks
-- params: distance_mm, together_mm, company_window_ms
-- columns:
--   hour          UTC hour number
--   camera_id
--   track_a       the lesser track id
--   track_b       the greater track id
--   n_records     violation records, also those another camera counts
--   n_near        those at most together_m apart
--   violation_ms  time the pair was in violation: sum of the weights of its records
--   standing_ms   that in windows in which they stand in one company; null in hours sealed by older versions
--   first_ms      first violation record with positions, milliseconds since 1970, UTC; null without any
--   first_x2_mm   x_a + x_b of it: its midpoint is half of that
--   first_y2_mm   y_a + y_b of it
--   last_ms       last violation record with positions
--   last_x2_mm    x_a + x_b of it
--   last_y2_mm    y_a + y_b of it
-- assumes: both persons carry track ids; two records with the same id in one frame are no pair
with close as (
    select
        p.hour,
        p.camera_id,
        least(p.track_a, p.track_b) as track_a,
        greatest(p.track_a, p.track_b) as track_b,
        p.ts_ms,
        p.weight_ms,
        case when a.group_id = b.group_id then p.weight_ms else 0 end as standing_ms,
        cast(p.x_a_mm + p.x_b_mm as bigint) as x2_mm,
        cast(p.y_a_mm + p.y_b_mm as bigint) as y2_mm,
        case when p.distance_mm <= s.together_mm then 1 else 0 end as is_near
    from pairs as p
    cross join params as s
    left join standing_tracks as a
        on
            p.camera_id = a.camera_id
            and cast(floor(p.ts_ms / s.company_window_ms) as bigint) * s.company_window_ms = a.window_ms
            and p.track_a = a.track_id
    left join standing_tracks as b on a.camera_id = b.camera_id and a.window_ms = b.window_ms and p.track_b = b.track_id
    where p.distance_mm < s.distance_mm and p.track_a <> p.track_b
)

select
    hour,
    camera_id,
    track_a,
    track_b,
    count(*) as n_records,
    cast(sum(is_near) as bigint) as n_near,
    cast(sum(weight_ms) as bigint) as violation_ms,
    cast(sum(standing_ms) as bigint) as standing_ms,
    min(ts_ms) filter (where x2_mm is not null) as first_ms,
    min_by(x2_mm, ts_ms) filter (where x2_mm is not null) as first_x2_mm,
    min_by(y2_mm, ts_ms) filter (where x2_mm is not null) as first_y2_mm,
    max(ts_ms) filter (where x2_mm is not null) as last_ms,
    max_by(x2_mm, ts_ms) filter (where x2_mm is not null) as last_x2_mm,
    max_by(y2_mm, ts_ms) filter (where x2_mm is not null) as last_y2_mm
from close
group by hour, camera_id, track_a, track_b
order by hour, camera_id, track_a, track_b
