-- name: facts/same_tracks
-- One row per UTC hour and two track ids of a camera that are one person: the id was switched, or one of the two is a double.
-- grain: hour, camera_id, track_a, track_b
-- reads: located, pairs, camera_days
-- params: episode_gap_ms, cut_half_intervals, next_half_intervals, cut_most_ms, cut_place_mm, cut_mm_per_s, cut_speed_ms,
--     cut_turn_mm_per_s, double_mm, double_thousandths, double_records
-- columns:
--   hour       UTC hour number: in which the later id begins, or the double is seen
--   camera_id
--   track_a    the lesser track id
--   track_b    the greater track id
-- steps:
--   placed     an engine may send one id twice in a frame: the first record counts
--   ends       a track also ends, and begins again, where it is not seen for longer than reach_ms
--   leaving    speed over the last second of a track, over the first one of the next; at least two frame intervals
--   beside     spans of 10 s: what begins within reach of an end lies in its span or in the next one
--   near       the later track begins where the earlier one would be, at the mean of both speeds; people who pass at a door walk in
--              opposite directions, so the speeds differ
--   ranked     each must be the best fit of the other
--   doubles    bodies are 0.35 m deep, so two ids nearer than that in 4 of 5 records are one body
-- assumes: reach_ms is episode_gap_s, at least one and a half frame intervals, at most 10 s; "near" is 0.5 m, plus 0.3 m a second
with placed as (
    select
        l.camera_id,
        l.track_id,
        l.ts_ms,
        min_by(l.x_mm, l.member) as x_mm,
        min_by(l.y_mm, l.member) as y_mm,
        min(d.interval_ms) as interval_ms
    from located as l
    inner join camera_days as d on l.camera_id = d.camera_id and cast(floor(l.ts_ms / 86400000) as bigint) = d.utc_day
    where l.track_id is not null and l.x_mm is not null
    group by l.camera_id, l.track_id, l.ts_ms
),

timed as (
    select
        p.camera_id,
        p.track_id,
        p.ts_ms,
        p.x_mm,
        p.y_mm,
        least(
            s.cut_most_ms, greatest(s.episode_gap_ms, cast(floor(s.cut_half_intervals * p.interval_ms / 2) as bigint))
        ) as reach_ms,
        greatest(s.cut_speed_ms, cast(floor(s.next_half_intervals * p.interval_ms / 2) as bigint)) as speed_ms,
        p.ts_ms - lag(p.ts_ms) over (partition by p.camera_id, p.track_id order by p.ts_ms) as since_ms,
        lead(p.ts_ms) over (partition by p.camera_id, p.track_id order by p.ts_ms) - p.ts_ms as until_ms
    from placed as p
    cross join params as s
),

-- outwards is 1 where time runs out of the track, at its end, and -1 at its start
ends as (
    select
        camera_id,
        track_id,
        ts_ms,
        x_mm,
        y_mm,
        reach_ms,
        speed_ms,
        1 as outwards
    from timed
    where until_ms is null or until_ms > reach_ms
    union all
    select
        camera_id,
        track_id,
        ts_ms,
        x_mm,
        y_mm,
        reach_ms,
        speed_ms,
        -1 as outwards
    from timed
    where since_ms is null or since_ms > reach_ms
),

-- the farthest record within speed_ms, inwards
inner_ms as (
    select
        e.camera_id,
        e.track_id,
        e.ts_ms,
        e.outwards,
        max(abs(p.ts_ms - e.ts_ms)) as away_ms
    from ends as e
    inner join placed as p
        on
            e.camera_id = p.camera_id
            and e.track_id = p.track_id
            and p.ts_ms between e.ts_ms - e.speed_ms and e.ts_ms + e.speed_ms
            and e.outwards * (e.ts_ms - p.ts_ms) > 0
    group by e.camera_id, e.track_id, e.ts_ms, e.outwards
),

leaving as (
    select
        e.camera_id,
        e.track_id,
        e.ts_ms,
        e.x_mm,
        e.y_mm,
        e.reach_ms,
        e.outwards,
        cast(floor(e.ts_ms / s.cut_most_ms) as bigint) as span,
        e.outwards * (e.x_mm - p.x_mm) / i.away_ms as x_mm_per_ms,
        e.outwards * (e.y_mm - p.y_mm) / i.away_ms as y_mm_per_ms
    from ends as e
    cross join params as s
    left join inner_ms as i
        on e.camera_id = i.camera_id and e.track_id = i.track_id and e.ts_ms = i.ts_ms and e.outwards = i.outwards
    left join placed as p
        on e.camera_id = p.camera_id and e.track_id = p.track_id and p.ts_ms = e.ts_ms - e.outwards * i.away_ms
),

spans as (
    select 0 as beside
    union all
    select 1 as beside
),

beside as (
    select
        e.camera_id,
        e.track_id,
        e.ts_ms,
        n.track_id as next_id,
        n.ts_ms as next_ms,
        n.ts_ms - e.ts_ms as away_ms,
        n.x_mm - e.x_mm as x_mm,
        n.y_mm - e.y_mm as y_mm,
        coalesce(e.x_mm_per_ms, n.x_mm_per_ms, 0) as x_mm_per_ms,
        coalesce(e.y_mm_per_ms, n.y_mm_per_ms, 0) as y_mm_per_ms,
        coalesce(n.x_mm_per_ms, e.x_mm_per_ms, 0) as next_x_mm_per_ms,
        coalesce(n.y_mm_per_ms, e.y_mm_per_ms, 0) as next_y_mm_per_ms
    from leaving as e
    cross join spans
    inner join leaving as n
        on
            e.camera_id = n.camera_id
            and e.span + spans.beside = n.span
            and e.track_id <> n.track_id
            and e.ts_ms < n.ts_ms
            and n.ts_ms <= e.ts_ms + e.reach_ms
    where e.outwards = 1 and n.outwards = -1
),

near as (
    select
        b.camera_id,
        b.track_id,
        b.ts_ms,
        b.next_id,
        b.next_ms,
        b.away_ms,
        power(b.x_mm - (b.x_mm_per_ms + b.next_x_mm_per_ms) / 2 * b.away_ms, 2)
        + power(b.y_mm - (b.y_mm_per_ms + b.next_y_mm_per_ms) / 2 * b.away_ms, 2) as square_mm2
    from beside as b
    cross join params as s
    where
        power(b.x_mm_per_ms - b.next_x_mm_per_ms, 2) + power(b.y_mm_per_ms - b.next_y_mm_per_ms, 2)
        <= power(s.cut_turn_mm_per_s / 1000, 2)
),

ranked as (
    select
        n.camera_id,
        n.track_id,
        n.next_id,
        n.next_ms,
        row_number() over (partition by n.camera_id, n.track_id, n.ts_ms order by n.square_mm2, n.next_id, n.next_ms) as rank,
        row_number() over (partition by n.camera_id, n.next_id, n.next_ms order by n.square_mm2, n.track_id, n.ts_ms) as next_rank
    from near as n
    cross join params as s
    where n.square_mm2 <= power(s.cut_place_mm + s.cut_mm_per_s * n.away_ms / 1000, 2)
),

lives as (
    select
        cast(floor(ts_ms / 3600000) as bigint) as hour,
        camera_id,
        track_id,
        count(*) as n_records
    from located
    where track_id is not null
    group by cast(floor(ts_ms / 3600000) as bigint), camera_id, track_id
),

beside_all_along as (
    select
        p.hour,
        p.camera_id,
        least(p.track_a, p.track_b) as track_a,
        greatest(p.track_a, p.track_b) as track_b,
        count(*) as n_records
    from pairs as p
    cross join params as s
    where p.distance_mm <= s.double_mm and p.track_a <> p.track_b
    group by p.hour, p.camera_id, least(p.track_a, p.track_b), greatest(p.track_a, p.track_b)
),

doubles as (
    select
        d.hour,
        d.camera_id,
        d.track_a,
        d.track_b
    from beside_all_along as d
    cross join params as s
    inner join lives as a on d.hour = a.hour and d.camera_id = a.camera_id and d.track_a = a.track_id
    inner join lives as b on d.hour = b.hour and d.camera_id = b.camera_id and d.track_b = b.track_id
    where d.n_records >= s.double_records and 1000 * d.n_records >= s.double_thousandths * least(a.n_records, b.n_records)
),

same as (
    select
        cast(floor(next_ms / 3600000) as bigint) as hour,
        camera_id,
        least(track_id, next_id) as track_a,
        greatest(track_id, next_id) as track_b
    from ranked
    where rank = 1 and next_rank = 1
    union
    select
        hour,
        camera_id,
        track_a,
        track_b
    from doubles
)

select
    hour,
    camera_id,
    track_a,
    track_b
from same
order by hour, camera_id, track_a, track_b
