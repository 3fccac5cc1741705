-- name: marts/cluster_sizes
-- One row per camera, local date and number of people in a cluster: how long such clusters lasted in opening hours.
-- stored_by: local_date
-- grain: camera_id, local_date, n_people
-- reads: cluster_times, calendar, cameras
-- columns:
--   camera_id
--   floor_id
--   local_date
--   n_people   people in the cluster, at least 2
--   cluster_s  time they lasted, summed over clusters that this camera counts
-- figure: M21 Cluster sizes
--   definition   time people spent in clusters of 2, 3, 4, 5 to 7, 8 and more people / time in clusters
--   unit         share of clustered person-time
--   denominator  person-hours in clusters
--   needs        clusters for half an hour in all
--   uncertainty  none
--   by           vsd_analytics.figures.gatherings.gatherings
-- assumes: in one frame, people closer than distance_m are in one cluster, and so are all whom a chain of such people connects
select
    cluster_times.camera_id,
    cameras.floor_id,
    calendar.local_date,
    cluster_times.n_people,
    sum(cluster_times.cluster_ms) / 1000 as cluster_s
from cluster_times
inner join calendar on cluster_times.bucket_quarter = calendar.quarter
inner join cameras on cluster_times.camera_id = cameras.camera_id
where calendar.is_open
group by cluster_times.camera_id, cameras.floor_id, calendar.local_date, cluster_times.n_people
order by calendar.local_date, cluster_times.camera_id, cluster_times.n_people
