-- name: marts/met_days
-- One row per track and site day: how many others came closer than distance_m, and the longest time with one of them.
-- stored_by: site_day
-- grain: camera_id, site_day, track_id
-- reads: track_days, pair_days
-- columns:
--   camera_id
--   site_day    day in the site's zone that starts at day_starts; track ids end with it
--   track_id    pseudonym of the engine's track number, of one site day
--   exposure_s  person-seconds in view
--   n_met       different other tracks that were closer than distance_m in any record
--   longest_s   seconds closer than distance_m to one of them, of the one with most; 0 without any
-- figure: M31 Others met
--   definition   different others closer than distance_m to a person at any time of the day: median and 90 % quantile over track ids
--   unit         others for each track id
--   denominator  track ids of cameras whose ids last
--   needs        30 track ids that last, as M9; 5 days for intervals
--   uncertainty  day-block bootstrap; a lower bound where a person has several ids
--   by           vsd_analytics.figures.neighbours.others_met
-- figure: M34 People with 15 minutes too close
--   definition   track ids with 15 minutes or more closer than distance_m to one other track id, within a site day (24 hours) / track ids
--   unit         share of track ids
--   denominator  track ids of cameras whose ids last
--   needs        as M12 and M31
--   uncertainty  day-clustered 95 % interval; a lower bound, as M12
--   by           vsd_analytics.figures.neighbours.others_met
-- assumes: each camera is computed by itself: a person whom two cameras see has two track ids
with sides as (
    select
        camera_id,
        site_day,
        track_a as track_id,
        violation_s
    from pair_days
    union all
    select
        camera_id,
        site_day,
        track_b as track_id,
        violation_s
    from pair_days
),

met as (
    select
        camera_id,
        site_day,
        track_id,
        count(*) as n_met,
        max(violation_s) as longest_s
    from sides
    group by camera_id, site_day, track_id
)

select
    track_days.camera_id,
    track_days.site_day,
    track_days.track_id,
    track_days.exposure_s,
    coalesce(met.n_met, 0) as n_met,
    coalesce(met.longest_s, 0) as longest_s
from track_days
left join met
    on
        track_days.camera_id = met.camera_id
        and track_days.site_day = met.site_day
        and track_days.track_id = met.track_id
order by track_days.site_day, track_days.camera_id, track_days.track_id
