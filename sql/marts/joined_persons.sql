-- name: marts/joined_persons
-- One row per track of a site day that is one person with a track of another camera, with the first track of that person.
-- grain: camera_id, site_day, track_id
-- reads: joined_tracks, track_lives, site_days
-- params: view_twice_ms
-- columns:
--   camera_id
--   site_day          day in the site's zone that starts at day_starts; track ids end with it
--   track_id          pseudonym of the engine's track number, of one site day
--   person_camera_id  camera of the least track of those of one person, in order of camera and id
--   person_track_id   that track
-- steps:
--   tracks   numbered in the order of camera and id: the walk below carries one integer
--   reached  a transitive closure that only walks towards lesser numbers; `union` removes repeats, so it ends
--   twice    a person is not in two places of one view: what has two tracks of a camera at once joins nothing
-- assumes: what is one person as a third is one person, within one site day; in which hours they agree does not matter
with recursive found as materialized (
    select distinct
        site_days.site_day,
        joined_tracks.camera_id,
        joined_tracks.track_id,
        joined_tracks.other_camera_id,
        joined_tracks.other_track_id
    from joined_tracks
    inner join site_days on floor(joined_tracks.hour * 3600000 / 900000) = site_days.quarter
),

ends as (
    select
        site_day,
        camera_id,
        track_id
    from found
    union
    select
        site_day,
        other_camera_id as camera_id,
        other_track_id as track_id
    from found
),

tracks as materialized (
    select
        site_day,
        camera_id,
        track_id,
        row_number() over (order by site_day, camera_id, track_id) as track_no
    from ends
),

links as materialized (
    select
        a.track_no as lesser_no,
        b.track_no
    from found
    inner join tracks as a on found.site_day = a.site_day and found.camera_id = a.camera_id and found.track_id = a.track_id
    inner join tracks as b
        on found.site_day = b.site_day and found.other_camera_id = b.camera_id and found.other_track_id = b.track_id
),

edges as materialized (
    select
        track_no,
        lesser_no as other_no
    from links
    union all
    select
        lesser_no as track_no,
        track_no as other_no
    from links
),

-- every lesser track of the component reaches a track; on the way from the least one all numbers are greater than it
reached as (
    select
        track_no,
        other_no as lesser_no
    from edges
    where other_no < track_no
    union
    select
        edges.track_no,
        reached.lesser_no
    from reached
    inner join edges on reached.track_no = edges.other_no
    where reached.lesser_no < edges.track_no
),

persons as materialized (
    select
        tracks.site_day,
        tracks.camera_id,
        tracks.track_id,
        least(tracks.track_no, coalesce(min(reached.lesser_no), tracks.track_no)) as person_no
    from tracks
    left join reached on tracks.track_no = reached.track_no
    group by tracks.site_day, tracks.camera_id, tracks.track_id, tracks.track_no
),

lives as (
    select
        persons.site_day,
        persons.person_no,
        persons.camera_id,
        persons.track_id,
        track_lives.first_ms,
        track_lives.last_ms
    from track_lives
    inner join site_days on floor(track_lives.first_ms / 900000) = site_days.quarter
    inner join persons
        on
            site_days.site_day = persons.site_day
            and track_lives.camera_id = persons.camera_id
            and track_lives.track_id = persons.track_id
),

twice as (
    select distinct a.person_no
    from lives as a
    cross join params as s
    inner join lives as b on a.person_no = b.person_no and a.camera_id = b.camera_id and a.track_id < b.track_id
    where least(a.last_ms, b.last_ms) - greatest(a.first_ms, b.first_ms) > s.view_twice_ms
)

select
    persons.camera_id,
    persons.site_day,
    persons.track_id,
    first_tracks.camera_id as person_camera_id,
    first_tracks.track_id as person_track_id
from persons
inner join tracks as first_tracks on persons.person_no = first_tracks.track_no
where persons.person_no not in (select twice.person_no from twice)
order by persons.site_day, persons.camera_id, persons.track_id
