-- name: facts/company_times
-- One row per person in violation, time bucket and company: how long exactly these others were closer than distance_m.
-- grain: camera_id, bucket_quarter, track_id, company
-- reads: pairs, in_violation
-- params: bucket_quarters, distance_mm
-- columns:
--   hour            UTC hour number
--   camera_id
--   bucket_quarter  first UTC quarter-hour of the bucket (an hour; a quarter where hours do not start on UTC hours)
--   track_id        the person; null when it has no id
--   company         track ids of all that were closer than distance_m, in order, joined by chr(1); null when one has no id
--   violation_ms    person-milliseconds counted by this camera (it owns the person's own position)
-- steps:
--   companies   chr(1) separates ids, as no pseudonym holds it; a company with an unknown member is null, since it cannot be compared
--               with a group
--   in_buckets  people are counted by the camera that owns their own place, not that of the pair: sums equal violation_time
-- assumes: sums over all rows are the violation_ms of violation_time
with sides as (
    select
        p.camera_id,
        p.ts_ms,
        p.member_a as member,
        p.track_b as other_id
    from pairs as p
    cross join params as s
    where p.distance_mm < s.distance_mm
    union all
    select
        p.camera_id,
        p.ts_ms,
        p.member_b as member,
        p.track_a as other_id
    from pairs as p
    cross join params as s
    where p.distance_mm < s.distance_mm
),

companies as (
    select
        camera_id,
        ts_ms,
        member,
        case
            when count(other_id) < count(*) then null
            when count(*) = 1 then min(other_id)
            else array_to_string(list_sort(list(other_id)), chr(1))
        end as company
    from sides
    group by camera_id, ts_ms, member
),

in_buckets as (
    select
        v.camera_id,
        cast(floor(v.ts_ms / (900000 * s.bucket_quarters)) as bigint) * s.bucket_quarters as bucket_quarter,
        v.track_id,
        c.company,
        v.weight_ms
    from in_violation as v
    cross join params as s
    inner join companies as c on v.camera_id = c.camera_id and v.ts_ms = c.ts_ms and v.member = c.member
    where v.is_owned
)

select
    cast(floor(bucket_quarter / 4) as bigint) as hour,
    camera_id,
    bucket_quarter,
    track_id,
    company,
    cast(sum(weight_ms) as bigint) as violation_ms
from in_buckets
group by camera_id, bucket_quarter, track_id, company
order by hour, camera_id, bucket_quarter, track_id, company
