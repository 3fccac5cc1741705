-- name: tables/area_hours
-- One row per area and local hour of the days asked for, and per rest of a floor; quiet, unrecorded and closed hours have a row too.
-- grain: floor_id, area_id, start
-- reads: camera_hours, area_hours, violations, areas, area_cells, owner_cells, cameras
-- params: full_hour_share, partial_hour_share, cell_mm, owner_cell_mm
-- columns:
--   floor_id
--   area_id            area of vsd.toml; rest for the rest of the floor
--   start              instant the hour starts, with the site's zone
--   local_date
--   weekday            1 Monday to 7 Sunday
--   local_hour         0 to 23; twice in the night the clocks go back
--   state              full, partial, low_data, no_data or closed, of the cameras that see the area
--   is_in_rates        the state is full or partial: the hour is recorded enough for rates and averages
--   open_s             opening time in it, seconds
--   recorded_s         recorded opening time, mean over the cameras that see the area, seconds
--   exposure_open_s    person-seconds in the area in opening hours; null where unknown
--   violation_open_s   person-seconds in violation; likewise
--   n_violations_open  violations with most of their person-time in the area that started in opening hours; likewise
-- steps:
--   places    an area has rows from its first day to its last
--   seers     cameras that count cells of the area; where no cell of it has an owner, all cameras of the floor see it
--   unplaced  hours in which no violation has a place: in which area they were is unknown
-- assumes: a quiet hour is 0 where a camera that sees the area recorded; violations without a place are those of the rest of the floor
with places as (
    select
        areas.floor_id,
        areas.area_id,
        areas.area_no,
        min(area_cells.from_ms) as from_ms,
        max(area_cells.to_ms) as to_ms
    from areas
    inner join area_cells on areas.floor_id = area_cells.floor_id and areas.area_id = area_cells.area_id
    group by areas.floor_id, areas.area_id, areas.area_no
    union all
    select distinct
        floor_id,
        'rest' as area_id,
        null::integer as area_no,
        null::bigint as from_ms,
        null::bigint as to_ms
    from cameras
),

owners as (
    select distinct
        area_cells.floor_id,
        area_cells.area_id,
        owner_cells.camera_id
    from area_cells
    cross join params
    inner join owner_cells
        on
            area_cells.floor_id = owner_cells.floor_id
            and floor((area_cells.cx + 0.5) * params.cell_mm / params.owner_cell_mm) = owner_cells.cx
            and floor((area_cells.cy + 0.5) * params.cell_mm / params.owner_cell_mm) = owner_cells.cy
),

seers as (
    select
        places.floor_id,
        places.area_id,
        cameras.camera_id
    from places
    inner join cameras on places.floor_id = cameras.floor_id
    left join owners
        on places.floor_id = owners.floor_id and places.area_id = owners.area_id and cameras.camera_id = owners.camera_id
    where
        owners.camera_id is not null
        or not exists (
            select 1
            from owners as o
            where o.floor_id = places.floor_id and o.area_id = places.area_id
        )
),

seen as (
    select
        seers.floor_id,
        seers.area_id,
        camera_hours.hour_start_ms,
        min(camera_hours.local_date) as local_date,
        min(camera_hours.weekday) as weekday,
        min(camera_hours.local_hour) as local_hour,
        max(camera_hours.open_s) as open_s,
        avg(camera_hours.recorded_open_s) filter (where camera_hours.length_s > 0) as recorded_s,
        count(camera_hours.exposure_open_s) > 0 as knows_people,
        count(camera_hours.violation_open_s) > 0 as knows_distances,
        count(camera_hours.n_violations_open) > 0 as knows_violations
    from seers
    inner join camera_hours on seers.camera_id = camera_hours.camera_id
    group by seers.floor_id, seers.area_id, camera_hours.hour_start_ms
),

counted as (
    select
        floor_id,
        coalesce(area_id, 'rest') as area_id,
        hour_start_ms,
        sum(exposure_open_s) as exposure_open_s,
        sum(violation_open_s) as violation_open_s,
        sum(n_violations_open)::bigint as n_violations_open
    from area_hours
    group by floor_id, coalesce(area_id, 'rest'), hour_start_ms
),

unplaced as (
    select
        floor_id,
        hour_start_ms
    from violations
    where is_open
    group by floor_id, hour_start_ms
    having count(x_m) = 0
),

judged as (
    select
        seen.*,
        places.area_no,
        unplaced.hour_start_ms is null or seen.area_id = 'rest' as knows_places,
        recording_state(
            seen.open_s,
            seen.recorded_s / nullif(seen.open_s, 0),
            params.full_hour_share,
            params.partial_hour_share
        ) as state
    from seen
    cross join params
    inner join places on seen.floor_id = places.floor_id and seen.area_id = places.area_id
    left join unplaced on seen.floor_id = unplaced.floor_id and seen.hour_start_ms = unplaced.hour_start_ms
    where
        (places.from_ms is null or seen.hour_start_ms >= places.from_ms)
        and (places.to_ms is null or seen.hour_start_ms < places.to_ms)
)

select
    judged.floor_id,
    judged.area_id,
    make_timestamptz(judged.hour_start_ms * 1000) as start,
    judged.local_date,
    judged.weekday,
    judged.local_hour,
    judged.state,
    judged.state in ('full', 'partial') as is_in_rates,
    judged.open_s,
    judged.recorded_s,
    case when judged.knows_people then coalesce(counted.exposure_open_s, 0) end as exposure_open_s,
    case when judged.knows_distances then coalesce(counted.violation_open_s, 0) end as violation_open_s,
    case
        when judged.knows_violations and judged.knows_places then coalesce(counted.n_violations_open, 0)
    end as n_violations_open
from judged
left join counted
    on
        judged.floor_id = counted.floor_id
        and judged.area_id = counted.area_id
        and judged.hour_start_ms = counted.hour_start_ms
order by judged.hour_start_ms, judged.floor_id, judged.area_no nulls last
