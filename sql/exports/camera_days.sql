-- name: exports/camera_days
-- One row per camera and local day: how much of the opening time it recorded.
-- grain: camera_id, local_date
-- reads: reports
-- columns:
--   floor_id
--   camera_id
--   name             display name of the camera
--   local_date
--   open_h           opening hours of the day; 0 when closed
--   recorded_h       those that the camera recorded
--   recorded_share   recorded over open hours; null when closed all day
-- assumes: recorded means that the engine processed frames, also when nobody was in view
with cameras as (
    select
        floor_id,
        unnest(cast(report -> '$.coverage.cameras' as json[])) as camera
    from reports
),

days as (
    select
        floor_id,
        camera ->> '$.camera_id' as camera_id,
        camera ->> '$.name' as name,
        unnest(cast(camera -> '$.days' as json[])) as of_day
    from cameras
)

select
    floor_id,
    camera_id,
    name,
    cast(of_day ->> '$.day' as date) as local_date,
    cast(of_day ->> '$.scheduled_h' as double) as open_h,
    cast(of_day ->> '$.recorded_h' as double) as recorded_h,
    cast(of_day ->> '$.share' as double) as recorded_share
from days
order by floor_id, camera_id, local_date
