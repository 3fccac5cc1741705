-- name: marts/area_hours
-- One row per area, camera and local hour with a person or violation in the area; area_id null is the rest of the floor.
-- stored_by: local_date
-- grain: floor_id, area_id, camera_id, hour_start_ms
-- reads: floor_cells, violations, area_cells, cameras, calendar
-- columns:
--   floor_id
--   area_id            null for the rest of the floor
--   camera_id
--   hour_start_ms      UTC instant the local hour starts
--   local_date
--   weekday            1 Monday to 7 Sunday
--   exposure_open_s    person-seconds of this camera in the area in opening hours
--   violation_open_s   person-seconds in violation
--   n_violations_open  violations with most of their person-time in the area that started in opening hours
-- figure: M15 Areas
--   definition   M0 and M7 of each area, highest M0 first, border areas noted; from four areas on, M7 pulled to their mean, excess a week
--   unit         per open hour; per person-hour
--   denominator  recorded open hours; person-hours
--   needs        as M0 and M7; ranked in a week recorded to 60 %
--   uncertainty  as M0 and M7; pulled rates by empirical Bayes (vsd_analytics.stats.shrinkage)
--   by           vsd_analytics.figures.week.areas.areas
-- figure: M54 By floor space
--   definition   M0 on 100 m², and M5 on each m², of the floor of a place that people can walk on where cameras see it: its polygon within
--                their views, without fixtures; a m² in two areas belongs to the first
--   unit         violations per open hour and 100 m²; people per m²
--   denominator  recorded open hours and m² at the end of the period
--   needs        as M0 and M5, and known views
--   uncertainty  as M0 and M5; sizes have none
--   by           vsd_analytics.figures.floor_space.per_floor
-- figure: M27 Before and after
--   definition   ratio of M7 after / before a logged change in its area, over the same ratio of areas left alone
--   unit         ratio
--   denominator  person-hours, and those of the comparison areas
--   needs        a whole week and 30 violations on either side; no recalibration between
--   uncertainty  day-clustered 95 % interval, spread of placebo areas, estimate shrunken for regression to the mean
--   by           vsd_analytics.figures.before_after.before_after
-- assumes: an hour without a row is 0 where the camera recorded, unknown where it did not
with stood as (
    select
        cameras.floor_id,
        area_cells.area_id,
        floor_cells.camera_id,
        calendar.hour_start_ms,
        sum(floor_cells.exposure_ms) / 1000.0 as exposure_open_s,
        sum(floor_cells.violation_ms) / 1000.0 as violation_open_s
    from floor_cells
    inner join calendar on floor_cells.bucket_quarter = calendar.quarter
    inner join cameras on floor_cells.camera_id = cameras.camera_id
    left join area_cells
        on
            cameras.floor_id = area_cells.floor_id
            and floor_cells.cx = area_cells.cx
            and floor_cells.cy = area_cells.cy
            and calendar.hour_start_ms >= area_cells.from_ms
            and calendar.hour_start_ms < area_cells.to_ms
    where calendar.is_open
    group by cameras.floor_id, area_cells.area_id, floor_cells.camera_id, calendar.hour_start_ms
),

counted as (
    select
        floor_id,
        area_id,
        camera_id,
        hour_start_ms,
        count(*) as n_violations_open
    from violations
    where is_open
    group by floor_id, area_id, camera_id, hour_start_ms
),

hour_days as (
    select distinct
        hour_start_ms,
        local_date,
        weekday
    from calendar
),

joined as (
    select
        coalesce(stood.floor_id, counted.floor_id) as floor_id,
        coalesce(stood.area_id, counted.area_id) as area_id,
        coalesce(stood.camera_id, counted.camera_id) as camera_id,
        coalesce(stood.hour_start_ms, counted.hour_start_ms) as hour_start_ms,
        coalesce(stood.exposure_open_s, 0) as exposure_open_s,
        coalesce(stood.violation_open_s, 0) as violation_open_s,
        coalesce(counted.n_violations_open, 0) as n_violations_open
    from stood
    full outer join counted
        on
            stood.floor_id = counted.floor_id
            and stood.area_id is not distinct from counted.area_id
            and stood.camera_id = counted.camera_id
            and stood.hour_start_ms = counted.hour_start_ms
)

select
    joined.floor_id,
    joined.area_id,
    joined.camera_id,
    joined.hour_start_ms,
    hour_days.local_date,
    hour_days.weekday,
    joined.exposure_open_s,
    joined.violation_open_s,
    joined.n_violations_open
from joined
inner join hour_days on joined.hour_start_ms = hour_days.hour_start_ms
order by joined.hour_start_ms, joined.floor_id, joined.area_id, joined.camera_id
