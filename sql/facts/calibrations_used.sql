-- name: facts/calibrations_used
-- One row per camera, UTC hour and calibration that turned pixels of that hour into floor positions.
-- stored_by: utc_day
-- grain: hour, camera_id, calibration_id
-- reads: stored_observations, calibrations
-- columns:
--   hour            UTC hour number
--   camera_id
--   calibration_id  8 hexadecimal digits over the nine numbers of the homography
--   first_ms        first record whose position it gave, milliseconds since 1970, UTC
--   last_ms         last one
--   n_records       person records whose position it gave
-- assumes: records that come with floor positions use no calibration
with placed as (
    select
        c.camera_id,
        c.calibration_id,
        unix_millis(o.ts) as ts_ms
    from stored_observations as o
    inner join calibrations as c
        on
            o.camera_id = c.camera_id
            and unix_millis(o.ts) >= c.from_ms
            and unix_millis(o.ts) < c.to_ms
    where o.x_mm is null and o.u_px is not null
)

select
    cast(floor(ts_ms / 3600000) as bigint) as hour,
    camera_id,
    calibration_id,
    min(ts_ms) as first_ms,
    max(ts_ms) as last_ms,
    count(*) as n_records
from placed
group by cast(floor(ts_ms / 3600000) as bigint), camera_id, calibration_id
order by hour, camera_id, calibration_id
