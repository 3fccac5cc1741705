-- name: staging/window_tracks
-- One row per track and window of company_window_ms it was seen in: its number in that window, and how long it was seen.
-- grain: camera_id, window_ms, track_id
-- reads: located
-- params: company_window_ms
-- columns:
--   camera_id
--   window_ms  start of the window, milliseconds since 1970, UTC; an hour has a whole number of windows
--   track_id   pseudonym of the engine's track number
--   member     number of the track in its window, in order of track ids
--   seen_ms    person-milliseconds, also those another camera counts
-- assumes: an hour's edge parts a window from the next, so that an hour is computed by itself
with windows as (
    select
        l.camera_id,
        cast(floor(l.ts_ms / s.company_window_ms) as bigint) * s.company_window_ms as window_ms,
        l.track_id,
        l.weight_ms
    from located as l
    cross join params as s
    where l.track_id is not null
)

select
    camera_id,
    window_ms,
    track_id,
    row_number() over (partition by camera_id, window_ms order by track_id) as member,
    cast(sum(weight_ms) as bigint) as seen_ms
from windows
group by camera_id, window_ms, track_id
