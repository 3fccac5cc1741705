-- name: marts/hours
-- One row per local hour of the calendar, over all cameras.
-- grain: hour_start_ms
-- reads: camera_hours, hour_states
-- columns:
--   hour_start_ms      UTC instant the local hour starts
--   local_date
--   local_hour         0 to 23
--   fold               1 in the second of two equal local hours
--   weekday            1 Monday to 7 Sunday
--   length_s           length of the local hour
--   open_s             opening time in it
--   recorded_s         recorded time, mean over cameras
--   recorded_share     of the opening time, mean over cameras; of the whole hour when closed
--   cameras_down       cameras that recorded less than half of it
--   is_inferred        some of it is inferred from silences; null without data
--   person_records     person records
--   exposure_s         person-seconds in view
--   violation_records  violation records
--   violation_s        person-seconds in violation
--   n_violations       violations that started in it
--   n_violations_open  those that started in opening hours
--   state              full, partial, low_data, no_data or closed
-- assumes: the state governs rates and verdicts only; counts are sums over the cameras that can know them, null where none can
with summed as (
    select
        hour_start_ms,
        min(local_date) as local_date,
        min(local_hour) as local_hour,
        min(fold) as fold,
        min(weekday) as weekday,
        max(length_s) as length_s,
        max(open_s) as open_s,
        avg(recorded_s) filter (where length_s > 0) as recorded_s,
        bool_or(is_inferred) as is_inferred,
        sum(person_records)::bigint as person_records,
        sum(exposure_s) as exposure_s,
        sum(violation_records)::bigint as violation_records,
        sum(violation_s) as violation_s,
        sum(n_violations)::bigint as n_violations,
        sum(n_violations_open)::bigint as n_violations_open
    from camera_hours
    group by hour_start_ms
)

select
    summed.hour_start_ms,
    summed.local_date,
    summed.local_hour,
    summed.fold,
    summed.weekday,
    summed.length_s,
    summed.open_s,
    summed.recorded_s,
    hour_states.recorded_share,
    hour_states.cameras_down,
    summed.is_inferred,
    summed.person_records,
    summed.exposure_s,
    summed.violation_records,
    summed.violation_s,
    summed.n_violations,
    summed.n_violations_open,
    hour_states.state
from summed
inner join hour_states
    on summed.hour_start_ms = hour_states.hour_start_ms and hour_states.floor_id is null
order by summed.hour_start_ms
