-- name: staging/gathering_clusters
-- One row per cluster of at least gathering_people people at an instant: the pieces of gatherings.
-- grain: cluster_no
-- reads: clusters, clustered, camera_days
-- params: gathering_people, gathering_link_ms, gap_half_intervals, crowd_people
-- columns:
--   cluster_no   number of the cluster, in order of camera, time and cluster
--   hour         UTC hour number
--   camera_id
--   ts_ms        milliseconds since 1970, UTC
--   cluster      least number of a person of the cluster
--   n_people     people in it
--   n_located    those with a floor position
--   sum_x_mm     sum over these; null without any
--   sum_y_mm     likewise
--   weight_ms    time that the frame represents
--   interval_ms  frame interval of the camera's day
--   gap_ms       longest time back to a cluster that it continues: gathering_link_ms, at least 2.5 frame intervals
--   square_mm2   square of the largest distance between two people of it; null without two positions
-- steps:
--   standing    up to 40 people all pairs are compared, above that widths in fixed directions
--   directions  unit vectors times 1000, 11.25 degrees apart: the largest width is at most 1 - cos(5.625 degrees) = 0.5 % too small
--   widths      millimetres times 1000 are micrometres: whole numbers, so that sums do not depend on their order
--   widest      the diameter of the cluster, squared
-- assumes: of more than 40 people the largest width in 16 directions is taken, at most 0.5 % less: work grows with people, not pairs
with big as (
    select
        row_number() over (order by c.camera_id, c.ts_ms, c.cluster) as cluster_no,
        c.camera_id,
        c.ts_ms,
        c.cluster,
        c.n_people,
        c.n_located,
        c.sum_x_mm,
        c.sum_y_mm,
        c.weight_ms
    from clusters as c
    cross join params as s
    where c.n_people >= s.gathering_people
),

standing as (
    select
        big.cluster_no,
        big.n_people > s.crowd_people as is_crowd,
        p.member,
        cast(p.x_mm as bigint) as x_mm,
        cast(p.y_mm as bigint) as y_mm
    from big
    cross join params as s
    inner join clustered as p on big.camera_id = p.camera_id and big.ts_ms = p.ts_ms and big.cluster = p.cluster
    where p.x_mm is not null
),

directions as (
    select
        1000 as ux,
        0 as uy
    union all
    select
        981 as ux,
        195 as uy
    union all
    select
        924 as ux,
        383 as uy
    union all
    select
        831 as ux,
        556 as uy
    union all
    select
        707 as ux,
        707 as uy
    union all
    select
        556 as ux,
        831 as uy
    union all
    select
        383 as ux,
        924 as uy
    union all
    select
        195 as ux,
        981 as uy
    union all
    select
        0 as ux,
        1000 as uy
    union all
    select
        -195 as ux,
        981 as uy
    union all
    select
        -383 as ux,
        924 as uy
    union all
    select
        -556 as ux,
        831 as uy
    union all
    select
        -707 as ux,
        707 as uy
    union all
    select
        -831 as ux,
        556 as uy
    union all
    select
        -924 as ux,
        383 as uy
    union all
    select
        -981 as ux,
        195 as uy
),

widths as (
    select
        p.cluster_no,
        max(d.ux * p.x_mm + d.uy * p.y_mm) - min(d.ux * p.x_mm + d.uy * p.y_mm) as width_um,
        count(*) as n_located
    from standing as p
    cross join directions as d
    where p.is_crowd
    group by p.cluster_no, d.ux, d.uy
),

widest as (
    select
        cluster_no,
        cast(floor(power(max(width_um) / 1000, 2)) as bigint) as square_mm2
    from widths
    where n_located > 1
    group by cluster_no
    union all
    select
        a.cluster_no,
        max((a.x_mm - b.x_mm) * (a.x_mm - b.x_mm) + (a.y_mm - b.y_mm) * (a.y_mm - b.y_mm)) as square_mm2
    from standing as a
    inner join standing as b on a.cluster_no = b.cluster_no and a.member < b.member
    where not a.is_crowd
    group by a.cluster_no
)

select
    big.cluster_no,
    cast(floor(big.ts_ms / 3600000) as bigint) as hour,
    big.camera_id,
    big.ts_ms,
    big.cluster,
    big.n_people,
    big.n_located,
    big.sum_x_mm,
    big.sum_y_mm,
    big.weight_ms,
    d.interval_ms,
    greatest(s.gathering_link_ms, cast(floor(s.gap_half_intervals * d.interval_ms / 2) as bigint)) as gap_ms,
    widest.square_mm2
from big
cross join params as s
inner join camera_days as d on big.camera_id = d.camera_id and cast(floor(big.ts_ms / 86400000) as bigint) = d.utc_day
left join widest on big.cluster_no = widest.cluster_no
