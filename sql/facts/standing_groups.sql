-- name: facts/standing_groups
-- One row per track and window of 2 minutes in which it is in a standing company: people who stay close to each other.
-- grain: hour, camera_id, window_ms, track_id
-- reads: standing_tracks
-- columns:
--   hour         UTC hour number
--   camera_id
--   window_ms    start of the window, milliseconds since 1970, UTC
--   track_id     pseudonym of the engine's track number, of one site day
--   group_id     the least track id of the company
--   exposure_ms  person-milliseconds of the track in the window, also those another camera counts
-- assumes: company is known by positions alone, window by window: who faces whom is not known
select
    cast(floor(window_ms / 3600000) as bigint) as hour,
    camera_id,
    window_ms,
    track_id,
    group_id,
    seen_ms as exposure_ms
from standing_tracks
order by hour, camera_id, window_ms, track_id
