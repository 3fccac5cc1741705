-- name: facts/company_times
-- One row per person in violation, time bucket and company: how long exactly these others were closer than distance_m.
-- grain: camera_id, bucket_quarter, track_id, company, is_standing
-- reads: pairs, in_violation, standing_tracks
-- params: bucket_quarters, distance_mm, company_window_ms
-- columns:
--   hour            UTC hour number
--   camera_id
--   bucket_quarter  first UTC quarter-hour of the bucket (an hour; a quarter where hours do not start on UTC hours)
--   track_id        the person; null when it has no id
--   company         track ids of all that were closer than distance_m, in order, joined by chr(1); null when one has no id
--   is_standing     all of them stand in one company with the person (standing_groups); null in hours sealed by older versions
--   violation_ms    person-milliseconds counted by this camera (it owns the person's own position)
-- steps:
--   in_buckets  people are counted by the camera that owns their own place, not that of the pair: sums equal violation_time
--   small       most companies are one or two people: their least and greatest id are all of them, so times add up by ids before any text
--               is joined; a company with an unknown member is null, since it cannot be compared with a group
--   sides       the others of people with three or more around them
--   companies   chr(1) separates ids, as no pseudonym holds it
-- assumes: sums over all rows are the violation_ms of violation_time
with standing as (
    select
        p.camera_id,
        p.ts_ms,
        p.member_a,
        p.member_b
    from pairs as p
    cross join params as s
    inner join standing_tracks as a
        on
            p.camera_id = a.camera_id
            and cast(floor(p.ts_ms / s.company_window_ms) as bigint) * s.company_window_ms = a.window_ms
            and p.track_a = a.track_id
    inner join standing_tracks as b
        on
            a.camera_id = b.camera_id
            and a.window_ms = b.window_ms
            and a.group_id = b.group_id
            and p.track_b = b.track_id
    where p.distance_mm < s.distance_mm and p.track_a <> p.track_b
),

n_standing as (
    select
        camera_id,
        ts_ms,
        member,
        count(*) as n
    from (
        select
            camera_id,
            ts_ms,
            member_a as member
        from standing
        union all
        select
            camera_id,
            ts_ms,
            member_b as member
        from standing
    ) as members
    group by camera_id, ts_ms, member
),

in_buckets as (
    select
        v.camera_id,
        cast(floor(v.ts_ms / (900000 * s.bucket_quarters)) as bigint) * s.bucket_quarters as bucket_quarter,
        v.ts_ms,
        v.member,
        v.track_id,
        case when v.n_named = v.n_others then v.n_others else 0 end as n_known,
        v.first_other_id,
        v.last_other_id,
        coalesce(n.n = v.n_others, false) as is_standing,
        v.weight_ms
    from in_violation as v
    cross join params as s
    left join n_standing as n on v.camera_id = n.camera_id and v.ts_ms = n.ts_ms and v.member = n.member
    where v.is_owned
),

small as (
    select
        camera_id,
        bucket_quarter,
        track_id,
        case when n_known >= 1 then first_other_id end as first_other_id,
        case when n_known = 2 then last_other_id end as second_other_id,
        is_standing,
        weight_ms
    from in_buckets
    where n_known <= 2
),

small_times as (
    select
        camera_id,
        bucket_quarter,
        track_id,
        first_other_id,
        second_other_id,
        is_standing,
        sum(weight_ms) as violation_ms
    from small
    group by camera_id, bucket_quarter, track_id, first_other_id, second_other_id, is_standing
),

large as materialized (
    select
        camera_id,
        bucket_quarter,
        ts_ms,
        member,
        track_id,
        is_standing,
        weight_ms
    from in_buckets
    where n_known > 2
),

sides as (
    select
        v.camera_id,
        v.ts_ms,
        v.member,
        p.track_b as other_id
    from pairs as p
    cross join params as s
    inner join large as v on p.camera_id = v.camera_id and p.ts_ms = v.ts_ms and p.member_a = v.member
    where p.distance_mm < s.distance_mm
    union all
    select
        v.camera_id,
        v.ts_ms,
        v.member,
        p.track_a as other_id
    from pairs as p
    cross join params as s
    inner join large as v on p.camera_id = v.camera_id and p.ts_ms = v.ts_ms and p.member_b = v.member
    where p.distance_mm < s.distance_mm
),

companies as (
    select
        camera_id,
        ts_ms,
        member,
        array_join(array_sort(array_agg(other_id)), chr(1)) as company
    from sides
    group by camera_id, ts_ms, member
),

large_times as (
    select
        v.camera_id,
        v.bucket_quarter,
        v.track_id,
        c.company,
        v.is_standing,
        sum(v.weight_ms) as violation_ms
    from large as v
    inner join companies as c on v.camera_id = c.camera_id and v.ts_ms = c.ts_ms and v.member = c.member
    group by v.camera_id, v.bucket_quarter, v.track_id, c.company, v.is_standing
),

every_company as (
    select
        camera_id,
        bucket_quarter,
        track_id,
        cast(first_other_id as string) || coalesce(chr(1) || cast(second_other_id as string), '') as company,
        is_standing,
        violation_ms
    from small_times
    union all
    select
        camera_id,
        bucket_quarter,
        track_id,
        company,
        is_standing,
        violation_ms
    from large_times
)

select
    cast(floor(bucket_quarter / 4) as bigint) as hour,
    camera_id,
    bucket_quarter,
    track_id,
    company,
    is_standing,
    cast(violation_ms as bigint) as violation_ms
from every_company
order by hour, camera_id, bucket_quarter, track_id, company, is_standing
