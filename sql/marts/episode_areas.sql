-- name: marts/episode_areas
-- One row per episode: the area in which most of its person-time in violation lies.
-- grain: camera_id, track_a, track_b, started_ms
-- reads: episodes, camera_episodes, joined_segments, shared_episodes, episode_cells, area_cells, cameras
-- columns:
--   camera_id     the camera that counts it, as in episodes
--   track_a       the lesser track id
--   track_b       the greater track id
--   started_ms    milliseconds since 1970, UTC, as in episodes
--   local_date
--   area_id       area of vsd.toml; null for the rest of the floor, which is one place beside the areas
--   share         share of its person-time in violation that lies there, above 0; null where only its middle is known or it is in no area
-- steps:
--   members  as in episodes: the camera that counts an episode gives its key, and members that own no record are left out where another
--            member owns one; most episodes were seen by one camera alone and need no ranks
--   inside   episodes of which anything lies in an area, or whose middle does: of all others the cells need not be summed
--   stood    both people of all members, each where they stand
--   ranked   of places with equal time the one with the episode's middle, as in a frame in which one person stands on either side of a
--            border; else the first by id
-- assumes: where the cells are unknown (hours sealed by older versions) the area of the cell of its mean midpoint
with shared as (
    select
        e.camera_id,
        e.track_a,
        e.track_b,
        e.from_ms,
        e.n_records,
        e.number,
        e.is_owned,
        shared_episodes.first as episode,
        bool_or(e.is_owned) over (partition by shared_episodes.first) as any_owned
    from camera_episodes as e
    inner join shared_episodes on e.number = shared_episodes.number
),

members as materialized (
    select
        number,
        episode,
        camera_id,
        is_owned,
        first_value(camera_id) over by_rank as counting_camera_id,
        first_value(track_a) over by_rank as counted_track_a,
        first_value(track_b) over by_rank as counted_track_b,
        min(from_ms) over (partition by episode) as counted_from_ms
    from shared
    where is_owned = any_owned
    window
        by_rank as (partition by episode order by n_records desc, number asc)
    union all
    select
        number,
        number as episode,
        camera_id,
        is_owned,
        camera_id as counting_camera_id,
        track_a as counted_track_a,
        track_b as counted_track_b,
        from_ms as counted_from_ms
    from camera_episodes
    where number not in (select number from shared_episodes)
),

middles as materialized (
    select
        episodes.camera_id,
        episodes.track_a,
        episodes.track_b,
        episodes.started_ms,
        area_cells.area_id
    from episodes
    inner join cameras on episodes.camera_id = cameras.camera_id
    inner join area_cells
        on
            cameras.floor_id = area_cells.floor_id
            and episodes.cx = area_cells.cx
            and episodes.cy = area_cells.cy
            and episodes.started_ms >= area_cells.from_ms
            and episodes.started_ms < area_cells.to_ms
),

spots as (
    select distinct
        c.camera_id,
        c.track_a,
        c.track_b,
        c.started_ms
    from episode_cells as c
    inner join cameras on c.camera_id = cameras.camera_id
    inner join area_cells on cameras.floor_id = area_cells.floor_id and c.cx = area_cells.cx and c.cy = area_cells.cy
),

inside as (
    select m.episode
    from spots
    inner join joined_segments as j
        on
            spots.camera_id = j.camera_id
            and spots.track_a = j.track_a
            and spots.track_b = j.track_b
            and spots.started_ms = j.started_ms
    inner join members as m on j.number = m.number
    union
    select m.episode
    from middles
    inner join members as m
        on
            middles.camera_id = m.counting_camera_id
            and middles.track_a = m.counted_track_a
            and middles.track_b = m.counted_track_b
            and middles.started_ms = m.counted_from_ms
),

stood as (
    select
        m.counting_camera_id as camera_id,
        m.counted_track_a as track_a,
        m.counted_track_b as track_b,
        m.counted_from_ms as started_ms,
        area_cells.area_id,
        sum(case when m.is_owned then c.owned_ms else c.violation_ms end) as violation_ms
    from members as m
    semi join inside on m.episode = inside.episode
    inner join cameras on m.camera_id = cameras.camera_id
    inner join joined_segments as j on m.number = j.number
    inner join episode_cells as c
        on
            j.camera_id = c.camera_id
            and j.track_a = c.track_a
            and j.track_b = c.track_b
            and j.started_ms = c.started_ms
    left join area_cells
        on
            cameras.floor_id = area_cells.floor_id
            and c.cx = area_cells.cx
            and c.cy = area_cells.cy
            and m.counted_from_ms >= area_cells.from_ms
            and m.counted_from_ms < area_cells.to_ms
    group by
        m.counting_camera_id, m.counted_track_a, m.counted_track_b, m.counted_from_ms, area_cells.area_id
),

ranked as (
    select
        stood.camera_id,
        stood.track_a,
        stood.track_b,
        stood.started_ms,
        case when stood.violation_ms > 0 then stood.area_id else m.area_id end as area_id,
        stood.violation_ms / nullif(sum(stood.violation_ms) over episode, 0) as share,
        row_number() over (
            partition by stood.camera_id, stood.track_a, stood.track_b, stood.started_ms
            order by
                stood.violation_ms desc nulls last,
                (coalesce(stood.area_id, '') = coalesce(m.area_id, '')) desc,
                stood.area_id asc nulls last
        ) as rank
    from stood
    left join middles as m
        on
            stood.camera_id = m.camera_id
            and stood.track_a = m.track_a
            and stood.track_b = m.track_b
            and stood.started_ms = m.started_ms
    window
        episode as (partition by stood.camera_id, stood.track_a, stood.track_b, stood.started_ms)
)

select
    e.camera_id,
    e.track_a,
    e.track_b,
    e.started_ms,
    e.local_date,
    case when r.rank is null then m.area_id else r.area_id end as area_id,
    r.share
from episodes as e
left join ranked as r
    on
        e.camera_id = r.camera_id
        and e.track_a = r.track_a
        and e.track_b = r.track_b
        and e.started_ms = r.started_ms
        and r.rank = 1
left join middles as m
    on
        e.camera_id = m.camera_id
        and e.track_a = m.track_a
        and e.track_b = m.track_b
        and e.started_ms = m.started_ms
order by e.started_ms, e.camera_id, e.track_a, e.track_b
