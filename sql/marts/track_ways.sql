-- name: marts/track_ways
-- One row per track of a site day that enters or leaves an area: where its camera first and last counts it, and the areas.
-- grain: camera_id, site_day, track_id
-- reads: track_ends, moves, joined_persons, site_days, cameras
-- columns:
--   floor_id
--   camera_id
--   site_day       day in the site's zone that starts at day_starts; track ids end with it
--   track_id       pseudonym of the engine's track number, of one site day
--   began_ms       first record that this camera counts, milliseconds since 1970, UTC
--   began_x_m      its place
--   began_y_m      likewise
--   first_area_id  area that the person enters first, seen and counted by this camera; null where none, or where the track begins inside
--   ended_ms       last record that this camera counts
--   ended_x_m      its place
--   ended_y_m      likewise
--   last_area_id   area that the person leaves last, seen and counted by this camera, before the track ends elsewhere; null where none
--   left_hour_ms   UTC instant of the local hour in which they leave it
--   entered_hour_ms  UTC instant of the local hour in which they enter the first one
--   began_by       camera of the first record
--   ended_by       camera of the last record
-- steps:
--   ends     a track of several hours has one first and one last record
--   outside  areas at either end of the way that this camera counts; people there came from, or go to, floor outside of it
-- assumes: clocks of the cameras agree within a second or two; a track, or what join_views joins, is a person
with ends as (
    select
        coalesce(joined_persons.person_camera_id, track_ends.camera_id) as camera_id,
        site_days.site_day,
        coalesce(joined_persons.person_track_id, track_ends.track_id) as track_id,
        min_by(track_ends.camera_id, (track_ends.first_ms, track_ends.camera_id)) as began_by,
        max_by(track_ends.camera_id, (track_ends.last_ms, track_ends.camera_id)) as ended_by,
        min(track_ends.first_ms) as first_ms,
        min_by(track_ends.first_x_mm, track_ends.first_ms) as first_x_mm,
        min_by(track_ends.first_y_mm, track_ends.first_ms) as first_y_mm,
        max(track_ends.last_ms) as last_ms,
        max_by(track_ends.last_x_mm, track_ends.last_ms) as last_x_mm,
        max_by(track_ends.last_y_mm, track_ends.last_ms) as last_y_mm
    from track_ends
    inner join site_days on floor(track_ends.first_ms / 900000) = site_days.quarter
    left join joined_persons
        on
            site_days.site_day = joined_persons.site_day
            and track_ends.camera_id = joined_persons.camera_id
            and track_ends.track_id = joined_persons.track_id
    group by all
),

outside as (
    select
        camera_id,
        site_day,
        track_id,
        min_by(area_id, visit_no) filter (where is_counted) as first_area_id,
        min_by(is_arrival and is_open, visit_no) filter (where is_counted) as was_outside,
        min_by(hour_start_ms, visit_no) filter (where is_counted) as entered_hour_ms,
        max_by(area_id, visit_no) filter (where is_last) as last_area_id,
        bool_or(is_last and is_departure and is_exit_counted and is_open_then) as goes_on,
        max_by(left_hour_ms, visit_no) filter (where is_last) as left_hour_ms
    from moves
    group by camera_id, site_day, track_id
)

select
    cameras.floor_id,
    ends.camera_id,
    ends.site_day,
    ends.track_id,
    ends.first_ms as began_ms,
    ends.first_x_mm / 1000.0 as began_x_m,
    ends.first_y_mm / 1000.0 as began_y_m,
    case when outside.was_outside then outside.first_area_id end as first_area_id,
    ends.last_ms as ended_ms,
    ends.last_x_mm / 1000.0 as ended_x_m,
    ends.last_y_mm / 1000.0 as ended_y_m,
    case when outside.goes_on then outside.last_area_id end as last_area_id,
    outside.left_hour_ms,
    outside.entered_hour_ms,
    ends.began_by,
    ends.ended_by
from ends
inner join cameras on ends.camera_id = cameras.camera_id
inner join outside
    on
        ends.camera_id = outside.camera_id
        and ends.site_day = outside.site_day
        and ends.track_id = outside.track_id
order by ends.first_ms, ends.camera_id, ends.track_id
