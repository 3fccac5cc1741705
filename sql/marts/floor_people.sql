-- name: marts/floor_people
-- One row per camera and site day with somebody in opening hours: how many people made its person-time, at least.
-- grain: camera_id, site_day
-- reads: track_lives, calendar, site_days, cameras
-- columns:
--   camera_id
--   floor_id
--   site_day  day in the site's zone that starts at day_starts; track ids end with it
--   n_tracks  different tracks with their first or last record of a UTC hour in opening hours
-- steps:
--   seen  of the time between its first and last record of an hour it is not certain that a track was in view
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
    site_days.site_day,
    count(distinct seen.track_id)::bigint as n_tracks
from seen
inner join calendar on floor(seen.seen_ms / 900000) = calendar.quarter
inner join site_days on calendar.quarter = site_days.quarter
inner join cameras on seen.camera_id = cameras.camera_id
where calendar.is_open
group by seen.camera_id, cameras.floor_id, site_days.site_day
order by site_days.site_day, seen.camera_id
