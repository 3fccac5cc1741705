-- name: marts/violation_cells
-- One row per camera, local date and floor cell with a violation in opening hours, for the map of a week.
-- grain: floor_id, camera_id, local_date, cx, cy
-- reads: violations
-- columns:
--   floor_id
--   camera_id
--   local_date
--   cx            floor(x / cell_m)
--   cy            floor(y / cell_m)
--   n_violations  violations whose mean midpoint lies here
-- assumes: violations without a position are left out
select
    floor_id,
    camera_id,
    local_date,
    cx,
    cy,
    count(*) as n_violations
from violations
where is_open and cx is not null
group by floor_id, camera_id, local_date, cx, cy
order by floor_id, camera_id, local_date, cy, cx
