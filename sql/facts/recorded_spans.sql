-- name: facts/recorded_spans
-- One row per camera and unbroken run of recorded time within one UTC hour.
-- stored_by: utc_day
-- grain: camera_id, started_ms
-- reads: instants
-- columns:
--   hour           UTC hour number
--   camera_id
--   started_ms     first instant, milliseconds since 1970, UTC
--   ended_ms       end of the time the last frame of the run covers
--   is_inferred    true when the engine sends no heartbeat
-- steps:
--   starts   a run ends where the time that a frame covers does not reach the next frame
--   lasting  a run ends where the frame before the next run ends; the last one ends with the hour's last frame
-- assumes: an hour of a camera has a heartbeat or not; a run is cut at every UTC hour, so that an hour depends on its own records
with marked as (
    select
        hour,
        camera_id,
        ts_ms,
        has_heartbeat,
        lag(ts_ms + covered_ms) over (partition by camera_id, hour order by ts_ms) as before_ms
    from instants
),

starts as (
    select
        hour,
        camera_id,
        ts_ms,
        before_ms,
        has_heartbeat
    from marked
    where before_ms is null or before_ms < ts_ms
),

lasting as (
    select
        hour,
        camera_id,
        ts_ms,
        lead(before_ms) over (partition by camera_id, hour order by ts_ms) as ended_ms,
        has_heartbeat
    from starts
),

hour_ends as (
    select
        hour,
        camera_id,
        max(ts_ms + covered_ms) as ended_ms
    from instants
    group by hour, camera_id
)

select
    l.hour,
    l.camera_id,
    l.ts_ms as started_ms,
    coalesce(l.ended_ms, e.ended_ms) as ended_ms,
    not l.has_heartbeat as is_inferred
from lasting as l
inner join hour_ends as e on l.hour = e.hour and l.camera_id = e.camera_id
order by l.hour, l.camera_id, l.ts_ms
