-- name: facts/exposure
-- One row per camera and UTC quarter-hour in which anybody was seen: how many person records, and how much person-time.
-- grain: camera_id, quarter
-- reads: located, instants
-- columns:
--   hour             UTC hour number
--   camera_id
--   quarter          UTC quarter-hours since 1970
--   person_records   person records counted by this camera (where views overlap, one camera counts)
--   n_doubled        person records left to another camera that sees the place better
--   n_unlocated      person records without a floor position
--   exposure_ms      person-milliseconds in view: sum of the weights of person_records
-- assumes: a record without a floor position is counted by its own camera
select
    cast(floor(located.ts_ms / 3600000) as bigint) as hour,
    located.camera_id,
    cast(floor(located.ts_ms / 900000) as bigint) as quarter,
    count(*) filter (where located.is_owned) as person_records,
    count(*) filter (where not located.is_owned) as n_doubled,
    count(*) filter (where located.x_mm is null) as n_unlocated,
    cast(coalesce(sum(instants.weight_ms) filter (where located.is_owned), 0) as bigint) as exposure_ms
from located
inner join instants on located.camera_id = instants.camera_id and located.ts_ms = instants.ts_ms
group by 1, 2, 3
order by 2, 3
