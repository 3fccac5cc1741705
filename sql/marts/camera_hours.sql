-- name: marts/camera_hours
-- One row per camera and local hour of the calendar, including hours without data.
-- stored_by: local_date
-- grain: camera_id, hour_start_ms
-- reads: camera_hour_records, whole_episodes, calendar
-- columns:
--   camera_id
--   camera_no            position in vsd.toml
--   floor_id
--   hour_start_ms        UTC instant the local hour starts
--   local_date
--   local_hour           0 to 23
--   fold                 1 in the second of two equal local hours
--   weekday              1 Monday to 7 Sunday
--   length_s             length of the local hour while the camera is there (`from` and `to` of vsd.toml)
--   open_s               opening time in it
--   recorded_s           recorded time
--   recorded_open_s      recorded time in opening hours
--   is_inferred          recorded time is inferred from silences; null without data
--   person_records       person records; null also where the engine sends pairs only
--   exposure_s           person-seconds in view; likewise
--   exposure_open_s      person-seconds in opening hours
--   violation_records    violation records; null also where people have pixels only and the camera no calibration
--   violation_s          person-seconds in violation; likewise
--   violation_open_s     person-seconds in violation in opening hours; likewise
--   n_violations         violations that started in it; null also where the engine sends no track ids
--   n_violations_open    those that started in opening hours; M8 sums hours with recorded_open_s >= partial_hour_share * open_s
-- figure: M0 How often (headline 1)
--   definition   sum over cameras of violations / recorded open hours of that camera
--   unit         violations per open hour
--   denominator  recorded open camera-hours
--   needs        5 recorded days and 5 violations for an interval
--   uncertainty  day-clustered 95 % interval; five verdicts on the change
--   by           vsd_analytics.figures.rates.violation_rate_level
-- figure: M13 Hour-of-week profile
--   definition   M7, M0 and people in view by local hour and weekday over the last 4 weeks; rates pulled towards the mean hour as far
--                as chance may have made them
--   unit         per person-hour; per open hour; people
--   denominator  person-hours; recorded open hours
--   needs        an hour recorded in 3 of 4 weeks
--   uncertainty  95 % interval of the pulled rate
--   by           vsd_analytics.figures.hour_of_week.week_profile
-- figure: M14 Peak hours
--   definition   the three highest hours of M13, per open hour and per person-hour, and all that cannot be distinguished from the first
--   unit         as M13
--   denominator  as M13
--   needs        as M13, in a week recorded to 60 %
--   uncertainty  all hours whose interval reaches that of the first are named
--   by           vsd_analytics.figures.hour_of_week.week_profile
-- figure: M24 Unusual hours
--   definition   hours 50 % and 5 violations away from the median of the same hour of up to 8 earlier weeks, at most five
--   unit         violations of the hour beside the usual range
--   denominator  hours that were recorded and have a usual count
--   needs        4 recorded weeks before, in a week recorded to 60 %
--   uncertainty  negative binomial tails, false discovery rate 5 % over the hours of the week
--   by           vsd_analytics.figures.unusual.unusual
-- figure: M25 Forecast of next week
--   definition   median of the last 8 recorded weeks by hour of the week, times the late weeks' level: people, violations; chance of a
--                gathering where they are counted
--   unit         people in view; violations per open hour; probability
--   denominator  open hours
--   needs        4 recorded weeks
--   uncertainty  80 % range; last week's forecast is scored beside the seasonal naive one
--   by           vsd_analytics.figures.forecast.forecast
-- figure: M28 Trend
--   definition   M0, M6 and M7 of each of the last 12 weeks, over the cameras that recorded the last one; weeks recorded too
--                little are gaps, weeks without one of these cameras are marked
--   unit         per open hour; share; per person-hour
--   denominator  recorded open hours; person-hours
--   needs        3 recorded weeks
--   uncertainty  each week's 95 % interval
--   by           vsd_analytics.figures.trend.trend
-- figure: M51 Value per person-hour
--   definition   value of each summed series of vsd context add, such as sales, over person-hours (M3) of the same hours, as M50
--   unit         the unit of the series per person-hour
--   denominator  person-hours
--   needs        20 person-hours; 5 days for an interval; show_context for reports
--   uncertainty  interval as M7, by days
--   by           vsd_analytics.figures.context_figures.value_answer
-- figure: M52 Violations at an equal value
--   definition   change of M0 with recorded hours of each day counted as hours times exp(beta (z - mean)), z a series of vsd context add or
--                its logarithm, beta its log-linear effect within the 16 weeks before; beside it the usual range of M0 at this week's z
--   unit         relative change; violations per open hour
--   denominator  recorded open camera-hours of both weeks
--   needs        8 earlier weeks and 100 violations with values; a value on every day compared, and within those of earlier days
--   uncertainty  interval of the change of M0 and that of beta, by weeks; five verdicts
--   by           vsd_analytics.stats.covariate.change_at_equal_covariate
-- figure: M53 Year on year
--   definition   M0, M6 and people of the week 52 weeks before, and their change over the camera-hours that both weeks recorded
--   unit         as M0, M6, M5; relative change
--   denominator  as M0, M6, M5
--   needs        both weeks recorded to 60 %, by one engine, one set of rules and the same calibrations
--   uncertainty  interval of the change of M0, by days, and by weekly steps before the earlier week; no verdict
--   by           vsd_analytics.figures.year_before.year_before
-- assumes: where nothing was recorded, or a count cannot be known, it is null, never 0
with counted as (
    select
        whole_episodes.camera_id,
        calendar.hour_start_ms,
        count(*) as n_violations,
        count(*) filter (where calendar.is_open) as n_violations_open
    from whole_episodes
    inner join calendar on floor(whole_episodes.started_ms / 900000) = calendar.quarter
    where whole_episodes.is_violation and whole_episodes.is_owned
    group by whole_episodes.camera_id, calendar.hour_start_ms
)

select
    camera_hour_records.camera_id,
    camera_hour_records.camera_no,
    camera_hour_records.floor_id,
    camera_hour_records.hour_start_ms,
    camera_hour_records.local_date,
    camera_hour_records.local_hour,
    camera_hour_records.fold,
    camera_hour_records.weekday,
    camera_hour_records.length_s,
    camera_hour_records.open_s,
    camera_hour_records.recorded_s,
    camera_hour_records.recorded_open_s,
    camera_hour_records.is_inferred,
    camera_hour_records.person_records,
    camera_hour_records.exposure_s,
    camera_hour_records.exposure_open_s,
    camera_hour_records.violation_records,
    camera_hour_records.violation_s,
    camera_hour_records.violation_open_s,
    case when camera_hour_records.counts_violations then coalesce(counted.n_violations, 0) end as n_violations,
    case when camera_hour_records.counts_violations_open then coalesce(counted.n_violations_open, 0) end as n_violations_open
from camera_hour_records
left join counted
    on camera_hour_records.camera_id = counted.camera_id and camera_hour_records.hour_start_ms = counted.hour_start_ms
order by camera_hour_records.hour_start_ms, camera_hour_records.camera_no
