-- name: facts/coverage
-- One row per camera and UTC quarter-hour with any recorded time.
-- stored_by: utc_day
-- grain: camera_id, quarter
-- reads: instants, quarters
-- columns:
--   hour         UTC hour number
--   camera_id
--   quarter      UTC quarter-hours since 1970
--   n_frames     processed frames in it
--   recorded_ms  milliseconds recorded, 0 to 900000
--   is_inferred  true when the engine sends no heartbeat, so that recorded_ms is inferred from silences
-- figure: M1 Data recorded
--   definition   recorded / scheduled open camera-hours
--   unit         share
--   denominator  scheduled open camera-hours
--   needs        always shown
--   uncertainty  none: a full count
--   by           vsd_analytics.figures.week.recording.coverage
-- steps:
--   pieces  most frames stand for time within one quarter-hour; only the others are joined with the quarters they touch
-- assumes: the last frame of an hour adds nothing to the next hour, so that an hour without a frame has no data
with spans as (
    select
        camera_id,
        ts_ms,
        ts_ms + covered_ms as end_ms,
        cast(floor(ts_ms / 900000) as bigint) as first_quarter,
        cast(floor((ts_ms + covered_ms - 1) / 900000) as bigint) as last_quarter,
        has_heartbeat
    from instants
),

pieces as (
    select
        camera_id,
        first_quarter as quarter,
        end_ms - ts_ms as recorded_ms,
        1 as n_frames,
        has_heartbeat
    from spans
    where first_quarter = last_quarter
    union all
    select
        spans.camera_id,
        quarters.quarter,
        least(spans.end_ms, (quarters.quarter + 1) * 900000) - greatest(spans.ts_ms, quarters.quarter * 900000) as recorded_ms,
        case when quarters.quarter = spans.first_quarter then 1 else 0 end as n_frames,
        spans.has_heartbeat
    from spans
    inner join quarters on spans.first_quarter <= quarters.quarter and spans.last_quarter >= quarters.quarter
    where spans.first_quarter < spans.last_quarter
),

summed as (
    select
        cast(floor(quarter / 4) as bigint) as hour,
        camera_id,
        quarter,
        cast(sum(n_frames) as bigint) as n_frames,
        cast(sum(recorded_ms) as bigint) as recorded_ms,
        not bool_and(has_heartbeat) as is_inferred
    from pieces
    group by camera_id, quarter
),

hours_with_frames as (
    select distinct
        hour,
        camera_id
    from instants
)

select
    summed.hour,
    summed.camera_id,
    summed.quarter,
    summed.n_frames,
    summed.recorded_ms,
    summed.is_inferred
from summed
inner join hours_with_frames on summed.camera_id = hours_with_frames.camera_id and summed.hour = hours_with_frames.hour
order by summed.hour, summed.camera_id, summed.quarter
