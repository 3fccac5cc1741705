-- name: marts/person_stays
-- One row of area_stays each, under the person of its track: where cameras are joined, one id for what several of them see.
-- grain: seen_by, seen_as, area_id, started_ms
-- reads: area_stays, joined_persons, site_days
-- columns:
--   hour            UTC hour number
--   camera_id       camera of the person's first track; else the track's own
--   track_id        the person's first track; else the track itself
--   seen_by         the camera that saw the stay
--   seen_as         its track
--   area_id         area of vsd.toml; the first of the file where two overlap
--   started_ms      first record inside, milliseconds since 1970, UTC
--   ended_ms        last record inside
--   interval_ms     frame interval of the camera's day
--   gap_ms          who is away for no longer is still the same visit
--   before_ms       the track's last record outside, as in area_stays
--   after_ms        the track's next record outside, as in area_stays
--   is_entry_owned  the camera that saw it counts the place of the first record
--   is_exit_owned   the camera that saw it counts the place of the last record
-- assumes: a track that is joined with no other one has its own id
select
    area_stays.hour,
    coalesce(joined_persons.person_camera_id, area_stays.camera_id) as camera_id,
    coalesce(joined_persons.person_track_id, area_stays.track_id) as track_id,
    area_stays.camera_id as seen_by,
    area_stays.track_id as seen_as,
    area_stays.area_id,
    area_stays.started_ms,
    area_stays.ended_ms,
    area_stays.interval_ms,
    area_stays.gap_ms,
    area_stays.before_ms,
    area_stays.after_ms,
    area_stays.is_entry_owned,
    area_stays.is_exit_owned
from area_stays
left join site_days on floor(area_stays.hour * 3600000 / 900000) = site_days.quarter
left join joined_persons
    on
        site_days.site_day = joined_persons.site_day
        and area_stays.camera_id = joined_persons.camera_id
        and area_stays.track_id = joined_persons.track_id
order by area_stays.started_ms, area_stays.camera_id, area_stays.track_id, area_stays.area_id
