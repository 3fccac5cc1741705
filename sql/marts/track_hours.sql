-- name: marts/track_hours
-- One row per camera and local hour in which somebody was seen in opening hours: how many people made its person-time, at least.
-- stored_by: local_date
-- grain: camera_id, hour_start_ms
-- reads: track_lives, calendar, cameras
-- columns:
--   camera_id
--   floor_id
--   hour_start_ms  UTC instant the local hour starts
--   local_date
--   local_hour     0 to 23
--   n_tracks       different tracks with their first or last record of a UTC hour in it
-- steps:
--   seen  where local hours do not begin on UTC hours, a track is certain to be in the hour of its first and of its last record
-- assumes: people have track ids; without ids there is no row
with seen as (
    select
        camera_id,
        track_id,
        first_ms as seen_ms
    from track_lives
    union all
    select
        camera_id,
        track_id,
        last_ms as seen_ms
    from track_lives
)

select
    seen.camera_id,
    cameras.floor_id,
    calendar.hour_start_ms,
    min(calendar.local_date) as local_date,
    min(calendar.local_hour) as local_hour,
    count(distinct seen.track_id)::bigint as n_tracks
from seen
inner join calendar on floor(seen.seen_ms / 900000) = calendar.quarter
inner join cameras on seen.camera_id = cameras.camera_id
where calendar.is_open
group by seen.camera_id, cameras.floor_id, calendar.hour_start_ms
order by calendar.hour_start_ms, seen.camera_id
