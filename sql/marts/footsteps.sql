-- name: marts/footsteps
-- One row per local date and floor cell with tracks in opening hours: a lower bound of the number of different tracks.
-- stored_by: local_date
-- grain: floor_id, local_date, cx, cy
-- reads: cell_tracks, calendar, cameras
-- columns:
--   floor_id
--   local_date
--   cx          floor(x / cell_m)
--   cy          floor(y / cell_m)
--   n_tracks    a lower bound of the different tracks that stood here: of each camera, those of its busiest hour
-- steps:
--   busiest  ids of one hour are counted once, those of two hours may be the same people: the busiest hour is a safe lower bound
-- assumes: a track belongs to one camera and one site day, so cameras and days add up
with busiest as (
    select
        cameras.floor_id,
        cell_tracks.camera_id,
        calendar.local_date,
        cell_tracks.cx,
        cell_tracks.cy,
        max(cell_tracks.n_tracks) as n_tracks
    from cell_tracks
    inner join calendar on cell_tracks.bucket_quarter = calendar.quarter
    inner join cameras on cell_tracks.camera_id = cameras.camera_id
    where calendar.is_open
    group by cameras.floor_id, cell_tracks.camera_id, calendar.local_date, cell_tracks.cx, cell_tracks.cy
)

select
    floor_id,
    local_date,
    cx,
    cy,
    sum(n_tracks)::bigint as n_tracks
from busiest
group by floor_id, local_date, cx, cy
having sum(n_tracks) > 0
order by floor_id, local_date, cy, cx
