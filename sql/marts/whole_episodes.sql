-- name: marts/whole_episodes
-- One row per episode of the facts loaded: a pair from meeting to parting (joined_segments), counted once.
-- grain: camera_id, track_a, track_b, started_ms
-- reads: camera_episodes, shared_episodes
-- params: episode_min_ms
-- columns:
--   camera_id         the camera that counts it: of those that saw it, the one with most records that count
--   track_a           the lesser of the two track ids that this camera gave first
--   track_b           the greater one
--   started_ms        first violation record that counts, of any camera, milliseconds since 1970, UTC
--   ended_ms          last violation record that counts
--   duration_ms       closer than distance_m, with gaps up to gap_ms; where frames do not show its ends, half a frame interval more
--   is_cut            seen in part; null in hours sealed by older versions
--   n_records         violation records that count, each with the camera that owns its midpoint
--   x_mm              mean midpoint, floor millimetres; null without positions
--   y_mm              mean midpoint, floor millimetres
--   min_distance_mm   closest approach
--   mean_distance_mm  mean over records of the cameras that count any
--   is_violation      it lasted at least episode_min_s: what reports call a violation
--   is_owned          false where no record counts: another camera sees the place better
-- steps:
--   members  camera episodes that another camera saw as well; rank 1 is the camera that counts the episode; first_rank and last_rank
--            find the member that saw its start and its end
--   whole    members that own no record are left out where another member owns one, so that no record counts twice; most episodes
--            were seen by one camera alone and need no ranks, which would take most of the time
-- assumes: counting violations needs no more than this; groups and areas, which cost far more, are joined in episodes and violations
with members as (
    select
        e.camera_id,
        e.track_a,
        e.track_b,
        e.from_ms,
        e.to_ms,
        e.before_ms,
        e.after_ms,
        e.apart_ms,
        e.knows_start,
        e.knows_end,
        e.n_records,
        e.n_located,
        e.x2_mm,
        e.y2_mm,
        e.n_measured,
        e.min_distance_mm,
        e.sum_distance_mm,
        e.is_owned,
        shared_episodes.first as episode,
        row_number() over (
            partition by shared_episodes.first order by e.is_owned desc, e.n_records desc, e.number asc
        ) as rank,
        row_number() over (
            partition by shared_episodes.first, e.is_owned order by e.from_ms - e.before_ms asc, e.number asc
        ) as first_rank,
        row_number() over (
            partition by shared_episodes.first, e.is_owned order by e.to_ms + e.after_ms desc, e.number asc
        ) as last_rank,
        bool_or(e.is_owned) over (partition by shared_episodes.first) as any_owned
    from camera_episodes as e
    inner join shared_episodes on e.number = shared_episodes.number
),

whole as (
    select
        max(camera_id) filter (where rank = 1) as camera_id,
        max(track_a) filter (where rank = 1) as track_a,
        max(track_b) filter (where rank = 1) as track_b,
        min(from_ms) as started_ms,
        max(to_ms) as ended_ms,
        max(to_ms + after_ms) - min(from_ms - before_ms) - min(apart_ms) as duration_ms,
        case
            when count(knows_start) = count(*)
                then bool_or((first_rank = 1 and not knows_start) or (last_rank = 1 and not knows_end))
        end as is_cut,
        sum(n_records)::bigint as n_records,
        sum(x2_mm) / nullif(2 * sum(n_located), 0) as x_mm,
        sum(y2_mm) / nullif(2 * sum(n_located), 0) as y_mm,
        min(min_distance_mm) as min_distance_mm,
        sum(sum_distance_mm) / sum(n_measured) as mean_distance_mm,
        bool_or(is_owned) as is_owned
    from members
    where is_owned = any_owned
    group by episode
    union all
    select
        camera_id,
        track_a,
        track_b,
        from_ms as started_ms,
        to_ms as ended_ms,
        to_ms + after_ms - from_ms + before_ms - apart_ms as duration_ms,
        not knows_start or not knows_end as is_cut,
        n_records,
        x2_mm / nullif(2 * n_located, 0) as x_mm,
        y2_mm / nullif(2 * n_located, 0) as y_mm,
        min_distance_mm,
        sum_distance_mm / n_measured as mean_distance_mm,
        is_owned
    from camera_episodes
    where number not in (select number from shared_episodes)
)

select
    whole.camera_id,
    whole.track_a,
    whole.track_b,
    whole.started_ms,
    whole.ended_ms,
    whole.duration_ms,
    whole.is_cut,
    whole.n_records,
    whole.x_mm,
    whole.y_mm,
    whole.min_distance_mm,
    whole.mean_distance_mm,
    whole.duration_ms >= params.episode_min_ms as is_violation,
    whole.is_owned
from whole
cross join params
order by whole.started_ms, whole.camera_id, whole.track_a, whole.track_b
