-- name: marts/outages
-- One row per camera and interval of at least ten minutes of opening time without data.
-- grain: camera_id, started_ms
-- reads: recorded_spans, calendar, cameras
-- params: outage_min_ms
-- columns:
--   camera_id
--   camera_no    position in vsd.toml
--   started_ms   end of the last recorded time before, or start of opening, milliseconds since 1970, UTC
--   ended_ms     start of the next recorded time, or end of opening
--   open_s       opening time lost
--   is_inferred  inferred from silence, as the engine sends no heartbeat before or after it
-- figure: M2 Outages
--   definition   runs of at least 10 minutes of opening time without data, per camera
--   unit         list
--   denominator  –
--   needs        always shown
--   uncertainty  inferred without a heartbeat
--   by           vsd_analytics.figures.week.recording.coverage
-- steps:
--   bounds  one pair of bounds per unbroken part of the calendar: years it leaves out are not missed time
--   edges   spans of no length at the bounds: a camera without any record then has an outage of the whole range
--           in which it is there
--   missed  an outage is cut to opening time quarter by quarter
-- assumes: time outside the calendar and closed time are no outages
with bounds as (
    select
        min(quarter) * 900000 as first_ms,
        (max(quarter) + 1) * 900000 as last_ms
    from (
        select
            quarter,
            quarter - row_number() over (order by quarter) as stretch
        from calendar
    ) as numbered
    group by stretch
),

edges as (
    select
        camera_id,
        started_ms,
        ended_ms,
        is_inferred
    from recorded_spans
    union all
    select
        cameras.camera_id,
        greatest(bounds.first_ms, cameras.from_ms) as started_ms,
        greatest(bounds.first_ms, cameras.from_ms) as ended_ms,
        false as is_inferred
    from cameras
    cross join bounds
    where cameras.from_ms < bounds.last_ms and cameras.to_ms > bounds.first_ms
    union all
    select
        cameras.camera_id,
        least(bounds.last_ms, cameras.to_ms) as started_ms,
        least(bounds.last_ms, cameras.to_ms) as ended_ms,
        false as is_inferred
    from cameras
    cross join bounds
    where cameras.from_ms < bounds.last_ms and cameras.to_ms > bounds.first_ms
),

gaps as (
    select
        edges.camera_id,
        max(edges.ended_ms) over earlier as from_ms,
        edges.started_ms as to_ms,
        edges.is_inferred or coalesce(last_value(edges.is_inferred) over earlier, false) as is_inferred
    from edges
    window
        earlier as (
            partition by edges.camera_id order by edges.started_ms, edges.ended_ms
            rows between unbounded preceding and 1 preceding
        )
),

missed as (
    select
        gaps.camera_id,
        gaps.from_ms,
        gaps.is_inferred,
        min(greatest(gaps.from_ms, calendar.quarter * 900000)) as started_ms,
        max(least(gaps.to_ms, (calendar.quarter + 1) * 900000)) as ended_ms,
        sum(least(gaps.to_ms, (calendar.quarter + 1) * 900000) - greatest(gaps.from_ms, calendar.quarter * 900000)) as open_ms
    from gaps
    inner join calendar
        on calendar.quarter * 900000 < gaps.to_ms and (calendar.quarter + 1) * 900000 > gaps.from_ms and calendar.is_open
    cross join params
    where gaps.to_ms - gaps.from_ms >= params.outage_min_ms
    group by gaps.camera_id, gaps.from_ms, gaps.to_ms, gaps.is_inferred
)

select
    missed.camera_id,
    cameras.camera_no,
    missed.started_ms,
    missed.ended_ms,
    missed.open_ms / 1000.0 as open_s,
    missed.is_inferred
from missed
inner join cameras on missed.camera_id = cameras.camera_id
cross join params
where missed.open_ms >= params.outage_min_ms
order by missed.started_ms, cameras.camera_no
