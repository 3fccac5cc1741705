-- name: marts/cell_hours
-- One row per camera, local hour and floor cell with a person or violation in opening hours.
-- stored_by: local_date
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
--   violation_open_s   those in violation, where each person stands
--   n_violations_open  violations whose mean midpoint lies here and that started in opening hours
-- figure: M16 Map of exposure
--   definition   sum over cameras of person-seconds / recorded open hours of that camera, per m²
--   unit         person-seconds per m² and open hour
--   denominator  recorded open camera-hours
--   needs        0.25 person-hours in a square metre to be in the JSON
--   uncertainty  none
--   by           vsd_analytics.figures.maps.exposure_map
-- figure: M17 Map of burden
--   definition   as M16, of person-seconds in violation, where each person stands
--   unit         person-seconds in violation per m² and open hour
--   denominator  recorded open camera-hours
--   needs        as M16
--   uncertainty  none
--   by           vsd_analytics.figures.maps.burden_map
-- figure: M18 Map of risk
--   definition   M6 by cell; both parts smoothed by the same Gaussian of 1 m
--   unit         share of person-time
--   denominator  person-hours in the cell
--   needs        0.25 person-hours
--   uncertainty  none; M20 is the test
--   by           vsd_analytics.figures.maps.risk_map
-- steps:
--   places  numbers for cameras: grouping by a number is faster than by two texts
-- assumes: an hour without a row is 0 where the camera recorded, unknown where it did not
with places as (
    select
        camera_id,
        floor_id,
        row_number() over (order by floor_id, camera_id) as place
    from cameras
),

counted as (
    select
        places.place,
        calendar.hour_start_ms,
        calendar.local_date,
        floor_cells.cx,
        floor_cells.cy,
        floor_cells.exposure_ms,
        floor_cells.violation_ms,
        0 as n_violations
    from floor_cells
    inner join calendar on floor_cells.bucket_quarter = calendar.quarter
    inner join places on floor_cells.camera_id = places.camera_id
    where calendar.is_open
    union all
    select
        places.place,
        violations.hour_start_ms,
        violations.local_date,
        violations.cx,
        violations.cy,
        0 as exposure_ms,
        0 as violation_ms,
        1 as n_violations
    from violations
    inner join places on violations.camera_id = places.camera_id
    where violations.is_open and violations.cx is not null
),

-- numbers are grouped and sorted, names joined to what is left: this is the longest of all marts
summed as (
    select
        place,
        hour_start_ms,
        min(local_date) as local_date,
        cx,
        cy,
        sum(exposure_ms) as exposure_ms,
        sum(violation_ms) as violation_ms,
        sum(n_violations) as n_violations
    from counted
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
    summed.violation_ms / 1000.0 as violation_open_s,
    summed.n_violations::bigint as n_violations_open
from summed
inner join places on summed.place = places.place
order by summed.hour_start_ms, summed.place, summed.cy, summed.cx
