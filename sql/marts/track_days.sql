-- name: marts/track_days
-- One row per track and site day: how long it lasted, and how many other tracks begin where it ends.
-- stored_by: site_day
-- grain: camera_id, site_day, track_id
-- reads: track_lives, site_days, cameras
-- columns:
--   camera_id
--   site_day       day in the site's zone that starts at day_starts; track ids end with it
--   track_id       pseudonym of the engine's track number, of one site day
--   n_records      person records, also those another camera counts
--   first_ms       first of them, milliseconds since 1970, UTC
--   last_ms        last of them
--   life_s         (last - first record) + the mean time that a record represents
--   exposure_s     person-seconds: sum of the weights of its records
--   n_ends         how often it ends at a known place: once, but for gaps on the hour
--   n_goes_on      other tracks that begin there right after
--   n_came_before  other tracks that began there right before: as many as chance gives
-- figure: M4 Tracks seen
--   definition   track ids, one of a camera and site day each: tracks, not visitors
--   unit         tracks
--   denominator  person records
--   needs        ids sent
--   uncertainty  none; ids that are cut count twice
--   by           vsd_analytics.figures.episodes.episode_figures
-- assumes: an hour's row belongs to the site day of its first record
select
    track_lives.camera_id,
    site_days.site_day,
    track_lives.track_id,
    sum(track_lives.n_records)::bigint as n_records,
    min(track_lives.first_ms) as first_ms,
    max(track_lives.last_ms) as last_ms,
    (max(track_lives.last_ms) - min(track_lives.first_ms) + sum(track_lives.exposure_ms) / sum(track_lives.n_records)) / 1000
        as life_s,
    sum(track_lives.exposure_ms) / 1000 as exposure_s,
    sum(track_lives.n_ends)::bigint as n_ends,
    sum(track_lives.n_goes_on)::bigint as n_goes_on,
    sum(track_lives.n_came_before)::bigint as n_came_before
from track_lives
inner join site_days on floor(track_lives.first_ms / 900000) = site_days.quarter
inner join cameras on track_lives.camera_id = cameras.camera_id
group by track_lives.camera_id, site_days.site_day, track_lives.track_id
order by site_days.site_day, track_lives.camera_id, track_lives.track_id
