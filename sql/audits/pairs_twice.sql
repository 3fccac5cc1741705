-- name: audits/pairs_twice
-- One row per key of pairs that occurs more than once among the parts checked.
-- grain: camera_id, ts, track_a, track_b, x_a_mm, y_a_mm, x_b_mm, y_b_mm, person_a, person_b, distance_mm
-- reads: part_pairs
-- columns:
--   camera_id
--   ts            instant, UTC
--   track_a       track of the first person, null where the engine gives none
--   track_b       of the second
--   x_a_mm        as stored, where a track is missing; else null
--   y_a_mm        as stored, where a track is missing; else null
--   x_b_mm        as stored, where a track is missing; else null
--   y_b_mm        as stored, where a track is missing; else null
--   person_a      as stored, where a track is missing; else null
--   person_b      as stored, where a track is missing; else null
--   distance_mm   as stored, where a track is missing; else null
--   n_rows        rows with this key, at least 2
--   first_part    number of the first part that holds it
--   last_part     number of the last one; the same when one part holds both
-- assumes: all parts of an hour are checked together, so that a key twice in the store is a key twice here
select
    camera_id,
    ts,
    track_a,
    track_b,
    case when track_a is null or track_b is null then x_a_mm end as x_a_mm,
    case when track_a is null or track_b is null then y_a_mm end as y_a_mm,
    case when track_a is null or track_b is null then x_b_mm end as x_b_mm,
    case when track_a is null or track_b is null then y_b_mm end as y_b_mm,
    case when track_a is null or track_b is null then person_a end as person_a,
    case when track_a is null or track_b is null then person_b end as person_b,
    case when track_a is null or track_b is null then distance_mm end as distance_mm,
    count(*) as n_rows,
    min(part) as first_part,
    max(part) as last_part
from part_pairs
group by
    camera_id,
    ts,
    track_a,
    track_b,
    case when track_a is null or track_b is null then x_a_mm end,
    case when track_a is null or track_b is null then y_a_mm end,
    case when track_a is null or track_b is null then x_b_mm end,
    case when track_a is null or track_b is null then y_b_mm end,
    case when track_a is null or track_b is null then person_a end,
    case when track_a is null or track_b is null then person_b end,
    case when track_a is null or track_b is null then distance_mm end
having count(*) > 1
order by camera_id, ts, track_a, track_b, x_a_mm, y_a_mm, x_b_mm, y_b_mm, person_a, person_b, distance_mm
