-- name: marts/heatmap
-- One row per floor and heat cell: its records and person-time over the calendar's days, in and outside opening hours.
-- grain: floor_id, cx, cy
-- reads: floor_cells, calendar, cameras
-- params: cell_mm, heat_cell_mm
-- columns:
--   floor_id
--   cx                 floor(x / heat cell)
--   cy                 floor(y / heat cell)
--   person_records     person records standing here
--   exposure_s         their person-seconds
--   violation_persons  person records in violation standing here
--   violation_s        their person-seconds
--   violation_records  violation records with their midpoint here
-- assumes: the heat cell is a multiple of cell_m, so that stored cells nest in it exactly
select
    cameras.floor_id,
    floor(floor_cells.cx * params.cell_mm / params.heat_cell_mm)::int as cx,
    floor(floor_cells.cy * params.cell_mm / params.heat_cell_mm)::int as cy,
    sum(floor_cells.person_records)::bigint as person_records,
    sum(floor_cells.exposure_ms) / 1000.0 as exposure_s,
    sum(floor_cells.violation_persons)::bigint as violation_persons,
    sum(floor_cells.violation_ms) / 1000.0 as violation_s,
    sum(floor_cells.violation_records)::bigint as violation_records
from floor_cells
cross join params
inner join calendar on floor_cells.bucket_quarter = calendar.quarter
inner join cameras on floor_cells.camera_id = cameras.camera_id
group by 1, 2, 3
order by 1, 3, 2
