-- name: facts/line_crossings
-- One row per crossing of a counting line of vsd.toml: a person was well on one side of it, and then well on the other.
-- Each way back counts, too. Whoever is first or last seen within 0.25 m of the line is not counted.
-- grain: camera_id, line_id, ts_ms, track_id, is_to_left
-- reads: line_walks, line_parts
-- params: line_margin_mm, line_stand_ms, line_place_mm, line_leap_mm_per_s, view_twice_ms, same_place_mm
-- columns:
--   hour        UTC hour number
--   camera_id   the camera that counts on this part of the line
--   line_id     line of vsd.toml
--   ts_ms       instant of the crossing, between two records, milliseconds since 1970, UTC
--   track_id    pseudonym of the engine's track number after the crossing, of one site day
--   is_to_left  the person went to the left, as seen from the first point of the line towards its second; else to the right
--   along_mm    where on the line, millimetres from its first point
-- steps:
--   on_both_sides  who is always on one side of a line does not cross it
--   stepped    from one record to the next, straight: where it meets the line beyond either end, it does not cross it; nobody leaps
--   ordered    records that lie 0.25 m or more from the line say on which side the person is
--   between_sides  what happened between two such records; steps back through the line take away from steps through it
--   beside     near a border on the line, each of two cameras may count a crossing, or neither: who is nearest to whom is one person
-- assumes: who is lost on the line for over 10 s, or waits at it for over 4 minutes before or after, is not counted
with on_both_sides as (
    select
        camera_id,
        first_track_id,
        first_piece_ms,
        line_id
    from line_walks
    group by camera_id, first_track_id, first_piece_ms, line_id
    having min(side_mm) < 0 and max(side_mm) >= 0
),

paced as (
    select
        m.camera_id,
        m.track_id,
        m.first_track_id,
        m.first_piece_ms,
        m.line_id,
        m.length_mm,
        m.ts_ms,
        m.side_mm,
        m.along_mm,
        lag(m.ts_ms) over chain as before_ms,
        lag(m.side_mm) over chain as before_side_mm,
        lag(m.along_mm) over chain as before_along_mm
    from line_walks as m
    inner join on_both_sides as b
        on
            m.camera_id = b.camera_id
            and m.first_track_id = b.first_track_id
            and m.first_piece_ms = b.first_piece_ms
            and m.line_id = b.line_id
    window chain as (partition by m.camera_id, m.first_track_id, m.first_piece_ms, m.line_id order by m.ts_ms)
),

met as (
    select
        camera_id,
        track_id,
        first_track_id,
        first_piece_ms,
        line_id,
        length_mm,
        ts_ms,
        side_mm,
        before_ms,
        case
            when side_mm >= 0 and before_side_mm < 0 then 1
            when side_mm < 0 and before_side_mm >= 0 then -1
        end as turn,
        case
            when (side_mm >= 0) <> (before_side_mm >= 0) then before_side_mm / (before_side_mm - side_mm)
        end as share,
        sqrt(
            (side_mm - before_side_mm) * (side_mm - before_side_mm) + (along_mm - before_along_mm) * (along_mm - before_along_mm)
        ) as step_mm,
        before_along_mm,
        along_mm
    from paced
),

stepped as (
    select
        m.camera_id,
        m.track_id,
        m.first_track_id,
        m.first_piece_ms,
        m.line_id,
        m.ts_ms,
        case
            when
                m.before_along_mm + m.share * (m.along_mm - m.before_along_mm) >= 0
                and m.before_along_mm + m.share * (m.along_mm - m.before_along_mm) < m.length_mm
                and m.step_mm <= s.line_place_mm + (m.ts_ms - m.before_ms) * s.line_leap_mm_per_s / 1000
                then m.turn
        end as turn,
        cast(round(m.before_ms + m.share * (m.ts_ms - m.before_ms)) as bigint) as crossed_ms,
        m.before_along_mm + m.share * (m.along_mm - m.before_along_mm) as along_mm,
        case
            when m.side_mm >= s.line_margin_mm then 1
            when m.side_mm <= -s.line_margin_mm then -1
        end as side
    from met as m
    cross join params as s
),

ordered as (
    select
        camera_id,
        track_id,
        first_track_id,
        first_piece_ms,
        line_id,
        ts_ms,
        turn,
        crossed_ms,
        along_mm,
        side,
        count(side) over (
            partition by camera_id, first_track_id, first_piece_ms, line_id order by ts_ms
            rows between unbounded preceding and current row
        ) as n_sides
    from stepped
    where side is not null or turn is not null
),

kept as (
    select
        camera_id,
        track_id,
        first_track_id,
        first_piece_ms,
        line_id,
        ts_ms,
        turn,
        crossed_ms,
        along_mm,
        side,
        n_sides - case when side is null then 0 else 1 end as gap_no,
        lag(side) over sided as before_side,
        lag(ts_ms) over sided as before_ms
    from ordered
    window sided as (
        partition by camera_id, first_track_id, first_piece_ms, line_id, case when side is null then 0 else 1 end order by ts_ms
    )
),

between_sides as (
    select
        camera_id,
        first_track_id,
        first_piece_ms,
        line_id,
        gap_no,
        sum(coalesce(turn, 0)) as net,
        max(side) as side,
        max(case when side is not null then before_side end) as before_side,
        max(case when side is not null then before_ms end) as before_ms,
        max(case when side is not null then ts_ms end) as after_ms,
        max_by(crossed_ms, ts_ms) filter (where turn = 1) as left_ms,
        max_by(along_mm, ts_ms) filter (where turn = 1) as left_along_mm,
        max_by(track_id, ts_ms) filter (where turn = 1) as left_track_id,
        max_by(crossed_ms, ts_ms) filter (where turn = -1) as right_ms,
        max_by(along_mm, ts_ms) filter (where turn = -1) as right_along_mm,
        max_by(track_id, ts_ms) filter (where turn = -1) as right_track_id
    from kept
    group by camera_id, first_track_id, first_piece_ms, line_id, gap_no
),

crossed as (
    select
        camera_id,
        line_id,
        before_ms,
        after_ms,
        side = 1 as is_to_left,
        case when side = 1 then left_ms else right_ms end as ts_ms,
        case when side = 1 then left_along_mm else right_along_mm end as along_mm,
        case when side = 1 then left_track_id else right_track_id end as track_id
    from between_sides
    where side <> before_side and net * side > 0
),

owned as materialized (
    select
        c.camera_id,
        c.line_id,
        c.ts_ms,
        c.track_id,
        c.is_to_left,
        c.along_mm,
        bool_or(p.camera_id = c.camera_id) as is_owned,
        min(p.camera_id) as owner_id
    from crossed as c
    cross join params as s
    inner join line_parts as p
        on
            c.line_id = p.line_id
            and c.ts_ms >= p.from_ms
            and c.ts_ms < p.to_ms
            and c.along_mm >= p.start_mm
            and c.along_mm < p.end_mm
    where c.after_ms - c.ts_ms <= s.line_stand_ms and c.ts_ms - c.before_ms <= s.line_stand_ms
    group by c.camera_id, c.line_id, c.ts_ms, c.track_id, c.is_to_left, c.along_mm
),

beside as (
    select
        a.camera_id,
        a.line_id,
        a.ts_ms,
        a.track_id,
        a.is_to_left,
        a.is_owned,
        a.owner_id,
        b.camera_id as other_camera_id,
        b.is_owned as other_is_owned,
        b.owner_id as other_owner_id,
        row_number() over (
            partition by a.camera_id, a.line_id, a.ts_ms, a.track_id, a.is_to_left, b.camera_id
            order by abs(a.along_mm - b.along_mm) + abs(a.ts_ms - b.ts_ms), b.ts_ms, b.track_id
        ) as rank,
        row_number() over (
            partition by b.camera_id, b.line_id, b.ts_ms, b.track_id, b.is_to_left, a.camera_id
            order by abs(a.along_mm - b.along_mm) + abs(a.ts_ms - b.ts_ms), a.ts_ms, a.track_id
        ) as other_rank
    from owned as a
    cross join params as s
    inner join owned as b on a.line_id = b.line_id and a.is_to_left = b.is_to_left and a.camera_id <> b.camera_id
    where abs(a.ts_ms - b.ts_ms) <= s.view_twice_ms and abs(a.along_mm - b.along_mm) <= s.same_place_mm
),

seen_twice as (
    select
        camera_id,
        line_id,
        ts_ms,
        track_id,
        is_to_left,
        bool_or(is_owned and other_is_owned and other_camera_id < camera_id) as is_counted_there,
        bool_or(
            not is_owned and not other_is_owned and camera_id < other_camera_id
            and owner_id = other_camera_id and other_owner_id = camera_id
        ) as is_counted_nowhere
    from beside
    where rank = 1 and other_rank = 1
    group by camera_id, line_id, ts_ms, track_id, is_to_left
)

select
    cast(floor(c.ts_ms / 3600000) as bigint) as hour,
    c.camera_id,
    c.line_id,
    c.ts_ms,
    c.track_id,
    c.is_to_left,
    cast(round(c.along_mm) as bigint) as along_mm
from owned as c
left join seen_twice as t
    on
        c.camera_id = t.camera_id
        and c.line_id = t.line_id
        and c.ts_ms = t.ts_ms
        and c.track_id = t.track_id
        and c.is_to_left = t.is_to_left
where coalesce((c.is_owned and not t.is_counted_there) or t.is_counted_nowhere, c.is_owned)
order by hour, c.camera_id, c.line_id, c.ts_ms, c.track_id, c.is_to_left
