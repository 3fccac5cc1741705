-- name: facts/area_tracks
-- One row per track, UTC hour and place it stood in: an area of vsd.toml, or the rest of a floor that has areas.
-- grain: hour, camera_id, area_id, track_id
-- reads: located, area_cells, cameras
-- params: cell_mm
-- columns:
--   hour       UTC hour number
--   camera_id
--   area_id    area of vsd.toml; the first of the file where two overlap; null is the rest of the floor
--   track_id   pseudonym of the engine's track number, of one site day
-- assumes: only what this camera owns is counted, as for person-time; a record without floor position or id says nothing
with standing as (
    select
        cast(floor(l.ts_ms / 3600000) as bigint) as hour,
        l.camera_id,
        l.track_id,
        l.ts_ms,
        c.floor_id,
        cast(floor(l.x_mm / s.cell_mm) as integer) as cx,
        cast(floor(l.y_mm / s.cell_mm) as integer) as cy
    from located as l
    cross join params as s
    inner join cameras as c on l.camera_id = c.camera_id
    where
        l.is_owned and l.x_mm is not null and l.track_id is not null
        and c.floor_id in (select floor_id from area_cells)
)

select distinct
    t.hour,
    t.camera_id,
    a.area_id,
    t.track_id
from standing as t
left join area_cells as a
    on
        t.floor_id = a.floor_id
        and t.cx = a.cx
        and t.cy = a.cy
        and t.ts_ms >= a.from_ms
        and t.ts_ms < a.to_ms
order by t.hour, t.camera_id, a.area_id, t.track_id
