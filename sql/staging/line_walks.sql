-- name: staging/line_walks
-- One row per record and counting line of its floor: who it is, also after a new id near a line, and where seen from the line.
-- grain: camera_id, line_id, first_track_id, first_piece_ms, ts_ms
-- reads: located, cameras, count_lines
-- params: cut_speed_ms, line_near_mm, line_lost_ms, line_place_mm, line_mm_per_s
-- columns:
--   camera_id
--   line_id         line of vsd.toml
--   length_mm       its length
--   first_track_id  first track of the person
--   first_piece_ms  first instant of that track's piece
--   track_id        pseudonym of the engine's track number of this record, of one site day
--   ts_ms           milliseconds since 1970, UTC
--   side_mm         distance from the straight line through both ends, positive on the left of whoever walks from the first to the second
--   along_mm        place along it, from its first point
-- steps:
--   placed     an engine may send one id twice in a frame: the first record counts
--   pieces     an id that is away for over 10 s may come back as somebody else: what follows is another piece
--   near_ends  pieces that begin or end within 2 m of a line, where a lost person must be found again
--   foreseen   who is lost goes on as in the last second: a beginning is so far off the place foreseen
--   links      an end and a beginning that are each nearest to the other, and near enough to the place foreseen: one person with a new id
--   chained    pieces of one person, each with the first of them
-- assumes: who has a new id goes on within 10 s, at most 0.5 m and 0.5 m/s off the way of the last second
with recursive placed as (
    select
        l.camera_id,
        c.floor_id,
        l.track_id,
        l.ts_ms,
        min_by(l.x_mm, l.member) as x_mm,
        min_by(l.y_mm, l.member) as y_mm
    from located as l
    inner join cameras as c on l.camera_id = c.camera_id
    where l.track_id is not null and l.x_mm is not null and c.floor_id in (select floor_id from count_lines)
    group by l.camera_id, c.floor_id, l.track_id, l.ts_ms
),

spaced as (
    select
        p.camera_id,
        p.floor_id,
        p.track_id,
        p.ts_ms,
        p.x_mm,
        p.y_mm,
        coalesce(p.ts_ms - (lag(p.ts_ms) over track) > s.line_lost_ms, true) as begins,
        coalesce((lead(p.ts_ms) over track) - p.ts_ms > s.line_lost_ms, true) as ends
    from placed as p
    cross join params as s
    window track as (partition by p.camera_id, p.track_id order by p.ts_ms)
),

pieces as materialized (
    select
        camera_id,
        floor_id,
        track_id,
        ts_ms,
        x_mm,
        y_mm,
        begins,
        ends,
        max(case when begins then ts_ms end) over (
            partition by camera_id, track_id order by ts_ms rows between unbounded preceding and current row
        ) as piece_ms
    from spaced
),

located_by_line as materialized (
    select
        p.camera_id,
        p.track_id,
        p.piece_ms,
        p.ts_ms,
        p.begins,
        p.ends,
        p.x_mm,
        p.y_mm,
        n.line_id,
        n.length_mm,
        ((n.bx_mm - n.ax_mm) * (p.y_mm - n.ay_mm) - (n.by_mm - n.ay_mm) * (p.x_mm - n.ax_mm)) / n.length_mm as side_mm,
        ((n.bx_mm - n.ax_mm) * (p.x_mm - n.ax_mm) + (n.by_mm - n.ay_mm) * (p.y_mm - n.ay_mm)) / n.length_mm as along_mm
    from pieces as p
    inner join count_lines as n on p.floor_id = n.floor_id
),

near_ends as materialized (
    select distinct
        m.camera_id,
        m.track_id,
        m.piece_ms,
        m.ts_ms,
        m.x_mm,
        m.y_mm,
        m.begins,
        m.ends,
        cast(floor(m.ts_ms / s.line_lost_ms) as bigint) as span
    from located_by_line as m
    cross join params as s
    where
        (m.begins or m.ends)
        and abs(m.side_mm) <= s.line_near_mm
        and m.along_mm >= -s.line_near_mm
        and m.along_mm <= m.length_mm + s.line_near_mm
),

steps as (
    select 0 as step
    union all
    select 1 as step
),

leaving as (
    select
        e.camera_id,
        e.track_id,
        e.piece_ms,
        e.ts_ms,
        e.span,
        e.x_mm,
        e.y_mm,
        e.x_mm - min_by(p.x_mm, p.ts_ms) as moved_x_mm,
        e.y_mm - min_by(p.y_mm, p.ts_ms) as moved_y_mm,
        greatest(e.ts_ms - min(p.ts_ms), 1) as moved_ms
    from near_ends as e
    cross join params as s
    inner join pieces as p
        on
            e.camera_id = p.camera_id
            and e.track_id = p.track_id
            and e.piece_ms = p.piece_ms
            and e.ts_ms - p.ts_ms <= s.cut_speed_ms
    where e.ends
    group by e.camera_id, e.track_id, e.piece_ms, e.ts_ms, e.span, e.x_mm, e.y_mm
),

foreseen as (
    select
        a.camera_id,
        a.track_id,
        a.piece_ms,
        b.track_id as next_track_id,
        b.piece_ms as next_piece_ms,
        b.ts_ms - a.ts_ms as lost_ms,
        b.x_mm - a.x_mm - a.moved_x_mm * (b.ts_ms - a.ts_ms) / a.moved_ms as off_x_mm,
        b.y_mm - a.y_mm - a.moved_y_mm * (b.ts_ms - a.ts_ms) / a.moved_ms as off_y_mm
    from leaving as a
    cross join steps as k
    cross join params as s
    inner join near_ends as b on a.camera_id = b.camera_id and a.span + k.step = b.span
    where b.begins and b.ts_ms > a.ts_ms and b.ts_ms - a.ts_ms <= s.line_lost_ms
),

reachable as (
    select
        f.camera_id,
        f.track_id,
        f.piece_ms,
        f.next_track_id,
        f.next_piece_ms,
        sqrt(f.off_x_mm * f.off_x_mm + f.off_y_mm * f.off_y_mm) + f.lost_ms * s.line_mm_per_s / 1000 as off_mm
    from foreseen as f
    cross join params as s
    where
        sqrt(f.off_x_mm * f.off_x_mm + f.off_y_mm * f.off_y_mm) <= s.line_place_mm + f.lost_ms * s.line_mm_per_s / 1000
),

ranked as (
    select
        r.camera_id,
        r.track_id,
        r.piece_ms,
        r.next_track_id,
        r.next_piece_ms,
        row_number() over (
            partition by r.camera_id, r.track_id, r.piece_ms
            order by r.off_mm, r.next_track_id, r.next_piece_ms
        ) as rank,
        row_number() over (
            partition by r.camera_id, r.next_track_id, r.next_piece_ms
            order by r.off_mm, r.track_id, r.piece_ms
        ) as next_rank
    from reachable as r
),

links as materialized (
    select
        camera_id,
        track_id,
        piece_ms,
        next_track_id,
        next_piece_ms
    from ranked
    where rank = 1 and next_rank = 1
),

chained as (
    select distinct
        p.camera_id,
        p.track_id,
        p.piece_ms,
        p.track_id as first_track_id,
        p.piece_ms as first_piece_ms
    from pieces as p
    left join links as k on p.camera_id = k.camera_id and p.track_id = k.next_track_id and p.piece_ms = k.next_piece_ms
    where k.track_id is null
    union all
    select
        k.camera_id,
        k.next_track_id as track_id,
        k.next_piece_ms as piece_ms,
        c.first_track_id,
        c.first_piece_ms
    from chained as c
    inner join links as k on c.camera_id = k.camera_id and c.track_id = k.track_id and c.piece_ms = k.piece_ms
)

select
    m.camera_id,
    m.line_id,
    m.length_mm,
    c.first_track_id,
    c.first_piece_ms,
    m.track_id,
    m.ts_ms,
    m.side_mm,
    m.along_mm
from located_by_line as m
inner join chained as c on m.camera_id = c.camera_id and m.track_id = c.track_id and m.piece_ms = c.piece_ms
order by m.camera_id, m.line_id, c.first_track_id, c.first_piece_ms, m.ts_ms
