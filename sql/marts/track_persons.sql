-- name: marts/track_persons
-- One row per track id of a site day that shares its person with another one, with the least id of that person (components of same_tracks).
-- grain: camera_id, site_day, track_id
-- reads: same_tracks, site_days
-- columns:
--   camera_id
--   site_day   day in the site's zone that starts at day_starts; track ids end with it
--   track_id   pseudonym of the engine's track number, of one site day
--   person_id  the least track id of those of one person
-- steps:
--   reached  a transitive closure that only walks towards lesser ids; `union` removes repeats, so it ends
-- assumes: what is one person as a third is one person; tracks of different cameras are never compared
with recursive found as materialized (
    select distinct
        same_tracks.camera_id,
        site_days.site_day,
        same_tracks.track_a,
        same_tracks.track_b
    from same_tracks
    inner join site_days on floor(same_tracks.hour * 3600000 / 900000) = site_days.quarter
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
)

select
    camera_id,
    site_day,
    track_id,
    min(lesser_id) as person_id
from reached
group by camera_id, site_day, track_id
order by site_day, camera_id, track_id
