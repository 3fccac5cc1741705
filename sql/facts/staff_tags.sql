-- name: facts/staff_tags
-- One row per UTC hour and track with a record that the engine's class or tag calls staff.
-- grain: hour, camera_id, track_id
-- reads: stored_observations, staff_classes
-- columns:
--   hour       UTC hour number
--   camera_id
--   track_id   pseudonym of the engine's track number, of one site day
--   n_staff    records whose class or tag was one of staff_classes when they were stored
-- assumes: no rows while staff_classes is empty
select
    cast(floor(unix_millis(ts) / 3600000) as bigint) as hour,
    camera_id,
    track_id,
    count(*) as n_staff
from stored_observations
where track_id is not null and is_staff and (select count(*) from staff_classes) > 0
group by cast(floor(unix_millis(ts) / 3600000) as bigint), camera_id, track_id
order by hour, camera_id, track_id
