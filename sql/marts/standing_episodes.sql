-- name: marts/standing_episodes
-- One row per episode of two people who stand in one company for at least half of it, counted in windows of standing_groups.
-- grain: camera_id, track_a, track_b, started_ms
-- reads: whole_episodes, standing_groups
-- params: company_window_ms
-- columns:
--   camera_id   the camera that counts it, as in whole_episodes
--   track_a     the lesser track id
--   track_b     the greater track id
--   started_ms  milliseconds since 1970, UTC
-- assumes: an episode that only touches a window is in it
with windows as (
    select
        e.camera_id,
        e.track_a,
        e.track_b,
        e.started_ms,
        unnest(
            range(
                floor(e.started_ms / params.company_window_ms)::bigint, floor(e.ended_ms / params.company_window_ms)::bigint + 1
            )
        ) * params.company_window_ms as window_ms
    from whole_episodes as e
    cross join params
)

select
    w.camera_id,
    w.track_a,
    w.track_b,
    w.started_ms
from windows as w
left join standing_groups as a on w.camera_id = a.camera_id and w.window_ms = a.window_ms and w.track_a = a.track_id
left join standing_groups as b on w.camera_id = b.camera_id and w.window_ms = b.window_ms and w.track_b = b.track_id
group by w.camera_id, w.track_a, w.track_b, w.started_ms
having 2 * count(*) filter (where a.group_id = b.group_id) >= count(*)
order by w.started_ms, w.camera_id, w.track_a, w.track_b
