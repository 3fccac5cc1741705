-- name: facts/gathering_joins
-- One row per two track ids that link a part of a gathering to a part in an earlier or a later UTC hour.
-- grain: camera_id, ts_ms, track_a, track_b, started_ms, cluster
-- reads: shared_tracks, gathering_links, gathering_clusters
-- columns:
--   hour        UTC hour number
--   camera_id
--   started_ms  the part, as in gathering_parts
--   cluster     likewise
--   track_a     the lesser track id
--   track_b     the greater track id
--   ts_ms       instant of their first cluster of this hour, or of their last one, milliseconds since 1970, UTC
--   before_ms   instant of the one before it, in an earlier hour; null when these two link it to none
--   after_ms    instant of the one after it, in a later hour; null when these two link it to none
-- steps:
--   crossing  links within one hour are edges of gathering_links; only those between hours are left for the mart
-- assumes: a link is in two rows: before_ms of the later hour, after_ms of the earlier one
with crossing as (
    select
        hour,
        camera_id,
        cluster_no,
        ts_ms,
        track_a,
        track_b,
        case when cast(floor(before_ms / 3600000) as bigint) < hour then before_ms end as before_ms,
        case when cast(floor(after_ms / 3600000) as bigint) > hour then after_ms end as after_ms
    from shared_tracks
)

select
    t.hour,
    t.camera_id,
    first_one.ts_ms as started_ms,
    first_one.cluster,
    t.track_a,
    t.track_b,
    t.ts_ms,
    t.before_ms,
    t.after_ms
from crossing as t
inner join gathering_links as g on t.cluster_no = g.node
inner join gathering_clusters as first_one on g.component = first_one.cluster_no
where t.before_ms is not null or t.after_ms is not null
order by t.hour, t.camera_id, t.ts_ms, t.track_a, t.track_b, first_one.ts_ms, first_one.cluster
