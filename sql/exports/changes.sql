-- name: exports/changes
-- One row per floor and entry of the change log that a report of these weeks shows.
-- grain: floor_id, at_utc, text
-- reads: reports
-- columns:
--   floor_id
--   at_utc       when it was done, UTC
--   at_local     the same on the clocks of the site
--   text         what was done
--   area_id      area it was done in; null for none
--   area_name    display name of the area
-- assumes: an entry that several weeks show is here once
with entries as (
    select
        floor_id,
        unnest(cast(report -> '$.log' as json[])) as entry
    from reports
)

select distinct
    floor_id,
    make_timestamp(epoch_us(cast(entry ->> '$.at' as timestamptz))) as at_utc,
    cast(left(entry ->> '$.at', 19) as timestamp) as at_local,
    entry ->> '$.text' as text,
    entry ->> '$.area_id' as area_id,
    entry ->> '$.area_name' as area_name
from entries
where entry ->> '$.kind' = 'logged'
order by floor_id, at_utc, text
