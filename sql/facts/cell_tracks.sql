-- name: facts/cell_tracks
-- One row per camera, time bucket and floor cell with a person who has a track id: how many different tracks stood there.
-- grain: camera_id, bucket_quarter, cx, cy
-- reads: located
-- params: cell_mm, bucket_quarters
-- columns:
--   hour            UTC hour number
--   camera_id
--   bucket_quarter  first UTC quarter-hour of the bucket, as in floor_cells
--   cx              floor(x / cell_m)
--   cy              floor(y / cell_m)
--   n_tracks        different tracks of this camera that stood here in the bucket
-- assumes: only people whom this camera owns are counted, as in floor_cells; a cell without track ids has no row
with standing as (
    select
        located.camera_id,
        located.track_id,
        cast(floor(located.ts_ms / (900000 * params.bucket_quarters)) as bigint) * params.bucket_quarters as bucket_quarter,
        cast(floor(located.x_mm / params.cell_mm) as integer) as cx,
        cast(floor(located.y_mm / params.cell_mm) as integer) as cy
    from located
    cross join params
    where located.is_owned and located.x_mm is not null and located.track_id is not null
)

select
    cast(floor(bucket_quarter / 4) as bigint) as hour,
    camera_id,
    bucket_quarter,
    cx,
    cy,
    cast(count(distinct track_id) as bigint) as n_tracks
from standing
group by camera_id, bucket_quarter, cx, cy
order by hour, camera_id, bucket_quarter, cx, cy
