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
-- figure: M32 Three or more others too close
--   definition   person-seconds with three or more others closer than distance_m at the same instant / person-seconds
--   unit         share of person-time
--   denominator  person-hours
--   needs        as M6
--   uncertainty  day-clustered 95 % interval, as M6 between groups
--   by           vsd_analytics.figures.neighbours.three_or_more
-- figure: M33 Room around people
--   definition   person-time by people per m² in the disc of distance_m around a person, oneself included, in the levels of service of
--                walkways A to F (limits 0.31, 0.43, 0.72, 1.08, 2.15; Fruin, Pedestrian Planning and Design, 1971); floor behind
--                walls and out of view counts as empty
--   unit         share of person-time
--   denominator  person-hours
--   needs        as M6, and a distance_m of 1.02 m or more: a smaller disc holds one person at level B
--   uncertainty  day-clustered 95 % interval, as M6 between groups
--   by           vsd_analytics.figures.neighbours.room_around
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
