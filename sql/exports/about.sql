-- name: exports/about
-- One row per floor and week: what made these numbers.
-- grain: floor_id, week
-- reads: reports
-- columns:
--   site_id           id of the site in vsd.toml
--   site_name         display name of the site
--   floor_id
--   floor_name        display name of the floor
--   week              ISO week, such as 2026-W46
--   time_zone         IANA name of the site's time zone
--   distance_m        legal distance in metres
--   mask_below        counts from 1 to just under this are hidden
--   made_at           UTC time that the report prints: the last record's, or that of --now
--   version           version of vsd_analytics
--   settings_id       hash of all settings
--   is_made_up        the data come from vsd demo
-- assumes: the numbers are those of vsd report --format json of the same week
select
    report ->> '$.site.site_id' as site_id,
    report ->> '$.site.name' as site_name,
    floor_id,
    report ->> '$.site.floor_name' as floor_name,
    report ->> '$.week.iso' as week,
    report ->> '$.week.zone' as time_zone,
    cast(report ->> '$.rules.distance_m' as double) as distance_m,
    cast(report ->> '$.rules.mask_below' as integer) as mask_below,
    make_timestamp(epoch_us(cast(report ->> '$.generated_at' as timestamptz))) as made_at,
    report ->> '$.provenance.version' as version,
    report ->> '$.provenance.settings_id' as settings_id,
    cast(report ->> '$.provenance.is_made_up' as boolean) as is_made_up
from reports
order by floor_id, week
