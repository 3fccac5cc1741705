-- name: exports/calendar
-- One row per local hour of the weeks: date, weekday and opening time.
-- grain: start_utc
-- reads: site_calendar
-- columns:
--   start_utc     start of the hour in UTC
--   local_date
--   week          ISO week, such as 2026-W46
--   weekday       1 Monday to 7 Sunday
--   local_hour    0 to 23
--   fold          1 in the second of two equal local hours, when clocks go back
--   offset_min    minutes east of UTC
--   open_min      minutes of opening time in it
-- assumes: a day has 23, 24 or 25 rows
select
    make_timestamp(hour_start_ms * 1000) as start_utc,
    local_date,
    min(isoyear(local_date) || '-W' || lpad(cast(week(local_date) as varchar), 2, '0')) as week,
    min(weekday) as weekday,
    min(local_hour) as local_hour,
    min(fold) as fold,
    min(offset_min) as offset_min,
    cast(15 * count(*) filter (where is_open) as integer) as open_min
from site_calendar
group by hour_start_ms, local_date
order by start_utc
