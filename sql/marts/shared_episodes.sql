-- name: marts/shared_episodes
-- One row per camera episode that another camera saw as well, with the first of those that are the same episode (components of same_pairs).
-- grain: number
-- reads: joined_segments, same_pairs
-- columns:
--   number  of a row of camera_episodes
--   first   the least number of those that are one episode
-- steps:
--   found    same_pairs names segments of an hour; joined_segments says which episode each is part of
--   reached  a transitive closure that only walks towards lesser numbers; `union` removes repeats, so it ends
-- assumes: two pairs that each equal a third are the same pair
with recursive found as (
    select distinct
        a.number,
        b.number as other
    from same_pairs as s
    inner join joined_segments as a
        on
            s.camera_id = a.camera_id
            and s.track_a = a.track_a
            and s.track_b = a.track_b
            and s.started_ms = a.started_ms
    inner join joined_segments as b
        on
            s.other_camera_id = b.camera_id
            and s.other_track_a = b.track_a
            and s.other_track_b = b.track_b
            and s.other_started_ms = b.started_ms
),

edges as materialized (
    select
        number,
        other
    from found
    union all
    select
        other as number,
        number as other
    from found
),

-- every lesser number of the component reaches an episode; on the way from the least one all numbers are greater than it
reached as (
    select
        number,
        other as lesser
    from edges
    where other < number
    union
    select
        edges.number,
        reached.lesser
    from reached
    inner join edges on reached.number = edges.other
    where reached.lesser < edges.number
),

labels as (
    select
        number,
        lesser as first
    from reached
    union all
    select
        number,
        number as first
    from edges
)

select
    number,
    min(first) as first
from labels
group by number
order by number
