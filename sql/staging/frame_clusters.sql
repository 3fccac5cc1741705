-- name: staging/frame_clusters
-- One row per person and instant with a neighbour closer than distance_m: the cluster the person is in, a connected component of all
-- such pairs of one frame.
-- graph: the query gives edges (node_a, node_b); rows are their nodes, each with the least node it is connected to
-- grain: camera_id, ts_ms, node
-- reads: pairs
-- params: distance_mm
-- columns:
--   camera_id
--   ts_ms      milliseconds since 1970, UTC
--   node       number of the person, as in pairs
--   component  least number of a person of the cluster
-- assumes: a cluster is single linkage: six people in a row are one
select
    p.camera_id,
    p.ts_ms,
    p.member_a as node_a,
    p.member_b as node_b
from pairs as p
cross join params as s
where p.distance_mm < s.distance_mm
