-- name: tables/episodes
-- One row per episode that started in the days asked for: a pair closer than distance_m, of any length, counted once over all cameras.
-- grain: camera_id, started, track_a, track_b
-- reads: episodes, cameras, camera_hours
-- columns:
--   started          instant of its first violation record, with the site's zone
--   ended            instant of its last violation record, with the site's zone
--   local_date
--   local_hour       0 to 23
--   duration_s       time closer than distance_m, seconds, with gaps up to episode_gap_s
--   is_violation     it lasted at least episode_min_s
--   is_cut           seen in part: the frames do not show when they came closer or parted; null where unknown
--   floor_id
--   camera_id        the camera that counts it
--   x_m              mean midpoint, floor metres; null where unknown
--   y_m              mean midpoint, floor metres
--   min_distance_m   closest approach
--   mean_distance_m  mean over its records
--   n_records        violation records
--   track_a          the lesser track id
--   track_b          the greater track id
--   is_open          it started in opening hours
--   is_together      the two walk in one group or stand in one company for half of it; null where that cannot be known
--   recorded_s       recorded time of the camera in the hour, seconds
-- assumes: an episode whose records another camera counts is left out
select
    make_timestamptz(episodes.started_ms * 1000) as started,
    make_timestamptz(episodes.ended_ms * 1000) as ended,
    episodes.local_date,
    episodes.local_hour,
    episodes.duration_s,
    episodes.is_violation,
    episodes.is_cut,
    cameras.floor_id,
    episodes.camera_id,
    episodes.x_m,
    episodes.y_m,
    episodes.min_distance_m,
    episodes.mean_distance_m,
    episodes.n_records,
    episodes.track_a,
    episodes.track_b,
    episodes.is_open,
    episodes.is_together,
    camera_hours.recorded_s
from episodes
inner join cameras on episodes.camera_id = cameras.camera_id
left join camera_hours
    on episodes.camera_id = camera_hours.camera_id and episodes.hour_start_ms = camera_hours.hour_start_ms
where episodes.is_owned
order by episodes.started_ms, episodes.camera_id, episodes.track_a, episodes.track_b
