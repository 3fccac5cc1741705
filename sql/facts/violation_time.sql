-- name: facts/violation_time
-- One row per camera and UTC quarter-hour with a violation record: violation records and person-time in violation.
-- stored_by: utc_day
-- grain: camera_id, quarter
-- reads: pairs, in_violation
-- params: distance_mm
-- columns:
--   hour               UTC hour number
--   camera_id
--   quarter            UTC quarter-hours since 1970
--   violation_records  pair records closer than distance_m counted by this camera (it owns their midpoint)
--   violation_ms       person-milliseconds with at least one neighbour closer than distance_m (it owns their own position)
-- figure: M6 Violation time share (headline 2)
--   definition   person-seconds with somebody closer than distance_m / person-seconds; of all people, and of people of different groups
--   unit         share of person-time
--   denominator  person-hours
--   needs        5 recorded days and 20 person-hours for an interval
--   uncertainty  day-clustered 95 % interval, as M7
--   by           vsd_analytics.figures.person_time.person_time
-- assumes: where views overlap, a camera may count one person of a pair, or the pair and neither person
with counted as (
    select
        p.camera_id,
        cast(floor(p.ts_ms / 900000) as bigint) as quarter,
        case when p.is_owned then 1 else 0 end as violation_records,
        0 as violation_ms
    from pairs as p
    cross join params as s
    where p.distance_mm < s.distance_mm
    union all
    select
        camera_id,
        cast(floor(ts_ms / 900000) as bigint) as quarter,
        0 as violation_records,
        case when is_owned then weight_ms else 0 end as violation_ms
    from in_violation
)

select
    cast(floor(quarter / 4) as bigint) as hour,
    camera_id,
    quarter,
    cast(sum(violation_records) as bigint) as violation_records,
    cast(sum(violation_ms) as bigint) as violation_ms
from counted
group by camera_id, quarter
order by hour, camera_id, quarter
