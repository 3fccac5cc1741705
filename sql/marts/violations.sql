-- name: marts/violations
-- One row per violation: an episode of at least episode_min_s, counted once, whichever cameras saw it.
-- stored_by: local_date
-- grain: camera_id, started_ms, track_a, track_b
-- reads: episodes, episode_areas, cameras, areas
-- columns:
--   camera_id        the camera that counts it, as in episodes
--   floor_id
--   track_a          the lesser track id
--   track_b          the greater track id
--   started_ms       milliseconds since 1970, UTC
--   duration_s       time closer than distance_m, with gaps up to gap_ms
--   x_m              mean midpoint, floor metres
--   y_m              mean midpoint, floor metres
--   cx               floor(x / cell_m)
--   cy               floor(y / cell_m)
--   area_id          area of vsd.toml in which most of its person-time in violation lies; null for the rest of the floor
--   min_distance_m   closest approach
--   hour_start_ms    UTC instant of its local hour
--   local_date
--   local_hour       0 to 23
--   is_open          it started in opening hours
--   is_together      the two walk in one group or stand in one company; null where that cannot be known, as in a queue
-- figure: M7 Encounters per person-hour
--   definition   violations / person-hours
--   unit         violations per person-hour
--   denominator  person-hours
--   needs        20 person-hours; 5 days and 5 violations for an interval
--   uncertainty  day-clustered 95 % interval; five verdicts on the change
--   by           vsd_analytics.figures.rates.encounter_rate_level
-- figure: M10 Duration of violations
--   definition   median, 90 % quantile, share of 30 s and longer, of violations that began in opening hours
--   unit         s; share
--   denominator  violations
--   needs        30 violations; 5 days for intervals
--   uncertainty  day-block bootstrap; "at least" where over 20 % were seen in part only
--   by           vsd_analytics.figures.episodes.episode_figures
-- assumes: a violation in a report is a row here; in a queue people stand close whoever they came with
select
    episodes.camera_id,
    cameras.floor_id,
    episodes.track_a,
    episodes.track_b,
    episodes.started_ms,
    episodes.duration_s,
    episodes.x_m,
    episodes.y_m,
    episodes.cx,
    episodes.cy,
    episode_areas.area_id,
    episodes.min_distance_m,
    episodes.hour_start_ms,
    episodes.local_date,
    episodes.local_hour,
    episodes.is_open,
    case when not coalesce(areas.is_queue, false) then episodes.is_together end as is_together
from episodes
inner join cameras on episodes.camera_id = cameras.camera_id
left join episode_areas
    on
        episodes.camera_id = episode_areas.camera_id
        and episodes.track_a = episode_areas.track_a
        and episodes.track_b = episode_areas.track_b
        and episodes.started_ms = episode_areas.started_ms
left join areas on episode_areas.area_id = areas.area_id
where episodes.is_violation and episodes.is_owned
order by episodes.started_ms, episodes.camera_id, episodes.track_a, episodes.track_b
