-- name: facts/floor_cells
-- One row per camera, time bucket and floor cell with a person or the midpoint of a violation record: person-time and violations.
-- grain: camera_id, bucket_quarter, cx, cy
-- reads: located, in_violation, pairs
-- params: cell_mm, bucket_quarters, distance_mm
-- columns:
--   hour               UTC hour number
--   camera_id
--   bucket_quarter     first UTC quarter-hour of the bucket (an hour; a quarter where hours do not start on UTC hours)
--   cx                 floor(x / cell_m)
--   cy                 floor(y / cell_m)
--   person_records     person records of this camera standing here
--   exposure_ms        their person-milliseconds
--   violation_persons  persons with a neighbour closer than distance_m standing here
--   violation_ms       their person-milliseconds
--   violation_records  violation records of this camera with their midpoint here
-- steps:
--   standing  scale 2 marks midpoints, whose coordinates are sums of two: halving in whole millimetres would move some to the next cell
-- assumes: only what this camera owns is counted, so that sums over cameras count nobody twice
with standing as (
    select
        camera_id,
        ts_ms,
        x_mm,
        y_mm,
        1 as scale,
        1 as person_records,
        weight_ms as exposure_ms,
        0 as violation_persons,
        0 as violation_ms,
        0 as violation_records
    from located
    where is_owned and x_mm is not null
    union all
    select
        camera_id,
        ts_ms,
        x_mm,
        y_mm,
        1 as scale,
        0 as person_records,
        0 as exposure_ms,
        1 as violation_persons,
        weight_ms as violation_ms,
        0 as violation_records
    from in_violation
    where is_owned and x_mm is not null
    union all
    select
        p.camera_id,
        p.ts_ms,
        p.x_a_mm + p.x_b_mm as x_mm,
        p.y_a_mm + p.y_b_mm as y_mm,
        2 as scale,
        0 as person_records,
        0 as exposure_ms,
        0 as violation_persons,
        0 as violation_ms,
        1 as violation_records
    from pairs as p
    cross join params as s
    where p.distance_mm < s.distance_mm and p.is_owned and p.x_a_mm is not null and p.x_b_mm is not null
),

in_cells as (
    select
        c.camera_id,
        cast(floor(c.ts_ms / (900000 * s.bucket_quarters)) as bigint) * s.bucket_quarters as bucket_quarter,
        cast(floor(c.x_mm / (c.scale * s.cell_mm)) as integer) as cx,
        cast(floor(c.y_mm / (c.scale * s.cell_mm)) as integer) as cy,
        c.person_records,
        c.exposure_ms,
        c.violation_persons,
        c.violation_ms,
        c.violation_records
    from standing as c
    cross join params as s
)

select
    cast(floor(bucket_quarter / 4) as bigint) as hour,
    camera_id,
    bucket_quarter,
    cx,
    cy,
    cast(sum(person_records) as bigint) as person_records,
    cast(sum(exposure_ms) as bigint) as exposure_ms,
    cast(sum(violation_persons) as bigint) as violation_persons,
    cast(sum(violation_ms) as bigint) as violation_ms,
    cast(sum(violation_records) as bigint) as violation_records
from in_cells
group by camera_id, bucket_quarter, cx, cy
order by hour, camera_id, bucket_quarter, cx, cy
