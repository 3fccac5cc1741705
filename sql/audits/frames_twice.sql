-- name: audits/frames_twice
-- One row per key of frames that occurs more than once among the parts checked.
-- grain: camera_id, ts
-- reads: part_frames
-- columns:
--   camera_id
--   ts            instant, UTC
--   n_rows        rows with this key, at least 2
--   first_part    number of the first part that holds it
--   last_part     number of the last one; the same when one part holds both
-- assumes: all parts of an hour are checked together, so that a key twice in the store is a key twice here
select
    camera_id,
    ts,
    count(*) as n_rows,
    min(part) as first_part,
    max(part) as last_part
from part_frames
group by camera_id, ts
having count(*) > 1
order by camera_id, ts
