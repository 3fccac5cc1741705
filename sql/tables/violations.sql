-- name: tables/violations
-- One row per violation that started in the days asked for: an episode of at least episode_min_s, counted once over all cameras.
-- grain: camera_id, started, track_a, track_b
-- reads: violations, camera_hours
-- columns:
--   started          instant of its first violation record, with the site's zone
--   local_date
--   local_hour       0 to 23
--   duration_s       time closer than distance_m, seconds, with gaps up to episode_gap_s
--   floor_id
--   camera_id        the camera that counts it
--   area_id          area in which most of its person-time lies; rest for the rest of the floor; null without a place
--   x_m              mean midpoint, floor metres; null where unknown
--   y_m              mean midpoint, floor metres
--   min_distance_m   closest approach
--   track_a          the lesser track id
--   track_b          the greater track id
--   is_open          it started in opening hours
--   is_together      the two walk in one group or stand in one company; null where that cannot be known, as in a queue
--   recorded_s       recorded time of the camera in the hour, seconds
-- assumes: numbers at different distances do not compare: a short distance cuts one meeting into several violations
select
    make_timestamptz(violations.started_ms * 1000) as started,
    violations.local_date,
    violations.local_hour,
    violations.duration_s,
    violations.floor_id,
    violations.camera_id,
    case when violations.x_m is not null then coalesce(violations.area_id, 'rest') end as area_id,
    violations.x_m,
    violations.y_m,
    violations.min_distance_m,
    violations.track_a,
    violations.track_b,
    violations.is_open,
    violations.is_together,
    camera_hours.recorded_s
from violations
left join camera_hours
    on violations.camera_id = camera_hours.camera_id and violations.hour_start_ms = camera_hours.hour_start_ms
order by violations.started_ms, violations.camera_id, violations.track_a, violations.track_b
