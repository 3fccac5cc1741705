-- name: marts/episodes
-- One row per episode: violation records of one pair with no gap longer than gap_ms, stitched over hours, files and midnight.
-- grain: camera_id, track_a, track_b, started_ms
-- reads: episode_segments, calendar, cameras, owner_cells, site_days, track_groups
-- params: episode_min_ms, owner_cell_mm, cell_mm
-- columns:
--   camera_id
--   track_a          the lesser track id
--   track_b          the greater track id
--   started_ms       first violation record, milliseconds since 1970, UTC
--   ended_ms         last violation record
--   duration_s       (last - first) + one frame interval
--   n_records        violation records
--   x_m              mean midpoint, floor metres; null without positions
--   y_m              mean midpoint, floor metres
--   cx               floor(x / cell_m)
--   cy               floor(y / cell_m)
--   min_distance_m   closest approach
--   mean_distance_m  mean over records
--   is_violation     it lasted at least episode_min_s: what reports call a violation
--   is_owned         false where another camera that sees the mean midpoint better counts it
--   hour_start_ms    UTC instant of the local hour it started in; it belongs to that hour and day
--   local_date
--   local_hour       0 to 23
--   is_open          it started in opening hours
--   is_together      the two move in one group, by all that was seen of them that site day; null where that cannot be known
-- assumes: segments of the hours around the calendar are loaded, so that an episode is whole; one that began before it is left out
with marked as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        ended_ms,
        interval_ms,
        n_records,
        n_located,
        sum_x2_mm,
        sum_y2_mm,
        min_distance_mm,
        sum_distance_mm,
        case when started_ms - max(ended_ms) over earlier <= gap_ms then 0 else 1 end as is_start
    from episode_segments
    window
        earlier as (
            partition by camera_id, track_a, track_b order by started_ms
            rows between unbounded preceding and 1 preceding
        )
),

numbered as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        ended_ms,
        interval_ms,
        n_records,
        n_located,
        sum_x2_mm,
        sum_y2_mm,
        min_distance_mm,
        sum_distance_mm,
        sum(is_start) over (
            partition by camera_id, track_a, track_b order by started_ms
            rows between unbounded preceding and current row
        ) as episode_no
    from marked
),

stitched as (
    select
        camera_id,
        track_a,
        track_b,
        min(started_ms) as started_ms,
        max(ended_ms) as ended_ms,
        max(ended_ms) - min(started_ms) + max(interval_ms) as duration_ms,
        sum(n_records)::bigint as n_records,
        sum(sum_x2_mm) / nullif(2 * sum(n_located), 0) as x_mm,
        sum(sum_y2_mm) / nullif(2 * sum(n_located), 0) as y_mm,
        min(min_distance_mm) as min_distance_mm,
        sum(sum_distance_mm) / sum(n_records) as mean_distance_mm
    from numbered
    group by camera_id, track_a, track_b, episode_no
)

select
    s.camera_id,
    s.track_a,
    s.track_b,
    s.started_ms,
    s.ended_ms,
    s.duration_ms / 1000 as duration_s,
    s.n_records,
    s.x_mm / 1000 as x_m,
    s.y_mm / 1000 as y_m,
    floor(s.x_mm / params.cell_mm)::int as cx,
    floor(s.y_mm / params.cell_mm)::int as cy,
    s.min_distance_mm / 1000 as min_distance_m,
    s.mean_distance_mm / 1000 as mean_distance_m,
    s.duration_ms >= params.episode_min_ms as is_violation,
    coalesce(owner_cells.camera_id = s.camera_id, true) as is_owned,
    calendar.hour_start_ms,
    calendar.local_date,
    calendar.local_hour,
    calendar.is_open,
    case
        when s.x_mm is not null and a.track_id is not null and b.track_id is not null then coalesce(a.group_id = b.group_id, false)
    end as is_together
from stitched as s
cross join params
inner join calendar on floor(s.started_ms / 900000) = calendar.quarter
inner join cameras on s.camera_id = cameras.camera_id
left join site_days on floor(s.started_ms / 900000) = site_days.quarter
left join track_groups as a
    on s.camera_id = a.camera_id and site_days.site_day = a.site_day and s.track_a = a.track_id
left join track_groups as b
    on s.camera_id = b.camera_id and site_days.site_day = b.site_day and s.track_b = b.track_id
left join owner_cells
    on
        cameras.floor_id = owner_cells.floor_id
        and s.started_ms >= owner_cells.from_ms
        and s.started_ms < owner_cells.to_ms
        and floor(s.x_mm / params.owner_cell_mm) = owner_cells.cx
        and floor(s.y_mm / params.owner_cell_mm) = owner_cells.cy
order by s.started_ms, s.camera_id, s.track_a, s.track_b
