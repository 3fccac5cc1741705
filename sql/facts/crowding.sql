-- name: facts/crowding
-- One row per camera and UTC quarter-hour in which it counted anybody with a floor position: how crowded, and how close.
-- grain: camera_id, quarter
-- reads: located, pairs, cameras, owner_cells
-- params: distance_mm, owner_cell_mm
-- columns:
--   hour                UTC hour number
--   camera_id
--   quarter             UTC quarter-hours since 1970
--   frames              instants with at least one person counted by this camera
--   person_ms           person-milliseconds of these persons
--   copresent_pair_ms   pair-milliseconds of any two of them at the same instant: n (n - 1) / 2 pairs of n persons
--   close_pair_ms       pair-milliseconds of two of them closer than distance_m
-- assumes: of two persons counted by different cameras, neither camera's pairs hold the two: it is left out above and below
with instants_seen as (
    select
        camera_id,
        ts_ms,
        count(*) as n_persons,
        min(weight_ms) as weight_ms
    from located
    where is_owned and x_mm is not null
    group by camera_id, ts_ms
),

placed_pairs as (
    select
        p.camera_id,
        cameras.floor_id,
        p.ts_ms,
        p.weight_ms,
        cast(floor(p.x_a_mm / s.owner_cell_mm) as integer) as cx_a,
        cast(floor(p.y_a_mm / s.owner_cell_mm) as integer) as cy_a,
        cast(floor(p.x_b_mm / s.owner_cell_mm) as integer) as cx_b,
        cast(floor(p.y_b_mm / s.owner_cell_mm) as integer) as cy_b
    from pairs as p
    cross join params as s
    left join cameras on p.camera_id = cameras.camera_id
    where p.distance_mm < s.distance_mm and p.x_a_mm is not null and p.x_b_mm is not null
),

close_pairs as (
    select
        p.camera_id,
        p.ts_ms,
        p.weight_ms
    from placed_pairs as p
    left join owner_cells as owner_a
        on
            p.floor_id = owner_a.floor_id
            and p.ts_ms >= owner_a.from_ms
            and p.ts_ms < owner_a.to_ms
            and p.cx_a = owner_a.cx
            and p.cy_a = owner_a.cy
    left join owner_cells as owner_b
        on
            p.floor_id = owner_b.floor_id
            and p.ts_ms >= owner_b.from_ms
            and p.ts_ms < owner_b.to_ms
            and p.cx_b = owner_b.cx
            and p.cy_b = owner_b.cy
    where coalesce(owner_a.camera_id = p.camera_id, true) and coalesce(owner_b.camera_id = p.camera_id, true)
),

counted as (
    select
        camera_id,
        cast(floor(ts_ms / 900000) as bigint) as quarter,
        1 as frames,
        n_persons * weight_ms as person_ms,
        n_persons * (n_persons - 1) / 2 * weight_ms as copresent_pair_ms,
        0 as close_pair_ms
    from instants_seen
    union all
    select
        camera_id,
        cast(floor(ts_ms / 900000) as bigint) as quarter,
        0 as frames,
        0 as person_ms,
        0 as copresent_pair_ms,
        weight_ms as close_pair_ms
    from close_pairs
)

select
    cast(floor(quarter / 4) as bigint) as hour,
    camera_id,
    quarter,
    cast(sum(frames) as bigint) as frames,
    cast(sum(person_ms) as bigint) as person_ms,
    cast(sum(copresent_pair_ms) as bigint) as copresent_pair_ms,
    cast(sum(close_pair_ms) as bigint) as close_pair_ms
from counted
group by camera_id, quarter
order by hour, camera_id, quarter
