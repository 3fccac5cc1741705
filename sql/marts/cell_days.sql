-- name: marts/cell_days
-- One row per camera, local date and floor cell of half a metre with a person or violation in opening hours.
-- stored_by: local_date
-- grain: floor_id, camera_id, local_date, cx, cy
-- reads: floor_cells, violations, calendar, cameras
-- params: cell_mm
-- columns:
--   floor_id
--   camera_id
--   local_date
--   cx            floor(x / 0.5 m)
--   cy            floor(y / 0.5 m)
--   exposure_s    person-seconds spent here
--   violation_s   person-seconds in violation, where each person stands
--   n_violations  violations whose mean midpoint lies here
-- figure: M20 Hotspots
--   definition   places of 28 days with clearly more time in violation than crowding explains (M19, and company that people keep
--                everywhere), ranked by what could be saved; new, persisting, resolved, watching after a logged change
--   unit         list
--   denominator  person-hours expected in violation, by day and cell
--   needs        14 recorded days of 28, since the last logged change in or near the place; 300 violations; a week recorded to 60 %
--   uncertainty  moderated t over days that resemble their neighbours, false discovery rate 5 %; 95 % interval of the ratio
--   by           vsd_analytics.figures.hotspots.hotspots
-- steps:
--   stood  500 mm: hotspots are found on cells of half a metre, about the space of one standing person
-- assumes: a cell without a row is 0 where the camera recorded, unknown where it did not
with stood as (
    select
        cameras.floor_id,
        floor_cells.camera_id,
        calendar.local_date,
        floor(floor_cells.cx * params.cell_mm / 500)::int as cx,
        floor(floor_cells.cy * params.cell_mm / 500)::int as cy,
        floor_cells.exposure_ms,
        floor_cells.violation_ms,
        0 as n_violations
    from floor_cells
    cross join params
    inner join calendar on floor_cells.bucket_quarter = calendar.quarter
    inner join cameras on floor_cells.camera_id = cameras.camera_id
    where calendar.is_open
    union all
    select
        violations.floor_id,
        violations.camera_id,
        violations.local_date,
        floor(violations.cx * params.cell_mm / 500)::int as cx,
        floor(violations.cy * params.cell_mm / 500)::int as cy,
        0 as exposure_ms,
        0 as violation_ms,
        1 as n_violations
    from violations
    cross join params
    where violations.is_open and violations.cx is not null
)

select
    floor_id,
    camera_id,
    local_date,
    cx,
    cy,
    sum(exposure_ms) / 1000.0 as exposure_s,
    sum(violation_ms) / 1000.0 as violation_s,
    sum(n_violations)::bigint as n_violations
from stood
group by floor_id, camera_id, local_date, cx, cy
order by local_date, floor_id, camera_id, cy, cx
