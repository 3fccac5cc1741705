-- name: marts/track_groups
-- One row per track and site day: the group it moves with. Groups are the connected components of pairs that move together.
-- stored_by: site_day
-- grain: camera_id, site_day, track_id
-- reads: track_days, pair_days
-- columns:
--   camera_id
--   site_day   day in the site's zone that starts at day_starts; track ids end with it
--   track_id   pseudonym of the engine's track number, of one site day
--   group_id   the least track id of the group; null for a track that moves with nobody
--   n_members  tracks of the group; 1 for a track that moves with nobody
-- figure: M9 Between-groups share
--   definition   violations of people who neither walk together nor stand in company / violations; M0 and M7 in both readings
--   unit         share of violations
--   denominator  violations
--   needs        ids that last (half of person-time in ids of 20 s, or ids that are not cut); at most half of the violations
--                in queues, where it cannot be known
--   uncertainty  day-clustered 95 % interval; the rule's accuracy is stated
--   by           vsd_analytics.figures.groups.groups
-- steps:
--   reached  a transitive closure that only walks towards lesser ids; `union` removes repeats, so it ends
-- assumes: two people who each move with a third move together
with recursive found as materialized (
    select
        camera_id,
        site_day,
        track_a,
        track_b
    from pair_days
    where moves_together
),

edges as materialized (
    select
        camera_id,
        site_day,
        track_a as track_id,
        track_b as other_id
    from found
    union all
    select
        camera_id,
        site_day,
        track_b as track_id,
        track_a as other_id
    from found
),

-- every lesser id of the component reaches a track; on the way from the least one all ids are greater than it
reached as (
    select
        camera_id,
        site_day,
        track_id,
        other_id as lesser_id
    from edges
    where other_id < track_id
    union
    select
        edges.camera_id,
        edges.site_day,
        edges.track_id,
        reached.lesser_id
    from reached
    inner join edges
        on
            reached.camera_id = edges.camera_id
            and reached.site_day = edges.site_day
            and reached.track_id = edges.other_id
    where reached.lesser_id < edges.track_id
),

labels as (
    select
        camera_id,
        site_day,
        track_id,
        min(lesser_id) as group_id
    from reached
    group by camera_id, site_day, track_id
    union all
    select
        camera_id,
        site_day,
        track_id,
        track_id as group_id
    from edges
    group by camera_id, site_day, track_id
),

members as (
    select
        camera_id,
        site_day,
        track_id,
        min(group_id) as group_id
    from labels
    group by camera_id, site_day, track_id
),

sizes as (
    select
        camera_id,
        site_day,
        group_id,
        count(*) as n_members
    from members
    group by camera_id, site_day, group_id
)

select
    track_days.camera_id,
    track_days.site_day,
    track_days.track_id,
    members.group_id,
    coalesce(sizes.n_members, 1) as n_members
from track_days
left join members
    on
        track_days.camera_id = members.camera_id
        and track_days.site_day = members.site_day
        and track_days.track_id = members.track_id
left join sizes
    on
        members.camera_id = sizes.camera_id
        and members.site_day = sizes.site_day
        and members.group_id = sizes.group_id
order by track_days.site_day, track_days.camera_id, track_days.track_id
