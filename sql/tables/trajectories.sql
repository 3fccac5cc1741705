-- name: tables/trajectories
-- One row per person record with a place in the days asked for, of the camera that counts the place.
-- grain: camera_id, t, member
-- reads: located, calendar, cameras
-- columns:
--   floor_id
--   camera_id
--   track_id      pseudonym of the engine's track number, of one site day; null when the engine does not track
--   t             instant of the record, with the site's zone
--   member        number of the person within camera and instant
--   x_m           floor metres
--   y_m           floor metres
--   weight_s      person-time of the record: its sum is exposure_s of the hours
--   local_date
--   is_open       it lies in opening hours
-- assumes: where views overlap, the record of the camera that counts the place is here and the others' are left out
select
    cameras.floor_id,
    located.camera_id,
    located.track_id,
    make_timestamptz(located.ts_ms * 1000) as t,
    located.member,
    located.x_mm / 1000 as x_m,
    located.y_mm / 1000 as y_m,
    located.weight_ms / 1000 as weight_s,
    calendar.local_date,
    calendar.is_open
from located
inner join calendar on floor(located.ts_ms / 900000) = calendar.quarter
inner join cameras on located.camera_id = cameras.camera_id
where located.is_owned and located.x_mm is not null
order by located.ts_ms, located.camera_id, located.member
