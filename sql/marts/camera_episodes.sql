-- name: marts/camera_episodes
-- One row per camera and run of violation records of a pair, no gap longer than gap_ms (episode_segments), over hours and midnight.
-- grain: camera_id, track_a, track_b, started_ms
-- reads: episode_segments, cameras, owner_cells
-- params: owner_cell_mm
-- columns:
--   number           1, 2, ... in order of grain
--   camera_id
--   track_a          the lesser track id
--   track_b          the greater track id
--   started_ms       first violation record, milliseconds since 1970, UTC
--   ended_ms         last violation record
--   from_ms          first record that counts: that this camera owns; where it owns none, started_ms
--   to_ms            last record that counts
--   before_ms        how long before from_ms they came closer than distance_m; half a frame interval when the frames do not show it
--   after_ms         how long after to_ms they parted; likewise
--   knows_start      the frames show when they came closer; null in hours sealed by older versions, which did not compute it
--   knows_end        the frames show when they parted; likewise
--   n_records        records that count
--   n_located        those with floor positions
--   x2_mm            sum of x_a + x_b over these
--   y2_mm            sum of y_a + y_b over these
--   n_measured       violation records that the distances are of: also those another camera counts
--   min_distance_mm  closest approach
--   sum_distance_mm  sum of distances over n_measured
--   is_owned         this camera counts any of it; in hours sealed by older versions, which did not store it: it owns the mean midpoint
-- steps:
--   marked    the greatest end of all earlier segments, because a later segment may end first
--   numbered  a running number per episode: it grows at each segment that does not follow within gap_ms
--   stitched  time before and after comes from the first and the last segment; distances from all records, owned or not
--   counted   only records this camera owns count; where another camera owns the first record, this one does not know when the two met,
--             so before_ms is null
-- assumes: segments of the hours around a range are loaded, so that an episode is whole
with marked as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        ended_ms,
        interval_ms,
        before_ms,
        after_ms,
        n_records,
        n_located,
        sum_x2_mm,
        sum_y2_mm,
        min_distance_mm,
        sum_distance_mm,
        n_owned,
        owned_from_ms,
        owned_to_ms,
        n_owned_located,
        owned_x2_mm,
        owned_y2_mm,
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
        before_ms,
        after_ms,
        n_records,
        n_located,
        sum_x2_mm,
        sum_y2_mm,
        min_distance_mm,
        sum_distance_mm,
        n_owned,
        owned_from_ms,
        owned_to_ms,
        n_owned_located,
        owned_x2_mm,
        owned_y2_mm,
        is_start,
        coalesce(lead(is_start) over (partition by camera_id, track_a, track_b order by started_ms) = 1, true) as is_last,
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
        min(before_ms) filter (where is_start = 1) as before_ms,
        max(after_ms) filter (where is_last) as after_ms,
        max(interval_ms) as interval_ms,
        sum(n_records)::bigint as n_records,
        sum(n_located)::bigint as n_located,
        sum(sum_x2_mm)::bigint as x2_mm,
        sum(sum_y2_mm)::bigint as y2_mm,
        min(min_distance_mm) as min_distance_mm,
        sum(sum_distance_mm)::bigint as sum_distance_mm,
        case when count(n_owned) = count(*) then sum(n_owned)::bigint end as n_owned,
        min(owned_from_ms) as owned_from_ms,
        max(owned_to_ms) as owned_to_ms,
        sum(n_owned_located)::bigint as n_owned_located,
        sum(owned_x2_mm)::bigint as owned_x2_mm,
        sum(owned_y2_mm)::bigint as owned_y2_mm
    from numbered
    group by camera_id, track_a, track_b, episode_no
),

counted as (
    select
        camera_id,
        track_a,
        track_b,
        started_ms,
        ended_ms,
        interval_ms,
        case when n_owned > 0 then owned_from_ms else started_ms end as from_ms,
        case when n_owned > 0 then owned_to_ms else ended_ms end as to_ms,
        case when n_owned > 0 and owned_from_ms > started_ms then null else before_ms end as before_ms,
        case when n_owned > 0 and owned_to_ms < ended_ms then null else after_ms end as after_ms,
        case when n_owned > 0 then n_owned else n_records end as n_records,
        case when n_owned > 0 then n_owned_located else n_located end as n_located,
        case when n_owned > 0 then owned_x2_mm else x2_mm end as x2_mm,
        case when n_owned > 0 then owned_y2_mm else y2_mm end as y2_mm,
        n_records as n_measured,
        min_distance_mm,
        sum_distance_mm,
        n_owned
    from stitched
)

select
    row_number() over (order by c.camera_id, c.track_a, c.track_b, c.started_ms) as number,
    c.camera_id,
    c.track_a,
    c.track_b,
    c.started_ms,
    c.ended_ms,
    c.from_ms,
    c.to_ms,
    coalesce(c.before_ms, floor(c.interval_ms / 2)::bigint) as before_ms,
    coalesce(c.after_ms, ceil(c.interval_ms / 2)::bigint) as after_ms,
    case when c.n_owned is not null then c.before_ms is not null end as knows_start,
    case when c.n_owned is not null then c.after_ms is not null end as knows_end,
    c.n_records,
    c.n_located,
    c.x2_mm,
    c.y2_mm,
    c.n_measured,
    c.min_distance_mm,
    c.sum_distance_mm,
    case when c.n_owned is null then coalesce(owner_cells.camera_id = c.camera_id, true) else c.n_owned > 0 end as is_owned
from counted as c
cross join params
inner join cameras on c.camera_id = cameras.camera_id
left join owner_cells
    on
        cameras.floor_id = owner_cells.floor_id
        and c.started_ms >= owner_cells.from_ms
        and c.started_ms < owner_cells.to_ms
        and floor(c.x2_mm / nullif(2 * c.n_located, 0) / params.owner_cell_mm) = owner_cells.cx
        and floor(c.y2_mm / nullif(2 * c.n_located, 0) / params.owner_cell_mm) = owner_cells.cy
order by number
