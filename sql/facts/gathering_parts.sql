-- name: facts/gathering_parts
-- One row per part of a gathering within one UTC hour: clusters of at least gathering_people people that share two track ids from each
-- to the next. Parts that are too short for a gathering and continue in no other hour are left out. The mart `gatherings` joins parts.
-- grain: camera_id, started_ms, cluster
-- reads: gathering_links, gathering_clusters, shared_tracks
-- params: gathering_last_ms
-- columns:
--   hour          UTC hour number
--   camera_id
--   started_ms    first cluster, milliseconds since 1970, UTC
--   cluster       least number of a person of it
--   ended_ms      last cluster
--   interval_ms   frame interval, added once to a gathering's duration
--   n_people      most people in it at one instant
--   person_ms     person-milliseconds in it
--   placed_ms     those of clusters with a place
--   x_mm_ms       sum of person-milliseconds * middle of the cluster: its mean place is x_mm_ms / placed_ms
--   y_mm_ms       likewise
--   wide_ms       time of clusters with two positions
--   width_mm_ms   sum of that time * the largest distance between two of its people
--   open_left     it continues a part of an earlier hour
--   open_right    it continues in a later hour
-- steps:
--   parts     weights times places, so that the mean place of joined parts is a division of sums
--   at_once   a part may hold two clusters at one instant, when a gathering splits for a moment: its people are added
--   going_on  a part that is too short alone may belong to a long gathering of the hour before or after
-- assumes: two parts of one hour that are linked only through another hour are two rows, even when they overlap in time
with parts as (
    select
        g.component as part,
        c.hour,
        c.camera_id,
        c.ts_ms,
        c.n_people,
        c.weight_ms,
        c.interval_ms,
        c.n_people * c.weight_ms as person_ms,
        case when c.n_located > 0 then c.n_people * c.weight_ms else 0 end as placed_ms,
        cast(round(c.n_people * c.weight_ms * c.sum_x_mm / nullif(c.n_located, 0)) as bigint) as x_mm_ms,
        cast(round(c.n_people * c.weight_ms * c.sum_y_mm / nullif(c.n_located, 0)) as bigint) as y_mm_ms,
        case when c.square_mm2 is not null then c.weight_ms else 0 end as wide_ms,
        cast(round(c.weight_ms * sqrt(c.square_mm2)) as bigint) as width_mm_ms
    from gathering_links as g
    inner join gathering_clusters as c on g.node = c.cluster_no
),

at_once as (
    select
        part,
        ts_ms,
        sum(n_people) as n_people
    from parts
    group by part, ts_ms
),

most as (
    select
        part,
        cast(max(n_people) as bigint) as n_people
    from at_once
    group by part
),

going_on as (
    select
        g.component as part,
        bool_or(coalesce(cast(floor(t.before_ms / 3600000) as bigint) < t.hour, false)) as open_left,
        bool_or(coalesce(cast(floor(t.after_ms / 3600000) as bigint) > t.hour, false)) as open_right
    from shared_tracks as t
    inner join gathering_links as g on t.cluster_no = g.node
    group by g.component
),

summed as (
    select
        part,
        hour,
        camera_id,
        min(ts_ms) as started_ms,
        max(ts_ms) as ended_ms,
        max(interval_ms) as interval_ms,
        cast(sum(person_ms) as bigint) as person_ms,
        cast(sum(placed_ms) as bigint) as placed_ms,
        cast(coalesce(sum(x_mm_ms), 0) as bigint) as x_mm_ms,
        cast(coalesce(sum(y_mm_ms), 0) as bigint) as y_mm_ms,
        cast(sum(wide_ms) as bigint) as wide_ms,
        cast(coalesce(sum(width_mm_ms), 0) as bigint) as width_mm_ms
    from parts
    group by part, hour, camera_id
)

select
    p.hour,
    p.camera_id,
    p.started_ms,
    c.cluster,
    p.ended_ms,
    p.interval_ms,
    most.n_people,
    p.person_ms,
    p.placed_ms,
    p.x_mm_ms,
    p.y_mm_ms,
    p.wide_ms,
    p.width_mm_ms,
    coalesce(o.open_left, false) as open_left,
    coalesce(o.open_right, false) as open_right
from summed as p
cross join params as s
inner join gathering_clusters as c on p.part = c.cluster_no
inner join most on p.part = most.part
left join going_on as o on p.part = o.part
where p.ended_ms - p.started_ms + p.interval_ms >= s.gathering_last_ms or o.open_left or o.open_right
order by p.hour, p.camera_id, p.started_ms, c.cluster
