-- name: exports/hours
-- One row per floor and local hour, over all cameras of the floor.
-- grain: floor_id, start_utc
-- reads: reports
-- columns:
--   floor_id
--   week              ISO week, such as 2026-W46
--   start_utc         start of the hour in UTC
--   start_local       the same on the clocks of the site
--   local_date
--   local_hour        0 to 23
--   recorded_share    recorded over open time, mean over cameras; null when closed
--   cameras_down      cameras that recorded less than half of the hour
--   violations        violations that began in it; null where hidden or unknown
--   state             full, partial, low_data, no_data, closed or not_over; masked: a small count is hidden; held_back: it would reveal one
-- assumes: an hour without data has a null count and state no_data: what happened is unknown
with cells as (
    select
        floor_id,
        report ->> '$.week.iso' as week,
        unnest(cast(report -> '$.when.cells' as json[])) as cell
    from reports
)

select
    floor_id,
    week,
    make_timestamp(epoch_us(cast(cell ->> '$.start' as timestamptz))) as start_utc,
    cast(left(cell ->> '$.start', 19) as timestamp) as start_local,
    cast(cell ->> '$.day' as date) as local_date,
    cast(cell ->> '$.hour' as integer) as local_hour,
    cast(cell ->> '$.share' as double) as recorded_share,
    cast(cell ->> '$.cameras_down' as integer) as cameras_down,
    cast(cell ->> '$.violations' as bigint) as violations,
    case
        when cast(cell ->> '$.is_masked' as boolean) then 'masked'
        when cast(cell ->> '$.is_held_back' as boolean) then 'held_back'
        else cell ->> '$.state'
    end as state
from cells
order by floor_id, start_utc
