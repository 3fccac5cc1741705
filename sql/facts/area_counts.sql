-- name: facts/area_counts
-- One row per place that asks for its number of people, UTC quarter-hour and number present: the time that all its cameras recorded.
-- grain: floor_id, area_id, bucket_quarter, n_people
-- reads: located, instants, count_cells, count_floors, cameras, quarters
-- params: cell_mm
-- columns:
--   hour            UTC hour number
--   floor_id
--   area_id         area of vsd.toml, the first of the file where two overlap; null is the whole floor
--   bucket_quarter  UTC quarter-hours since 1970; in hours that version 1.1 sealed the first one of the hour
--   n_people        people present at once, 0 included, each counted by the camera that owns the place
--   recorded_ms     milliseconds with so many, in which every camera that counts somebody there in the hour recorded
-- steps:
--   gridded   the cell of each record first: DuckDB would join each record with all cells of its floor, then compare
--   counting  a place without anybody all hour has no row: its cameras' recorded time says for how long
--   changes   a person stands where seen for the time that the record represents; a camera records for the time its frame covers
--   levels    running sums over all cameras of a place, so that instants of several cameras need not agree
-- assumes: an hour depends on its own records alone: a frame's time ends with its hour; a camera that counts nobody in an hour adds 0
with gridded as materialized (
    select
        l.camera_id,
        c.floor_id,
        l.ts_ms,
        cast(floor(l.x_mm / s.cell_mm) as integer) as cx,
        cast(floor(l.y_mm / s.cell_mm) as integer) as cy
    from located as l
    cross join params as s
    inner join cameras as c on l.camera_id = c.camera_id
    where l.is_owned and l.x_mm is not null
),

placed as (
    select
        g.camera_id,
        g.floor_id,
        v.area_id,
        g.ts_ms
    from gridded as g
    inner join count_cells as v
        on
            g.floor_id = v.floor_id
            and g.cx = v.cx
            and g.cy = v.cy
            and g.ts_ms >= v.from_ms
            and g.ts_ms < v.to_ms
    union all
    select
        l.camera_id,
        c.floor_id,
        null as area_id,
        l.ts_ms
    from located as l
    inner join cameras as c on l.camera_id = c.camera_id
    inner join count_floors as f on c.floor_id = f.floor_id
    where l.is_owned
),

counts as (
    select
        cast(floor(ts_ms / 3600000) as bigint) as hour,
        floor_id,
        area_id,
        camera_id,
        ts_ms,
        count(*) as n_people
    from placed
    group by floor_id, area_id, camera_id, ts_ms
),

counting as (
    select distinct
        hour,
        floor_id,
        area_id,
        camera_id
    from counts
),

seen as (
    select
        g.hour,
        g.floor_id,
        g.area_id,
        i.ts_ms,
        least(i.ts_ms + i.weight_ms, (g.hour + 1) * 3600000) as stood_to_ms,
        least(i.ts_ms + i.covered_ms, (g.hour + 1) * 3600000) as covered_to_ms,
        coalesce(counts.n_people, 0) as n_people
    from counting as g
    inner join instants as i on g.camera_id = i.camera_id and g.hour = i.hour
    left join counts
        on
            g.camera_id = counts.camera_id
            and i.ts_ms = counts.ts_ms
            and g.floor_id = counts.floor_id
            and g.area_id is not distinct from counts.area_id
),

changes as (
    select
        hour,
        floor_id,
        area_id,
        ts_ms as at_ms,
        n_people as more_people,
        1 as more_cameras
    from seen
    union all
    select
        hour,
        floor_id,
        area_id,
        stood_to_ms as at_ms,
        -n_people as more_people,
        0 as more_cameras
    from seen
    union all
    select
        hour,
        floor_id,
        area_id,
        covered_to_ms as at_ms,
        0 as more_people,
        -1 as more_cameras
    from seen
    union all
    select distinct
        g.hour,
        g.floor_id,
        g.area_id,
        q.quarter * 900000 as at_ms,
        0 as more_people,
        0 as more_cameras
    from counting as g
    inner join quarters as q on g.hour = cast(floor(q.quarter / 4) as bigint)
),

summed as (
    select
        hour,
        floor_id,
        area_id,
        at_ms,
        sum(more_people) as more_people,
        sum(more_cameras) as more_cameras
    from changes
    group by hour, floor_id, area_id, at_ms
),

levels as (
    select
        hour,
        floor_id,
        area_id,
        at_ms,
        (lead(at_ms) over place) - at_ms as lasts_ms,
        sum(more_people) over place as n_people,
        sum(more_cameras) over place as n_cameras
    from summed
    window place as (partition by hour, floor_id, area_id order by at_ms)
),

needed as (
    select
        hour,
        floor_id,
        area_id,
        count(*) as n_cameras
    from counting
    group by hour, floor_id, area_id
)

select
    l.hour,
    l.floor_id,
    l.area_id,
    cast(floor(l.at_ms / 900000) as bigint) as bucket_quarter,
    cast(l.n_people as bigint) as n_people,
    cast(sum(l.lasts_ms) as bigint) as recorded_ms
from levels as l
inner join needed
    on
        l.hour = needed.hour
        and l.floor_id = needed.floor_id
        and l.area_id is not distinct from needed.area_id
        and l.n_cameras = needed.n_cameras
where l.lasts_ms > 0
group by l.hour, l.floor_id, l.area_id, bucket_quarter, l.n_people
order by l.hour, l.floor_id, l.area_id, bucket_quarter, l.n_people
