-- name: tables/hours
-- One row per local hour of the days asked for, over all cameras; hours without data and closed hours have a row too.
-- grain: start
-- reads: hours
-- columns:
--   start              instant the hour starts, with the site's zone
--   local_date
--   weekday            1 Monday to 7 Sunday
--   local_hour         0 to 23; twice in the night the clocks go back
--   state              full, partial, low_data, no_data or closed
--   is_in_rates        the state is full or partial: the hour is recorded enough for rates and averages
--   open_s             opening time in it, seconds
--   recorded_s         recorded time, mean over cameras, seconds
--   recorded_share     of the opening time, mean over cameras; of the whole hour when closed
--   cameras_down       cameras that recorded less than half of it
--   person_records     person records; null where unknown
--   exposure_s         person-seconds in view; likewise
--   violation_records  violation records; likewise
--   violation_s        person-seconds in violation; likewise
--   n_violations       violations that started in it; likewise
--   n_violations_open  those that started in opening hours; null also when closed
-- assumes: counts are those of the cameras that recorded; the weekly page counts by camera-hour, see camera_hours
select
    make_timestamptz(hour_start_ms * 1000) as start,
    local_date,
    weekday,
    local_hour,
    state,
    state in ('full', 'partial') as is_in_rates,
    open_s,
    recorded_s,
    recorded_share,
    cameras_down,
    person_records,
    exposure_s,
    violation_records,
    violation_s,
    n_violations,
    n_violations_open
from hours
order by hour_start_ms
