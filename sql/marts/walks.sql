-- name: marts/walks
-- One row per floor, local date and square metre that people walked through in opening hours: how many at least, and which way.
-- grain: floor_id, local_date, cx, cy
-- reads: walk_cells, calendar, cameras
-- columns:
--   floor_id
--   local_date
--   cx         floor(x) of the square metre
--   cy         floor(y)
--   n_walkers  tracks that walked through it, those of two hours counted twice
--   n_people   a lower bound of different tracks: of each camera, those of its busiest hour
--   east       sum of the cosine of the direction of each track, counter-clockwise from the x axis
--   north      sum of its sine
--   along_x    sum of the cosine of twice the direction
--   along_y    sum of its sine
-- figure: M42 Walking directions
--   definition   mean direction of people who walk through a cell, each counted once (circular mean)
--   unit         degrees, counter-clockwise from the x axis of the floor
--   denominator  people who walk through it
--   needs        5 people in a cell
--   uncertainty  Rayleigh test at 1 % in each cell; of cells whose people walk anywhere, one in a hundred has an arrow
--   by           vsd_analytics.figures.walks.walking_directions
-- assumes: a track belongs to one camera and one site day, so cameras and days add up
with hourly as (
    select
        cameras.floor_id,
        calendar.local_date,
        walk_cells.camera_id,
        walk_cells.cx,
        walk_cells.cy,
        sum(walk_cells.n_walkers) as n_walkers,
        max(walk_cells.n_walkers) as n_people,
        sum(walk_cells.east) as east,
        sum(walk_cells.north) as north,
        sum(walk_cells.along_x) as along_x,
        sum(walk_cells.along_y) as along_y
    from walk_cells
    inner join calendar on walk_cells.hour * 4 = calendar.quarter
    inner join cameras on walk_cells.camera_id = cameras.camera_id
    where calendar.is_open
    group by cameras.floor_id, calendar.local_date, walk_cells.camera_id, walk_cells.cx, walk_cells.cy
)

select
    floor_id,
    local_date,
    cx,
    cy,
    sum(n_walkers)::bigint as n_walkers,
    sum(n_people)::bigint as n_people,
    sum(east)::double / 1000 as east,
    sum(north)::double / 1000 as north,
    sum(along_x)::double / 1000 as along_x,
    sum(along_y)::double / 1000 as along_y
from hourly
group by floor_id, local_date, cx, cy
order by floor_id, local_date, cy, cx
