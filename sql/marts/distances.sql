-- name: marts/distances
-- One row per camera, local date and millimetre of distance: pairs and person-time with the nearest neighbour that far apart.
-- stored_by: local_date
-- grain: camera_id, local_date, distance_mm
-- reads: distance_times, calendar, cameras
-- columns:
--   camera_id
--   local_date
--   distance_mm  whole millimetres, rounded down, up to pair_max_m
--   n_pairs      pair records counted by this camera (it owns their midpoint)
--   n_sent       those whose distance the engine sent
--   nearest_s    person-seconds with the nearest neighbour this far (it owns their own position)
-- figure: M11 Minimum distance
--   definition   person-time in violation by distance to the nearest person: below 0.5, 1, 1.5 m and distance_m
--   unit         share of violation time
--   denominator  person-hours in violation
--   needs        30 violations
--   uncertainty  none; the engine's own error: M26
--   by           vsd_analytics.figures.episodes.episode_figures
-- figure: M26 Threshold sensitivity
--   definition   M6 at 0.9, 1 and 1.1 times distance_m, over all recorded hours; beside it the effect of the stated error of the engine
--   unit         share of person-time
--   denominator  person-hours
--   needs        distances stored that far (pair_max_m)
--   uncertainty  none; it is itself one
--   by           vsd_analytics.figures.sensitivity.threshold_sensitivity
-- assumes: sums over distance_mm < 1000 D are the violation_records and violation_s of a legal distance of D
select
    distance_times.camera_id,
    calendar.local_date,
    distance_times.distance_mm,
    sum(distance_times.n_pairs)::bigint as n_pairs,
    sum(distance_times.n_sent)::bigint as n_sent,
    sum(distance_times.nearest_ms) / 1000 as nearest_s
from distance_times
inner join calendar on distance_times.bucket_quarter = calendar.quarter
inner join cameras on distance_times.camera_id = cameras.camera_id
group by distance_times.camera_id, calendar.local_date, distance_times.distance_mm
order by calendar.local_date, distance_times.camera_id, distance_times.distance_mm
