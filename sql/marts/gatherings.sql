-- name: marts/gatherings
-- One row per gathering: clusters of at least gathering_people people, each sharing two track ids with the next, over gathering_last_ms.
-- stored_by: local_date
-- grain: camera_id, started_ms, cluster
-- reads: gathering_parts, gathering_joins, calendar, cameras, owner_cells
-- params: gathering_last_ms, owner_cell_mm
-- columns:
--   camera_id
--   floor_id
--   started_ms     first cluster, milliseconds since 1970, UTC
--   cluster        least number of a person of it
--   ended_ms       last cluster
--   duration_s     (last - first) + one frame interval
--   n_people       most people in it at one instant
--   person_s       person-seconds in it
--   x_m            mean place over its person-time, floor metres; null without positions
--   y_m            likewise
--   diameter_m     mean over its time of the largest distance between two people of a cluster; null likewise
--   is_owned       false where another camera that sees its place better counts it
--   hour_start_ms  UTC instant of the local hour it began in; it belongs to that hour and day
--   local_date
--   is_open        it began in opening hours
-- figure: M22 Gatherings
--   definition   clusters of 3 and more that stay together for 10 s, per recorded open hours, sum over cameras; the five with most
--                person-time
--   unit         gatherings per 100 open hours
--   denominator  recorded open camera-hours
--   needs        5 recorded days and 5 gatherings for an interval
--   uncertainty  day-clustered 95 % interval, as M0
--   by           vsd_analytics.figures.gatherings.gatherings
-- steps:
--   joins    parts of neighbouring hours are one gathering if the same two ids link them, seen from both hours
--   reached  a transitive closure that only walks towards lesser parts; `union` removes repeats, so it ends
-- assumes: parts of the hours around the calendar are loaded, so that a gathering is whole; one that began before it is left out
with recursive parts as materialized (
    select
        row_number() over (order by camera_id, started_ms, cluster) as part,
        camera_id,
        started_ms,
        cluster,
        ended_ms,
        interval_ms,
        n_people,
        person_ms,
        placed_ms,
        x_mm_ms,
        y_mm_ms,
        wide_ms,
        width_mm_ms
    from gathering_parts
),

joins as materialized (
    select
        gathering_joins.camera_id,
        gathering_joins.track_a,
        gathering_joins.track_b,
        gathering_joins.ts_ms,
        gathering_joins.before_ms,
        gathering_joins.after_ms,
        parts.part
    from gathering_joins
    inner join parts
        on
            gathering_joins.camera_id = parts.camera_id
            and gathering_joins.started_ms = parts.started_ms
            and gathering_joins.cluster = parts.cluster
),

links as (
    select
        joins.part as part_a,
        earlier.part as part_b
    from joins
    inner join joins as earlier
        on
            joins.camera_id = earlier.camera_id
            and joins.track_a = earlier.track_a
            and joins.track_b = earlier.track_b
            and joins.before_ms = earlier.ts_ms
            and joins.ts_ms = earlier.after_ms
),

edges as materialized (
    select
        part_a as part,
        part_b as other
    from links
    union
    select
        part_b as part,
        part_a as other
    from links
),

-- every lesser part reaches a part; on the way from the least one all parts are greater than it
reached as (
    select
        part,
        other as lesser
    from edges
    where other < part
    union
    select
        edges.part,
        reached.lesser
    from reached
    inner join edges on reached.part = edges.other
    where reached.lesser < edges.part
),

labels as (
    select
        part,
        min(lesser) as gathering
    from reached
    group by part
),

summed as (
    select
        coalesce(labels.gathering, parts.part) as gathering,
        min(parts.camera_id) as camera_id,
        min(parts.started_ms) as started_ms,
        arg_min(parts.cluster, parts.part) as cluster,
        max(parts.ended_ms) as ended_ms,
        max(parts.ended_ms) - min(parts.started_ms) + max(parts.interval_ms) as duration_ms,
        max(parts.n_people) as n_people,
        sum(parts.person_ms) as person_ms,
        sum(parts.x_mm_ms) / nullif(sum(parts.placed_ms), 0) as x_mm,
        sum(parts.y_mm_ms) / nullif(sum(parts.placed_ms), 0) as y_mm,
        sum(parts.width_mm_ms) / nullif(sum(parts.wide_ms), 0) as diameter_mm
    from parts
    left join labels on parts.part = labels.part
    group by coalesce(labels.gathering, parts.part)
)

select
    s.camera_id,
    cameras.floor_id,
    s.started_ms,
    s.cluster,
    s.ended_ms,
    s.duration_ms / 1000 as duration_s,
    s.n_people,
    s.person_ms / 1000 as person_s,
    s.x_mm / 1000 as x_m,
    s.y_mm / 1000 as y_m,
    s.diameter_mm / 1000 as diameter_m,
    coalesce(owner_cells.camera_id = s.camera_id, true) as is_owned,
    calendar.hour_start_ms,
    calendar.local_date,
    calendar.is_open
from summed as s
cross join params
inner join calendar on floor(s.started_ms / 900000) = calendar.quarter
inner join cameras on s.camera_id = cameras.camera_id
left join owner_cells
    on
        cameras.floor_id = owner_cells.floor_id
        and s.started_ms >= owner_cells.from_ms
        and s.started_ms < owner_cells.to_ms
        and floor(s.x_mm / params.owner_cell_mm) = owner_cells.cx
        and floor(s.y_mm / params.owner_cell_mm) = owner_cells.cy
where s.duration_ms >= params.gathering_last_ms
order by s.started_ms, s.camera_id, s.cluster
