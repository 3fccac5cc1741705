-- name: exports/area_hours
-- One row per area and local hour, opening hours only; small counts hidden as by vsd hours --by area --share.
-- grain: floor_id, area_id, start_utc
-- reads: shared_area_hours
-- columns:
--   floor_id
--   area_id          area of vsd.toml; rest for the rest of the floor
--   start_utc        start of the hour in UTC
--   start_local      the same on the clocks of the site
--   violations       violations that began in it; null where hidden or unknown
--   violation_s      person-seconds too close; likewise
--   state            ok; unknown; masked = a small count is hidden; held_back = hidden because it would reveal one
-- assumes: how long people were in an area in an hour is left out: nobody knows how few they were
select
    floor_id,
    coalesce(area_id, 'rest') as area_id,
    make_timestamp(epoch_us(cast(started as timestamptz))) as start_utc,
    cast(left(started, 19) as timestamp) as start_local,
    cast(n_violations as bigint) as violations,
    cast(violation_s as double) as violation_s,
    case
        when masked then 'masked'
        when held_back then 'held_back'
        when n_violations is null then 'unknown'
        else 'ok'
    end as state
from shared_area_hours
order by floor_id, area_id, start_utc
