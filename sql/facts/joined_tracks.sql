-- name: facts/joined_tracks
-- One row per UTC hour and two tracks of two cameras that are one person: both cameras place it at the same spot, and nobody else near it.
-- grain: hour, camera_id, track_id, other_camera_id, other_track_id
-- reads: located, cameras, joined_floors
-- params: same_step_ms, view_place_mm, view_margin_mm, view_error_mm, view_seconds
-- columns:
--   hour             UTC hour number
--   camera_id        the lesser camera id
--   track_id         its track
--   other_camera_id  the greater camera id
--   other_track_id   the track of that camera
--   n_same           whole seconds in which each is nearest to the other, within 0.35 m, and any third track is 0.3 m farther away
--   n_both           whole seconds in which both tracks have a place
-- steps:
--   placed      an engine may send one id twice in a frame: the first record counts
--   at_seconds  frames of two cameras fall on different instants; places are compared at whole seconds, by linear interpolation
--   reaching    comparing by squares of side 1 m, each track with those of its square and the eight around it
--   ranked      the nearest track of the other camera, and how much farther its second nearest is, seen from either side
--   trusted     cameras whose places or clocks disagree have far nearest tracks, so they join nothing in this hour
-- assumes: at least 3 seconds are the same, and half of n_both; the middle distance of nearest tracks within 1 m is at most 0.25 m
with placed as (
    select
        l.camera_id,
        c.floor_id,
        l.track_id,
        l.ts_ms,
        min_by(l.x_mm, l.member) as x_mm,
        min_by(l.y_mm, l.member) as y_mm
    from located as l
    inner join cameras as c on l.camera_id = c.camera_id
    inner join joined_floors as f on c.floor_id = f.floor_id
    where l.track_id is not null and l.x_mm is not null
    group by l.camera_id, c.floor_id, l.track_id, l.ts_ms
),

followed as (
    select
        camera_id,
        floor_id,
        track_id,
        ts_ms,
        x_mm,
        y_mm,
        lead(ts_ms) over track as to_ms,
        lead(x_mm) over track as to_x_mm,
        lead(y_mm) over track as to_y_mm
    from placed
    window track as (partition by camera_id, track_id order by ts_ms)
),

seconds as (
    select 0 as k
    union all
    select 1 as k
    union all
    select 2 as k
    union all
    select 3 as k
),

at_seconds as (
    select
        p.camera_id,
        p.floor_id,
        p.track_id,
        cast(ceil(p.ts_ms / 1000) as bigint) + n.k as second,
        (1000 * (cast(ceil(p.ts_ms / 1000) as bigint) + n.k) - p.ts_ms) / (p.to_ms - p.ts_ms) as share,
        p.x_mm,
        p.y_mm,
        p.to_x_mm,
        p.to_y_mm
    from followed as p
    cross join seconds as n
    cross join params as s
    where p.to_ms - p.ts_ms <= s.same_step_ms and 1000 * (cast(ceil(p.ts_ms / 1000) as bigint) + n.k) < p.to_ms
),

seen as materialized (
    select
        camera_id,
        floor_id,
        track_id,
        second,
        cast(floor(second / 3600) as bigint) as hour,
        x_mm + share * (to_x_mm - x_mm) as x_mm,
        y_mm + share * (to_y_mm - y_mm) as y_mm,
        cast(floor((x_mm + share * (to_x_mm - x_mm)) / 1000) as integer) as gx,
        cast(floor((y_mm + share * (to_y_mm - y_mm)) / 1000) as integer) as gy
    from at_seconds
),

steps as (
    select -1 as step
    union all
    select 0 as step
    union all
    select 1 as step
),

reaching as (
    select
        p.camera_id,
        p.floor_id,
        p.track_id,
        p.second,
        p.x_mm,
        p.y_mm,
        p.gx + a.step as gx,
        p.gy + b.step as gy
    from seen as p
    cross join steps as a
    cross join steps as b
),

near as materialized (
    select
        p.hour,
        p.second,
        p.camera_id,
        p.track_id,
        q.camera_id as other_camera_id,
        q.track_id as other_track_id,
        sqrt((p.x_mm - q.x_mm) * (p.x_mm - q.x_mm) + (p.y_mm - q.y_mm) * (p.y_mm - q.y_mm)) as apart_mm
    from seen as p
    inner join reaching as q
        on
            p.floor_id = q.floor_id
            and p.second = q.second
            and p.gx = q.gx
            and p.gy = q.gy
            and p.camera_id < q.camera_id
    where (p.x_mm - q.x_mm) * (p.x_mm - q.x_mm) + (p.y_mm - q.y_mm) * (p.y_mm - q.y_mm) <= 1000 * 1000
),

ranked as materialized (
    select
        hour,
        camera_id,
        track_id,
        other_camera_id,
        other_track_id,
        apart_mm,
        row_number() over one as rank,
        row_number() over other as other_rank,
        lead(apart_mm) over one as next_mm,
        lead(apart_mm) over other as other_next_mm
    from near
    window
        one as (partition by second, camera_id, track_id, other_camera_id order by apart_mm, other_track_id),
        other as (partition by second, other_camera_id, other_track_id, camera_id order by apart_mm, track_id)
),

trusted as (
    select
        r.hour,
        r.camera_id,
        r.other_camera_id
    from ranked as r
    cross join params as s
    where r.rank = 1 and r.other_rank = 1
    group by r.hour, r.camera_id, r.other_camera_id, s.view_error_mm
    having median(r.apart_mm) <= s.view_error_mm
),

agreeing as (
    select
        r.hour,
        r.camera_id,
        r.track_id,
        r.other_camera_id,
        r.other_track_id,
        count(*) as n_same
    from ranked as r
    cross join params as s
    inner join trusted as t on r.hour = t.hour and r.camera_id = t.camera_id and r.other_camera_id = t.other_camera_id
    where
        r.rank = 1 and r.other_rank = 1 and r.apart_mm <= s.view_place_mm
        and coalesce(r.next_mm >= r.apart_mm + s.view_margin_mm, true)
        and coalesce(r.other_next_mm >= r.apart_mm + s.view_margin_mm, true)
    group by r.hour, r.camera_id, r.track_id, r.other_camera_id, r.other_track_id
),

compared as (
    select
        g.hour,
        g.camera_id,
        g.track_id,
        g.other_camera_id,
        g.other_track_id,
        g.n_same,
        count(*) as n_both
    from agreeing as g
    inner join seen as p on g.hour = p.hour and g.camera_id = p.camera_id and g.track_id = p.track_id
    inner join seen as q
        on g.other_camera_id = q.camera_id and g.other_track_id = q.track_id and p.second = q.second
    group by g.hour, g.camera_id, g.track_id, g.other_camera_id, g.other_track_id, g.n_same
)

select
    c.hour,
    c.camera_id,
    c.track_id,
    c.other_camera_id,
    c.other_track_id,
    c.n_same,
    c.n_both
from compared as c
cross join params as s
where c.n_same >= s.view_seconds and 2 * c.n_same >= c.n_both
order by c.hour, c.camera_id, c.track_id, c.other_camera_id, c.other_track_id
