-- name: exports/context
-- One row per series of vsd context add, such as sales or weather, and local hour of the weeks.
-- grain: series, start_utc
-- reads: site_context
-- columns:
--   series        name of the series
--   unit          unit of the values
--   place         area or floor it concerns, or site
--   start_utc     start of the hour in UTC
--   local_date
--   local_hour    0 to 23
--   value         sum, or mean by open time, of the intervals in the hour; null unless they cover its open time
--   open_min      minutes of opening time in it
-- assumes: missing is not 0; an interval longer than an hour is in no hour
select
    name as series,
    unit,
    place,
    make_timestamp(epoch_us(start)) as start_utc,
    local_date,
    local_hour,
    value,
    cast(open_s / 60 as integer) as open_min
from site_context
order by series, start_utc
