-- name: facts/same_pairs
-- One row per two episode segments of two cameras that show the same two people: where both cameras see the pair, it is in the same place.
-- grain: camera_id, track_a, track_b, started_ms, other_camera_id, other_track_a, other_track_b, other_started_ms
-- reads: close_records, cameras, owner_cells
-- params: owner_cell_mm, same_place_mm, same_step_ms, same_stay_ms
-- columns:
--   hour              UTC hour number
--   camera_id         the lesser camera id
--   track_a           pair of its segment in episode_segments
--   track_b           likewise
--   started_ms        start of its segment
--   other_camera_id   the greater camera id
--   other_track_a     pair of that camera's segment
--   other_track_b     likewise
--   other_started_ms  start of that segment
--   n_same            whole seconds in which each person is at most 0.5 m apart in the two views, and no other pair fits better
--   n_both            whole seconds in which both segments place the pair on floor from which several cameras may report
-- steps:
--   segments    numbered in the order of camera, tracks and start: the joins and ranks below carry one integer for all of these
--   lasting     pairs on floor without an owner cell are seen by one camera alone and cannot be counted twice; 4 s and 1 s bound how
--               far a position may be carried on without a record
--   seconds     a stretch of at most 4 s holds at most four whole seconds
--   at_seconds  frames of two cameras fall on different instants; their places are compared at whole seconds, by linear interpolation
--   seen        g is the square of side 1 m that holds the midpoint: a sum of two coordinates divided by 2000
--   corners     joining by squares compares each pair with those around it, not with all of the floor
--   ranked      each must be the best fit of the other, so that in a crowd a pair is not joined with
--               its neighbours
--   candidates  a step of its own, so that no engine compares all segments of a second with each other first
--   compared    seconds in which only one camera sees its pair say nothing, so agreement is counted over seconds that both have
-- assumes: at least half of n_both agree; clocks of the cameras agree; ids of different cameras are never compared
with segments as (
    select
        hour,
        camera_id,
        track_a,
        track_b,
        started_ms,
        cast(row_number() over (order by camera_id, track_a, track_b, started_ms) as integer) as segment_no,
        cast(dense_rank() over (order by camera_id, track_a, track_b) as integer) as pair_no
    from close_records
    group by hour, camera_id, track_a, track_b, started_ms
),

floors as (
    select
        floor_id,
        min(camera_no) as floor_no
    from cameras
    group by floor_id
),

lasting as materialized (
    select
        g.segment_no,
        g.pair_no,
        f.floor_no,
        r.camera_id,
        r.hour,
        r.ts_ms,
        r.x_a_mm,
        r.y_a_mm,
        r.x_b_mm,
        r.y_b_mm,
        -- until its next record, at most four seconds on, a pair goes straight there; else it stays for a second at most
        case
            when r.is_followed and r.next_ms - r.ts_ms <= s.same_step_ms then r.next_ms
            else r.ts_ms + least(r.interval_ms, s.same_stay_ms)
        end as to_ms,
        coalesce(case when r.is_followed and r.next_ms - r.ts_ms <= s.same_step_ms then r.next_x_a_mm end, r.x_a_mm) as to_x_a_mm,
        coalesce(case when r.is_followed and r.next_ms - r.ts_ms <= s.same_step_ms then r.next_y_a_mm end, r.y_a_mm) as to_y_a_mm,
        coalesce(case when r.is_followed and r.next_ms - r.ts_ms <= s.same_step_ms then r.next_x_b_mm end, r.x_b_mm) as to_x_b_mm,
        coalesce(case when r.is_followed and r.next_ms - r.ts_ms <= s.same_step_ms then r.next_y_b_mm end, r.y_b_mm) as to_y_b_mm,
        o.camera_id is not null as is_shared
    from close_records as r
    cross join params as s
    inner join cameras as c on r.camera_id = c.camera_id
    inner join floors as f on c.floor_id = f.floor_id
    inner join segments as g
        on
            r.camera_id = g.camera_id
            and r.track_a = g.track_a
            and r.track_b = g.track_b
            and r.started_ms = g.started_ms
    left join owner_cells as o
        on
            c.floor_id = o.floor_id
            and r.ts_ms >= o.from_ms
            and r.ts_ms < o.to_ms
            and cast(floor((r.x_a_mm + r.x_b_mm) / (2 * s.owner_cell_mm)) as integer) = o.cx
            and cast(floor((r.y_a_mm + r.y_b_mm) / (2 * s.owner_cell_mm)) as integer) = o.cy
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
        p.segment_no,
        p.pair_no,
        p.floor_no,
        p.camera_id,
        p.hour,
        cast(ceil(p.ts_ms / 1000) as bigint) + n.k as second,
        (1000 * (cast(ceil(p.ts_ms / 1000) as bigint) + n.k) - p.ts_ms) / (p.to_ms - p.ts_ms) as share,
        p.x_a_mm,
        p.y_a_mm,
        p.x_b_mm,
        p.y_b_mm,
        p.to_x_a_mm,
        p.to_y_a_mm,
        p.to_x_b_mm,
        p.to_y_b_mm
    from lasting as p
    cross join seconds as n
    where p.is_shared and 1000 * (cast(ceil(p.ts_ms / 1000) as bigint) + n.k) < p.to_ms
),

seen as materialized (
    select
        segment_no,
        pair_no,
        floor_no,
        camera_id,
        hour,
        second,
        x_a_mm + share * (to_x_a_mm - x_a_mm) as x_a_mm,
        y_a_mm + share * (to_y_a_mm - y_a_mm) as y_a_mm,
        x_b_mm + share * (to_x_b_mm - x_b_mm) as x_b_mm,
        y_b_mm + share * (to_y_b_mm - y_b_mm) as y_b_mm,
        cast(floor((x_a_mm + x_b_mm + share * (to_x_a_mm + to_x_b_mm - x_a_mm - x_b_mm)) / 2000) as integer) as gx,
        cast(floor((y_a_mm + y_b_mm + share * (to_y_a_mm + to_y_b_mm - y_a_mm - y_b_mm)) / 2000) as integer) as gy
    from at_seconds
),

-- midpoints within 0.5 m of one lie in the squares of side 1 m that hold the corners of the square 0.5 m around it
corners as (
    select
        -1000 as dx2,
        -1000 as dy2
    union all
    select
        -1000 as dx2,
        1000 as dy2
    union all
    select
        1000 as dx2,
        -1000 as dy2
    union all
    select
        1000 as dx2,
        1000 as dy2
),

reaching as (
    select
        p.segment_no,
        p.pair_no,
        p.floor_no,
        p.camera_id,
        p.hour,
        p.second,
        p.x_a_mm,
        p.y_a_mm,
        p.x_b_mm,
        p.y_b_mm,
        cast(floor((p.x_a_mm + p.x_b_mm + n.dx2) / 2000) as integer) as gx,
        cast(floor((p.y_a_mm + p.y_b_mm + n.dy2) / 2000) as integer) as gy
    from seen as p
    cross join corners as n
),

-- whichever person of one is which of the other, the worse placed of the two counts
near as materialized (
    select
        p.second,
        p.camera_id,
        p.pair_no,
        p.segment_no,
        q.camera_id as other_camera_id,
        q.pair_no as other_pair_no,
        q.segment_no as other_segment_no,
        least(
            greatest(
                (p.x_a_mm - q.x_a_mm) * (p.x_a_mm - q.x_a_mm) + (p.y_a_mm - q.y_a_mm) * (p.y_a_mm - q.y_a_mm),
                (p.x_b_mm - q.x_b_mm) * (p.x_b_mm - q.x_b_mm) + (p.y_b_mm - q.y_b_mm) * (p.y_b_mm - q.y_b_mm)
            ),
            greatest(
                (p.x_a_mm - q.x_b_mm) * (p.x_a_mm - q.x_b_mm) + (p.y_a_mm - q.y_b_mm) * (p.y_a_mm - q.y_b_mm),
                (p.x_b_mm - q.x_a_mm) * (p.x_b_mm - q.x_a_mm) + (p.y_b_mm - q.y_a_mm) * (p.y_b_mm - q.y_a_mm)
            )
        ) as square_mm2
    from seen as p
    inner join reaching as q
        on
            p.floor_no = q.floor_no
            and p.hour = q.hour
            and p.second = q.second
            and p.gx = q.gx
            and p.gy = q.gy
            and p.camera_id < q.camera_id
),

ranked as (
    select
        segment_no,
        other_segment_no,
        row_number() over (
            partition by second, pair_no, other_camera_id order by square_mm2, other_segment_no, segment_no
        ) as rank,
        row_number() over (
            partition by second, other_pair_no, camera_id order by square_mm2, segment_no, other_segment_no
        ) as other_rank
    from near
    cross join params as s
    where square_mm2 <= s.same_place_mm * s.same_place_mm
),

agreeing as (
    select
        segment_no,
        other_segment_no,
        count(*) as n_same
    from ranked
    where rank = 1 and other_rank = 1
    group by segment_no, other_segment_no
),

candidates as materialized (
    select
        g.segment_no,
        g.other_segment_no,
        g.n_same,
        p.second
    from agreeing as g
    inner join seen as p on g.segment_no = p.segment_no
),

compared as (
    select
        c.segment_no,
        c.other_segment_no,
        c.n_same,
        count(distinct c.second) as n_both
    from candidates as c
    inner join seen as q on c.other_segment_no = q.segment_no and c.second = q.second
    group by c.segment_no, c.other_segment_no, c.n_same
)

select
    p.hour,
    p.camera_id,
    p.track_a,
    p.track_b,
    p.started_ms,
    q.camera_id as other_camera_id,
    q.track_a as other_track_a,
    q.track_b as other_track_b,
    q.started_ms as other_started_ms,
    c.n_same,
    c.n_both
from compared as c
inner join segments as p on c.segment_no = p.segment_no
inner join segments as q on c.other_segment_no = q.segment_no
where 2 * c.n_same >= c.n_both
order by p.hour, p.camera_id, p.track_a, p.track_b, p.started_ms, q.camera_id, q.track_a, q.track_b, q.started_ms
