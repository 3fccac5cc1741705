-- name: facts/crowding
-- One row per camera and UTC quarter-hour in which it counted a person with a floor position: person-time and pair-time in view.
-- grain: camera_id, quarter
-- reads: located, pairs
-- params: distance_mm
-- columns:
--   hour               UTC hour number
--   camera_id
--   quarter            UTC quarter-hours since 1970
--   frames             instants with at least one person counted by this camera
--   person_ms          person-milliseconds of these persons
--   copresent_pair_ms  pair-milliseconds of any two of them at one instant: n (n - 1) / 2 pairs of n persons
--   close_pair_ms      pair-milliseconds of two of them closer than distance_m
-- steps:
--   close_pairs  both persons must be counted by this camera, as in crowds: else close pairs could exceed all pairs
-- assumes: two persons counted by different cameras are a pair of neither, in all pairs and in close pairs
with standing as (
    select
        camera_id,
        ts_ms,
        member,
        weight_ms
    from located
    where is_owned and x_mm is not null
),

crowds as (
    select
        camera_id,
        ts_ms,
        count(*) as n_persons,
        min(weight_ms) as weight_ms
    from standing
    group by camera_id, ts_ms
),

close_pairs as (
    select
        p.camera_id,
        p.ts_ms,
        p.weight_ms
    from pairs as p
    cross join params as s
    inner join standing as a on p.camera_id = a.camera_id and p.ts_ms = a.ts_ms and p.member_a = a.member
    inner join standing as b on p.camera_id = b.camera_id and p.ts_ms = b.ts_ms and p.member_b = b.member
    where p.distance_mm < s.distance_mm
),

counted as (
    select
        camera_id,
        cast(floor(ts_ms / 900000) as bigint) as quarter,
        1 as frames,
        n_persons * weight_ms as person_ms,
        n_persons * (n_persons - 1) / 2 * weight_ms as copresent_pair_ms,
        0 as close_pair_ms
    from crowds
    union all
    select
        camera_id,
        cast(floor(ts_ms / 900000) as bigint) as quarter,
        0 as frames,
        0 as person_ms,
        0 as copresent_pair_ms,
        weight_ms as close_pair_ms
    from close_pairs
)

select
    cast(floor(quarter / 4) as bigint) as hour,
    camera_id,
    quarter,
    cast(sum(frames) as bigint) as frames,
    cast(sum(person_ms) as bigint) as person_ms,
    cast(sum(copresent_pair_ms) as bigint) as copresent_pair_ms,
    cast(sum(close_pair_ms) as bigint) as close_pair_ms
from counted
group by camera_id, quarter
order by hour, camera_id, quarter
