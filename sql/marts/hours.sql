-- name: marts/hours
-- One row per local hour of the calendar, over all cameras.
-- grain: hour_start_ms
-- reads: camera_hours
-- params: full_hour_share, partial_hour_share
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
        min(length_s) as length_s,
        min(open_s) as open_s,
        avg(recorded_s) as recorded_s,
        case
            when min(open_s) > 0 then sum(recorded_open_s) / sum(open_s)
            else sum(recorded_s) / sum(length_s)
        end as recorded_share,
        count(*) filter (
            where case when open_s > 0 then recorded_open_s / open_s else recorded_s / length_s end < params.partial_hour_share
        ) as cameras_down,
        bool_or(is_inferred) as is_inferred,
        sum(person_records)::bigint as person_records,
        sum(exposure_s) as exposure_s,
        sum(violation_records)::bigint as violation_records,
        sum(violation_s) as violation_s,
        sum(n_violations)::bigint as n_violations,
        sum(n_violations_open)::bigint as n_violations_open
    from camera_hours
    cross join params
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
    summed.recorded_share,
    summed.cameras_down,
    summed.is_inferred,
    summed.person_records,
    summed.exposure_s,
    summed.violation_records,
    summed.violation_s,
    summed.n_violations,
    summed.n_violations_open,
    case
        when open_s = 0 then 'closed'
        when recorded_share >= params.full_hour_share then 'full'
        when recorded_share >= params.partial_hour_share then 'partial'
        when recorded_share > 0 then 'low_data'
        else 'no_data'
    end as state
from summed
cross join params
order by hour_start_ms
