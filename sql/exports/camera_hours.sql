-- name: exports/camera_hours
-- One row per camera and local hour; in the file of vsd export --exact alone.
-- grain: camera_id, start_utc
-- reads: exact_camera_hours
-- columns:
--   camera_id
--   start_utc        start of the hour in UTC
--   start_local      the same on the clocks of the site
--   open_s           opening time in it, seconds
--   recorded_s       recorded time, seconds
--   person_records   person records; null where unknown
--   violations       violations that began in it; likewise
--   exposure_s       person-seconds in view; likewise
--   violation_s      person-seconds too close; likewise
--   state            ok; no_data = nothing recorded
-- assumes: a count of an hour without data is null, never 0
select
    camera_id,
    make_timestamp(epoch_us(cast(started as timestamptz))) as start_utc,
    cast(left(started, 19) as timestamp) as start_local,
    cast(open_s as double) as open_s,
    cast(recorded_s as double) as recorded_s,
    cast(person_records as bigint) as person_records,
    cast(n_violations as bigint) as violations,
    cast(exposure_s as double) as exposure_s,
    cast(violation_s as double) as violation_s,
    case
        when coalesce(recorded_s, 0) = 0 then 'no_data'
        else 'ok'
    end as state
from exact_camera_hours
order by camera_id, start_utc
