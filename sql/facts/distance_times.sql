-- name: facts/distance_times
-- One row per camera, time bucket and millimetre of distance: pairs and person-time with the nearest neighbour that far apart.
-- grain: camera_id, bucket_quarter, distance_mm
-- reads: pairs, cameras, owner_cells
-- params: bucket_quarters, owner_cell_mm
-- columns:
--   hour            UTC hour number
--   camera_id
--   bucket_quarter  first UTC quarter-hour of the bucket (an hour; a quarter where hours do not start on UTC hours)
--   distance_mm     whole millimetres, rounded down, up to pair_max_m
--   n_pairs         pair records counted by this camera (it owns their midpoint)
--   n_sent          those whose distance the engine sent
--   nearest_ms      person-milliseconds with the nearest neighbour this far (it owns their own position)
-- assumes: a person without a position is counted with the pairs it is in
with sides as (
    select
        camera_id,
        ts_ms,
        member_a as member,
        x_a_mm as x_mm,
        y_a_mm as y_mm,
        distance_mm,
        weight_ms,
        is_owned
    from pairs
    union all
    select
        camera_id,
        ts_ms,
        member_b as member,
        x_b_mm as x_mm,
        y_b_mm as y_mm,
        distance_mm,
        weight_ms,
        is_owned
    from pairs
),

persons as (
    select
        camera_id,
        ts_ms,
        member,
        min(x_mm) as x_mm,
        min(y_mm) as y_mm,
        min(distance_mm) as distance_mm,
        min(weight_ms) as weight_ms,
        bool_or(is_owned) as is_owned
    from sides
    group by camera_id, ts_ms, member
),

counted as (
    select
        camera_id,
        ts_ms,
        distance_mm,
        case when is_owned then 1 else 0 end as n_pairs,
        case when is_owned and not is_derived then 1 else 0 end as n_sent,
        0 as nearest_ms
    from pairs
    union all
    select
        p.camera_id,
        p.ts_ms,
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
),

in_buckets as (
    select
        c.camera_id,
        cast(floor(c.ts_ms / (900000 * s.bucket_quarters)) as bigint) * s.bucket_quarters as bucket_quarter,
        c.distance_mm,
        c.n_pairs,
        c.n_sent,
        c.nearest_ms
    from counted as c
    cross join params as s
)

select
    cast(floor(bucket_quarter / 4) as bigint) as hour,
    camera_id,
    bucket_quarter,
    distance_mm,
    cast(sum(n_pairs) as bigint) as n_pairs,
    cast(sum(n_sent) as bigint) as n_sent,
    cast(sum(nearest_ms) as bigint) as nearest_ms
from in_buckets
group by camera_id, bucket_quarter, distance_mm
order by hour, camera_id, bucket_quarter, distance_mm
