-- name: exports/context_days
-- One row per series of vsd context add, such as sales or weather, and local day of the weeks.
-- grain: series, local_date
-- reads: site_context_days
-- columns:
--   series        name of the series
--   unit          unit of the values
--   place         area or floor it concerns, or site
--   local_date
--   value         sum, or mean by open time, of the intervals in the day; null unless they cover its open time
--   open_min      minutes of opening time in it
-- assumes: missing is not 0
select
    name as series,
    unit,
    place,
    local_date,
    value,
    cast(open_s / 60 as integer) as open_min
from site_context_days
order by series, local_date
