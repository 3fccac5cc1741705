-- name: staging/gathering_links
-- One row per large cluster: the part of a gathering it belongs to, named by its first cluster in the UTC hour.
-- graph: the query gives edges (node_a, node_b); rows are their nodes, each with the least node it is connected to
-- grain: node
-- reads: gathering_clusters, shared_tracks
-- columns:
--   node       the cluster, as in gathering_clusters
--   component  the first cluster connected to it
-- assumes: parts end with the hour, so that an hour depends on its own records; gathering_joins has the links between hours
select
    cluster_no as node_a,
    cluster_no as node_b
from gathering_clusters
union all
select
    before_no as node_a,
    cluster_no as node_b
from shared_tracks
where before_no is not null and cast(floor(before_ms / 3600000) as bigint) = hour
