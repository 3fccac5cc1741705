-- name: marts/distances
-- One row per camera, local date and millimetre of distance: how many pairs were that far apart, and whose nearest neighbour was.
-- grain: camera_id, local_date, distance_mm
-- reads: pairs, calendar, cameras, owner_cells
-- params: owner_cell_mm
-- columns:
--   camera_id
--   local_date
--   distance_mm  whole millimetres, rounded down, up to pair_max_m
--   n_pairs      pair records counted by this camera (it owns their midpoint)
--   n_sent       those whose distance the engine sent
--   nearest_s    person-seconds with the nearest neighbour this far (it owns their own position)
-- assumes: sums over distance_mm < 1000 D are the violation_records and violation_s of a legal distance of D; purged hours have no rows
with dated as (
    select
        p.camera_id,
        p.ts_ms,
        p.member_a,
        p.member_b,
        p.x_a_mm,
        p.y_a_mm,
        p.x_b_mm,
        p.y_b_mm,
        p.distance_mm,
        p.weight_ms,
        p.is_owned,
        p.is_derived,
        calendar.local_date
    from pairs as p
    inner join calendar on floor(p.ts_ms / 900000) = calendar.quarter
),

sides as (
    select
        camera_id,
        local_date,
        ts_ms,
        member_a as member,
        x_a_mm as x_mm,
        y_a_mm as y_mm,
        distance_mm,
        weight_ms,
        is_owned
    from dated
    union all
    select
        camera_id,
        local_date,
        ts_ms,
        member_b as member,
        x_b_mm as x_mm,
        y_b_mm as y_mm,
        distance_mm,
        weight_ms,
        is_owned
    from dated
),

persons as (
    select
        camera_id,
        local_date,
        ts_ms,
        member,
        min(x_mm) as x_mm,
        min(y_mm) as y_mm,
        min(distance_mm) as distance_mm,
        min(weight_ms) as weight_ms,
        bool_or(is_owned) as is_owned
    from sides
    group by camera_id, local_date, ts_ms, member
),

counted as (
    select
        camera_id,
        local_date,
        distance_mm,
        case when is_owned then 1 else 0 end as n_pairs,
        case when is_owned and not is_derived then 1 else 0 end as n_sent,
        0 as nearest_ms
    from dated
    union all
    select
        p.camera_id,
        p.local_date,
        p.distance_mm,
        0 as n_pairs,
        0 as n_sent,
        case
            when case when p.x_mm is null then p.is_owned else coalesce(owner_cells.camera_id = p.camera_id, true) end
                then p.weight_ms
            else 0
        end as nearest_ms
    from persons as p
    cross join params as s
    left join cameras on p.camera_id = cameras.camera_id
    left join owner_cells
        on
            cameras.floor_id = owner_cells.floor_id
            and p.ts_ms >= owner_cells.from_ms
            and p.ts_ms < owner_cells.to_ms
            and cast(floor(p.x_mm / s.owner_cell_mm) as integer) = owner_cells.cx
            and cast(floor(p.y_mm / s.owner_cell_mm) as integer) = owner_cells.cy
)

select
    camera_id,
    local_date,
    distance_mm,
    cast(sum(n_pairs) as bigint) as n_pairs,
    cast(sum(n_sent) as bigint) as n_sent,
    sum(nearest_ms) / 1000 as nearest_s
from counted
group by camera_id, local_date, distance_mm
order by camera_id, local_date, distance_mm
