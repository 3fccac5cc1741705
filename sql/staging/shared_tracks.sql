-- name: staging/shared_tracks
-- One row per two track ids of one large cluster: the previous cluster with both, and the instant of the next one.
-- In a cluster of more than 40 people, only ids at most 8 places apart in order are paired: work grows with people, not pairs.
-- grain: cluster_no, track_a, track_b
-- reads: gathering_clusters, clustered
-- params: crowd_people
-- columns:
--   hour        UTC hour number
--   camera_id
--   cluster_no  the cluster, as in gathering_clusters
--   ts_ms       its instant, milliseconds since 1970, UTC
--   track_a     the lesser track id
--   track_b     the greater track id
--   before_no   the cluster these two were in before, if within gap_ms; else null
--   before_ms   its instant
--   after_ms    instant of the cluster these two are in next, if within its gap_ms; else null
-- steps:
--   named        group by, as an engine may send one id twice in a frame
--   ranked       place is the rank of an id in its cluster
--   steps        8 neighbours in order of ids: enough pairs to recognise a crowd in its next cluster
--   neighboured  the cluster before and after in which the same two ids were: two shared ids make two clusters one gathering
-- assumes: two clusters that share two track ids within gap_ms are one gathering; an id that occurs twice in a cluster counts once
with named as (
    select
        c.hour,
        c.camera_id,
        c.cluster_no,
        c.ts_ms,
        c.gap_ms,
        c.n_people > params.crowd_people as is_crowd,
        p.track_id
    from gathering_clusters as c
    cross join params
    inner join clustered as p on c.camera_id = p.camera_id and c.ts_ms = p.ts_ms and c.cluster = p.cluster
    where p.track_id is not null
    group by c.hour, c.camera_id, c.cluster_no, c.ts_ms, c.gap_ms, c.n_people, params.crowd_people, p.track_id
),

steps as (
    select 1 as step
    union all
    select 2 as step
    union all
    select 3 as step
    union all
    select 4 as step
    union all
    select 5 as step
    union all
    select 6 as step
    union all
    select 7 as step
    union all
    select 8 as step
),

ranked as (
    select
        hour,
        camera_id,
        cluster_no,
        ts_ms,
        gap_ms,
        track_id,
        row_number() over (partition by cluster_no order by track_id) as place
    from named
    where is_crowd
),

reaching as (
    select
        n.cluster_no,
        n.track_id,
        n.place + s.step as place
    from ranked as n
    cross join steps as s
),

paired as (
    select
        a.hour,
        a.camera_id,
        a.cluster_no,
        a.ts_ms,
        a.gap_ms,
        a.track_id as track_a,
        b.track_id as track_b
    from named as a
    inner join named as b on a.cluster_no = b.cluster_no and a.track_id < b.track_id
    where not a.is_crowd
    union all
    select
        b.hour,
        b.camera_id,
        b.cluster_no,
        b.ts_ms,
        b.gap_ms,
        a.track_id as track_a,
        b.track_id as track_b
    from reaching as a
    inner join ranked as b on a.cluster_no = b.cluster_no and a.place = b.place
),

neighboured as (
    select
        hour,
        camera_id,
        cluster_no,
        ts_ms,
        gap_ms,
        track_a,
        track_b,
        lag(cluster_no) over in_time as before_no,
        lag(ts_ms) over in_time as before_ms,
        lead(ts_ms) over in_time as after_ms,
        lead(gap_ms) over in_time as after_gap_ms
    from paired
    window
        in_time as (partition by camera_id, track_a, track_b order by ts_ms, cluster_no)
)

select
    hour,
    camera_id,
    cluster_no,
    ts_ms,
    track_a,
    track_b,
    case when ts_ms - before_ms <= gap_ms then before_no end as before_no,
    case when ts_ms - before_ms <= gap_ms then before_ms end as before_ms,
    case when after_ms - ts_ms <= after_gap_ms then after_ms end as after_ms
from neighboured
