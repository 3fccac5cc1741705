-- name: marts/area_people
-- One row per site day and place that somebody stood in: how many people made its person-time, at least.
-- stored_by: site_day
-- grain: floor_id, area_id, site_day
-- reads: area_tracks, site_days, cameras
-- columns:
--   floor_id
--   area_id    null is the rest of a floor that has areas
--   site_day   day in the site's zone that starts at day_starts; track ids end with it
--   n_people   different tracks of the camera that saw most of them
-- steps:
--   seen  who stays over the hour is one track; ids of two cameras may be the same people, so cameras do not add up
-- assumes: an hour's row belongs to the site day of its first quarter
with seen as (
    select
        cameras.floor_id,
        area_tracks.area_id,
        site_days.site_day,
        area_tracks.camera_id,
        count(distinct area_tracks.track_id) as n_tracks
    from area_tracks
    inner join site_days on area_tracks.hour * 4 = site_days.quarter
    inner join cameras on area_tracks.camera_id = cameras.camera_id
    group by cameras.floor_id, area_tracks.area_id, site_days.site_day, area_tracks.camera_id
)

select
    floor_id,
    area_id,
    site_day,
    max(n_tracks)::bigint as n_people
from seen
group by floor_id, area_id, site_day
order by site_day, floor_id, area_id
