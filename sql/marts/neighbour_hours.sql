-- name: marts/neighbour_hours
-- One row per camera, local hour and number of others closer than distance_m, in opening hours: person-time in such company.
-- stored_by: local_date
-- grain: camera_id, hour_start_ms, n_others
-- reads: neighbour_times, calendar
-- columns:
--   camera_id
--   hour_start_ms  UTC instant the local hour starts
--   local_date
--   n_others       others closer than distance_m at the instant, at least 1
--   violation_s    person-seconds in opening hours
-- assumes: person-time without anybody closer than distance_m is that of camera_hours less these
select
    neighbour_times.camera_id,
    calendar.hour_start_ms,
    min(calendar.local_date) as local_date,
    neighbour_times.n_others,
    sum(neighbour_times.violation_ms) / 1000.0 as violation_s
from neighbour_times
inner join calendar on neighbour_times.bucket_quarter = calendar.quarter
where calendar.is_open
group by neighbour_times.camera_id, calendar.hour_start_ms, neighbour_times.n_others
order by calendar.hour_start_ms, neighbour_times.camera_id, neighbour_times.n_others
