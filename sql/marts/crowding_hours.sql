-- name: marts/crowding_hours
-- One row per camera and local hour in which it counted a person with a floor position in opening hours: person-time and pair-time.
-- stored_by: local_date
-- grain: camera_id, hour_start_ms
-- reads: crowding, calendar, cameras
-- columns:
--   camera_id
--   floor_id
--   hour_start_ms     UTC instant the local hour starts
--   local_date
--   person_s          person-seconds in opening hours
--   copresent_pair_s  pair-seconds of any two persons counted by this camera at the same instant
--   close_pair_s      pair-seconds of two of them closer than distance_m
-- figure: M19 Map of excess
--   definition   person-seconds in violation over those that random mixing would make of the same crowd and map, both smoothed by a
--                Gaussian of 1 m
--   unit         ratio
--   denominator  expected person-seconds in violation
--   needs        10 expected person-seconds
--   uncertainty  cells clearly above the floor's own ratio, by the test of M20, from 14 recorded days on
--   by           vsd_analytics.figures.maps.excess_map
-- figure: M23 Crowding, layout, behaviour
--   definition   V = P L B: pair-time too close = pair-time in view × chance to be close by the map × rest, and what moved since the
--                week before
--   unit         pair-hours; probability; ratio
--   denominator  pair-hours in view
--   needs        20 person-hours; 5 days for an interval
--   uncertainty  day-clustered 95 % interval of behaviour
--   by           vsd_analytics.figures.mixing.mixing_of
-- assumes: an hour without a row is 0 where the camera recorded, unknown where it did not
select
    crowding.camera_id,
    cameras.floor_id,
    calendar.hour_start_ms,
    min(calendar.local_date) as local_date,
    sum(crowding.person_ms) / 1000.0 as person_s,
    sum(crowding.copresent_pair_ms) / 1000.0 as copresent_pair_s,
    sum(crowding.close_pair_ms) / 1000.0 as close_pair_s
from crowding
inner join calendar on crowding.quarter = calendar.quarter
inner join cameras on crowding.camera_id = cameras.camera_id
where calendar.is_open
group by crowding.camera_id, cameras.floor_id, calendar.hour_start_ms
order by calendar.hour_start_ms, crowding.camera_id
