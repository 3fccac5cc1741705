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
--   numbered  a run ends where the time that a frame covers does not reach the next frame
-- assumes: a run is cut at every UTC hour, so that the unit of an hour depends on that hour alone
with marked as (
    select
        hour,
        camera_id,
        ts_ms,
        covered_ms,
        has_heartbeat,
        lag(ts_ms + covered_ms) over (partition by camera_id, hour order by ts_ms) as before_ms
    from instants
),

numbered as (
    select
        hour,
        camera_id,
        ts_ms,
        covered_ms,
        has_heartbeat,
        sum(case when before_ms >= ts_ms then 0 else 1 end) over (
            partition by camera_id, hour order by ts_ms rows between unbounded preceding and current row
        ) as run
    from marked
)

select
    hour,
    camera_id,
    min(ts_ms) as started_ms,
    max(ts_ms + covered_ms) as ended_ms,
    not bool_and(has_heartbeat) as is_inferred
from numbered
group by hour, camera_id, run
order by hour, camera_id, started_ms
