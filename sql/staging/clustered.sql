-- name: staging/clustered
-- One row per person and instant in a cluster, with its place.
-- grain: camera_id, ts_ms, member
-- reads: frame_clusters, in_violation
-- columns:
--   camera_id
--   ts_ms      milliseconds since 1970, UTC
--   cluster    least number of a person of its cluster
--   member     number of the person, as in pairs
--   track_id   null when the engine does not track
--   x_mm       floor millimetres, null when unknown
--   y_mm       floor millimetres
--   weight_ms  time that the frame represents
-- assumes: every person in violation is in a cluster
select
    f.camera_id,
    f.ts_ms,
    f.component as cluster,
    f.node as member,
    v.track_id,
    v.x_mm,
    v.y_mm,
    v.weight_ms
from frame_clusters as f
inner join in_violation as v on f.camera_id = v.camera_id and f.ts_ms = v.ts_ms and f.node = v.member
