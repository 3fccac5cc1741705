-- name: staging/window_pairs
-- One row per pair of tracks and window in which they were closer than company_reach_mm: how long, and how far apart on average.
-- grain: camera_id, window_ms, member_a, member_b
-- reads: pairs, window_tracks
-- params: company_window_ms, company_reach_mm
-- columns:
--   camera_id
--   window_ms  start of the window
--   member_a   number of the lesser track, as in window_tracks
--   member_b   number of the greater track
--   n_records  records closer than company_reach_mm
--   close_ms   time they were closer than company_reach_mm
--   mean_mm    mean distance over the time the one seen longer was seen, rounded down; apart or out of view counts as company_reach_mm
-- steps:
--   close  two records with the same id in one frame are no pair
--   timed  a pair that an engine sends without a person's record makes the time seen too short, so it is at least the time close
-- assumes: who passes by somebody who stays has little of the time of either
with close as (
    select
        p.camera_id,
        cast(floor(p.ts_ms / s.company_window_ms) as bigint) * s.company_window_ms as window_ms,
        least(p.track_a, p.track_b) as track_a,
        greatest(p.track_a, p.track_b) as track_b,
        p.weight_ms,
        p.distance_mm
    from pairs as p
    cross join params as s
    where p.distance_mm < s.company_reach_mm and p.track_a <> p.track_b
),

summed as (
    select
        camera_id,
        window_ms,
        track_a,
        track_b,
        count(*) as n_records,
        cast(sum(weight_ms) as bigint) as close_ms,
        cast(sum(cast(weight_ms as bigint) * distance_mm) as bigint) as mm_ms
    from close
    group by camera_id, window_ms, track_a, track_b
),

timed as (
    select
        c.camera_id,
        c.window_ms,
        a.member as member_a,
        b.member as member_b,
        c.n_records,
        c.close_ms,
        c.mm_ms,
        greatest(a.seen_ms, b.seen_ms, c.close_ms) as both_ms
    from summed as c
    inner join window_tracks as a on c.camera_id = a.camera_id and c.window_ms = a.window_ms and c.track_a = a.track_id
    inner join window_tracks as b on c.camera_id = b.camera_id and c.window_ms = b.window_ms and c.track_b = b.track_id
    where c.close_ms > 0
)

select
    t.camera_id,
    t.window_ms,
    t.member_a,
    t.member_b,
    t.n_records,
    t.close_ms,
    cast(floor((t.mm_ms + s.company_reach_mm * (t.both_ms - t.close_ms)) / t.both_ms) as bigint) as mean_mm
from timed as t
cross join params as s
