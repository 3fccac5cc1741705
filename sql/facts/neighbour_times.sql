-- name: facts/neighbour_times
-- One row per camera, time bucket and number of others closer than distance_m: person-time in such company.
-- stored_by: utc_day
-- grain: camera_id, bucket_quarter, n_others
-- reads: in_violation
-- params: bucket_quarters
-- columns:
--   hour            UTC hour number
--   camera_id
--   bucket_quarter  first UTC quarter-hour of the bucket (an hour; a quarter where hours do not start on UTC hours)
--   n_others        others closer than distance_m at the instant, at least 1
--   violation_ms    person-milliseconds counted by this camera (it owns the person's own position)
-- assumes: sums over all rows are the violation_ms of violation_time; who has nobody so close is in no row
with in_buckets as (
    select
        v.camera_id,
        cast(floor(v.ts_ms / (900000 * s.bucket_quarters)) as bigint) * s.bucket_quarters as bucket_quarter,
        v.n_others,
        v.weight_ms
    from in_violation as v
    cross join params as s
    where v.is_owned
)

select
    cast(floor(bucket_quarter / 4) as bigint) as hour,
    camera_id,
    bucket_quarter,
    n_others,
    cast(sum(weight_ms) as bigint) as violation_ms
from in_buckets
group by camera_id, bucket_quarter, n_others
order by hour, camera_id, bucket_quarter, n_others
