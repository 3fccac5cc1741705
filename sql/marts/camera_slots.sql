-- name: marts/camera_slots
-- One row per camera, local day and hour of the clock, with opening time; the two equal hours of a night of clock change are one row.
-- grain: camera_id, local_date, local_hour
-- reads: camera_hours
-- columns:
--   camera_id
--   camera_no          position in vsd.toml
--   floor_id
--   local_date
--   local_hour         0 to 23
--   open_h             opening time in hours; 2 where an always open site puts its clocks back
--   recorded_h         recorded opening time, hours
--   person_h           person-hours in opening hours; null where nothing was recorded or the engine sends no positions
--   violation_h        person-hours in violation in opening hours; null where they cannot be known in a recorded part of it
--   n_violations       violations that started in opening hours; null where they cannot be known in a recorded part of it
-- assumes: hours without opening time are left out, and the hour the clocks skip is missing
select
    camera_id,
    camera_no,
    floor_id,
    local_date,
    local_hour,
    sum(open_s) / 3600 as open_h,
    sum(recorded_open_s) / 3600 as recorded_h,
    case
        when count(*) filter (where recorded_open_s > 0 and exposure_open_s is null) = 0 then sum(exposure_open_s) / 3600
    end as person_h,
    case
        when count(*) filter (where recorded_open_s > 0 and violation_open_s is null) = 0 then sum(violation_open_s) / 3600
    end as violation_h,
    case
        when count(*) filter (where recorded_open_s > 0 and n_violations_open is null) = 0 then sum(n_violations_open)
    end as n_violations
from camera_hours
where open_s > 0
group by camera_id, camera_no, floor_id, local_date, local_hour
order by local_date, local_hour, camera_no
