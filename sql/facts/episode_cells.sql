-- name: facts/episode_cells
-- One row per run of violation records of one pair within one UTC hour and floor cell: how long either person stood there in violation.
-- grain: camera_id, track_a, track_b, started_ms, cx, cy
-- reads: close_records
-- params: cell_mm
-- columns:
--   hour          UTC hour number
--   camera_id
--   track_a       pair of its segment in episode_segments
--   track_b       likewise
--   started_ms    start of its segment
--   cx            floor(x / cell_m) of a person's own place
--   cy            floor(y / cell_m)
--   violation_ms  person-milliseconds of the two, over all violation records of the run
--   owned_ms      those of records that this camera counts, because it owns their midpoint
-- assumes: each of the two counts where they stand; a person without a position is in no cell
with persons as (
    select
        hour,
        camera_id,
        track_a,
        track_b,
        started_ms,
        weight_ms,
        is_owned,
        x_a_mm as x_mm,
        y_a_mm as y_mm
    from close_records
    where x_a_mm is not null
    union all
    select
        hour,
        camera_id,
        track_a,
        track_b,
        started_ms,
        weight_ms,
        is_owned,
        x_b_mm as x_mm,
        y_b_mm as y_mm
    from close_records
    where x_b_mm is not null
),

in_cells as (
    select
        p.hour,
        p.camera_id,
        p.track_a,
        p.track_b,
        p.started_ms,
        cast(floor(p.x_mm / s.cell_mm) as integer) as cx,
        cast(floor(p.y_mm / s.cell_mm) as integer) as cy,
        p.weight_ms,
        case when p.is_owned then p.weight_ms else 0 end as owned_ms
    from persons as p
    cross join params as s
)

select
    hour,
    camera_id,
    track_a,
    track_b,
    started_ms,
    cx,
    cy,
    cast(sum(weight_ms) as bigint) as violation_ms,
    cast(sum(owned_ms) as bigint) as owned_ms
from in_cells
group by hour, camera_id, track_a, track_b, started_ms, cx, cy
order by hour, camera_id, track_a, track_b, started_ms, cx, cy
