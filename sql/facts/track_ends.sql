-- name: facts/track_ends
-- One row per track and UTC hour of a floor whose areas ask for visits: where its camera first and last counts the person.
-- grain: hour, camera_id, track_id
-- reads: located, visit_cells, cameras
-- columns:
--   hour        UTC hour number
--   camera_id
--   track_id    pseudonym of the engine's track number, of one site day
--   first_ms    first record that this camera counts, milliseconds since 1970, UTC
--   first_x_mm  its place
--   first_y_mm  likewise
--   last_ms     last record that this camera counts
--   last_x_mm   its place
--   last_y_mm   likewise
-- steps:
--   asked  floors with an area that asks
-- assumes: where two views overlap, the next camera's track goes on where this one's floor ends, as at a border
with asked as (
    select distinct floor_id
    from visit_cells
)

select
    cast(floor(l.ts_ms / 3600000) as bigint) as hour,
    l.camera_id,
    l.track_id,
    min(l.ts_ms) as first_ms,
    min_by(l.x_mm, (l.ts_ms, l.member)) as first_x_mm,
    min_by(l.y_mm, (l.ts_ms, l.member)) as first_y_mm,
    max(l.ts_ms) as last_ms,
    max_by(l.x_mm, (l.ts_ms, -l.member)) as last_x_mm,
    max_by(l.y_mm, (l.ts_ms, -l.member)) as last_y_mm
from located as l
inner join cameras as c on l.camera_id = c.camera_id
inner join asked on c.floor_id = asked.floor_id
where l.track_id is not null and l.x_mm is not null and l.is_owned
group by cast(floor(l.ts_ms / 3600000) as bigint), l.camera_id, l.track_id
order by hour, l.camera_id, l.track_id
