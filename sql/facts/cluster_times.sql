-- name: facts/cluster_times
-- One row per camera, time bucket and number of people in a cluster: how long such clusters lasted.
-- stored_by: utc_day
-- grain: camera_id, bucket_quarter, n_people
-- reads: clusters
-- params: bucket_quarters
-- columns:
--   hour            UTC hour number
--   camera_id
--   bucket_quarter  first UTC quarter-hour of the bucket (an hour; a quarter where hours do not start on UTC hours)
--   n_people        people in the cluster, at least 2
--   cluster_ms      time they lasted, summed over clusters that this camera counts (it owns their middle)
-- assumes: where another camera counts a cluster there is a row with 0: every violation record has a row
with in_buckets as (
    select
        c.camera_id,
        cast(floor(c.ts_ms / (900000 * s.bucket_quarters)) as bigint) * s.bucket_quarters as bucket_quarter,
        c.n_people,
        case when c.is_owned then c.weight_ms else 0 end as cluster_ms
    from clusters as c
    cross join params as s
)

select
    cast(floor(bucket_quarter / 4) as bigint) as hour,
    camera_id,
    bucket_quarter,
    n_people,
    cast(sum(cluster_ms) as bigint) as cluster_ms
from in_buckets
group by camera_id, bucket_quarter, n_people
order by hour, camera_id, bucket_quarter, n_people
