-- name: facts/floor_cells
-- One row per camera, time bucket and floor cell in which anybody stood or a violation record had its midpoint.
-- grain: camera_id, bucket_quarter, cx, cy
-- reads: located, instants, pairs
-- params: cell_mm, bucket_quarters, distance_mm
-- columns:
--   hour               UTC hour number
--   camera_id
--   bucket_quarter     first UTC quarter-hour of the bucket (an hour; a quarter where hours do not start on UTC hours)
--   cx                 floor(x / cell_m)
--   cy                 floor(y / cell_m)
--   person_records     person records of this camera standing here
--   exposure_ms        their person-milliseconds
--   violation_persons  those with a neighbour closer than distance_m
--   violation_ms       their person-milliseconds
--   violation_records  violation records of this camera with their midpoint here
-- assumes: only what this camera owns is counted, so that sums over cameras count nobody twice
with close as (
    select
        p.camera_id,
        p.ts_ms,
        p.member_a,
        p.member_b,
        p.x_a_mm + p.x_b_mm as x2_mm,
        p.y_a_mm + p.y_b_mm as y2_mm,
        p.is_owned,
        p.is_derived
    from pairs as p
    cross join params as s
    where p.distance_mm < s.distance_mm and p.x_a_mm is not null and p.x_b_mm is not null
),

in_violation as (
    select
        camera_id,
        ts_ms,
        member_a as member
    from close
    where is_derived
    union
    select
        camera_id,
        ts_ms,
        member_b as member
    from close
    where is_derived
),

stood as (
    select
        l.camera_id,
        cast(floor(l.ts_ms / (900000 * s.bucket_quarters)) as bigint) * s.bucket_quarters as bucket_quarter,
        cast(floor(l.x_mm / s.cell_mm) as integer) as cx,
        cast(floor(l.y_mm / s.cell_mm) as integer) as cy,
        i.weight_ms,
        v.ts_ms is not null as is_in_violation
    from located as l
    cross join params as s
    inner join instants as i on l.camera_id = i.camera_id and l.ts_ms = i.ts_ms
    left join in_violation as v on l.camera_id = v.camera_id and l.ts_ms = v.ts_ms and l.member = v.member
    where l.is_owned and l.x_mm is not null
),

standing as (
    select
        camera_id,
        bucket_quarter,
        cx,
        cy,
        count(*) as person_records,
        cast(sum(weight_ms) as bigint) as exposure_ms,
        count(*) filter (where is_in_violation) as violation_persons,
        cast(coalesce(sum(weight_ms) filter (where is_in_violation), 0) as bigint) as violation_ms
    from stood
    group by 1, 2, 3, 4
),

between_them as (
    select
        c.camera_id,
        cast(floor(c.ts_ms / (900000 * s.bucket_quarters)) as bigint) * s.bucket_quarters as bucket_quarter,
        cast(floor(c.x2_mm / (2 * s.cell_mm)) as integer) as cx,
        cast(floor(c.y2_mm / (2 * s.cell_mm)) as integer) as cy,
        count(*) as violation_records
    from close as c
    cross join params as s
    where c.is_owned
    group by 1, 2, 3, 4
)

select
    cast(floor(coalesce(a.bucket_quarter, b.bucket_quarter) / 4) as bigint) as hour,
    coalesce(a.camera_id, b.camera_id) as camera_id,
    coalesce(a.bucket_quarter, b.bucket_quarter) as bucket_quarter,
    coalesce(a.cx, b.cx) as cx,
    coalesce(a.cy, b.cy) as cy,
    coalesce(a.person_records, 0) as person_records,
    coalesce(a.exposure_ms, 0) as exposure_ms,
    coalesce(a.violation_persons, 0) as violation_persons,
    coalesce(a.violation_ms, 0) as violation_ms,
    coalesce(b.violation_records, 0) as violation_records
from standing as a
full outer join between_them as b
    on a.camera_id = b.camera_id and a.bucket_quarter = b.bucket_quarter and a.cx = b.cx and a.cy = b.cy
order by 2, 3, 4, 5
