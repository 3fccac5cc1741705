-- name: marts/quarter_hours
-- One row per quarter-hour of the calendar, over all cameras.
-- grain: quarter
-- reads: calendar, camera_hours, coverage, exposure, violation_time, whole_episodes
-- params: full_hour_share, partial_hour_share
-- columns:
--   quarter            UTC quarter-hours since 1970
--   hour_start_ms      UTC instant the local hour starts
--   local_date
--   local_hour         0 to 23
--   weekday            1 Monday to 7 Sunday
--   open_s             opening time in it: 900 or 0
--   recorded_s         recorded time, mean over cameras
--   recorded_share     of the quarter-hour, mean over cameras
--   cameras_down       cameras that recorded less than half of it
--   person_records     person records
--   exposure_s         person-seconds in view
--   violation_records  violation records
--   violation_s        person-seconds in violation
--   n_violations       violations that started in it
--   state              full, partial, low_data, no_data or closed
-- steps:
--   of_cameras  what a camera can count in an hour, it can count in each quarter-hour of it that it recorded
-- assumes: counts of the quarter-hours of an hour add up to those of the hour; a camera is there for whole hours
with started as (
    select
        camera_id,
        cast(floor(started_ms / 900000) as bigint) as quarter,
        count(*) as n_violations
    from whole_episodes
    where is_violation and is_owned
    group by camera_id, cast(floor(started_ms / 900000) as bigint)
),

of_cameras as (
    select
        calendar.quarter,
        calendar.hour_start_ms,
        calendar.local_date,
        calendar.local_hour,
        calendar.weekday,
        calendar.is_open,
        coalesce(coverage.recorded_ms, 0) / 1000.0 as recorded_s,
        case
            when coverage.recorded_ms > 0 and camera_hours.person_records is not null then coalesce(exposure.person_records, 0)
        end as person_records,
        case
            when coverage.recorded_ms > 0 and camera_hours.exposure_s is not null then coalesce(exposure.exposure_ms, 0)
        end as exposure_ms,
        case
            when coverage.recorded_ms > 0 and camera_hours.violation_records is not null
                then coalesce(violation_time.violation_records, 0)
        end as violation_records,
        case
            when coverage.recorded_ms > 0 and camera_hours.violation_s is not null then coalesce(violation_time.violation_ms, 0)
        end as violation_ms,
        case
            when coverage.recorded_ms > 0 and camera_hours.n_violations is not null then coalesce(started.n_violations, 0)
        end as n_violations
    from calendar
    inner join camera_hours on calendar.hour_start_ms = camera_hours.hour_start_ms and camera_hours.length_s > 0
    left join coverage on camera_hours.camera_id = coverage.camera_id and calendar.quarter = coverage.quarter
    left join exposure on camera_hours.camera_id = exposure.camera_id and calendar.quarter = exposure.quarter
    left join violation_time
        on camera_hours.camera_id = violation_time.camera_id and calendar.quarter = violation_time.quarter
    left join started on camera_hours.camera_id = started.camera_id and calendar.quarter = started.quarter
),

summed as (
    select
        of_cameras.quarter,
        of_cameras.hour_start_ms,
        of_cameras.local_date,
        of_cameras.local_hour,
        of_cameras.weekday,
        case when of_cameras.is_open then 900 else 0 end as open_s,
        avg(of_cameras.recorded_s) as recorded_s,
        avg(of_cameras.recorded_s) / 900 as recorded_share,
        count(*) filter (where of_cameras.recorded_s / 900 < params.partial_hour_share) as cameras_down,
        cast(sum(of_cameras.person_records) as bigint) as person_records,
        sum(of_cameras.exposure_ms) / 1000.0 as exposure_s,
        cast(sum(of_cameras.violation_records) as bigint) as violation_records,
        sum(of_cameras.violation_ms) / 1000.0 as violation_s,
        cast(sum(of_cameras.n_violations) as bigint) as n_violations
    from of_cameras
    cross join params
    group by
        of_cameras.quarter,
        of_cameras.hour_start_ms,
        of_cameras.local_date,
        of_cameras.local_hour,
        of_cameras.weekday,
        of_cameras.is_open
)

select
    summed.quarter,
    summed.hour_start_ms,
    summed.local_date,
    summed.local_hour,
    summed.weekday,
    summed.open_s,
    summed.recorded_s,
    summed.recorded_share,
    summed.cameras_down,
    summed.person_records,
    summed.exposure_s,
    summed.violation_records,
    summed.violation_s,
    summed.n_violations,
    recording_state(summed.open_s, summed.recorded_share, params.full_hour_share, params.partial_hour_share) as state
from summed
cross join params
order by summed.quarter
