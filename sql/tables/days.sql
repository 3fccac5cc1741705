-- name: tables/days
-- One row per local day asked for, over all cameras; days without data and closed days have a row too.
-- grain: local_date
-- reads: hours
-- params: full_hour_share, partial_hour_share
-- columns:
--   local_date
--   weekday                 1 Monday to 7 Sunday
--   state                   full, partial, low_data, no_data or closed, by the share of the opening time recorded
--   is_in_rates             the state is full or partial
--   open_s                  opening time, seconds
--   recorded_s              recorded time in and outside opening hours, mean over cameras, seconds
--   recorded_share          of the opening time, mean over cameras; null when closed
--   n_hours_in_rates        hours whose state is full or partial
--   person_records          person records; null where unknown
--   exposure_s              person-seconds in view; likewise
--   violation_s             person-seconds in violation; likewise
--   n_violations            violations that started on it; likewise
--   n_violations_open       those that started in opening hours; likewise
--   n_violations_in_rates   those that started in hours whose state is full or partial; null without such an hour
-- assumes: counts are those of the hours and cameras that recorded; recorded_share says how much that is
with summed as (
    select
        local_date,
        min(weekday) as weekday,
        sum(open_s) as open_s,
        sum(recorded_s) as recorded_s,
        sum(recorded_share * open_s) / nullif(sum(open_s), 0) as recorded_share,
        count(*) filter (where state in ('full', 'partial')) as n_hours_in_rates,
        sum(person_records)::bigint as person_records,
        sum(exposure_s) as exposure_s,
        sum(violation_s) as violation_s,
        sum(n_violations)::bigint as n_violations,
        sum(n_violations_open)::bigint as n_violations_open,
        (sum(n_violations_open) filter (where state in ('full', 'partial')))::bigint as n_violations_in_rates
    from hours
    group by local_date
),

judged as (
    select
        summed.*,
        recording_state(
            summed.open_s, summed.recorded_share, params.full_hour_share, params.partial_hour_share
        ) as state
    from summed
    cross join params
)

select
    local_date,
    weekday,
    state,
    state in ('full', 'partial') as is_in_rates,
    open_s,
    recorded_s,
    recorded_share,
    n_hours_in_rates,
    person_records,
    exposure_s,
    violation_s,
    n_violations,
    n_violations_open,
    n_violations_in_rates
from judged
order by local_date
