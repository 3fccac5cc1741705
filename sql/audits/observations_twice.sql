-- name: audits/observations_twice
-- One row per key of observations that occurs more than once among the parts checked.
-- grain: camera_id, ts, track_id, x_mm, y_mm, u_px, v_px
-- reads: part_observations
-- columns:
--   camera_id
--   ts            instant, UTC
--   track_id      track, null where the engine gives none
--   x_mm          as stored, where a track is missing; else null
--   y_mm          as stored, where a track is missing; else null
--   u_px          as stored, where a track is missing; else null
--   v_px          as stored, where a track is missing; else null
--   n_rows        rows with this key, at least 2
--   first_part    number of the first part that holds it
--   last_part     number of the last one; the same when one part holds both
-- assumes: all parts of an hour are checked together, so that a key twice in the store is a key twice here
select
    camera_id,
    ts,
    track_id,
    case when track_id is null then x_mm end as x_mm,
    case when track_id is null then y_mm end as y_mm,
    case when track_id is null then u_px end as u_px,
    case when track_id is null then v_px end as v_px,
    count(*) as n_rows,
    min(part) as first_part,
    max(part) as last_part
from part_observations
group by
    camera_id,
    ts,
    track_id,
    case when track_id is null then x_mm end,
    case when track_id is null then y_mm end,
    case when track_id is null then u_px end,
    case when track_id is null then v_px end
having count(*) > 1
order by camera_id, ts, track_id, x_mm, y_mm, u_px, v_px
