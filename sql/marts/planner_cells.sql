-- name: marts/planner_cells
-- One row per camera, local hour and floor cell of half a metre with a person or violation in opening hours.
-- stored_by: local_date
-- grain: floor_id, camera_id, hour_start_ms, cx, cy
-- reads: floor_cells, cell_tracks, violations, calendar, cameras
-- params: cell_mm
-- columns:
--   floor_id
--   camera_id
--   hour_start_ms  UTC instant the local hour starts
--   local_date
--   cx             floor(x / 0.5 m)
--   cy             floor(y / 0.5 m)
--   exposure_ms    person-milliseconds spent here
--   violation_ms   person-milliseconds in violation, where each person stands
--   n_tracks       a lower bound of the different tracks that stood here; 0 where the engine sends no ids
--   n_violations   violations whose mean midpoint lies here and that started in opening hours
-- steps:
--   stood  500 mm: the planner draws areas on cells of half a metre, about the space of one standing person
-- assumes: an hour without a row is 0 where the camera recorded, unknown where it did not
with stood as (
    select
        cameras.floor_id,
        floor_cells.camera_id,
        calendar.hour_start_ms,
        calendar.local_date,
        floor(floor_cells.cx * params.cell_mm / 500)::int as cx,
        floor(floor_cells.cy * params.cell_mm / 500)::int as cy,
        floor_cells.exposure_ms,
        floor_cells.violation_ms,
        0 as n_tracks,
        0 as n_violations
    from floor_cells
    cross join params
    inner join calendar on floor_cells.bucket_quarter = calendar.quarter
    inner join cameras on floor_cells.camera_id = cameras.camera_id
    where calendar.is_open
    union all
    select
        cameras.floor_id,
        cell_tracks.camera_id,
        calendar.hour_start_ms,
        calendar.local_date,
        floor(cell_tracks.cx * params.cell_mm / 500)::int as cx,
        floor(cell_tracks.cy * params.cell_mm / 500)::int as cy,
        0 as exposure_ms,
        0 as violation_ms,
        cell_tracks.n_tracks,
        0 as n_violations
    from cell_tracks
    cross join params
    inner join calendar on cell_tracks.bucket_quarter = calendar.quarter
    inner join cameras on cell_tracks.camera_id = cameras.camera_id
    where calendar.is_open
    union all
    select
        violations.floor_id,
        violations.camera_id,
        violations.hour_start_ms,
        violations.local_date,
        floor(violations.cx * params.cell_mm / 500)::int as cx,
        floor(violations.cy * params.cell_mm / 500)::int as cy,
        0 as exposure_ms,
        0 as violation_ms,
        0 as n_tracks,
        1 as n_violations
    from violations
    cross join params
    where violations.is_open and violations.cx is not null
)

select
    floor_id,
    camera_id,
    hour_start_ms,
    min(local_date) as local_date,
    cx,
    cy,
    sum(exposure_ms)::bigint as exposure_ms,
    sum(violation_ms)::bigint as violation_ms,
    max(n_tracks)::bigint as n_tracks,
    sum(n_violations)::bigint as n_violations
from stood
group by floor_id, camera_id, hour_start_ms, cx, cy
order by hour_start_ms, floor_id, camera_id, cy, cx
