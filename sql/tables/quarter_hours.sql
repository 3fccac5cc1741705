-- name: tables/quarter_hours
-- One row per quarter-hour of the days asked for, over all cameras; those without data and closed ones have a row too.
-- grain: start
-- reads: quarter_hours
-- columns:
--   start              instant the quarter-hour starts, with the site's zone
--   local_date
--   weekday            1 Monday to 7 Sunday
--   local_hour         0 to 23; twice in the night the clocks go back
--   state              full, partial, low_data, no_data or closed
--   is_in_rates        the state is full or partial: it is recorded enough for rates and averages
--   open_s             opening time in it, seconds: 900 or 0
--   recorded_s         recorded time, mean over cameras, seconds
--   recorded_share     of the quarter-hour, mean over cameras
--   cameras_down       cameras that recorded less than half of it
--   person_records     person records; null where unknown
--   exposure_s         person-seconds in view; likewise
--   violation_records  violation records; likewise
--   violation_s        person-seconds in violation; likewise
--   n_violations       violations that started in it; likewise
-- assumes: exact counts, for the operator; the quarter-hours of an hour add up to its row in hours
select
    make_timestamptz(quarter * 900000 * 1000) as start,
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
    n_violations
from quarter_hours
order by quarter
