-- name: marts/joined_segments
-- One row per segment of two people (episode_segments), with the episode of its camera that it is part of.
-- grain: camera_id, track_a, track_b, started_ms
-- reads: episode_segments, track_persons, site_days
-- columns:
--   number         of the episode: 1, 2, ... in order of camera, people and time
--   camera_id
--   track_a        the lesser track id of the segment
--   track_b        the greater track id
--   started_ms     first violation record of the segment, milliseconds since 1970, UTC
--   apart_ms       how long before the segment they were farther apart than distance_m; 0 for the first, and where a gap is bridged
--   is_after_owned  records that this camera owns lie before the segment, in the episode
-- steps:
--   named     a person has one id here, however often the tracker changed it; two ids of one person are no pair
--   again     pairs that met more than once; all others, which are most, begin an episode and need no look back
--   marked    the greatest end of all earlier segments, because a later segment may end first
--   numbered  a running number: it grows at each segment before which the pair parted
-- assumes: people who do not part, by 0.3 m beyond distance_m or for longer than gap_ms, are in one episode; ids are of one site day
with named as (
    select
        s.camera_id,
        s.track_a,
        s.track_b,
        least(coalesce(a.person_id, s.track_a), coalesce(b.person_id, s.track_b)) as person_a,
        greatest(coalesce(a.person_id, s.track_a), coalesce(b.person_id, s.track_b)) as person_b,
        s.started_ms,
        s.ended_ms,
        s.gap_ms,
        s.n_owned,
        s.owned_to_ms,
        coalesce(s.near_from_ms, s.started_ms) as near_from_ms,
        coalesce(s.near_to_ms, s.ended_ms) as near_to_ms,
        s.started_ms - coalesce(s.before_ms, floor(s.interval_ms / 2)::bigint) as met_ms,
        s.ended_ms + coalesce(s.after_ms, ceil(s.interval_ms / 2)::bigint) as parted_ms
    from episode_segments as s
    left join site_days on floor(s.started_ms / 900000) = site_days.quarter
    left join track_persons as a
        on s.camera_id = a.camera_id and site_days.site_day = a.site_day and s.track_a = a.track_id
    left join track_persons as b
        on s.camera_id = b.camera_id and site_days.site_day = b.site_day and s.track_b = b.track_id
),

again as materialized (
    select
        camera_id,
        person_a,
        person_b
    from named
    group by camera_id, person_a, person_b
    having count(*) > 1
),

marked as (
    select
        camera_id,
        track_a,
        track_b,
        person_a,
        person_b,
        started_ms,
        owned_to_ms,
        1 as is_start,
        0 as apart_ms
    from named
    anti join again
        on
            named.camera_id = again.camera_id
            and named.person_a = again.person_a
            and named.person_b = again.person_b
    where person_a <> person_b or track_a = track_b
    union all
    select
        camera_id,
        track_a,
        track_b,
        person_a,
        person_b,
        started_ms,
        owned_to_ms,
        case when near_from_ms - max(near_to_ms) over earlier <= gap_ms then 0 else 1 end as is_start,
        case
            when started_ms - max(ended_ms) over earlier > gap_ms then greatest(0, met_ms - max(parted_ms) over earlier)
            else 0
        end as apart_ms
    from named
    semi join again
        on
            named.camera_id = again.camera_id
            and named.person_a = again.person_a
            and named.person_b = again.person_b
    where person_a <> person_b or track_a = track_b
    window
        earlier as (
            partition by camera_id, person_a, person_b order by started_ms, track_a, track_b
            rows between unbounded preceding and 1 preceding
        )
),

numbered as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        case when is_start = 1 then 0 else apart_ms end as apart_ms,
        owned_to_ms,
        sum(is_start) over (
            order by camera_id, person_a, person_b, started_ms, track_a, track_b rows between unbounded preceding and current row
        )::bigint as number
    from marked
)

select
    number,
    camera_id,
    track_a,
    track_b,
    started_ms,
    apart_ms,
    max(owned_to_ms) over (
        partition by number order by started_ms, track_a, track_b rows between unbounded preceding and 1 preceding
    ) is not null as is_after_owned
from numbered
order by number, started_ms, track_a, track_b
