-- name: marts/cell_hours
-- One row per camera, local hour and floor cell in which anybody stood in opening hours, or a violation lies.
-- grain: floor_id, camera_id, hour_start_ms, cx, cy
-- reads: floor_cells, violations, calendar, cameras
-- columns:
--   floor_id
--   camera_id
--   hour_start_ms      UTC instant the local hour starts
--   local_date
--   cx                 floor(x / cell_m)
--   cy                 floor(y / cell_m)
--   exposure_open_s    person-seconds of this camera here in opening hours
--   n_violations_open  violations whose mean midpoint lies here and that started in opening hours
-- assumes: an hour without a row is to be read with the camera's recorded time: 0 if recorded, unknown if not
with counted as (
    select
        cameras.floor_id,
        floor_cells.camera_id,
        calendar.hour_start_ms,
        calendar.local_date,
        floor_cells.cx,
        floor_cells.cy,
        floor_cells.exposure_ms,
        0 as n_violations
    from floor_cells
    inner join calendar on floor_cells.bucket_quarter = calendar.quarter
    inner join cameras on floor_cells.camera_id = cameras.camera_id
    where calendar.is_open
    union all
    select
        floor_id,
        camera_id,
        hour_start_ms,
        local_date,
        cx,
        cy,
        0 as exposure_ms,
        1 as n_violations
    from violations
    where is_open and cx is not null
)

select
    floor_id,
    camera_id,
    hour_start_ms,
    min(local_date) as local_date,
    cx,
    cy,
    sum(exposure_ms) / 1000.0 as exposure_open_s,
    sum(n_violations)::bigint as n_violations_open
from counted
group by floor_id, camera_id, hour_start_ms, cx, cy
order by floor_id, camera_id, hour_start_ms, cy, cx
