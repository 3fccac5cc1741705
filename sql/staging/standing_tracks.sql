-- name: staging/standing_tracks
-- One row per track and window in which it is standing in company: the company, named by its least track.
-- grain: camera_id, window_ms, track_id
-- reads: window_company, window_tracks
-- columns:
--   camera_id
--   window_ms  start of the window
--   track_id   pseudonym of the engine's track number
--   group_id   the least track id of the company
--   seen_ms    person-milliseconds the track was seen in the window
-- assumes: the least track id of a company names it, in this window only
select
    c.camera_id,
    c.window_ms,
    t.track_id,
    g.track_id as group_id,
    t.seen_ms
from window_company as c
inner join window_tracks as t on c.camera_id = t.camera_id and c.window_ms = t.window_ms and c.node = t.member
inner join window_tracks as g on c.camera_id = g.camera_id and c.window_ms = g.window_ms and c.component = g.member
