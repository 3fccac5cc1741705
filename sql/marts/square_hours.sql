-- name: marts/square_hours
-- One row per camera, local hour and square metre with a person in opening hours.
-- stored_by: local_date
-- grain: floor_id, camera_id, hour_start_ms, cx, cy
-- reads: floor_cells, calendar, cameras
-- params: cell_mm
-- columns:
--   floor_id
--   camera_id
--   hour_start_ms     UTC instant the local hour starts
--   local_date
--   cx                floor(x / 1 m)
--   cy                floor(y / 1 m)
--   exposure_open_s   person-seconds of this camera here in opening hours
--   violation_open_s  those in violation, where each person stands
-- steps:
--   places  numbers for cameras: grouping by a number is faster than by two texts
--   stood   1000 mm: hotspots are tested on square metres, and a search reads many weeks of them
-- assumes: an hour without a row is 0 where the camera recorded, unknown where it did not
with places as (
    select
        camera_id,
        floor_id,
        row_number() over (order by floor_id, camera_id) as place
    from cameras
),

stood as (
    select
        places.place,
        calendar.hour_start_ms,
        calendar.local_date,
        floor(floor_cells.cx * params.cell_mm / 1000)::int as cx,
        floor(floor_cells.cy * params.cell_mm / 1000)::int as cy,
        floor_cells.exposure_ms,
        floor_cells.violation_ms
    from floor_cells
    cross join params
    inner join calendar on floor_cells.bucket_quarter = calendar.quarter
    inner join places on floor_cells.camera_id = places.camera_id
    where calendar.is_open
),

summed as (
    select
        place,
        hour_start_ms,
        min(local_date) as local_date,
        cx,
        cy,
        sum(exposure_ms) as exposure_ms,
        sum(violation_ms) as violation_ms
    from stood
    group by place, hour_start_ms, cx, cy
)

select
    places.floor_id,
    places.camera_id,
    summed.hour_start_ms,
    summed.local_date,
    summed.cx,
    summed.cy,
    summed.exposure_ms / 1000.0 as exposure_open_s,
    summed.violation_ms / 1000.0 as violation_open_s
from summed
inner join places on summed.place = places.place
where summed.exposure_ms > 0
order by summed.hour_start_ms, summed.place, summed.cx, summed.cy
