-- name: staging/clusters
-- One row per cluster and instant: number of its people, and sums of their places.
-- grain: camera_id, ts_ms, cluster
-- reads: clustered, cameras, owner_cells
-- params: owner_cell_mm
-- columns:
--   camera_id
--   ts_ms      milliseconds since 1970, UTC
--   cluster    least number of a person of the cluster
--   n_people   people in it
--   n_located  those with a floor position
--   sum_x_mm   sum over these: the middle is sum_x_mm / n_located; null without any
--   sum_y_mm   likewise
--   weight_ms  time that the frame represents
--   is_owned   false where another camera counts it, because it sees the middle better
-- assumes: a cluster without a place is counted by its own camera
with summed as (
    select
        camera_id,
        ts_ms,
        cluster,
        count(*) as n_people,
        count(x_mm) as n_located,
        cast(sum(x_mm) as bigint) as sum_x_mm,
        cast(sum(y_mm) as bigint) as sum_y_mm,
        min(weight_ms) as weight_ms
    from clustered
    group by camera_id, ts_ms, cluster
)

select
    c.camera_id,
    c.ts_ms,
    c.cluster,
    c.n_people,
    c.n_located,
    c.sum_x_mm,
    c.sum_y_mm,
    c.weight_ms,
    coalesce(owner_cells.camera_id = c.camera_id, true) as is_owned
from summed as c
cross join params as s
left join cameras on c.camera_id = cameras.camera_id
left join owner_cells
    on
        cameras.floor_id = owner_cells.floor_id
        and c.ts_ms >= owner_cells.from_ms
        and c.ts_ms < owner_cells.to_ms
        and cast(floor(c.sum_x_mm / nullif(c.n_located * s.owner_cell_mm, 0)) as integer) = owner_cells.cx
        and cast(floor(c.sum_y_mm / nullif(c.n_located * s.owner_cell_mm, 0)) as integer) = owner_cells.cy
