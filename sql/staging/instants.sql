-- name: staging/instants
-- One row per camera and instant at which its engine processed a frame, with the time that the frame represents.
-- grain: camera_id, ts_ms
-- reads: stored_frames, stored_observations, stored_pairs, camera_days
-- params: coverage_gap_ms, next_half_intervals
-- columns:
--   hour           UTC hour number (hours since 1970)
--   camera_id
--   ts_ms          milliseconds since 1970, UTC
--   weight_ms      person-time of one record: to the next frame; one frame interval when that is missing or over two intervals away
--   covered_ms     recorded time that this frame proves: weight_ms with a heartbeat; without one also silences of up to coverage_gap_ms
--   interval_ms    frame interval of the camera's day
--   has_heartbeat  the engine also reports frames without people on this day
-- steps:
--   seen   a record of a person or pair proves a processed frame, also when the engine sends no heartbeat
--   timed  the interval of the day decides whether the next frame is late: up to twice the interval is jitter or one lost frame
-- assumes: neighbouring hours are loaded, so that the next frame is known wherever it matters
with seen as (
    select
        camera_id,
        unix_millis(ts) as ts_ms
    from stored_frames
    union
    select
        camera_id,
        unix_millis(ts) as ts_ms
    from stored_observations
    union
    select
        camera_id,
        unix_millis(ts) as ts_ms
    from stored_pairs
),

ordered as (
    select
        camera_id,
        ts_ms,
        lead(ts_ms) over (partition by camera_id order by ts_ms) - ts_ms as to_next_ms
    from seen
),

timed as (
    select
        ordered.camera_id,
        ordered.ts_ms,
        ordered.to_next_ms,
        camera_days.interval_ms,
        camera_days.has_heartbeat
    from ordered
    inner join camera_days
        on
            ordered.camera_id = camera_days.camera_id
            and cast(floor(ordered.ts_ms / 86400000) as bigint) = camera_days.utc_day
)

select
    cast(floor(timed.ts_ms / 3600000) as bigint) as hour,
    timed.camera_id,
    timed.ts_ms,
    case
        when 2 * timed.to_next_ms <= s.next_half_intervals * timed.interval_ms then timed.to_next_ms
        else timed.interval_ms
    end as weight_ms,
    case
        when 2 * timed.to_next_ms <= s.next_half_intervals * timed.interval_ms then timed.to_next_ms
        when not timed.has_heartbeat and timed.to_next_ms <= s.coverage_gap_ms then timed.to_next_ms
        else timed.interval_ms
    end as covered_ms,
    timed.interval_ms,
    timed.has_heartbeat
from timed
cross join params as s
