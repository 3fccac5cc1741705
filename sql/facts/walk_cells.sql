-- name: facts/walk_cells
-- One row per camera, UTC hour and square metre of a floor whose areas ask for visits: who walks through it, and which way.
-- grain: hour, camera_id, cx, cy
-- reads: located, visit_cells, cameras, camera_days
-- params: gap_half_intervals
-- columns:
--   hour       UTC hour number
--   camera_id
--   cx         floor(x) of the square metre
--   cy         floor(y)
--   n_walkers  tracks that move at least half a metre in it
--   east       sum over them of the cosine of their direction, thousandths
--   north      sum of the sine
--   along_x    sum of the cosine of twice the direction: who walks the other way counts alike
--   along_y    sum of the sine of twice the direction
-- steps:
--   asked   floors with an area that asks
--   steps   from one record of a track to the next, in the square metre of its middle; longer gaps than 2.5 frame intervals say nothing
--   walked  what a track moved within a square metre in all, so that jitter of the position cancels
-- assumes: only what this camera owns is counted; who stands moves less than half a metre
with asked as (
    select distinct floor_id
    from visit_cells
),

followed as (
    select
        l.camera_id,
        l.track_id,
        l.ts_ms,
        l.x_mm,
        l.y_mm,
        l.is_owned,
        lag(l.ts_ms) over track as before_ms,
        lag(l.x_mm) over track as before_x_mm,
        lag(l.y_mm) over track as before_y_mm
    from located as l
    inner join cameras as c on l.camera_id = c.camera_id
    inner join asked on c.floor_id = asked.floor_id
    where l.track_id is not null and l.x_mm is not null
    window track as (partition by l.camera_id, l.track_id order by l.ts_ms, l.member)
),

steps as (
    select
        cast(floor(f.ts_ms / 3600000) as bigint) as hour,
        f.camera_id,
        f.track_id,
        cast(floor((f.x_mm + f.before_x_mm) / (2 * 1000)) as integer) as cx,
        cast(floor((f.y_mm + f.before_y_mm) / (2 * 1000)) as integer) as cy,
        f.x_mm - f.before_x_mm as dx_mm,
        f.y_mm - f.before_y_mm as dy_mm
    from followed as f
    cross join params as s
    inner join camera_days as d on f.camera_id = d.camera_id and cast(floor(f.ts_ms / 86400000) as bigint) = d.utc_day
    where f.is_owned and f.ts_ms - f.before_ms <= greatest(1000, s.gap_half_intervals * d.interval_ms / 2)
),

walked as (
    select
        hour,
        camera_id,
        track_id,
        cx,
        cy,
        cast(sum(dx_mm) as double) as dx_mm,
        cast(sum(dy_mm) as double) as dy_mm,
        cast(sum(dx_mm) as double) * sum(dx_mm) + cast(sum(dy_mm) as double) * sum(dy_mm) as length2_mm2
    from steps
    group by hour, camera_id, track_id, cx, cy
)

select
    hour,
    camera_id,
    cx,
    cy,
    count(*) as n_walkers,
    cast(sum(cast(round(1000 * dx_mm / sqrt(length2_mm2)) as bigint)) as bigint) as east,
    cast(sum(cast(round(1000 * dy_mm / sqrt(length2_mm2)) as bigint)) as bigint) as north,
    cast(sum(cast(round(1000 * (dx_mm * dx_mm - dy_mm * dy_mm) / length2_mm2) as bigint)) as bigint) as along_x,
    cast(sum(cast(round(1000 * 2 * dx_mm * dy_mm / length2_mm2) as bigint)) as bigint) as along_y
from walked
where length2_mm2 >= (1000 / 2) * (1000 / 2)
group by hour, camera_id, cx, cy
order by hour, camera_id, cx, cy
