-- name: tables/cells
-- One row per floor and cell of 1 m in which anybody stood in the days asked for.
-- grain: floor_id, x_m, y_m
-- reads: floor_cells, calendar, cameras, camera_hours
-- params: cell_mm
-- columns:
--   floor_id
--   x_m               middle of the cell, floor metres
--   y_m               middle of the cell, floor metres
--   exposure_s        person-seconds
--   violation_s       person-seconds in violation
--   recorded_s        recorded time of the cameras that counted anybody here, mean over them, seconds
-- assumes: a cell without a row had nobody, or no camera sees it; which of the two is unknown
with stood as (
    select
        cameras.floor_id,
        floor_cells.camera_id,
        floor((floor_cells.cx + 0.5) * params.cell_mm / 1000) as cx,
        floor((floor_cells.cy + 0.5) * params.cell_mm / 1000) as cy,
        sum(floor_cells.exposure_ms) as exposure_ms,
        sum(floor_cells.violation_ms) as violation_ms
    from floor_cells
    cross join params
    inner join calendar on floor_cells.bucket_quarter = calendar.quarter
    inner join cameras on floor_cells.camera_id = cameras.camera_id
    where floor_cells.exposure_ms > 0
    group by
        cameras.floor_id,
        floor_cells.camera_id,
        floor((floor_cells.cx + 0.5) * params.cell_mm / 1000),
        floor((floor_cells.cy + 0.5) * params.cell_mm / 1000)
),

recorded as (
    select
        camera_id,
        sum(recorded_s) as recorded_s
    from camera_hours
    group by camera_id
)

select
    stood.floor_id,
    stood.cx + 0.5 as x_m,
    stood.cy + 0.5 as y_m,
    sum(stood.exposure_ms) / 1000 as exposure_s,
    sum(stood.violation_ms) / 1000 as violation_s,
    avg(recorded.recorded_s) as recorded_s
from stood
left join recorded on stood.camera_id = recorded.camera_id
group by stood.floor_id, stood.cx, stood.cy
order by stood.floor_id, stood.cy, stood.cx
