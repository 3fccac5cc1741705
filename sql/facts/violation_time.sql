-- name: facts/violation_time
-- One row per camera and UTC quarter-hour with a violation record: how many, and how much person-time in violation.
-- grain: camera_id, quarter
-- reads: pairs, located, instants
-- params: distance_mm
-- columns:
--   hour               UTC hour number
--   camera_id
--   quarter            UTC quarter-hours since 1970
--   violation_records  pair records closer than distance_m counted by this camera (it owns their midpoint)
--   violation_ms       person-milliseconds with at least one neighbour closer than distance_m (it owns their own position)
-- assumes: a person with three close neighbours is one person in violation; persons of pairs sent without positions are told apart by member
with close as (
    select
        p.camera_id,
        p.ts_ms,
        p.member_a,
        p.member_b,
        p.track_a,
        p.track_b,
        p.weight_ms,
        p.is_owned,
        p.is_derived
    from pairs as p
    cross join params as s
    where p.distance_mm < s.distance_mm
),

records as (
    select
        camera_id,
        cast(floor(ts_ms / 900000) as bigint) as quarter,
        count(*) filter (where is_owned) as violation_records
    from close
    group by 1, 2
),

persons as (
    select
        camera_id,
        ts_ms,
        is_derived,
        case when is_derived then cast(member_a as varchar) else coalesce(track_a, cast(member_a as varchar)) end as person,
        weight_ms
    from close
    union
    select
        camera_id,
        ts_ms,
        is_derived,
        case when is_derived then cast(member_b as varchar) else coalesce(track_b, cast(member_b as varchar)) end as person,
        weight_ms
    from close
),

person_time as (
    select
        persons.camera_id,
        cast(floor(persons.ts_ms / 900000) as bigint) as quarter,
        cast(sum(persons.weight_ms) as bigint) as violation_ms
    from persons
    left join located
        on
            persons.is_derived
            and persons.camera_id = located.camera_id
            and persons.ts_ms = located.ts_ms
            and persons.person = cast(located.member as varchar)
    where coalesce(located.is_owned, true)
    group by 1, 2
)

select
    cast(floor(coalesce(r.quarter, t.quarter) / 4) as bigint) as hour,
    coalesce(r.camera_id, t.camera_id) as camera_id,
    coalesce(r.quarter, t.quarter) as quarter,
    coalesce(r.violation_records, 0) as violation_records,
    coalesce(t.violation_ms, 0) as violation_ms
from records as r
full outer join person_time as t on r.camera_id = t.camera_id and r.quarter = t.quarter
order by 2, 3
