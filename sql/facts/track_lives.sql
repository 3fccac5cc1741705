-- name: facts/track_lives
-- One row per track and UTC hour it was seen in: its records and time, and how many other tracks begin where it ends.
-- grain: hour, camera_id, track_id
-- reads: located, camera_days
-- params: cut_half_intervals, cut_least_ms, cut_most_ms, cut_place_mm, cut_mm_per_s
-- columns:
--   hour           UTC hour number
--   camera_id
--   track_id       pseudonym of the engine's track number, of one site day
--   n_records      person records, also those another camera counts
--   first_ms       first of them, milliseconds since 1970, UTC
--   last_ms        last of them
--   exposure_ms    person-milliseconds: sum of their weights
--   n_ends         1 where the track ends in this hour at a known place, else 0
--   n_goes_on      other tracks that begin within reach after its end, near the place where it would have been
--   n_came_before  other tracks that began within reach before its end, near where it was: as many as chance gives
-- steps:
--   reaching  mean velocity from the first to the last known place; reach_ms is one frame and a half, at least 1 s and at most 10 s
--   starts    only starts that the same track does not continue from an earlier hour, likewise for ends
--   judged    within 500 mm, plus 3/10 mm per millisecond (0.3 m/s): how far a walker may leave its straight way in that time
--   ended     starts before the end cannot be the same person, so their number is what chance gives; the difference is tracks that were
--             cut
-- assumes: reach is 1.5 frame intervals, 1 to 10 s; "near" is 0.5 m, plus 0.3 m a second, around its path at mean velocity
with lives as (
    select
        cast(floor(ts_ms / 3600000) as bigint) as hour,
        camera_id,
        track_id,
        count(*) as n_records,
        min(ts_ms) as first_ms,
        max(ts_ms) as last_ms,
        cast(sum(weight_ms) as bigint) as exposure_ms,
        min_by(x_mm, ts_ms) filter (where x_mm is not null) as first_x_mm,
        min_by(y_mm, ts_ms) filter (where x_mm is not null) as first_y_mm,
        max_by(x_mm, ts_ms) filter (where x_mm is not null) as last_x_mm,
        max_by(y_mm, ts_ms) filter (where x_mm is not null) as last_y_mm,
        max(ts_ms) filter (where x_mm is not null) - min(ts_ms) filter (where x_mm is not null) as moved_ms
    from located
    where track_id is not null
    group by cast(floor(ts_ms / 3600000) as bigint), camera_id, track_id
),

reaching as (
    select
        l.hour,
        l.camera_id,
        l.track_id,
        l.first_ms,
        l.last_ms,
        l.first_x_mm,
        l.first_y_mm,
        l.last_x_mm,
        l.last_y_mm,
        coalesce((l.last_x_mm - l.first_x_mm) / nullif(l.moved_ms, 0), 0) as x_mm_per_ms,
        coalesce((l.last_y_mm - l.first_y_mm) / nullif(l.moved_ms, 0), 0) as y_mm_per_ms,
        l.first_ms - lag(l.last_ms) over (partition by l.camera_id, l.track_id order by l.hour) as since_ms,
        lead(l.first_ms) over (partition by l.camera_id, l.track_id order by l.hour) - l.last_ms as until_ms,
        greatest(
            params.cut_least_ms,
            least(params.cut_most_ms, cast(floor(params.cut_half_intervals * d.interval_ms / 2) as bigint))
        ) as reach_ms
    from lives as l
    cross join params
    inner join camera_days as d on l.camera_id = d.camera_id and cast(floor(l.hour / 24) as bigint) = d.utc_day
),

-- spans of 10 s: what is within reach of an end lies in its span or in one beside it
spans as (
    select -1 as beside
    union all
    select 0 as beside
    union all
    select 1 as beside
),

ends as (
    select
        r.hour,
        r.camera_id,
        r.track_id,
        r.last_ms,
        r.last_x_mm,
        r.last_y_mm,
        r.x_mm_per_ms,
        r.y_mm_per_ms,
        r.reach_ms,
        cast(floor(r.last_ms / params.cut_most_ms) as bigint) + spans.beside as span
    from reaching as r
    cross join spans
    cross join params
    where r.last_x_mm is not null and (r.until_ms is null or r.until_ms > r.reach_ms)
),

starts as (
    select
        camera_id,
        track_id,
        first_ms,
        first_x_mm,
        first_y_mm,
        cast(floor(first_ms / params.cut_most_ms) as bigint) as span
    from reaching
    cross join params
    where first_x_mm is not null and (since_ms is null or since_ms > reach_ms)
),

beside as (
    select
        e.hour,
        e.camera_id,
        e.track_id,
        s.first_ms - e.last_ms as after_ms,
        s.first_x_mm - e.last_x_mm - e.x_mm_per_ms * (s.first_ms - e.last_ms) as x_off_mm,
        s.first_y_mm - e.last_y_mm - e.y_mm_per_ms * (s.first_ms - e.last_ms) as y_off_mm
    from ends as e
    left join starts as s
        on
            e.camera_id = s.camera_id
            and e.span = s.span
            and e.track_id <> s.track_id
            and s.first_ms between e.last_ms - e.reach_ms and e.last_ms + e.reach_ms
),

judged as (
    select
        hour,
        camera_id,
        track_id,
        after_ms,
        x_off_mm * x_off_mm + y_off_mm * y_off_mm <= power(params.cut_place_mm + params.cut_mm_per_s * abs(after_ms) / 1000, 2) as is_there
    from beside
    cross join params
),

ended as (
    select
        hour,
        camera_id,
        track_id,
        count(*) filter (where is_there and after_ms > 0) as n_goes_on,
        count(*) filter (where is_there and after_ms < 0) as n_came_before
    from judged
    group by hour, camera_id, track_id
)

select
    l.hour,
    l.camera_id,
    l.track_id,
    l.n_records,
    l.first_ms,
    l.last_ms,
    l.exposure_ms,
    case when e.hour is null then 0 else 1 end as n_ends,
    coalesce(e.n_goes_on, 0) as n_goes_on,
    coalesce(e.n_came_before, 0) as n_came_before
from lives as l
left join ended as e on l.hour = e.hour and l.camera_id = e.camera_id and l.track_id = e.track_id
order by l.hour, l.camera_id, l.track_id
