-- name: exports/area_hours
-- One row per area and local hour, opening hours only; in the file of vsd export --exact alone.
-- grain: floor_id, area_id, start_utc
-- reads: exact_area_hours
-- columns:
--   floor_id
--   area_id          area of vsd.toml; rest for the rest of the floor
--   start_utc        start of the hour in UTC
--   start_local      the same on the clocks of the site
--   violations       violations that began in it; null where unknown
--   violation_s      person-seconds too close; likewise
-- assumes: counts are exact, for the operator: a null is unknown
select
    floor_id,
    coalesce(area_id, 'rest') as area_id,
    make_timestamp(epoch_us(cast(started as timestamptz))) as start_utc,
    cast(left(started, 19) as timestamp) as start_local,
    cast(n_violations as bigint) as violations,
    cast(violation_s as double) as violation_s
from exact_area_hours
order by floor_id, area_id, start_utc
