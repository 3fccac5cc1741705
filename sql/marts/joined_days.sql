-- name: marts/joined_days
-- One row per camera and local date with violation records of pairs whose track ids are known: the records that can become episodes.
-- stored_by: local_date
-- grain: camera_id, local_date
-- reads: episode_segments, calendar
-- columns:
--   camera_id
--   local_date
--   n_records   violation records, also those another camera counts; of runs that began on that date
-- assumes: where fewer than half of the violation records (`violation_time`) are here, the engine sends too few ids for episodes
select
    episode_segments.camera_id,
    calendar.local_date,
    sum(episode_segments.n_records)::bigint as n_records
from episode_segments
inner join calendar on floor(episode_segments.started_ms / 900000) = calendar.quarter
group by episode_segments.camera_id, calendar.local_date
order by calendar.local_date, episode_segments.camera_id
