-- name: marts/area_people
-- One row per site day and place that somebody stood in while open: how many people made its person-time, at least.
-- grain: floor_id, area_id, site_day
-- reads: area_tracks, calendar, site_days, cameras
-- columns:
--   floor_id
--   area_id    null is the rest of a floor that has areas
--   site_day   day in the site's zone that starts at day_starts; track ids end with it
--   n_people   different tracks of the camera that saw most of them, in UTC hours of opening hours alone
-- steps:
--   open_hours  when a track was in an area is known to the hour, so an hour that is partly closed proves nobody's presence
--   seen        who stays over the hour is one track; ids of two cameras may be the same people, so cameras do not add up
-- assumes: an hour's row belongs to the site day of its first quarter
with open_hours as (
    select cast(floor(quarter / 4) as bigint) as hour
    from calendar
    group by cast(floor(quarter / 4) as bigint)
    having bool_and(is_open)
),

seen as (
    select
        cameras.floor_id,
        area_tracks.area_id,
        site_days.site_day,
        area_tracks.camera_id,
        count(distinct area_tracks.track_id) as n_tracks
    from area_tracks
    inner join open_hours on area_tracks.hour = open_hours.hour
    inner join site_days on area_tracks.hour * 4 = site_days.quarter
    inner join cameras on area_tracks.camera_id = cameras.camera_id
    group by cameras.floor_id, area_tracks.area_id, site_days.site_day, area_tracks.camera_id
)

select
    floor_id,
    area_id,
    site_day,
    cast(max(n_tracks) as bigint) as n_people
from seen
group by floor_id, area_id, site_day
order by site_day, floor_id, area_id
